"""A session along given increments of the noise, in place of random ones."""

from __future__ import annotations

from phigen.runtime.interface import Floats
from phigen.runtime.session import Session


class Given:
    """A session (`phigen.runtime.session.Session`) whose k-th step has the increments of row k (steps, draws)."""

    def __init__(self, session: Session, increments: Floats) -> None:
        self.session, self.increments = session, increments

    @property
    def steps(self) -> int:
        """Good steps since the start."""
        return self.session.steps

    def advance(self, h: float, steps: int) -> None:
        """Make so many steps."""
        done = self.steps
        self.session.advance_along(h, self.increments[done : done + steps])

    def advance_along(self, h: float, increments: Floats) -> None:
        """See `Session`."""
        self.session.advance_along(h, increments)

    def branch(self) -> Given:
        """An independent copy."""
        return Given(self.session.branch(), self.increments)

    def state(self) -> Floats:
        """See `Session`."""
        return self.session.state()

    def time(self) -> float:
        """See `Session`."""
        return self.session.time()

    def element(self) -> Floats:
        """See `Session`."""
        return self.session.element()

    def saved(self) -> bytes:
        """See `Session`."""
        return self.session.saved()

    def advance_tangent(self, h: float) -> Floats:
        """See `Session`."""
        return self.session.advance_tangent(h)

    def place(self, x: Floats) -> None:
        """See `Session`."""
        self.session.place(x)

    def kick(self, change: Floats) -> None:
        """See `Session`."""
        self.session.kick(change)

    def placed(self, x: Floats) -> Given:
        """See `Session`."""
        return Given(self.session.placed(x), self.increments)
