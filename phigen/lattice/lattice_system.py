"""Lattices as `phigen.load` returns them: a spec and its cell."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, cast

from phigen.display import display
from phigen.errors import missing_attribute
from phigen.lattice.cell import Cell
from phigen.lattice.cell_building import cell_from_spec
from phigen.spec.model import Spec


@dataclass(frozen=True)
class LatticeSystem:
    """A lattice of any size: ``spec`` is the content of the spec file, and ``cell`` holds the fields, brackets and
    densities of one site.

    `phigen.compile` accepts a `LatticeSystem` in place of a `System`.
    """

    spec: Spec = field(repr=False)
    cell: Cell

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Raise an `AttributeError`. If a `System` has the attribute, the message says what to use for a lattice
            instead.
            """
            raise missing_attribute(self, name)

    def __repr__(self) -> str:
        relation = f"on axes {', '.join(self.axes)}" if self.axes else f"related by {self.cell.relation}"
        return f"<LatticeSystem {self.name}: ({', '.join(self.coordinates)}) at each site, {relation}>"

    @property
    def name(self) -> str:
        """Name of the spec."""
        return self.spec.name

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the fields of a site."""
        return self.spec.coordinates

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes of a grid; () for graphs and pairs. In arrays, the index along the first axis varies
        slowest.
        """
        return self.cell.axes

    def _repr_latex_(self) -> str:
        """Return brackets, H, Casimirs and invariants as formulas in LaTeX, which notebooks display."""
        return cast(str, display("formulas of a cell")(self.cell))


def lattice_from_spec(spec: Spec) -> LatticeSystem:
    """Return the lattice of a spec. Raises `SpecError` as `cell_from_spec` does."""
    return LatticeSystem(spec, cell_from_spec(spec))
