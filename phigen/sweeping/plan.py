"""Plan of a sweep: dimensions, chunks, and the values of each member, computed on demand.

A plan is plain data, stored with the result as JSON. It documents the result, and contains all settings that a worker
needs. Members are numbered in the order of the dimensions, with the last dimension the fastest. A chunk is a box of
members with consecutive numbers.
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

#: Largest size in bytes of the frames of a chunk in memory.
_MOST_BYTES = 256 * 2**20


@dataclass(frozen=True)
class Plan:
    """Numerical description of a sweep.

    ``initial``, ``h``, ``t0`` and ``parameters`` are the values of quantities that are not varied. ``axes`` are the
    varied quantities; values along axes without a size are drawn with ``seed``. ``noise`` is the seed of the noise;
    each member number has a different path. ``members`` is the number of members in a file or of random members, whose
    only dimension is ``member``; ``listed`` names the columns of the file. Lattices of ``sizes`` have no ``initial``:
    workers compute the initial state from the spec.
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
    blocks: int | None = None  # number of blocks of rows for the standard errors
    stride: int = 1  # steps between averaged rows, for lattices without frames
    chunk: tuple[int, ...] = ()
    sizes: tuple[int, ...] = ()
    # additional properties that determine the result: target, version
    about: Mapping[str, Any] = field(default_factory=dict)

    @property
    def grid(self) -> tuple[Axis, ...]:
        """The axes that are dimensions."""
        return tuple(axis for axis in self.axes if axis.size)

    @property
    def drawn(self) -> tuple[Axis, ...]:
        """The axes whose values are drawn at random."""
        return tuple(axis for axis in self.axes if not axis.size)

    @property
    def dims(self) -> tuple[str, ...]:
        """The names of the dimensions."""
        return ("member",) if self.members else tuple(axis.name for axis in self.grid)

    @property
    def shape(self) -> tuple[int, ...]:
        """The sizes of the dimensions."""
        return (self.members,) if self.members else tuple(axis.size for axis in self.grid)

    @property
    def size(self) -> int:
        """The number of members of the sweep."""
        return prod(self.shape)

    @property
    def boxes(self) -> tuple[int, ...]:
        """The number of chunks along each dimension."""
        return tuple(ceil(size / of) for size, of in zip(self.shape, self.chunk, strict=True))

    @property
    def rows(self) -> tuple[int, ...]:
        """The step numbers of the stored frames."""
        return tuple(range(0, self.steps + 1, self.frames)) if self.frames else ()

    def statistics(self, observables: Collection[str]) -> dict[str, Statistic]:
        """Return the stored statistics of observables by their keywords."""
        read = {word: Statistic.read(word, observables) for word in self.keep}
        return {word: statistic for word, statistic in read.items() if statistic is not None}

    @property
    def bytes_of_member(self) -> int:
        """Lower bound of the memory of a member in bytes: its current states and all of its frames."""
        return 8 * len(self.coordinates) * prod(self.sizes) * (len(self.rows) + 4)

    def region(self, number: int) -> tuple[slice, ...]:
        """Return the box of members of a chunk."""
        place = np.unravel_index(number, self.boxes)
        ends = zip(place, self.chunk, self.shape, strict=True)
        return tuple(slice(int(k) * of, min((int(k) + 1) * of, size)) for k, of, size in ends)

    def first(self, region: Sequence[slice]) -> int:
        """Return the number of the first member of a region."""
        return int(np.ravel_multi_index([part.start for part in region], self.shape))

    def varied(self, region: Sequence[slice], listed: Mapping[str, Floats]) -> dict[str, Floats]:
        """Return the varied values of the members of a region, (members,) each; ``listed`` are values from a file."""
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
        """Return the plan as plain data."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Plan:
        """Return the plan from the data of `as_json`."""
        axes = tuple(
            Axis(**{**axis, "values": tuple(axis["values"]), "ends": tuple(axis["ends"])}) for axis in data["axes"]
        )
        lists = ("coordinates", "initial", "listed", "keep", "chunk", "sizes")
        return cls(**{**data, **{key: tuple(data[key]) for key in lists}, "axes": axes})


def values_of(axis: Axis) -> Floats:
    """Return the values along an axis; for the axis ``seed`` these are the numbers of draws."""
    if axis.values:
        return np.array(axis.values)
    if axis.name == "seed" and axis.ends == (0.0, 0.0):
        return np.arange(float(axis.count))
    share = np.arange(axis.count) / max(axis.count - 1, 1)
    spaced = _spaced(axis, share)
    spaced[-1] = axis.ends[1] if axis.count > 1 else spaced[-1]
    return spaced


def _spaced(axis: Axis, share: Floats) -> Floats:
    """Return the values at fractions 0 to 1 of the way between the ends of an axis."""
    first, last = axis.ends
    if axis.scale == "log":
        return np.asarray(first * (last / first) ** share)
    return np.asarray(first + (last - first) * share)


def _uniform(seed: int, column: int, first: int, count: int) -> Floats:
    """Return random numbers of a column from position ``first`` on.

    They do not depend on the division into chunks.
    """
    stream = np.random.Philox(key=[seed, column])
    stream.advance(first // 4)  # one round of the generator yields four numbers
    return np.random.Generator(stream).random(first % 4 + count)[first % 4 :]


def chunk_of(plan: Plan, members: int) -> tuple[int, ...]:
    """Return the sizes of a chunk with at most ``members`` members that fit into the memory limit."""
    left = max(1, min(members, _MOST_BYTES // plan.bytes_of_member))
    sides: list[int] = []
    for size in reversed(plan.shape):
        sides.append(min(size, left))
        left = left // size if size <= left else 1
    return tuple(reversed(sides))
