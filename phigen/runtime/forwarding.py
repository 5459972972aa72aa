"""Base class of sessions that wrap another session and make its steps in a different way."""

from __future__ import annotations

from typing import Generic, TypeVar

from phigen.runtime.interface import Floats
from phigen.runtime.session import Followed

Inner = TypeVar("Inner", bound=Followed)


class Forwarding(Generic[Inner]):
    """A `phigen.runtime.session.Followed` whose state, time and attitude are those of the wrapped ``session``."""

    def __init__(self, session: Inner) -> None:
        self.session = session

    @property
    def steps(self) -> int:
        """The number of successful steps since the start."""
        return self.session.steps

    @property
    def rounding(self) -> float:
        return self.session.rounding

    def state(self) -> Floats:
        return self.session.state()

    def time(self) -> float:
        return self.session.time()

    def element(self) -> Floats:
        return self.session.element()
