"""Plan of a sweep: dimensions, chunks, and the numbers of each member, computed where they are needed.

A plan is plain data, stored beside the result as JSON, so that whoever opens it knows what was made, and a worker needs
nothing else. Members are numbered in the order of the dimensions, the last the fastest. A chunk is a box of members
whose numbers follow one another.
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

#: Bytes of frames that a chunk may hold in memory.
_MOST_BYTES = 256 * 2**20


@dataclass(frozen=True)
class Plan:
    """A sweep in numbers: ``initial``, ``h``, ``t0`` and ``parameters`` are those of what is not varied.

    ``axes`` are varied, those without a size drawn from ``seed``; ``noise`` is the seed of the noise, whose member each
    is by its number. ``members`` is the number of those in a file or of
    random ones, whose only dimension is ``member``; ``listed`` names the columns of the file. Of a
    lattice of these ``sizes`` there is no ``initial``: workers find it by the spec.
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
    after: float | None = None  # the time from which means of observables are taken
    blocks: int | None = None  # of rows, for the errors of these means
    stride: int = 1  # of lattices without frames: steps between the rows that means are over
    chunk: tuple[int, ...] = ()
    sizes: tuple[int, ...] = ()
    about: Mapping[str, Any] = field(default_factory=dict)  # target, version: what else decides the result

    @property
    def grid(self) -> tuple[Axis, ...]:
        """The axes that are dimensions."""
        return tuple(axis for axis in self.axes if axis.size)

    @property
    def drawn(self) -> tuple[Axis, ...]:
        """The axes that are drawn."""
        return tuple(axis for axis in self.axes if not axis.size)

    @property
    def dims(self) -> tuple[str, ...]:
        """The names of the dimensions."""
        return ("member",) if self.members else tuple(axis.name for axis in self.grid)

    @property
    def shape(self) -> tuple[int, ...]:
        """Their sizes."""
        return (self.members,) if self.members else tuple(axis.size for axis in self.grid)

    @property
    def size(self) -> int:
        """The number of members."""
        return prod(self.shape)

    @property
    def boxes(self) -> tuple[int, ...]:
        """The number of chunks along each dimension."""
        return tuple(ceil(size / of) for size, of in zip(self.shape, self.chunk, strict=True))

    @property
    def rows(self) -> tuple[int, ...]:
        """The numbers of the steps that are stored as frames."""
        return tuple(range(0, self.steps + 1, self.frames)) if self.frames else ()

    def statistics(self, observables: Collection[str]) -> dict[str, Statistic]:
        """Return what is kept of observables, by the words for it."""
        read = {word: Statistic.read(word, observables) for word in self.keep}
        return {word: statistic for word, statistic in read.items() if statistic is not None}

    @property
    def bytes_of_member(self) -> int:
        """The least memory of a member in bytes: its current states, and all of its frames."""
        return 8 * len(self.coordinates) * prod(self.sizes) * (len(self.rows) + 4)

    def region(self, number: int) -> tuple[slice, ...]:
        """The box of a chunk."""
        place = np.unravel_index(number, self.boxes)
        ends = zip(place, self.chunk, self.shape, strict=True)
        return tuple(slice(int(k) * of, min((int(k) + 1) * of, size)) for k, of, size in ends)

    def first(self, region: Sequence[slice]) -> int:
        """The number of the first member of a region."""
        return int(np.ravel_multi_index([part.start for part in region], self.shape))

    def varied(self, region: Sequence[slice], listed: Mapping[str, Floats]) -> dict[str, Floats]:
        """The varied numbers of the members of a region, (members,) each; ``listed`` are those of a file."""
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
        """Plain data."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Plan:
        """The inverse of `as_json`."""
        axes = tuple(
            Axis(**{**axis, "values": tuple(axis["values"]), "ends": tuple(axis["ends"])}) for axis in data["axes"]
        )
        lists = ("coordinates", "initial", "listed", "keep", "chunk", "sizes")
        return cls(**{**data, **{key: tuple(data[key]) for key in lists}, "axes": axes})


def values_of(axis: Axis) -> Floats:
    """The values along an axis; of ``seed`` the numbers of the draws."""
    if axis.values:
        return np.array(axis.values)
    if axis.name == "seed" and axis.ends == (0.0, 0.0):
        return np.arange(float(axis.count))
    share = np.arange(axis.count) / max(axis.count - 1, 1)
    spaced = _spaced(axis, share)
    spaced[-1] = axis.ends[1] if axis.count > 1 else spaced[-1]
    return spaced


def _spaced(axis: Axis, share: Floats) -> Floats:
    """Values at shares, from 0 to 1, of the way from one end to the other."""
    first, last = axis.ends
    if axis.scale == "log":
        return np.asarray(first * (last / first) ** share)
    return np.asarray(first + (last - first) * share)


def _uniform(seed: int, column: int, first: int, count: int) -> Floats:
    """Numbers of a stream of their own for each column, from a place on: the same however they are cut into chunks."""
    stream = np.random.Philox(key=[seed, column])
    stream.advance(first // 4)  # four numbers come from one round
    return np.random.Generator(stream).random(first % 4 + count)[first % 4 :]


def chunk_of(plan: Plan, members: int) -> tuple[int, ...]:
    """The sizes of a chunk of so many members at most, and of no more than memory has room for."""
    left = max(1, min(members, _MOST_BYTES // plan.bytes_of_member))
    sides: list[int] = []
    for size in reversed(plan.shape):
        sides.append(min(size, left))
        left = left // size if size <= left else 1
    return tuple(reversed(sides))
