"""``phigen show`` for lattices: the formulas of a cell as text, LaTeX or JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING

from phigen.cli.console import heading, out
from phigen.cli.sections import assignments, section

if TYPE_CHECKING:
    from phigen.lattice.cell import Cell
    from phigen.spec.model import Parameter, Spec


def print_cell(spec: Spec, cell: Cell, max_terms: int | None) -> None:
    """Print the formulas of a cell."""
    from phigen.notation.cell_formulas import described, sections

    out(heading(f"{spec.name}: {spec.title}" if spec.title else spec.name))
    reach = [f"{a} {h}" for a, h in zip(cell.axes, cell.hamiltonian_reach, strict=True)]
    reach_note = f"; H couples sites up to {', '.join(reach)} apart" if any(cell.hamiltonian_reach) else ""
    section("Lattice", [described(cell) + reach_note])
    if cell.parameters:
        section("Parameters", [", ".join(map(_parameter, cell.parameters))])
    for title, lines in sections(cell, max_terms):
        section(title, assignments(lines))


def _parameter(p: Parameter) -> str:
    domain_text = {"all": "", "sites": " at every site", "bonds": " at every bond"}[p.at]
    value = "" if p.values else f" = {float(p.value):.9g}"
    return f"{p.name}{value}{p.inequality}{domain_text}"


def described_cell(spec: Spec, cell: Cell) -> dict[str, object]:
    """Return the cell as data for JSON."""
    from phigen.notation.cell_formulas import brackets, rates
    from phigen.symbolic.expression import text
    from phigen.symbolic.readable import readable

    slopes = dict(rates(cell))
    return {
        "name": spec.name,
        "title": spec.title,
        "lattice": {"relation": cell.relation, "axes": list(cell.axes), "boundary": list(cell.boundary)},
        "coordinates": list(cell.fields),
        "parameters": {p.name: {"value": float(p.value), "at": p.at} for p in cell.parameters},
        "poisson": {name: text(e) for name, e in brackets(cell)},
        "hamiltonian": {
            "sites": text(cell.hamiltonian),
            "bonds": text(cell.bond_hamiltonian),
            "pairs": text(cell.pair_hamiltonian),
        },
        "casimirs": {name: {"value": text(e), "at": kind} for name, (e, kind) in cell.casimirs.items()},
        "invariants": {name: text(e) for name, e in cell.invariants.items()},
        "rates": dict(zip(slopes, readable([*slopes.values()], None), strict=True)),
        "reach": {"poisson": list(cell.poisson_reach), "hamiltonian": list(cell.hamiltonian_reach)},
    }
