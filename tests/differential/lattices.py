"""Random lattices: grids of one to three axes, graphs, and sites that interact in pairs, with few sites."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import sympy
from differential.brackets import ALGEBRAS, lie_poisson, rows
from differential.formulas import TIME, Expr, Symbol, bounded, small, symbols
from differential.sites import Lattice, Parameter


@dataclass(frozen=True)
class Cell:
    """The brackets of a site: its fields, their form in a spec, and π. ``pairs`` has canonical positions and momenta,
    ``across`` the brackets with other sites.
    """

    kind: str
    fields: tuple[str, ...]
    poisson: dict[str, Any]
    pi: sympy.Matrix
    pairs: tuple[tuple[str, str], ...] = ()
    positive: bool = False
    casimir: Expr | None = None
    across: tuple[tuple[str, str, str, Expr], ...] = ()


def draw_lattice(seed: int, attempt: int = 0) -> Lattice:
    """Draw the lattice of a seed; each attempt gives another one. The result is the same on every machine."""
    source = random.Random(f"lattice {seed}" + f" {attempt}" * (attempt > 0))
    relation = source.choices(["grid", "graph", "pairs"], [60, 25, 15])[0]
    place = _relation(source, relation)
    cell = _cell(source, relation, place)
    parameters = _parameters(source, place)
    drawn = Lattice(
        seed, cell.fields, cell.poisson, cell.pi, (), across=cell.across, casimir=cell.casimir, positive=cell.positive,
        parameters=parameters, initial=_initial(source, cell, place), **place,
    )  # fmt: skip
    drawn = _with_energy(source, drawn, cell)
    drawn = _acted_upon(source, drawn, cell)
    return _monitored(source, _with_options(source, drawn), cell)


def _relation(source: random.Random, relation: str) -> dict[str, Any]:
    """Draw how sites are related: the axes of a grid with boundaries and sizes, the bonds of a graph, or all pairs."""
    if relation == "grid":
        axes = ("i", "j", "k")[: source.choices([1, 2, 3], [60, 28, 12])[0]]
        most = {1: [1, 2, 3, 4, 5, 6, 7, 8, 9, 12], 2: [1, 2, 3, 4, 5], 3: [1, 2, 3]}[len(axes)]
        boundary = tuple(source.choice(["periodic", "periodic", "open"]) for _ in axes)
        return {"axes": axes, "boundary": boundary, "sizes": tuple(source.choice(most) for _ in axes)}
    count = source.choice([1, 2, 3, 4, 5, 7])
    if relation == "pairs":
        return {"pairs": True, "sizes": (count,)}
    bonds = tuple(
        tuple(source.sample(range(count), 2)) for _ in range(source.choice([0, 1, 2, 4, 6, 8]) if count > 1 else 0)
    )
    return {"bonds": bonds, "sizes": (count,)}


def _cell(source: random.Random, relation: str, place: dict[str, Any]) -> Cell:
    """Draw the brackets of a site."""
    kinds: list[tuple[Callable[..., Cell], float]] = [(_canonical, 42), (_algebra, 32), (_log, 6), (_nothing, 3)]
    if relation == "grid":
        kinds.append((_coupled, 12))
    if relation == "graph":
        kinds.append((_along_bonds, 10))
    makers, weights = zip(*kinds, strict=True)
    return source.choices(makers, weights)[0](source, place)


def _canonical(source: random.Random, place: dict[str, Any]) -> Cell:
    fields, pairs = source.choices(
        [
            (("q", "p"), (("q", "p"),)),
            (("q", "r", "p", "s"), (("q", "p"), ("r", "s"))),
            (("q", "p", "z"), (("q", "p"),)),
        ],
        [75, 15, 10],
    )[0]
    pi = sympy.zeros(len(fields))
    for a, b in pairs:
        pi[fields.index(a), fields.index(b)] = sympy.Integer(1)
        pi[fields.index(b), fields.index(a)] = sympy.Integer(-1)
    form = {"canonical": {"q": [a for a, _ in pairs], "p": [b for _, b in pairs]}}
    return Cell("canonical", fields, form, pi, pairs)


def _algebra(source: random.Random, place: dict[str, Any]) -> Cell:
    name = source.choices(["so(3)", "heisenberg(1)", "se(2)", "sl(2)"], [66, 18, 8, 8])[0]
    sign = source.choice([1, -1])
    x = symbols("xyz")
    pi = lie_poisson(ALGEBRAS[name](), x) * sign
    form = {"lie_algebra": {"name": name, "sign": "plus" if sign > 0 else "minus"}}
    casimir = sum((v**2 for v in x), sympy.Integer(0)) if name == "so(3)" else None
    return Cell(name, ("x", "y", "z"), form, pi, casimir=casimir)


def _log(source: random.Random, place: dict[str, Any]) -> Cell:
    x, y = symbols("xy")
    a = small(source)
    pi = sympy.Matrix([[0, a * x * y], [-a * x * y, 0]])
    form = source.choice(
        [{"log_canonical": rows(sympy.Matrix([[0, a], [-a, 0]]))}, {"brackets": {"x": {"y": f"{a}*x*y"}}}]
    )
    return Cell("log-canonical", ("x", "y"), form, pi, positive=True)


def _nothing(source: random.Random, place: dict[str, Any]) -> Cell:
    fields = source.choice([("x",), ("x", "y")])
    forms: list[dict[str, Any]] = [{"brackets": {"x": {}}}, {"matrix": rows(sympy.zeros(len(fields)))}]
    return Cell("zero", fields, source.choice(forms), sympy.zeros(len(fields)))


def _coupled(source: random.Random, place: dict[str, Any]) -> Cell:
    """Draw brackets between neighbours: those of the Volterra, Toda or Korteweg–de Vries lattice."""
    axis = source.choice(place["axes"])
    kind, index = source.choice(["volterra", "toda", "kdv"]), f"[{axis}+1]"
    if kind == "toda":
        a = Symbol("a")
        poisson = {"brackets": {"a": {"b": "a/2", f"b{index}": "-a/2"}}}
        pi = sympy.Matrix([[0, a / 2], [-a / 2, 0]])
        return Cell(kind, ("a", "b"), poisson, pi, positive=True, across=(("a", "b", index, -a / 2),))
    u, v = symbols(["u", f"u{index}"])
    value = u * v if kind == "volterra" else sympy.Rational(1, 2)
    poisson = {"brackets": {"u": {f"u{index}": str(value)}}}
    return Cell(kind, ("u",), poisson, sympy.zeros(1), positive=kind == "volterra", across=(("u", "u", index, value),))


def _along_bonds(source: random.Random, place: dict[str, Any]) -> Cell:
    a, b = symbols(["x[a]", "x[b]"])
    poisson = {"bonds": {"x[a]": {"x[b]": "k*x[a]*x[b]"}}}
    return Cell(
        "food web", ("x",), poisson, sympy.zeros(1), positive=True, across=(("x", "x", "[b]", Symbol("k") * a * b),)
    )


def _parameters(source: random.Random, place: dict[str, Any]) -> dict[str, Parameter]:
    """Draw parameters: J is a number, B an array over sites, and k, for graphs, an array over bonds."""
    parameters = {
        "J": Parameter("all", round(source.uniform(0.5, 1.5), 2), source.random() < 0.3),
        "B": Parameter("sites", _array(source, place)),
    }
    if not place.get("axes") and not place.get("pairs"):
        count = len(place["bonds"])
        listed = [round(source.uniform(0.5, 1.5), 2) for _ in range(count)]
        parameters["k"] = Parameter("bonds", listed if count and source.random() < 0.3 else 0.9)
    return parameters


def _array(source: random.Random, place: dict[str, Any]) -> Any:
    """Draw values of a parameter at sites, in one of the forms of docs/lattices.md."""
    index = (place.get("axes") or "i")[0]
    formulas = [f"1 + {index}/N_{index}", f"cos(2*pi*{index}/N_{index})/2", f"{index} - 1"]
    formula: Any = source.choice(formulas) if place.get("axes") or place.get("pairs") else 1.5
    drawn: dict[str, Any] = {"random": source.choice(["normal", "uniform"]), "seed": source.randint(0, 9)}
    if source.random() < 0.6:
        drawn["scale"] = source.choice([0, 0.5, "1/4", 2])
    if source.random() < 0.5:
        drawn["mean"] = source.choice([1, formula])
    total = 1
    for size in place["sizes"]:
        total *= size
    listed = [round(source.uniform(-1, 1), 2) for _ in range(total)]
    return source.choice([0.7, formula, listed, drawn, drawn])


def _initial(source: random.Random, cell: Cell, place: dict[str, Any]) -> Any:
    """Draw the initial state of the run in the spec."""
    if not cell.positive and len(cell.fields) == 3 and source.random() < 0.3:
        return {"random": "sphere", "seed": source.randint(0, 9)}
    if source.random() < 0.3 and not cell.positive:
        return {"random": "normal", "seed": source.randint(0, 9), "scale": source.choice([0, 0.5])}
    return {f: 1.3 if cell.positive else _array(source, place) for f in cell.fields}


# --- the energy


def _with_energy(source: random.Random, drawn: Lattice, cell: Cell) -> Lattice:
    """Return the lattice with a random Hamiltonian: terms of single sites, and terms of two sites."""
    one_part = source.random() < 0.15
    site_terms, between = _terms(source, cell, one_part)
    if not drawn.axes:
        ends = [
            _between(source, cell, "[a]", "[b]", between, symmetric=drawn.pairs)
            for _ in range(source.choice([0, 1, 1, 2]))
        ]
        if cell.kind == "food web":
            ends = []  # phigen refuses bond energies if brackets act along bonds
        weight = Symbol("k") if drawn.graph and source.random() < 0.5 else Symbol("J")
        return replace(drawn, sites=tuple(site_terms), ends=tuple(weight * e for e in ends))
    terms = list(site_terms)
    reach = [1] * len(drawn.axes) if drawn.across else [0] * len(drawn.axes)
    for _ in range(source.choice([0, 1, 1, 2, 3])):
        offset = _offset(source, drawn)
        if not any(offset):
            continue
        reach = [max(r, abs(o)) for r, o in zip(reach, offset, strict=True)]
        terms.append(
            _weighted(source) * _between(source, cell, "", _index(drawn.axes, offset), between, symmetric=False)
        )
    fits = [max(s, r + 1) if b == "periodic" else s for s, r, b in zip(drawn.sizes, reach, drawn.boundary, strict=True)]
    if tuple(fits) != drawn.sizes:
        resized = {n: replace(p, value=0.8) if isinstance(p.value, list) else p for n, p in drawn.parameters.items()}
        initial = dict.fromkeys(cell.fields, 1.3 if cell.positive else 0.4)
        drawn = replace(drawn, sizes=tuple(fits), parameters=resized, initial=initial)
    return replace(drawn, sites=tuple(terms) or (symbols(cell.fields)[0],))


def _weighted(source: random.Random) -> Expr:
    """Draw a coefficient for a term of two sites."""
    return source.choice([Symbol("J"), Symbol("B"), sympy.Rational(1, 2), Symbol("J") / 3])


def _offset(source: random.Random, drawn: Lattice) -> list[int]:
    """Draw the offset to another site, usually the next one along an axis."""
    if source.random() < 0.75:
        k = source.randrange(len(drawn.axes))
        return [source.choice([1, 1, -1]) * (n == k) for n in range(len(drawn.axes))]
    return [source.choice([-1, 0, 1, 2]) for _ in drawn.axes]


def _index(axes: Sequence[str], offset: Sequence[int]) -> str:
    """Return an offset as an index in the syntax of specs."""
    return "[" + ",".join(f"{a}{o:+d}" for a, o in zip(axes, offset, strict=True) if o) + "]"


def _terms(source: random.Random, cell: Cell, one_part: bool) -> tuple[list[Expr], list[tuple[str, str]]]:
    """Draw terms of a site. Return also pairs of fields that terms of two sites may contain."""
    v = symbols(cell.fields)
    b = Symbol("B")
    if cell.pairs:
        q, p = (tuple(Symbol(c) for c in side) for side in zip(*cell.pairs, strict=True))
        kinetic = [] if one_part else [sympy.Rational(source.randint(1, 3), 2) * c**2 for c in p]
        wells = [
            source.choice([b, sympy.Integer(1), Symbol("J")])
            * source.choice([c**4 / 4, c**2 / 2, sympy.cos(c), bounded(source, c)])
            for c in q
        ]
        mixed = [source.choice(q) * source.choice(p) / 3] if source.random() < 0.15 and not one_part else []
        beside = [Symbol("z") * source.choice([q[0], p[0], q[0] ** 2])] if "z" in cell.fields else []
        positions = [(str(c), str(d)) for c in q for d in q]
        further = [(str(q[0]), str(p[0]))] if source.random() < 0.15 and not one_part else []
        return [*kinetic, *wells, *mixed, *beside], positions + further
    if cell.positive:
        terms = [c * source.choice([sympy.Integer(1), b**2 + 1]) for c in v]
        more = [(v[0] ** 2) / 3] if source.random() < 0.4 else []
        return [*terms, *more], [(f, f) for f in cell.fields]
    chosen = [source.choice(v)] if one_part else list(v)
    terms = [
        source.choice([b * c, c**2 / 2, sympy.Rational(1, 3) * c**2, Symbol("J") * c])
        for c in chosen
        if one_part or source.random() < 0.6
    ]
    if source.random() < 0.12 and not one_part and len(v) > 1:
        terms.append(v[0] * v[1] / 3)
    meet = [(str(c), str(c)) for c in chosen] + (
        [(str(v[0]), str(v[1]))] if source.random() < 0.15 and not one_part and len(v) > 1 else []
    )
    return terms, meet


def _between(
    source: random.Random, cell: Cell, left: str, right: str, meet: Sequence[tuple[str, str]], *, symmetric: bool
) -> Expr:
    """Draw a term of two sites."""
    first, second = source.choice([(a, b) for a, b in meet if a == b or not symmetric] or [(cell.fields[0],) * 2])
    a, b = symbols([first + left, second + right])
    if cell.pairs and first == second:
        r = b - a
        return source.choice([r**2 / 2, r**4 / 4, sympy.cos(r), sympy.exp(-(r**2)), sympy.sqrt(1 + r**2), a * b / 2])
    if cell.kind in ("zero", "kdv") or cell.positive:
        return source.choice([a * b / 3, (b - a) ** 2 / 2]) if first == second else a * b / 3
    return source.choice([a * b, a * b / 2, a * b, (b - a) ** 2 / 3]) if first == second else a * b / 2


# --- time, forces and noise, and options


def _acted_upon(source: random.Random, drawn: Lattice, cell: Cell) -> Lattice:
    """Return the lattice with time dependence, a force, damping or noise, or unchanged."""
    what = source.choices(["", "time", "vector", "covector", "damping", "noise"], [58, 14, 7, 6, 7, 8])[0]
    v = symbols(cell.fields)
    if what == "time":
        wave = sympy.cos(small(source) * TIME + source.choice([0, Symbol("B")]))
        return replace(drawn, sites=(*drawn.sites, v[0] * wave / 4), timed=True)
    chosen = source.choice(v)
    if what == "vector":
        return replace(drawn, vector={str(chosen): -source.choice([Symbol("J"), sympy.Integer(1)]) * chosen / 7})
    if what == "covector":
        return replace(drawn, covector={str(chosen): source.choice(v) * sympy.Rational(1, 7)})
    if what == "damping" and not drawn.across:
        return replace(drawn, damping=source.choice([sympy.Rational(1, 9), sympy.Rational(1, 5)]))
    if what == "noise" and not drawn.across:
        return replace(drawn, noise={"w": (chosen, source.choice([sympy.Rational(1, 4), sympy.Rational(1, 3)]))})
    return drawn


def _with_options(source: random.Random, drawn: Lattice) -> Lattice:
    """Return the lattice with further keys of the spec, and with requests for derivatives."""
    options: dict[str, Any] = {}
    scheme = source.choices(["", "auto", "series", "splitting"], [45, 10, 30, 15])[0]
    if scheme:
        options["scheme"] = scheme
    options["order"] = 2 if drawn.noise else source.choices([2, 4, 6], [65, 28, 7])[0]
    options["profile"] = source.choice(["fast", "small", "certified"])
    if source.random() < 0.12:
        options["solver"] = {"lanes": False}
    if options["order"] == 4 and source.random() < 0.2:
        options["composition"] = source.choice(["suzuki", "triple-jump"])
    if source.random() < 0.04:
        options |= {"real": "float", "profile": "small"}
    asked: dict[str, Any] = {}
    adjoint = not drawn.noise and source.random() < 0.75
    if not adjoint and source.random() < 0.25:
        options["solver"] = {"compensated": True}
    for name, chosen in (("adjoint", adjoint), ("tangent", source.random() < 0.4)):
        if chosen:
            (options if source.random() < 0.6 else asked)[name] = True
    return replace(drawn, options=options, asked=asked)


def _monitored(source: random.Random, drawn: Lattice, cell: Cell) -> Lattice:
    """Return the lattice unchanged or, if canonical pairs interact, with a monitor and another energy that has a
    negative part.
    """
    acted_upon = drawn.timed or drawn.forced or bool(drawn.noise)
    if not (drawn.pairs and cell.pairs and drawn.count > 1) or acted_upon or source.random() < 0.4:
        return drawn
    q, p = (tuple(Symbol(c) for c in side) for side in zip(*cell.pairs, strict=True))
    apart = sum((Symbol(f"{c}[a]") - Symbol(f"{c}[b]")) ** 2 for c in q)
    well = source.choice([1 / sympy.sqrt(1 + apart), sympy.exp(-apart / 4), sympy.Integer(2) - sympy.cos(apart)])
    masses = source.choice([sympy.Integer(1), Symbol("B") ** 2 + 1])
    options = {k: v for k, v in drawn.options.items() if k not in ("adjoint", "scheme")}
    options |= {"scheme": "splitting"} if source.random() < 0.5 else {}
    asked = {k: v for k, v in drawn.asked.items() if k != "adjoint"}
    return replace(
        drawn, sites=(sum(c**2 for c in p) / (2 * masses),), ends=(-well,), options=options, asked=asked, monitored=True
    )
