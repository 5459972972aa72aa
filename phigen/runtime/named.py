"""Properties that solvers of ordinary systems and of lattices share, such as target, order and names of coordinates."""

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
    """Base class of `Solver` and `LatticeSolver`: a loaded solver, and the interface with its names and its order."""

    backend: B
    interface: N
    #: The spec that was compiled; None for generated code that was loaded without its spec.
    spec: Spec | None = None

    @property
    def runs(self) -> tuple[str, ...]:
        """The names of the runs of the spec, which `run` takes as its argument."""
        return tuple(self.spec.runs) if self.spec else ()

    @property
    def target(self) -> str:
        """The target language or device of the solver, such as ``c`` or ``numpy``."""
        return self.backend.target

    @property
    def order(self) -> int:
        """The order of the method."""
        return self.interface.order

    @property
    def coordinates(self) -> tuple[str, ...]:
        """The names of the coordinates; for a lattice, of the coordinates at one site."""
        return self.interface.coordinates
