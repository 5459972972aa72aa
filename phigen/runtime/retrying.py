"""Sessions that repeat a failing step as several smaller steps, for the argument ``retry`` of `integrate`."""

from __future__ import annotations

from typing import Self

from phigen.runtime.forwarding import Forwarding
from phigen.runtime.interface import BackendError
from phigen.runtime.session import Followed


class Retrying(Forwarding[Followed]):
    """Session that repeats a failing step as 2, 4, … equal smaller steps, at most 2^``most``.

    Each smaller step is a step of the method: a Poisson map that keeps the Casimirs. The composition of the smaller
    steps is another map than the whole step. ``retried`` lists the indices, from 0 on, of the whole steps that were
    divided. ``steps`` counts whole steps.
    """

    def __init__(self, session: Followed, limit: int) -> None:
        super().__init__(session)
        self.most = limit
        self.retried: list[int] = []
        self._extra = 0  # steps of the session minus whole steps; a step made as n smaller steps adds n - 1

    @property
    def steps(self) -> int:
        """The number of successful whole steps since the start."""
        return self.session.steps - self._extra

    def advance(self, h: float, steps: int) -> None:
        """Make ``steps`` whole steps. A step that fails is repeated as 2, 4, … smaller steps. Raises `BackendError` if
        it fails for every number of smaller steps.
        """
        while steps > 0:
            begin = self.steps
            try:
                self.session.advance(h, steps)
            except BackendError as error:
                self._make_parts(h, error)
                steps -= self.steps - begin
            else:
                return

    def branch(self) -> Self:
        """Return an independent copy of the session."""
        twin = type(self)(self.session.branch(), self.most)
        twin.retried, twin._extra = list(self.retried), self._extra
        return twin

    def _make_parts(self, h: float, error: BackendError) -> None:
        step = self.steps
        for k in range(1, self.most + 1):
            copy = self.session.branch()
            try:
                copy.advance(h / 2**k, 2**k)
            except BackendError:
                continue
            self.session, self._extra = copy, self._extra + 2**k - 1
            self.retried.append(step)
            return
        raise error
