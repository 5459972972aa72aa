"""Bi-realisations (α, β) on a lattice: α and β at a site depend on covectors p in its neighbourhood.

Suppose that brackets are between fields of one site only. Then one site is a system of its own, and any bi-realisation
of this system can be used if it is symmetric and in closed form. If π couples neighbours, it must be constant after a
change of coordinates that replaces each field f by φ(f), where φ(f) is f or log f. Let π' and p' be π and the covector
in the new coordinates, and D = π'p', a sum over neighbouring sites. Then α = φ⁻¹(φ − ½D) and β = φ⁻¹(φ + ½D). These
formulas cover constant π, log-canonical π, and the brackets of the Toda lattice.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from phigen.geometry.shapes import coordinate_terms
from phigen.geometry.system import System, build_system
from phigen.lattice.cell import Cell
from phigen.realisations.catalogue import realise
from phigen.realisations.protocol import BiRealisation, refuse
from phigen.scheme.elimination import elimination
from phigen.spec.model import BirealisationChoice, MatrixForm, PoissonForm
from phigen.symbolic.expression import (
    ONE,
    ZERO,
    Expression,
    call,
    gradient,
    number,
    substitute,
    symbol,
    symbols_of,
    total,
)
from phigen.symbolic.symbols import Symbol, initial, momentum

#: Kind of the bi-realisation if brackets couple neighbours and are constant in the logarithms of some fields.
KIND = "constant in logarithms"


@dataclass(frozen=True)
class CellRealisation:
    """Bi-realisation (α, β) of the brackets of a lattice, at one site. It is symmetric, and in closed form, not a
    truncated series.

    ``displacement`` is α − x and ``increment`` is β − α, by field. These expressions contain the fields at the site and
    around it, and symbols of the kind `momentum` for the components of the covector. If brackets are between fields of
    one site only, ``site`` has the system of one site and its bi-realisation. Otherwise ``logarithmic`` has the fields
    f that enter as log f.
    """

    kind: str
    displacement: Mapping[str, Expression]
    increment: Mapping[str, Expression]
    explanation: str
    site: tuple[System, BiRealisation] | None = None
    logarithmic: frozenset[str] = frozenset()

    @cached_property
    def middle(self) -> dict[str, Expression]:
        """The formula for y at a site, by field, where y solves α(y, p) = x. Symbols of the kind `initial` stand for x
        at the site.

        The formula is explicit if α is affine in y. Otherwise the formula contains y itself.
        """
        fields, values = list(self.displacement), list(self.displacement.values())
        slopes = [gradient(e, fields) for e in values]
        start = [symbol(initial(f)) for f in fields]
        affine = not any(n in fields for n in symbols_of(*(d for row in slopes for d in row)))
        if not self.site or not affine or all(d.is_zero for row in slopes for d in row):
            return {f: x - e for f, x, e in zip(fields, start, values, strict=True)}
        constant = substitute(values, dict.fromkeys(fields, ZERO))
        solution, _ = elimination([[not d.is_zero for d in row] for row in slopes])
        solutions: dict[str, Expression] = {Symbol("r", i): start[i] - c for i, c in enumerate(constant)}
        for i, row in enumerate(slopes):
            solutions |= {Symbol("J", i, j): d + 1 if i == j else d for j, d in enumerate(row)}
        return dict(zip(fields, substitute(solution, solutions), strict=True))


def realise_cell(cell: Cell, form: PoissonForm | None, choice: BirealisationChoice) -> CellRealisation:
    """Return the bi-realisation for the brackets of a cell. Raises `SpecError` if phigen knows none in closed form."""
    return _of_site(cell, form, choice) if cell.is_local else _of_neighbours(cell, choice)


def _of_site(cell: Cell, form: PoissonForm | None, choice: BirealisationChoice) -> CellRealisation:
    rows = tuple(tuple(cell.bracket.get((f, g), ZERO) for g in cell.fields) for f in cell.fields)
    energy = total(symbol(f) for f in cell.fields)  # any H will do, since the bi-realisation does not depend on it
    system = build_system(cell.name, cell.fields, cell.parameters, form or MatrixForm(rows), energy)
    realisation = realise(system, choice)
    if realisation.path or not realisation.exact:
        shortcoming = "follows paths numerically" if realisation.path else "is approximate"
        raise refuse(f"scheme series: on lattices α and β must be in closed form; {realisation.kind} {shortcoming}")
    if not realisation.symmetric:
        raise refuse(f"scheme series: on lattices the bi-realisation must be symmetric; {realisation.kind} is not")
    displacement, increment = (
        dict(zip(cell.fields, values, strict=True)) for values in (realisation.displacement, realisation.increment)
    )
    return CellRealisation(realisation.kind, displacement, increment, realisation.explanation, (system, realisation))


def _of_neighbours(cell: Cell, choice: BirealisationChoice) -> CellRealisation:
    if choice.kind not in ("auto", "constant", "log-canonical"):
        raise refuse(
            f"birealisation {choice.kind} is not offered for brackets that couple neighbours", "birealisation: auto"
        )
    coordinates = _logarithms(cell)
    if coordinates is None:
        hint = "brackets must be constant, if necessary with log f as a coordinate in place of some fields f"
        raise refuse("scheme series: no bi-realisation is known for these brackets, which couple neighbours", hint)
    logarithmic, constants = coordinates
    one_half, displacement, increment = number(Fraction(1, 2)), {}, {}
    for f in cell.fields:
        terms = [
            constant * (symbol(other) if cell.place(other)[0] in logarithmic else ONE) * symbol(momentum(other))
            for (g, other), constant in constants.items()
            if g == f
        ]
        stencil_sum = total(terms)
        if f in logarithmic:
            growth = call("expm1", -(one_half * stencil_sum))
            displacement[f] = symbol(f) * growth
            increment[f] = -(symbol(f) * (growth * (1 + 1 / (1 + growth))))
        else:
            displacement[f], increment[f] = -(one_half * stencil_sum), stencil_sum
    coordinate_names = ", ".join(f"log {f}" if f in logarithmic else f for f in cell.fields)
    kind = KIND if logarithmic else "constant"
    return CellRealisation(kind, displacement, increment, f"π is constant in {coordinate_names}", None, logarithmic)


def _logarithms(cell: Cell) -> tuple[frozenset[str], dict[tuple[str, str], Expression]] | None:
    """Return the smallest set of fields whose logarithms make all brackets constant, and the constant brackets.

    Returns None if there is no such set.
    """
    for count in range(len(cell.fields) + 1):
        for logarithmic in itertools.combinations(cell.fields, count):
            constants = {pair: _constant(cell, *pair, logarithmic) for pair in cell.bracket}
            constant_brackets = {pair: c for pair, c in constants.items() if c is not None}
            if len(constant_brackets) == len(constants):
                return frozenset(logarithmic), constant_brackets
    return None


def _constant(cell: Cell, f: str, other: str, logarithmic: Sequence[str]) -> Expression | None:
    """Return the bracket of the symbols ``f`` and ``other``, or of their logarithms; None if this bracket is not
    constant.

    ``logarithmic`` has the fields of which logarithms are taken.
    """
    entry = cell.bracket[f, other]
    fields = [n for n, (base, _) in cell.places(entry, symbol(f), symbol(other)).items() if base in cell.fields]
    terms = coordinate_terms(fields, [entry])
    factors = {n for n in (f, other) if cell.place(n)[0] in logarithmic}
    exponents = tuple(int(n in factors) for n in fields)
    return terms[0][exponents] if terms and set(terms[0]) == {exponents} else None
