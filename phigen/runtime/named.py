"""Properties that solvers of ordinary systems and of lattices share: names of runs and coordinates, target, order."""

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
    """Base class of solvers: a back end of some target, and the interface with its names and order."""

    backend: B
    interface: N
    #: The spec that was compiled; None for a back end that was loaded without one.
    spec: Spec | None = None

    @property
    def runs(self) -> tuple[str, ...]:
        """The names of the runs of the spec, as arguments of `run`."""
        return tuple(self.spec.runs) if self.spec else ()

    @property
    def target(self) -> str:
        """The target of the solver, such as ``c`` or ``numpy``."""
        return self.backend.target

    @property
    def order(self) -> int:
        """The order of the method."""
        return self.interface.order

    @property
    def coordinates(self) -> tuple[str, ...]:
        """The names of the coordinates; for a lattice, of the coordinates at one site."""
        return self.interface.coordinates
