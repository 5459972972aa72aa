"""Sessions whose noise has prescribed increments instead of random ones."""

from __future__ import annotations

from phigen.runtime.forwarding import Forwarding
from phigen.runtime.interface import Floats
from phigen.runtime.session import Session


class PrescribedNoise(Forwarding[Session]):
    """Session in which step k uses row k of the prescribed increments (steps, draws) in place of random numbers."""

    def __init__(self, session: Session, increments: Floats) -> None:
        super().__init__(session)
        self.increments = increments

    def advance(self, h: float, steps: int) -> None:
        """Make ``steps`` steps with the prescribed increments of the noise."""
        steps_done = self.steps
        self.session.advance_along(h, self.increments[steps_done : steps_done + steps])

    def branch(self) -> PrescribedNoise:
        """Return an independent copy of the session."""
        return PrescribedNoise(self.session.branch(), self.increments)
