"""A session whose failing steps are made in parts, where that was asked for."""

from __future__ import annotations

from phigen.runtime.interface import BackendError, Floats
from phigen.runtime.session import Followed


class Retrying:
    """A course (`phigen.runtime.session.Followed`) that makes a failing step in 2, 4, …, 2^``most`` equal parts.

    Each part is a step of the method: a Poisson map that stays on the leaf. But the whole is another map than the steps
    that did not fail; ``retried`` are their numbers. ``steps`` counts whole steps.
    """

    def __init__(self, session: Followed, most: int) -> None:
        self.session, self.most = session, most
        self.retried: list[int] = []
        self._more = 0  # steps of the session beyond one for each step

    @property
    def steps(self) -> int:
        """Good steps since the start."""
        return self.session.steps - self._more

    def state(self) -> Floats:
        """A copy of the state (DIM,)."""
        return self.session.state()

    @property
    def rounding(self) -> float:
        """See `Followed`."""
        return self.session.rounding

    def time(self) -> float:
        """See `Followed`."""
        return self.session.time()

    def element(self) -> Floats:
        """See `Followed`."""
        return self.session.element()

    def advance(self, h: float, steps: int) -> None:
        """Make so many steps."""
        target = self.steps + steps
        while self.steps < target:
            try:
                self.session.advance(h, target - self.steps)
            except BackendError as error:
                self._make_parts(h, error)

    def branch(self) -> Retrying:
        """An independent copy."""
        twin = Retrying(self.session.branch(), self.most)
        twin.retried, twin._more = list(self.retried), self._more
        return twin

    def _make_parts(self, h: float, error: BackendError) -> None:
        step = self.steps
        for k in range(1, self.most + 1):
            copy = self.session.branch()
            try:
                copy.advance(h / 2**k, 2**k)
            except BackendError:
                continue
            self.session, self._more = copy, self._more + 2**k - 1
            self.retried.append(step)
            return
        raise error
