"""Plan of a sweep: dimensions, chunks, and the values of each member, computed on demand.

A plan is stored with the results, as JSON. It contains all settings that a worker process needs. Members are numbered
from 0; if the sweep has several dimensions, the last one varies fastest. A chunk is a box of members: a range of
indices along each dimension.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from math import ceil, prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phigen.spec.model import Axis, Statistic

Floats = NDArray[np.float64]

#: Largest memory in bytes for the states of the members of a chunk, stored frames included.
_MOST_BYTES = 256 * 2**20


@dataclass(frozen=True)
class Plan:
    """Numerical description of a sweep.

    ``initial``, ``h``, ``t0`` and ``parameters`` are the values of quantities that are not varied. ``axes`` are the
    ranges of the varied quantities. If an axis has the size 0, its values are drawn at random with ``seed``. ``noise``
    is the seed of the noise; each member has its own path of the noise. ``members`` is 0 for a grid. Otherwise it is
    the number of random members or of the rows of a file, and the only dimension is ``member``. ``listed`` names the
    columns of the file. ``sizes`` are the sizes of a lattice, () for other systems. For a lattice, workers compute the
    initial state from the spec, and ``initial`` is not used.
    """

    name: str
    coordinates: tuple[str, ...]
    initial: tuple[float, ...]
    h: float
    t0: float
    parameters: Mapping[str, float]
    steps: int
    axes: tuple[Axis, ...] = ()
    seed: int = 0
    noise: int = 0
    members: int = 0
    listed: tuple[str, ...] = ()
    keep: tuple[str, ...] = ("final",)
    frames: int = 0
    after: float | None = None  # start of the time averages of observables
    blocks: int | None = None  # least number of blocks of rows from which standard errors follow
    stride: int = 1  # steps between averaged rows, if no frames are stored
    chunk: tuple[int, ...] = ()
    sizes: tuple[int, ...] = ()
    # further data that determine the results: target, version of phigen, run, files that the spec names
    about: Mapping[str, Any] = field(default_factory=dict)

    @property
    def grid(self) -> tuple[Axis, ...]:
        """The axes whose values form a grid. They are dimensions of the results."""
        return tuple(axis for axis in self.axes if axis.size)

    @property
    def drawn(self) -> tuple[Axis, ...]:
        """The axes whose values are drawn at random, for each member. They are not dimensions of the results."""
        return tuple(axis for axis in self.axes if not axis.size)

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the dimensions of the results."""
        return ("member",) if self.members else tuple(axis.name for axis in self.grid)

    @property
    def shape(self) -> tuple[int, ...]:
        """Sizes of the dimensions of the results."""
        return (self.members,) if self.members else tuple(axis.size for axis in self.grid)

    @property
    def size(self) -> int:
        """Number of members of the sweep."""
        return prod(self.shape)

    @property
    def boxes(self) -> tuple[int, ...]:
        """Number of chunks along each dimension."""
        return tuple(ceil(size / of) for size, of in zip(self.shape, self.chunk, strict=True))

    @property
    def rows(self) -> tuple[int, ...]:
        """Numbers of the steps after which states are stored (frames); () if none are stored."""
        return tuple(range(0, self.steps + 1, self.frames)) if self.frames else ()

    def statistics(self, observables: Collection[str]) -> dict[str, Statistic]:
        """Return the statistics of observables that the sweep stores, by keyword, such as M or mean(M)."""
        read = {word: Statistic.read(word, observables) for word in self.keep}
        return {word: statistic for word, statistic in read.items() if statistic is not None}

    @property
    def bytes_of_member(self) -> int:
        """Lower bound, in bytes, of the memory that a member needs. It counts the frames and four more states."""
        return 8 * len(self.coordinates) * prod(self.sizes) * (len(self.rows) + 4)

    def region(self, number: int) -> tuple[slice, ...]:
        """Return the region of the chunk with this number. A region has a slice of members along each dimension."""
        place = np.unravel_index(number, self.boxes)
        ends = zip(place, self.chunk, self.shape, strict=True)
        return tuple(slice(int(k) * of, min((int(k) + 1) * of, size)) for k, of, size in ends)

    def first(self, region: Sequence[slice]) -> int:
        """Return the number of the first member of a region, which has a slice of members along each dimension."""
        return int(np.ravel_multi_index([part.start for part in region], self.shape))

    def varied(self, region: Sequence[slice], listed: Mapping[str, Floats]) -> dict[str, Floats]:
        """Return the values of the varied quantities for the members of a region, by name, (members,) each.

        ``listed`` has the values that come from a file of members.
        """
        sizes = tuple(part.stop - part.start for part in region)
        first = self.first(region)
        columns: dict[str, Floats] = dict(listed)
        for k, axis in enumerate(self.grid):
            along = [1] * len(sizes)
            along[k] = sizes[k]
            columns[axis.name] = np.broadcast_to(values_of(axis)[region[k]].reshape(along), sizes).reshape(-1)
        for k, axis in enumerate(self.drawn):
            columns[axis.name] = _spaced(axis, _uniform(self.seed, k, first, prod(sizes)))
        seeded = "seed" in self.parameters or self.sizes
        return {name: values for name, values in columns.items() if name != "seed" or seeded}

    def as_json(self) -> dict[str, Any]:
        """Return the plan as data that JSON can represent."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Plan:
        """Return the plan whose data `as_json` has returned, possibly after a conversion to JSON and back."""
        axes = tuple(
            Axis(**{**axis, "values": tuple(axis["values"]), "ends": tuple(axis["ends"])}) for axis in data["axes"]
        )
        lists = ("coordinates", "initial", "listed", "keep", "chunk", "sizes")
        return cls(**{**data, **{key: tuple(data[key]) for key in lists}, "axes": axes})


def values_of(axis: Axis) -> Floats:
    """Return the values along an axis. Along the axis ``seed`` they are the numbers 0, 1, … of the random draws."""
    if axis.values:
        return np.array(axis.values)
    if axis.name == "seed" and axis.ends == (0.0, 0.0):
        return np.arange(float(axis.count))
    share = np.arange(axis.count) / max(axis.count - 1, 1)
    spaced = _spaced(axis, share)
    spaced[-1] = axis.ends[1] if axis.count > 1 else spaced[-1]
    return spaced


def _spaced(axis: Axis, share: Floats) -> Floats:
    """Return values between the ends of an axis. A ``share`` of 0 gives the first end, and 1 gives the last.

    The values are linear in ``share``. If the scale of the axis is log, the logarithms of the values are linear.
    """
    first, last = axis.ends
    if axis.scale == "log":
        return np.asarray(first * (last / first) ** share)
    return np.asarray(first + (last - first) * share)


def _uniform(seed: int, column: int, first: int, count: int) -> Floats:
    """Return uniform random numbers for ``count`` members, from the member ``first`` on.

    The numbers are for one varied quantity, which is numbered by ``column``. A random number depends only on the seed,
    the quantity and the member, not on the division into chunks.
    """
    stream = np.random.Philox(key=[seed, column])
    stream.advance(first // 4)  # the generator makes four numbers at a time
    return np.random.Generator(stream).random(first % 4 + count)[first % 4 :]


def chunk_of(plan: Plan, members: int) -> tuple[int, ...]:
    """Return the sizes of chunks along the dimensions.

    A chunk has at most ``members`` members, and fits into the memory limit.
    """
    left = max(1, min(members, _MOST_BYTES // plan.bytes_of_member))
    sides: list[int] = []
    for size in reversed(plan.shape):
        sides.append(min(size, left))
        left = left // size if size <= left else 1
    return tuple(reversed(sides))
