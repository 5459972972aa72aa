"""Films of runs of lattices: chains as curves over the sites, planes and graphs as sequences of images."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from phigen.drawing.lattice_figures import MOST_PANELS, draw_sites, places_of
from phigen.drawing.palette import SERIES, styled
from phigen.drawing.shades import bounds_of, shades_of
from phigen.errors import MissingPackageError
from phigen.runtime.lattice import LatticeTrajectory
from phigen.symbolic.arrays import Floats

#: MOST_PICTURES: largest number of images of a film. RATE: images per second. DOTS: dots per inch.
MOST_PICTURES, RATE, DOTS = 400, 20, 80


@styled
def film(run: LatticeTrajectory, title: str, path: Path, origin: str = "") -> None:
    """Write a film of all coordinates to a ``.gif`` or ``.mp4`` file.

    The text ``origin`` becomes a comment in the file. Raises `MissingPackageError` if ffmpeg is needed and missing.
    """
    from matplotlib.animation import FFMpegWriter, PillowWriter
    from matplotlib.figure import Figure

    expect_writer(path)
    is_gif = path.suffix.lower() == ".gif"
    writer: Any = PillowWriter(fps=RATE) if is_gif else FFMpegWriter(fps=RATE, metadata={"comment": origin})
    names = run.coordinates[:MOST_PANELS]
    figure = Figure(figsize=(3.0 * len(names), 3.0), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(names)))
    if (positions := places_of(run)) is not None:
        updates = [_graph(axes, name, run, positions) for axes, name in zip(panels, names, strict=True)]
    else:
        updates = [_displayed_values(axes, name, run.column(name)) for axes, name in zip(panels, names, strict=True)]
    part = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        with writer.saving(figure, str(part), DOTS):
            for k in np.unique(np.linspace(0, len(run) - 1, min(len(run), MOST_PICTURES)).astype(int)).tolist():
                figure.suptitle(f"{title}, t = {run.t[k]:.4g}", fontsize=10)
                for change, name in zip(updates, names, strict=True):
                    change(_flat(run.column(name)[k]))
                writer.grab_frame()
        if is_gif:
            part.write_bytes(_commented(part.read_bytes(), origin.encode()))
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def expect_writer(path: Path) -> None:
    """Raise `MissingPackageError` if the film needs ffmpeg and ffmpeg is missing.

    All films except ``.gif`` need ffmpeg.
    """
    from matplotlib.animation import FFMpegWriter

    if path.suffix.lower() != ".gif" and not FFMpegWriter.isAvailable():
        raise MissingPackageError(f"{path.name} needs ffmpeg, which was not found; a .gif film needs no ffmpeg")


def _commented(gif: bytes, comment: bytes) -> bytes:
    """Return the GIF with a comment before its last byte; unchanged if the comment is empty or longer than 255
    bytes."""
    if not 0 < len(comment) < 256:
        return gif
    return gif[:-1] + b"\x21\xfe" + bytes([len(comment)]) + comment + b"\x00" + gif[-1:]


def _flat(values: Floats) -> Floats:
    """Return the values that are drawn: all values of a chain or a plane.

    If the lattice has three dimensions, only the plane in the middle of the first axis is drawn.
    """
    return values if values.ndim < 3 else values[values.shape[0] // 2]


def _graph(axes: Any, name: str, run: LatticeTrajectory, positions: Floats) -> Any:
    """Draw the values of a coordinate at the sites of a graph.

    Return a function that replaces the drawn values by those of an array (sites,).
    """
    values = run.column(name)
    picture = draw_sites(axes, run.parameters["bonds"], positions, values[0], shades_of(values))
    axes.set_title(name)
    return picture.set_array


def _displayed_values(axes: Any, name: str, values: Floats) -> Any:
    """Draw the first frame of a coordinate: a chain as a curve, a plane as an image. Return a function that draws
    another frame in its place.

    ``values`` (frames, *sizes) has the values of the coordinate in all frames.
    """
    first = _flat(values[0])
    axes.set_title(name)
    if first.ndim == 1:
        (line,) = axes.plot(first, color=SERIES[0], linewidth=1.0)
        low, high = bounds_of(values)
        axes.set_ylim(low - 0.025 * (high - low), high + 0.025 * (high - low))
        return line.set_ydata
    picture = axes.imshow(first.T, origin="lower", interpolation="none", **shades_of(values))
    return lambda plane: picture.set_data(plane.T)
