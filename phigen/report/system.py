"""Section on the system: π, H, Casimirs, the equations of motion, parameters."""

from __future__ import annotations

from markupsafe import Markup

from phigen.geometry.system import System
from phigen.notation import mathml, named_parts
from phigen.report import page
from phigen.report.equations import group
from phigen.report.known import MOTION

#: A matrix π with more than ROWS rows, or with more than ENTRIES names and numbers, is shown as a list of brackets.
ROWS, ENTRIES = 6, 90


def system_section(system: System) -> Markup:
    """Return the section with the formulas of the spec."""
    equations = [("H", system.hamiltonian), *system.casimirs.items(), *system.invariants.items()]
    blocks = [
        page.paragraph(f"Poisson tensor: {system.shape}.", "note"),
        _tensor(system),
        page.heading("Hamiltonian, Casimirs and invariants"),
        _kinds(system),
        group([mathml.name(n) for n, _ in equations], [e for _, e in equations], "H, Casimirs and invariants"),
        page.heading("Equations of motion"),
        page.equations([MOTION]),
        group([mathml.dotted(c) for c in system.coordinates], system.vector_field(), "The equations of motion"),
    ]
    return page.joined([*blocks, _parameters(system)] if system.parameters else blocks)


def _tensor(system: System) -> Markup:
    entries = [e for row in system.poisson for e in row]
    if system.dimension <= ROWS and sum(map(named_parts.leaves, entries)) <= ENTRIES:
        return page.equations([[mathml.math(f"<mi>π</mi><mo>=</mo>{mathml.matrix(system.poisson)}")]])
    names, n = system.coordinates, system.dimension
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n) if not system.poisson[i][j].is_zero]
    left = [mathml.bracket(names[i], names[j]) for i, j in pairs]
    return group(left, [system.poisson[i][j] for i, j in pairs], "The brackets that are not zero")


def _kinds(system: System) -> Markup:
    """Return a paragraph that lists the Casimirs and the further invariants.

    Casimirs that the spec declares are listed apart from those that phigen found.
    """
    declared = [c for c in system.casimirs if c in system.declared]
    undeclared = [c for c in system.casimirs if c not in system.declared]
    kinds = [("Casimirs of the spec", declared), ("Casimirs that phigen found", undeclared)]
    kinds.append(("further invariants", list(system.invariants)))
    kinds_text = (
        "; ".join(f"{kind}: {', '.join(names)}" for kind, names in kinds if names) or "no Casimirs or invariants"
    )
    return page.paragraph(f"{kinds_text[0].upper()}{kinds_text[1:]}.", "note")


def _parameters(system: System) -> Markup:
    rows = []
    for p in system.parameters:
        description = f"{p.description} ({p.bound})".strip() if p.bound else p.description
        rows.append(
            (Markup(mathml.math(mathml.name(p.name))), [("number", f"{float(p.value):.9g}"), ("", description)])
        )
    return page.table("Parameters", [("", "name"), ("number", "default"), ("", "meaning")], rows)
