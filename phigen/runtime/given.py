"""A session along given increments of the noise, in place of random ones."""

from __future__ import annotations

from phigen.runtime.interface import Floats
from phigen.runtime.session import Session


class Given:
    """A course (`phigen.runtime.session.Followed`) whose k-th step has the increments of row k (steps, draws)."""

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

    def branch(self) -> Given:
        """An independent copy."""
        return Given(self.session.branch(), self.increments)

    def state(self) -> Floats:
        """See `Followed`."""
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
