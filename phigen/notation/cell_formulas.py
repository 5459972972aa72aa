"""Formulas of a lattice, for display. They describe one site (a cell) and its relations to other sites.

The formulas are brackets, the density of H, Casimirs, invariants, and the vector field at a site.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from phigen.lattice.cell import GRID, Cell, bond_forces, forces, vector_field
from phigen.notation import mathml
from phigen.notation.latex import Equation, aligned
from phigen.notation.named_parts import short
from phigen.symbolic.expression import Expression, substitute, symbol
from phigen.symbolic.neighbours import Offset, steps
from phigen.symbolic.readable import SHOWN, readable

#: An equation of a lattice: its left side as text, its left side as markup, and its right side.
Named = tuple[str, str, Expression]

KINDS = {"sites": "", "sum": "Σ ", "product": "Π "}


def described(cell: Cell) -> str:
    """Return a description in words of the relation between the sites of a lattice, such as its grid or graph."""
    if cell.relation == GRID:
        axes = ", ".join(f"{a} ({b})" for a, b in zip(cell.axes, cell.boundary, strict=True))
        return f"grid with the axes {axes}" if len(cell.axes) > 1 else f"chain along {axes}"
    return "graph, its bonds given at run time" if cell.relation == "graph" else "all sites interact in pairs"


def brackets(cell: Cell) -> list[tuple[str, Expression]]:
    """Return the nonzero brackets as pairs: the left side ``{a, b}`` as text, and the expression.

    Of {a, b} and {b, a} only one is listed. Brackets of fields at one site come first, then brackets with neighbours.
    """
    entries: list[tuple[str, Expression]] = []
    printed_pairs: set[tuple[str, str]] = set()
    for (f, second_field), value in (*cell.bracket.items(), *cell.bond_bracket.items()):
        if (f, second_field) not in printed_pairs:
            entries.append((f"{{{f}, {second_field}}}", value))
            printed_pairs |= {(f, second_field), _mirrored(cell, f, second_field)}
    return entries


def _mirrored(cell: Cell, f: str, second_field: str) -> tuple[str, str]:
    if cell.relation != GRID:
        return second_field, f
    base, offset = cell.place(second_field)
    return base, cell.at(f, tuple(-o for o in steps(offset)))


def sections(cell: Cell, max_terms: int | None = SHOWN) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return the formulas of a lattice as text: pairs (title of a section, lines).

    A line is a pair (left side, right side). ``max_terms`` is the largest number of terms of an expression that are
    displayed; None displays all.
    """
    contents = [
        ("Poisson tensor of a site" if cell.is_local else "Poisson tensor", brackets(cell)),
        ("Hamiltonian, the sum of", _densities(cell)),
        ("Forces at a site: ẋ = π(∇H + ζ) + f; damping adds λ π∇H to ζ", _forces(cell)),
        ("Noise at a site: dx = … + Σ σ π∇g ∘ dW", _noise(cell)),
        ("Casimirs", [(KINDS[kind] + name, density) for name, (density, kind) in cell.casimirs.items()]),
        ("Invariants, sums of", list(cell.invariants.items())),
        ("At a site", rates(cell)),
    ]
    return [
        (title, list(zip((n for n, _ in lines), readable([e for _, e in lines], max_terms), strict=True)))
        for title, lines in contents
        if lines
    ]


def _forces(cell: Cell) -> list[tuple[str, Expression]]:
    acting = cell.forces
    lines = [(f"ζ_{f}", e) for f, e in acting.covector.items()] + [(f"f_{f}", e) for f, e in acting.vector.items()]
    return [*lines, *([("λ", acting.damping)] if acting.damping is not None else [])]


def _noise(cell: Cell) -> list[tuple[str, Expression]]:
    pairs = [((f"σ_{name}", s.amplitude), (f"g_{name}", s.hamiltonian)) for name, s in cell.noise.items()]
    return [line for pair in pairs for line in pair]


def _densities(cell: Cell) -> list[tuple[str, Expression]]:
    densities = {"sites": cell.hamiltonian, "bonds": cell.bond_hamiltonian, "pairs": cell.pair_hamiltonian}
    return [(f"h, of {domain}", e) for domain, e in densities.items() if not e.is_zero]


