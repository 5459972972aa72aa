"""Bi-realisations on a lattice: α and β at a site depend on covectors p in its neighbourhood.

Where π is local, so are α and β, and any bi-realisation in closed form of the system of one site can be used. Where π
couples neighbours, it must be constant in coordinates φ(f) of each field f, with φ(f) = f or log f. With p' the
covector in these coordinates and D = π'p', which is a stencil, α = φ⁻¹(φ − ½D) and β = φ⁻¹(φ + ½D). This covers
constant π, log-canonical π, and the brackets of the Toda lattice.
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

#: The kind of a bi-realisation for brackets that couple neighbours.
KIND = "constant in logarithms"


@dataclass(frozen=True)
class CellRealisation:
    """α and β at a site, symmetric and exact.

    ``displacement`` is α − x and ``increment`` β − α, for each field, in the symbols of the fields at offsets and of
    their covectors (`momentum` of these symbols). Where π is local, ``site`` has the system of one site and its
    bi-realisation; elsewhere ``logarithmic`` has the fields f with φ = log f.
    """

    kind: str
    displacement: Mapping[str, Expression]
    increment: Mapping[str, Expression]
    explanation: str
    site: tuple[System, BiRealisation] | None = None
    logarithmic: frozenset[str] = frozenset()

    @cached_property
    def middle(self) -> dict[str, Expression]:
        """The solution y of α(y, p) = x at a site, by field, with the symbols `initial` for x at this site.

        The formula is explicit where α is affine in y.
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
    """Return the bi-realisation of a grid or of pairs. Raises `SpecError` where none in closed form is known."""
    return _of_site(cell, form, choice) if cell.is_local else _of_neighbours(cell, choice)


def _of_site(cell: Cell, form: PoissonForm | None, choice: BirealisationChoice) -> CellRealisation:
    rows = tuple(tuple(cell.bracket.get((f, g), ZERO) for g in cell.fields) for f in cell.fields)
    energy = total(symbol(f) for f in cell.fields)  # α and β do not depend on H
    system = build_system(cell.name, cell.fields, cell.parameters, form or MatrixForm(rows), energy)
    realisation = realise(system, choice)
    if realisation.path or not realisation.exact:
        shortcoming = "follows paths numerically" if realisation.path else "is approximate"
        raise refuse(f"scheme series: on lattices α and β are in closed form; {realisation.kind} {shortcoming}")
    if not realisation.symmetric:
        raise refuse(f"scheme series: on lattices the bi-realisation is symmetric; {realisation.kind} is not")
    displacement, increment = (
        dict(zip(cell.fields, values, strict=True)) for values in (realisation.displacement, realisation.increment)
    )
    return CellRealisation(realisation.kind, displacement, increment, realisation.explanation, (system, realisation))


def _of_neighbours(cell: Cell, choice: BirealisationChoice) -> CellRealisation:
    if choice.kind not in ("auto", "constant", "log-canonical"):
        raise refuse(f"birealisation {choice.kind} is not for brackets that couple neighbours", "birealisation: auto")
    coordinates = _logarithms(cell)
    if coordinates is None:
        hint = "brackets that are constant, or become so for log f in place of some fields f"
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
    """Return the fewest fields whose logarithms make π constant, and π in these coordinates, or None."""
    for count in range(len(cell.fields) + 1):
        for logarithmic in itertools.combinations(cell.fields, count):
            constants = {pair: _constant(cell, *pair, logarithmic) for pair in cell.bracket}
            constant_brackets = {pair: c for pair, c in constants.items() if c is not None}
            if len(constant_brackets) == len(constants):
                return frozenset(logarithmic), constant_brackets
    return None


def _constant(cell: Cell, f: str, other: str, logarithmic: Sequence[str]) -> Expression | None:
    """Return the bracket of two fields in coordinates that may be logarithms, or None if it is not constant."""
    entry = cell.bracket[f, other]
    fields = [n for n, (base, _) in cell.places(entry, symbol(f), symbol(other)).items() if base in cell.fields]
    terms = coordinate_terms(fields, [entry])
    factors = {n for n in (f, other) if cell.place(n)[0] in logarithmic}
    exponents = tuple(int(n in factors) for n in fields)
    return terms[0][exponents] if terms and set(terms[0]) == {exponents} else None
