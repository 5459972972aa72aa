"""Ensembles: their members, and the distribution of the members among threads."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from phigen.runtime.interface import FIRST_DRAWS, BackendError, Draws, Floats, row_steps

if TYPE_CHECKING:
    from phigen.runtime.backend import Backend

Part = TypeVar("Part")

#: Ensembles are divided into parts. The number of members in each part but the last is a multiple of this number, which
#: is a multiple of every SIMD width. So SIMD batches, and the bits of results, do not depend on the number of parts.
PART_GRANULARITY = 32

#: Smallest number of steps, summed over members, for which another thread is started. Fewer steps take less time than
#: the start of a thread.
_STEPS_PER_THREAD = 20_000

#: One call of C integrates up to _MEMBERS_PER_CALL members. If members make few steps, the call may integrate a
#: multiple of this number, with at most _STEPS_PER_CALL steps in total. Calls are short, since Python handles Ctrl-C
#: only between two calls.
_MEMBERS_PER_CALL, _STEPS_PER_CALL = 1024, 1 << 16


@dataclass(frozen=True, eq=False)
class Members:
    """Arguments of an ensemble: initial states (members, DIM), and ``h``, ``t0`` and parameters, as arrays.

    An array of shape () holds for all members. An array (members,) has a value for each member. The random numbers of
    member m are selected by ``paths[m]``, and by the seed and the first step of ``draws``. The states after every
    ``stride`` steps are stored. If ``stride`` is 0, only the final states are stored.
    """

    x0: Floats
    h: Floats
    steps: int
    parameters: Mapping[str, Floats]
    t0: Floats
    stride: int = 0
    draws: Draws = FIRST_DRAWS
    paths: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def __len__(self) -> int:
        return len(self.x0)

    @property
    def alike(self) -> bool:
        """Whether members differ in their initial states only, and have equal step sizes, times and parameters."""
        return not any(np.ndim(value) for value in (self.h, self.t0, *self.parameters.values()))

    def part(self, selection: slice | NDArray[np.intp]) -> Members:
        """Return the ensemble of some of the members."""

        def selected(value: Floats) -> Floats:
            return value[selection] if np.ndim(value) else value

        parameters = {name: selected(value) for name, value in self.parameters.items()}
        numbers: dict[str, Any] = {
            "h": selected(self.h),
            "parameters": parameters,
            "t0": selected(self.t0),
            "paths": self.paths[selection],
        }
        return replace(self, x0=self.x0[selection], **numbers)

    def numbers(self, m: int) -> tuple[float, dict[str, float], float]:
        """Return the step size, the parameters and the initial time of one member."""

        def of_member(value: Floats) -> float:
            return float(value[m] if np.ndim(value) else value)

        parameters = {name: of_member(value) for name, value in self.parameters.items()}
        return of_member(self.h), parameters, of_member(self.t0)

    def frames(self) -> Floats:
        """Return an array (rows, members, DIM) for the states to be stored; row 0 has the initial states, all others
        are unset."""
        frames = np.empty((len(row_steps(self.steps, self.stride)), *self.x0.shape))
        frames[0] = self.x0
        return frames

    def checked(self, states: Floats, failures: Mapping[int, str], step: int = -1) -> Floats:
        """Return the states if no member has failed. Otherwise raise `BackendError` with the states and the failures.

        ``step`` is the number of successful steps, −1 if unknown.
        """
        if not failures:
            return states
        failed = tuple(sorted(failures))
        raise BackendError(failures[failed[0]], step, states, failed, failures)


def cores() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def parts(members: Members, threads: int) -> Iterator[slice]:
    """Yield the parts of an ensemble, as slices of its members; each part is integrated by one call of C.

    Parts are short, since Python handles Ctrl-C only between two calls. If there are several threads, and enough
    members, there are about four parts or more for each thread.
    """
    count = len(members)
    batches = _STEPS_PER_CALL // max(members.steps, 1) // _MEMBERS_PER_CALL
    size = max(1, batches) * _MEMBERS_PER_CALL
    size = min(size, -(-count // (4 * threads)) if threads > 1 else size)
    size = -(-max(size, 1) // PART_GRANULARITY) * PART_GRANULARITY
    return (slice(start, min(start + size, count)) for start in range(0, count, size))


def shared_out(members: Members, threads: int | None, make: Callable[[slice], None]) -> None:
    """Call ``make`` for each part of an ensemble, in at most ``threads`` threads (None: one for each core).

    Ensembles with few steps use fewer threads, since the start of a thread costs more than these steps.
    """
    useful_threads = min(len(members) * members.steps // _STEPS_PER_THREAD, -(-len(members) // PART_GRANULARITY))
    threads = max(1, min(cores() if threads is None else threads, useful_threads))
    in_threads(threads, make, parts(members, threads))


def in_threads(threads: int, make: Callable[[Part], None], parts: Iterable[Part]) -> None:
    """Call ``make`` for each part, in ``threads`` threads. If a call raises an error, parts that have not begun are
    cancelled.
    """
    if threads == 1:
        for part in parts:
            make(part)
        return
    with ThreadPoolExecutor(threads) as pool:
        try:
            for _ in pool.map(make, parts):
                pass
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def one_by_one(backend: Backend, members: Members, threads: int | None = 1) -> Floats:
    """Return the final states or frames of an ensemble, integrated member by member with a session for each."""
    final, failures = members.x0.copy(), dict[int, str]()
    frames = members.frames() if members.stride else None
    marks = row_steps(members.steps, members.stride or max(members.steps, 1))

    def make(part: slice) -> None:
        for m in range(*part.indices(len(members))):
            h, parameters, t0 = members.numbers(m)
            if frames is not None:
                frames[1:, m] = np.nan
            try:
                draws = replace(members.draws, member=int(members.paths[m])) if len(members.paths) else members.draws
                session = backend.start(members.x0[m], parameters, t0, draws=draws)
                for row, steps in enumerate(np.diff(marks), 1):
                    session.advance(h, int(steps))
                    if frames is not None:
                        frames[row, m] = session.state()
                final[m] = session.state()
            except BackendError as error:
                failures[m] = error.status
                final[m] = error.states[-1]

    shared_out(members, threads, make)
    return members.checked(final if frames is None else frames, failures)
