"""What solvers of systems and of lattices tell of themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

from phigen.runtime.interface import Interface

if TYPE_CHECKING:
    from phigen.spec.model import Spec


class _Backend(Protocol):
    target: str


B = TypeVar("B", bound=_Backend)
N = TypeVar("N", bound=Interface)


class Named(Generic[B, N]):
    """A solver over a back end of some target, with the names and the order of its interface."""

    backend: B
    interface: N
    #: The spec that was compiled; None of a back end that was loaded without one.
    spec: Spec | None = None

    @property
    def runs(self) -> tuple[str, ...]:
        """Names of the runs of the spec, which `run` takes."""
        return tuple(self.spec.runs) if self.spec else ()

    @property
    def target(self) -> str:
        """``c`` or ``numpy``."""
        return self.backend.target

    @property
    def order(self) -> int:
        """The order of the method."""
        return self.interface.order

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates, of a lattice those of a site."""
        return self.interface.coordinates
