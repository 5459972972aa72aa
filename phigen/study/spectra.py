"""Correlations and spectra of lattices, from the frames of a trajectory by fast Fourier transforms."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from phigen.runtime.interface import Floats
from phigen.runtime.memory import expect_room

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from phigen.runtime.lattice import LatticeTrajectory

#: Frames that a spectrum needs at least: with fewer the window leaves nothing.
LEAST_FRAMES = 4
#: How far apart in time frames may be unequally, relative to their distance.
_EQUAL = 1e-6


@dataclass(frozen=True)
class DynamicSpectrum:
    """Dynamic structure factor S(q, ω) of some fields of a grid.

    ``values`` (*sizes, frequencies) are over the wave numbers ``q`` of each of the ``axes``, in radians for a site from
    −π on, and the frequencies ``omega``, both in ascending order. A wave cos(qr − ωt) is at (q, ω) and (−q, −ω). The
    sum of all values is the mean of Σ f² over sites and time, weighted with the window.
    """

    q: tuple[Floats, ...]
    omega: Floats
    values: Floats
    axes: tuple[str, ...]
    of: tuple[str, ...]

    def save(self, path: str | Path) -> None:
        """Write a Zarr store: arrays ``S``, ``q_AXIS`` and ``omega``, which xarray opens too.

        Raises `MissingPackageError` without zarr.
        """
        from phigen.sweeping.store import imported

        root = imported("zarr").open_group(str(path), mode="w")
        names = [f"q_{axis}" for axis in self.axes]
        for name, values in [*zip(names, self.q, strict=True), ("omega", self.omega)]:
            root.create_array(name, data=values, attributes={"_ARRAY_DIMENSIONS": [name]})
        root.create_array("S", data=self.values, attributes={"_ARRAY_DIMENSIONS": [*names, "omega"]})
        root.attrs["of"] = list(self.of)

    def plot(self, title: str = "") -> Figure:
        """A picture of S over q and ω ≥ 0, by its logarithm; of planes and boxes along the first axis, others at q = 0.

        Raises `MissingPackageError` without matplotlib.
        """
        from phigen.drawing.spectra import spectrum_figure

        return spectrum_figure(self, title)


def spectrum(run: LatticeTrajectory, of: Sequence[str], *, after: float | None = None) -> DynamicSpectrum:
    """Return S(q, ω) of some coordinates, over the frames from the time ``after`` on, with a Hann window in time.

    Frames are equal times apart; a last one that is not is left out. Open axes are taken as if they were periodic.
    Raises `ValueError` for graphs and pairs, names that are no coordinates, and fewer than four frames.
    """
    fields = [_index(run, name) for name in ([of] if isinstance(of, str) else of)]
    _expect_grid(run, "a spectrum")
    if not fields:
        raise ValueError("a spectrum is of one coordinate or more")
    frames = _frames(run, after)
    if len(frames) > 2 and abs(frames[-1] - 2 * frames[-2] + frames[-3]) > _EQUAL * abs(frames[1] - frames[0]):
        frames = frames[:-1]
    first, count, sizes = len(run.t) - len(_frames(run, after)), len(frames), run.x.shape[2:]
    if count < LEAST_FRAMES:
        raise ValueError(f"a spectrum needs {LEAST_FRAMES} frames that are equal times apart, not {count}")
    if np.ptp(np.diff(frames)) > _EQUAL * abs(frames[1] - frames[0]):
        raise ValueError("a spectrum needs frames that are equal times apart")
    expect_room("the transform of the frames", 3 * 16 * count * int(np.prod(sizes)))
    window = np.hanning(count + 2)[1:-1]
    window *= np.sqrt(count / (window**2).sum())
    total = np.zeros((count, *sizes))
    for k in fields:
        shown = np.array(run.x[first : first + count, k]) * window.reshape(-1, *[1] * len(sizes))
        # e^{+iωt} in time, so that a wave that moves to larger r has q and ω of one sign
        total += np.abs(np.fft.fftn(np.fft.ifft(shown, axis=0), axes=range(1, 1 + len(sizes)))) ** 2
    total /= float(np.prod(sizes)) ** 2
    values = np.moveaxis(np.fft.fftshift(total), 0, -1)
    q = tuple(np.fft.fftshift(2 * np.pi * np.fft.fftfreq(size)) for size in sizes)
    omega = np.fft.fftshift(2 * np.pi * np.fft.fftfreq(count, abs(frames[1] - frames[0])))
    return DynamicSpectrum(q, omega, values, run.axes, tuple([of] if isinstance(of, str) else of))


def correlation(
    run: LatticeTrajectory, of: str, other: str, axis: str, up_to: int, *, after: float | None = None
) -> Floats:
    """Return the correlations ⟨f(r) g(r + d)⟩ − ⟨f⟩⟨g⟩ for d = 0 … ``up_to`` sites along an axis, (up_to + 1,).

    Means are over all sites, along an open axis over those from which r + d is on the lattice, and over the frames from
    the time ``after`` on. Raises `ValueError` for graphs and pairs, and for what is no coordinate or axis.
    """
    _expect_grid(run, "a correlation")
    if axis not in run.axes:
        raise ValueError(f"{axis!r} is no axis; there are {', '.join(run.axes)}")
    along = 1 + run.axes.index(axis)
    size = run.x.shape[1 + along]
    if not 0 <= up_to < size:
        raise ValueError(f"up_to must be from 0 to {size - 1}, the last distance along {axis}, not {up_to!r}")
    count, sums = 0, np.zeros(up_to + 1)
    numbers, means = np.zeros(up_to + 1), np.zeros(2)
    pair, wraps = (_index(run, of), _index(run, other)), not run.solver.interface.open_axes[along - 1]
    for x in itertools.islice(run.x, len(run.t) - len(_frames(run, after)), None):
        f, g = (np.moveaxis(np.asarray(x[k]), along - 1, 0) for k in pair)
        means += f.mean(), g.mean()
        count += 1
        for d in range(up_to + 1):
            product = f * np.roll(g, -d, axis=0) if wraps else f[: size - d] * g[d:]
            sums[d] += product.sum()
            numbers[d] += product.size
    if not count:
        raise ValueError(f"there are no frames from t = {after!r} on")
    return sums / numbers - np.prod(means / count)


def _frames(run: LatticeTrajectory, after: float | None) -> Floats:
    """Return the times of the frames from a time on, in the direction of the run."""
    sign = np.sign(run.h)
    return run.t if after is None else run.t[sign * run.t >= sign * after - 1e-9 * abs(run.h)]


def _index(run: LatticeTrajectory, name: str) -> int:
    if name not in run.coordinates:
        raise ValueError(f"{name!r} is no coordinate; there are {', '.join(run.coordinates)}")
    return run.coordinates.index(name)


def _expect_grid(run: LatticeTrajectory, what: str) -> None:
    about = run.solver.interface
    if about.graph or about.pairs:
        raise ValueError(f"{what} is along the axes of a grid, and {about.name} has none")