def rates(cell: Cell) -> list[tuple[str, Expression]]:
    """Return the equations of motion at a site of a grid, as tuples of left side (a text) and right side.

    A lattice without axes (a graph, or pairs of sites) has densities h of H for a site and for a bond or pair. For this
    lattice the derivatives ∂h/∂x are returned instead.
    """
    if cell.relation == GRID:
        return [(f"d{f}/dt", e) for f, e in vector_field(cell).items()]
    site_rates = [(f"∂h/∂{f}", e) for f, e in forces(cell).items() if not e.is_zero]
    return site_rates + [(f"∂h/∂{f}", e) for f, e in bond_forces(cell).items()]


def document(cell: Cell) -> str:
    """Return the formulas of a lattice as LaTeX. Every value has the index of its site, as in {x_i, y_{i+1}}."""
    blocks = [aligned(equations) for _, equations in formulas(cell)]
    head = f"% {cell.name}, {described(cell)}; needs amsmath"
    return "\n".join([head, "\\begingroup\\allowdisplaybreaks", *blocks, "\\endgroup"])


def formulas(cell: Cell) -> Iterator[tuple[str, list[Equation]]]:
    """Yield pairs of a title and its equations in MathML. Every value has the index of its site, as in {x_i,
    y_{i+1}}.
    """
    if left := [(_bracket(cell, name), e) for name, e in brackets(cell)]:
        yield "Poisson tensor", _equations(cell, left)
    sums = {"sites": cell.axes or ("i",), "bonds": ("a", "b"), "pairs": ("a", "b")}
    densities = {"sites": cell.hamiltonian, "bonds": cell.bond_hamiltonian, "pairs": cell.pair_hamiltonian}
    markup_terms: list[str] = []
    for domain, density in densities.items():
        if not density.is_zero:
            markup = mathml.grouped(_indexed(cell, density)) if domain == "sites" else mathml.grouped(density)
            markup_terms.append(("<mo>+</mo>" if markup_terms else "") + _sum("∑", sums[domain], domain) + markup)
    yield "Hamiltonian", [("<mi>H</mi>", markup_terms or ["<mn>0</mn>"])]
    integrals = [(n, e, kind) for n, (e, kind) in cell.casimirs.items()]
    integrals += [(n, e, "sum") for n, e in cell.invariants.items()]
    if integrals:
        yield "Casimirs and invariants", [_integral(cell, *integral) for integral in integrals]
    if cell.relation == GRID:
        field = [(mathml.dotted(_site(cell, f, cell.origin)), e) for f, e in vector_field(cell).items()]
        yield "Equations of motion", _equations(cell, field)


def _integral(cell: Cell, name: str, density: Expression, kind: str) -> Equation:
    axes = cell.axes or ("i",)
    left = mathml.name(_site(cell, name, cell.origin) if kind == "sites" else name)
    sign = {"sites": "", "sum": _sum("∑", axes, "sites"), "product": _sum("∏", axes, "sites")}[kind]
    integrand = _indexed(cell, density)
    return left, [sign + mathml.grouped(integrand)] if sign else mathml.pieces(integrand)


def _equations(cell: Cell, formulas: Sequence[tuple[str, Expression]]) -> list[Equation]:
    forms = short([_indexed(cell, e) for _, e in formulas])
    return [(left, mathml.pieces(form)) for (left, _), form in zip(formulas, forms, strict=True)]


def _indexed(cell: Cell, e: Expression) -> Expression:
    """Return an expression in which values at the site itself have an index too: x becomes x[i]."""
    indexed = {name: symbol(_site(cell, *site)) for name, site in cell.places(e).items()}
    return substitute([e], indexed)[0]


def _site(cell: Cell, name: str, offset: Offset) -> str:
    if cell.relation != GRID:
        return f"{name}[{offset[0] if offset else 'i'}]"
    index = [f"{a}{o:+d}" if o else a for a, o in zip(cell.axes, steps(offset) or (0,) * len(cell.axes), strict=True)]
    return f"{name}[{','.join(index)}]"


def _bracket(cell: Cell, name: str) -> str:
    f, second_field = name[1:-1].split(", ", 1)
    return mathml.bracket(_site(cell, *cell.place(f)), _site(cell, *cell.place(second_field)))


def _sum(sign: str, indices: Sequence[str], domain: str) -> str:
    separator = {"sites": "<mo>,</mo>", "bonds": "<mo>,</mo>", "pairs": "<mo>&lt;</mo>"}[domain]
    index_list = separator.join(f"<mi>{i}</mi>" for i in indices)
    return f"<msub><mo>{sign}</mo><mrow>{index_list}</mrow></msub>"
