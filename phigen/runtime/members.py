"""Ensembles: what is asked for, shared out between threads, or made one by one where the code has no better way."""

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

#: Members that one part of an ensemble has at least, a multiple of all that groups of lanes hold: so members have the
#: same neighbours, and the same bits, however many parts there are.
LEAST = 32

#: Steps of members for which one more thread repays that it is started.
_REPAID = 20_000

#: Members of a part, and steps of members, after which Python can deliver a keyboard interrupt.
_MOST, _STEPS = 1024, 1 << 16


@dataclass(frozen=True, eq=False)
class Members:
    """An ensemble: initial states (members, DIM), and numbers of shape (), the same for all, or (members,).

    ``paths`` are the members whose random numbers they take (members,), with the seed and the step of ``draws``. With a
    ``stride`` the states after every so many steps are asked for, else the final ones.
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
        """Whether members differ in their states only."""
        return not any(np.ndim(value) for value in (self.h, self.t0, *self.parameters.values()))

    def part(self, chosen: slice | NDArray[np.intp]) -> Members:
        """Some of the members."""

        def own(value: Floats) -> Floats:
            return value[chosen] if np.ndim(value) else value

        parameters = {name: own(value) for name, value in self.parameters.items()}
        numbers: dict[str, Any] = {
            "h": own(self.h),
            "parameters": parameters,
            "t0": own(self.t0),
            "paths": self.paths[chosen],
        }
        return replace(self, x0=self.x0[chosen], **numbers)

    def numbers(self, m: int) -> tuple[float, dict[str, float], float]:
        """The step, the parameters and the time of the start of one member."""

        def own(value: Floats) -> float:
            return float(value[m] if np.ndim(value) else value)

        return own(self.h), {name: own(value) for name, value in self.parameters.items()}, own(self.t0)

    def frames(self) -> Floats:
        """Room for the states that are asked for, (rows, members, DIM), with the initial ones."""
        found = np.empty((len(row_steps(self.steps, self.stride)), *self.x0.shape))
        found[0] = self.x0
        return found

    def told(self, states: Floats, failures: Mapping[int, str], step: int = -1) -> Floats:
        """The states, or the `BackendError` that some members failed; their frames are no numbers from then on."""
        if not failures:
            return states
        failed = tuple(sorted(failures))
        raise BackendError(failures[failed[0]], step, states, failed, failures)


def cores() -> int:
    """The processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def parts(members: Members, threads: int) -> Iterator[slice]:
    """What is integrated by one call each: enough to keep the threads busy, short enough to be interrupted."""
    count = len(members)
    size = max(_MOST, _STEPS // max(members.steps, 1) // _MOST * _MOST)
    size = min(size, -(-count // (4 * threads)) if threads > 1 else size)
    size = -(-max(size, 1) // LEAST) * LEAST
    return (slice(start, min(start + size, count)) for start in range(0, count, size))


def shared_out(members: Members, threads: int | None, make: Callable[[slice], None]) -> None:
    """Make all parts of an ensemble, in as many threads as are worth it; None for all cores."""
    most = len(members) * members.steps // _REPAID
    threads = max(1, min(cores() if threads is None else threads, most, -(-len(members) // LEAST)))
    in_threads(threads, make, parts(members, threads))


def in_threads(threads: int, make: Callable[[Part], None], parts: Iterable[Part]) -> None:
    """Make all parts, in so many threads."""
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
    """The states that are asked for, by a session for each member."""
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
    return members.told(final if frames is None else frames, failures)
