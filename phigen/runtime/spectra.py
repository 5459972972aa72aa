"""Correlations and spectra of lattices, from the frames of a trajectory by fast Fourier transforms."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from phigen.display import display
from phigen.memory import expect_room
from phigen.packages import imported
from phigen.runtime.interface import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from phigen.runtime.lattice import LatticeTrajectory
    from phigen.spec.model import CorrelationChoice, SpectrumChoice

#: Smallest number of frames for a spectrum. The Hann window spreads a wave over about four frequencies, and a spectrum
#: of fewer frames has fewer frequencies.
LEAST_FRAMES = 4
#: Two intervals between successive frames count as equal if their relative difference is at most this number.
_EQUAL = 1e-6


@dataclass(frozen=True)
class DynamicSpectrum:
    """Dynamic structure factor S(q, ω) of some coordinates f of a grid.

    ``values`` (*sizes, frequencies) are S over the wave numbers ``q`` of each of the ``axes`` and the frequencies
    ``omega``. Wave numbers are in radians per site, in ascending order from −π; frequencies are ascending too. A wave
    cos(qr − ωt) contributes at (q, ω) and (−q, −ω). The sum of all values is the mean of Σ f² over sites and times,
    where Σ runs over the coordinates f. The Hann window weights the times in this mean.
    """

    q: tuple[Floats, ...]
    omega: Floats
    values: Floats
    axes: tuple[str, ...]
    of: tuple[str, ...]

    def __repr__(self) -> str:
        shape = " × ".join(map(str, self.values.shape))
        return f"<DynamicSpectrum of {', '.join(self.of)}: q of {', '.join(self.axes)} and ω, {shape} values>"

    def variables(self, name: str, prefix: str = "") -> dict[str, tuple[tuple[str, ...], Floats]]:
        """Return the arrays of the spectrum as a dict: name → (names of dimensions, values).

        The array of S(q, ω) has the name ``name``. The arrays of wave numbers and frequencies have the names ``q_AXIS``
        and ``omega``, with the ``prefix`` before each name.
        """
        names = [f"{prefix}q_{axis}" for axis in self.axes] + [f"{prefix}omega"]
        coordinates = zip(names, [*self.q, self.omega], strict=True)
        return {name: (tuple(names), self.values)} | {n: ((n,), values) for n, values in coordinates}

    def save(self, path: str | Path) -> None:
        """Write a Zarr store with the arrays ``S``, ``q_AXIS`` and ``omega``; xarray can open it too.

        Raises `MissingPackageError` without zarr.
        """
        zarr = imported("zarr")
        root = zarr.open_group(str(path), mode="w", zarr_format=2)
        for name, (dimensions, values) in self.variables("S").items():
            attributes = {"_ARRAY_DIMENSIONS": list(dimensions)}
            # By default, xarray would read zeros as missing values.
            root.create_array(name, data=values, fill_value=None, attributes=attributes)
        root.attrs["of"] = list(self.of)
        zarr.consolidate_metadata(str(path))

    def plot(self, title: str = "") -> Figure:
        """Return a picture of the structure factor S(q, ω) for ω ≥ 0. The scale of S is logarithmic.

        For grids of two or three axes, q is along the first axis and 0 along the others. Raises `MissingPackageError`
        without matplotlib.
        """
        figure: Figure = display("figure of a spectrum")(self, title)
        return figure


@dataclass(frozen=True)
class Correlation:
    """Correlation ⟨f(r) g(r + d)⟩ − ⟨f⟩⟨g⟩ of the two coordinates f and g named in ``of``.

    ⟨ ⟩ is the mean over the sites r and over frames. ``values`` (distances,) are for d = 0, 1, … sites along an
    ``axis``.
    """

    values: Floats
    of: tuple[str, str]
    axis: str


@dataclass(frozen=True)
class Transforms:
    """Settings of a run for ``spectrum`` and ``correlation``, each None if the run does not request it."""

    spectrum: SpectrumChoice | None = None
    correlation: CorrelationChoice | None = None

    def __bool__(self) -> bool:
        return bool(self.spectrum or self.correlation)

    def expect_frames(self, t: Floats, h: float) -> None:
        """Raise `ValueError` if frames at the times ``t`` do not suffice for the requested spectrum or correlation."""
        if self.spectrum:
            equal_times(t, h, _number(self.spectrum.after))
        if self.correlation:
            expect_frames(t, h, _number(self.correlation.after))

    def of(self, run: LatticeTrajectory) -> tuple[DynamicSpectrum | None, Correlation | None]:
        """Return the requested spectrum and correlation of a trajectory; None for a result that is not requested."""
        spectrum_request, pair = self.spectrum, self.correlation
        structure_factor = (
            spectrum(run, spectrum_request.of, after=_number(spectrum_request.after)) if spectrum_request else None
        )
        if pair is None:
            return structure_factor, None
        values = correlation(run, pair.of, pair.other, pair.axis, pair.up_to, after=_number(pair.after))
        return structure_factor, Correlation(values, (pair.of, pair.other), pair.axis)


def _number(value: Fraction | None) -> float | None:
    return None if value is None else float(value)


def spectrum(run: LatticeTrajectory, of: Sequence[str], *, after: float | None = None) -> DynamicSpectrum:
    """Return the dynamic structure factor S(q, ω) of some coordinates, by a Fourier transform of frames.

    The frames from the time ``after`` on are used, weighted by a Hann window in time. They must be equally spaced in
    time; if only the last frame is at a shorter distance, it is left out. Open axes are treated as periodic. Raises
    `ValueError` for lattices that are not grids, unknown coordinates, and fewer than four frames.
    """
    fields = [_index(run, name) for name in ([of] if isinstance(of, str) else of)]
    _expect_grid(run, "a spectrum")
    if not fields:
        raise ValueError("a spectrum needs one coordinate or more")
    frames = equal_times(run.t, run.h, after)
    first, count, sizes = len(run.t) - len(_later(run.t, run.h, after)), len(frames), run.x.shape[2:]
    expect_room("the transform of the frames", 3 * 16 * count * int(np.prod(sizes)))
    window = np.hanning(count + 2)[1:-1]
    window *= np.sqrt(count / (window**2).sum())
    total = np.zeros((count, *sizes))
    for k in fields:
        windowed = np.array(run.x[first : first + count, k]) * window.reshape(-1, *[1] * len(sizes))
        # The sign of e^{+iωt} is chosen so that a wave that moves to larger r has q and ω of the same sign.
        total += np.abs(np.fft.fftn(np.fft.ifft(windowed, axis=0), axes=range(1, 1 + len(sizes)))) ** 2
    total /= float(np.prod(sizes)) ** 2
    values = np.moveaxis(np.fft.fftshift(total), 0, -1)
    q = tuple(np.fft.fftshift(2 * np.pi * np.fft.fftfreq(size)) for size in sizes)
    omega = np.fft.fftshift(2 * np.pi * np.fft.fftfreq(count, abs(frames[1] - frames[0])))
    return DynamicSpectrum(q, omega, values, run.axes, tuple([of] if isinstance(of, str) else of))


def correlation(
    run: LatticeTrajectory, of: str, other: str, axis: str, up_to: int, *, after: float | None = None
) -> Floats:
    """Return the correlations ⟨f(r) g(r + d)⟩ − ⟨f⟩⟨g⟩ for d = 0 … ``up_to`` sites along an axis, (up_to + 1,).

    The arguments ``of`` and ``other`` are the names of the coordinates f and g. ⟨ ⟩ is the mean over the sites r, and
    over the frames from the time ``after`` on. If the axis is open, ⟨f(r) g(r + d)⟩ is only over the sites r for which
    r + d is on the lattice. Raises `ValueError` for lattices that are not grids, and for unknown coordinates or axes.
    """
    _expect_grid(run, "a correlation")
    if axis not in run.axes:
        raise ValueError(f"{axis!r} is no axis; there are {', '.join(run.axes)}")
    array_axis = 1 + run.axes.index(axis)
    size = run.x.shape[1 + array_axis]
    if not 0 <= up_to < size:
        raise ValueError(f"up_to must be from 0 to {size - 1}, the last distance along {axis}, not {up_to!r}")
    count, sums = 0, np.zeros(up_to + 1)
    numbers, means = np.zeros(up_to + 1), np.zeros(2)
    pair, wraps = (_index(run, of), _index(run, other)), not run.solver.interface.open_axes[array_axis - 1]
    for x in itertools.islice(run.x, len(run.t) - len(_later(run.t, run.h, after)), None):
        f, g = (np.moveaxis(np.asarray(x[k]), array_axis - 1, 0) for k in pair)
        means += f.mean(), g.mean()
        count += 1
        for d in range(up_to + 1):
            product = f * np.roll(g, -d, axis=0) if wraps else f[: size - d] * g[d:]
            sums[d] += product.sum()
            numbers[d] += product.size
    expect_frames(run.t, run.h, after)
    return sums / numbers - np.prod(means / count)


def equal_times(t: Floats, h: float, after: float | None) -> Floats:
    """Return the times of the frames from which a spectrum is computed: all frames from the time ``after`` on.

    A last frame at a shorter distance is left out. Raises `ValueError` for fewer than four frames, and for unequal
    distances in time.
    """
    frames = _later(t, h, after)
    if len(frames) > 2 and abs(frames[-1] - 2 * frames[-2] + frames[-3]) > _EQUAL * abs(frames[1] - frames[0]):
        frames = frames[:-1]
    if len(frames) < LEAST_FRAMES:
        raise ValueError(f"a spectrum needs {LEAST_FRAMES} frames at equal intervals of time, not {len(frames)}")
    if np.ptp(np.diff(frames)) > _EQUAL * abs(frames[1] - frames[0]):
        raise ValueError("a spectrum needs frames at equal intervals of time")
    return frames


def expect_frames(t: Floats, h: float, after: float | None) -> None:
    """Raise `ValueError` if there is no frame from the time ``after`` on; ``t`` are the times of the frames."""
    if not len(_later(t, h, after)):
        raise ValueError(f"there are no frames from t = {after!r} on")


def _later(t: Floats, h: float, after: float | None) -> Floats:
    """Return the times in ``t`` that are at least ``after``. If h < 0, the run goes backwards, and the times that are
    at most ``after`` are returned.
    """
    sign = np.sign(h)
    return t if after is None else t[sign * t >= sign * after - 1e-9 * abs(h)]


def _index(run: LatticeTrajectory, name: str) -> int:
    if name not in run.coordinates:
        raise ValueError(f"{name!r} is not a coordinate; there are {', '.join(run.coordinates)}")
    return run.coordinates.index(name)


def _expect_grid(run: LatticeTrajectory, argument: str) -> None:
    interface = run.solver.interface
    if interface.graph or interface.pairs:
        raise ValueError(f"{argument} needs the axes of a grid, and {interface.name} is not a grid")
