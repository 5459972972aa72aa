"""Sessions whose noise has prescribed increments in place of random ones."""

from __future__ import annotations

from phigen.runtime.interface import Floats
from phigen.runtime.session import Session


class PrescribedNoise:
    """A `phigen.runtime.session.Followed` whose k-th step takes row k of the increments (steps, draws)."""

    def __init__(self, session: Session, increments: Floats) -> None:
        self.session, self.increments = session, increments

    @property
    def steps(self) -> int:
        """The number of successful steps since the start."""
        return self.session.steps

    def advance(self, h: float, steps: int) -> None:
        """Make ``steps`` steps."""
        done = self.steps
        self.session.advance_along(h, self.increments[done : done + steps])

    def branch(self) -> PrescribedNoise:
        """Return an independent copy."""
        return PrescribedNoise(self.session.branch(), self.increments)

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
