"""Random systems other than lattices ("ordinary"): the text of their spec, and their equations of motion, derived
without phigen.
"""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import sympy
from differential.brackets import Structure, draw_structure, paired
from differential.formulas import TIME, Expr, Symbol, bounded, gradient, linear, monomial, numeric, small, text
from differential.reference import Floats

#: Names of parameters; some are keywords of C or Python, or may occur in generated code.
PARAMETERS = ("a", "mu", "lambda", "k", "c")

#: Forms of observables with two operands, as text in a spec and as Python functions of the values of the operands.
OBSERVED: Mapping[str, Callable[[float, float], float]] = {
    "({0})*({1})": lambda a, b: a * b,
    "atan2({0}, 2 + ({1})**2)": lambda a, b: math.atan2(a, 2 + b**2),
    "max({0}, min({1}, 1/2))": lambda a, b: max(a, min(b, 0.5)),
    "if({0} < {1}, {0}, sign({1}))": lambda a, b: a if a < b else float(np.sign(b)),
    "heaviside({0}) - abs({1})": lambda a, b: (a >= 0) - abs(b),
}


@dataclass(frozen=True)
class Ordinary:
    """A random system.

    H is the sum of ``terms``. Each of the ``parameters`` has a default and a flag for positivity. ``covector``,
    ``vector``, ``damping``, ``monitor`` and ``noise`` (Hamiltonian and amplitude) have the meaning of docs/spec.md. If
    ``monitor`` is "log", ``attraction`` is the negative part of H. ``observables`` are forms of `OBSERVED` with two
    operands. ``options`` are further keys of the spec, and ``asked`` further options of the call of `phigen.compile`.
    """

    seed: int
    structure: Structure
    terms: tuple[Expr, ...]
    start: tuple[float, ...]
    parameters: Mapping[str, tuple[sympy.Rational, bool]] = field(default_factory=dict)
    covector: Mapping[str, Expr] = field(default_factory=dict)
    vector: Mapping[str, Expr] = field(default_factory=dict)
    damping: Expr | None = None
    monitor: Expr | str | None = None
    attraction: Expr | None = None
    noise: Mapping[str, tuple[Expr, Expr]] = field(default_factory=dict)
    timed: bool = False
    observables: Mapping[str, tuple[str, Expr, Expr]] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    asked: Mapping[str, Any] = field(default_factory=dict)

    kind = "ordinary"

    # --- the spec

    @property
    def text(self) -> str:
        """Text of the spec; every value is written as JSON, which is valid YAML."""
        return "".join(f"{key}: {json.dumps(value)}\n" for key, value in self.entries())

    def entries(self) -> Iterator[tuple[str, Any]]:
        """Yield the top-level keys of the spec with their values."""
        yield from {"phigen": 1, "name": f"o{self.seed}"}.items()
        yield "coordinates", [str(v) for v in self.structure.coordinates]
        if self.parameters:
            parameters = {
                n: {"value": text(v), "positive": p} if p else text(v) for n, (v, p) in self.parameters.items()
            }
            yield "parameters", parameters
        if self.timed:
            yield "time", str(TIME)
        yield "poisson", dict(self.structure.form)
        yield "hamiltonian", " + ".join(f"({text(term)})" for term in self.terms) or "0"
        if self.structure.casimirs:
            yield "casimirs", {f"C{k}": text(c) for k, c in enumerate(self.structure.casimirs)}
        forces = {"covector": self.covector, "vector": self.vector}
        if any(forces.values()):
            yield "forces", {kind: {n: text(f) for n, f in by.items()} for kind, by in forces.items() if by}
        if self.damping is not None:
            yield "damping", text(self.damping)
        if self.monitor is not None:
            yield "monitor", self.monitor if isinstance(self.monitor, str) else text(self.monitor)
        if self.observables:
            seen = self.observables.items()
            yield "observables", {n: form.format(text(a), text(b)) for n, (form, a, b) in seen}
        if self.noise:
            yield "noise", {n: {"hamiltonian": text(g), "amplitude": text(s)} for n, (g, s) in self.noise.items()}
        yield from self.options.items()

    # --- the equations of motion

    @property
    def forced(self) -> bool:
        """Whether there are forces or damping."""
        return bool(self.covector or self.vector or self.damping is not None)

    @property
    def hamiltonian(self) -> Expr:
        """Hamiltonian: the sum of all terms."""
        return sympy.Add(*self.terms)

    @property
    def order(self) -> int:
        """Order that the spec requests, or the default."""
        return int(self.options.get("order", 2 if self.noise else 4))

    @property
    def arguments(self) -> list[Symbol]:
        """Symbols on which formulas depend: time, coordinates, parameters."""
        return [TIME, *self.structure.coordinates, *(Symbol(name) for name in self.parameters)]

    @property
    def values(self) -> dict[str, float]:
        """Default values of the parameters."""
        return {name: float(value) for name, (value, _) in self.parameters.items()}

    def function(self, expressions: list[Expr]) -> Callable[[float, Floats], Floats]:
        """Return a function of time and state (DIM,) that evaluates the expressions, with the default parameters."""
        compiled, values = numeric(expressions, self.arguments), list(self.values.values())

        def at(t: float, x: Floats) -> Floats:
            return np.array([float(v) for v in compiled(t, *x, *values)])

        return at

    @cached_property
    def slope(self) -> list[Expr]:
        """Gradient of H along the coordinates."""
        return gradient(self.hamiltonian, self.structure.coordinates)

    @cached_property
    def pace(self) -> Expr:
        """Derivative of the time t along the fictitious time τ: the value of the monitor, or 1."""
        if self.attraction is not None:
            return -1 / self.attraction
        return sympy.Integer(1) if self.monitor is None else self.monitor

    @cached_property
    def field(self) -> Callable[[float, Floats], Floats]:
        """Right-hand side without noise: the derivatives along τ of the state and, as the last component, of
        the time.
        """
        whole = self.function([*(self.pace * v for v in self.velocity), self.pace])
        return lambda s, y: whole(y[-1], y[:-1])

    @cached_property
    def velocity(self) -> list[Expr]:
        """Time derivative of the state: π∇H plus the contributions of forces and damping."""
        x, pi, slope = self.structure.coordinates, self.structure.pi, sympy.Matrix(self.slope)
        pushed = slope + sympy.Matrix([self.covector.get(str(v), 0) for v in x])
        if self.damping is not None:
            pushed += self.damping * pi * slope
        return list(pi * pushed + sympy.Matrix([self.vector.get(str(v), 0) for v in x]))

    @cached_property
    def sources(self) -> list[Callable[[float, Floats], Floats]]:
        """Vector field σπ∇g of each noise source with Hamiltonian g and amplitude σ."""
        x, pi = self.structure.coordinates, self.structure.pi
        return [self.function(list(s * pi * sympy.Matrix(gradient(g, x)))) for g, s in self.noise.values()]

    # --- shrinking

    def simpler(self) -> Iterator[Ordinary]:
        """Yield simpler systems, each with one term or option removed."""
        for k in range(len(self.terms)):
            if len(self.terms) > 1:
                yield replace(self, terms=self.terms[:k] + self.terms[k + 1 :])
        for name in ("covector", "vector", "noise", "observables", "options", "asked"):
            values = getattr(self, name)
            for key in values:
                yield replace(self, **{name: {k: v for k, v in values.items() if k != key}})
        if self.damping is not None:
            yield replace(self, damping=None)
        if self.monitor is not None:
            yield replace(self, monitor=None, attraction=None)
        if self.structure.casimirs:
            yield replace(self, structure=replace(self.structure, casimirs=()))
        used = set().union(*(e.free_symbols for e in self._expressions()))
        for name, (value, _) in self.parameters.items():
            rest = {k: v for k, v in self.parameters.items() if k != name}
            if Symbol(name) not in used:
                yield replace(self, parameters=rest)
            else:
                yield self._with_value(name, value, rest)
        if self.timed and TIME not in used:
            yield replace(self, timed=False)

    def _expressions(self) -> list[Expr]:
        more = [self.damping, None if isinstance(self.monitor, str) else self.monitor]
        noise = [e for pair in self.noise.values() for e in pair]
        noise += [e for _, *pair in self.observables.values() for e in pair]
        return [
            *self.terms,
            *self.covector.values(),
            *self.vector.values(),
            *noise,
            *(e for e in more if e is not None),
        ]

    def _with_value(self, name: str, value: sympy.Rational, rest: Mapping[str, Any]) -> Ordinary:
        """Return the system with a parameter replaced by its value."""
        put = {Symbol(name): value}
        new: dict[str, Any] = {
            "terms": tuple(e.xreplace(put) for e in self.terms),
            "covector": {k: e.xreplace(put) for k, e in self.covector.items()},
            "vector": {k: e.xreplace(put) for k, e in self.vector.items()},
            "noise": {k: (g.xreplace(put), s.xreplace(put)) for k, (g, s) in self.noise.items()},
        }
        new["observables"] = {k: (f, *(e.xreplace(put) for e in both)) for k, (f, *both) in self.observables.items()}
        new["damping"] = None if self.damping is None else self.damping.xreplace(put)
        new["monitor"] = self.monitor.xreplace(put) if isinstance(self.monitor, sympy.Basic) else self.monitor
        new["attraction"] = None if self.attraction is None else self.attraction.xreplace(put)
        return replace(self, parameters=rest, **new)


# --- random draws


def draw_ordinary(seed: int, attempt: int = 0) -> Ordinary:
    """Draw the system of a seed; each attempt gives another one. The result is the same on every machine."""
    source = random.Random(f"ordinary {seed}" + f" {attempt}" * (attempt > 0))
    structure = draw_structure(source)
    scheme = source.choices(["series", "splitting"], [65, 35])[0]
    names = source.sample(PARAMETERS, source.choice([0, 1, 1, 2, 2]))
    parameters = {name: (abs(small(source)), source.random() < 0.3) for name in names}
    weights = [Symbol(name) for name in parameters]

    def weight() -> Expr:
        """Draw a coefficient: a number, or a number times a parameter."""
        return small(source) * (source.choice(weights) if weights and source.random() < 0.4 else 1)

    make = _splittable if scheme == "splitting" else _any_terms
    terms = _coupled(source, structure, weight) if structure.kind == "chain" else make(source, structure, weight)
    signs = [1] if structure.positive else [1, -1]
    start = tuple(round(source.uniform(0.4, 1.1) * source.choice(signs), 3) for _ in structure.coordinates)
    drawn = Ordinary(seed, structure, tuple(terms), start, parameters)
    drawn = _acted_upon(source, drawn, scheme, weight)
    drawn = replace(drawn, options=_options(source, drawn, scheme))
    drawn = _with_exact_flows(random.Random(f"flows {seed} {attempt}"), _extras(source, drawn))
    drawn = _collocated(random.Random(f"gauss {seed} {attempt}"), drawn)
    drawn = _chosen(random.Random(f"auto {seed} {attempt}"), drawn)
    return _observed(random.Random(f"observables {seed} {attempt}"), drawn)


def _observed(source: random.Random, drawn: Ordinary) -> Ordinary:
    """Return the system with observables in half of the cases, otherwise unchanged. Observables may depend on time and
    parameters.
    """
    if source.random() < 0.5:
        return drawn
    symbols = [*drawn.structure.coordinates, *(Symbol(name) for name in drawn.parameters), *([TIME] * drawn.timed)]

    def operand() -> Expr:
        """Draw a function of coordinates, parameters and the time."""
        return small(source) * bounded(source, linear(source, symbols)) + small(source) * source.choice(symbols) / 3

    forms = source.sample(list(OBSERVED), source.randint(1, 3))
    return replace(drawn, observables={f"seen{k}": (form, operand(), operand()) for k, form in enumerate(forms)})


def _with_exact_flows(source: random.Random, drawn: Ordinary) -> Ordinary:
    """Return the system unchanged or with terms that have exact flows. For so(3)* these are a rotation or a free rigid
    body; for canonical pairs a quadratic H, a perturbed Kepler motion, or two or three bodies.
    """
    acted_upon = drawn.timed or drawn.forced or drawn.noise or drawn.monitor is not None
    if drawn.structure.body and not acted_upon and drawn.options.get("scheme") == "splitting":
        return _with_rotations(source, drawn)
    if drawn.structure.kind != "canonical" or acted_upon:
        return drawn
    series_only = ("gauge", "birealisation", "solver", "composition")
    options = {k: v for k, v in drawn.options.items() if k not in series_only}
    options |= {"scheme": "splitting", "order": options["order"] + options["order"] % 2}
    q, p = zip(*drawn.structure.pairs, strict=True)
    way = source.choices(["", "linear", "Kepler"], [40, 15, 45])[0]
    if source.random() < 0.2:
        return _bodies(source, drawn, options)
    if way == "linear":
        terms = [linear(source, (*q, *p)) ** 2 / 3 for _ in range(source.randint(2, 4))]
        return replace(drawn, terms=(*terms, small(source) * q[0] * p[-1]), options=options)
    if way != "Kepler" or len(q) < 2:
        return drawn
    size = len(q) if source.random() < 0.7 else 2
    mass, pull = abs(small(source)) + 1, abs(small(source)) + 1
    motion = [sum(v**2 for v in p[:size]) / (2 * mass), -pull / sympy.sqrt(sum(v**2 for v in q[:size]))]
    beside = [v**2 / 300 for v in p[size:]]
    terms = [*motion, *beside, small(source) * monomial(source, q, 3) / 300]
    names = {2: ["saba-8-2", "wisdom-holman"], 4: ["aba-8-6-4", "aba-10-6-4", "wisdom-holman-modified-7"]}
    if not beside and options["order"] in names and source.random() < 0.7:
        name = source.choice(names[options["order"]])
        options["composition"] = name + ("-5" if name == "wisdom-holman" else "")
    return replace(drawn, terms=tuple(terms), options=options)


def _with_rotations(source: random.Random, drawn: Ordinary) -> Ordinary:
    """Return the system with a rotation about a vector, with the kinetic energy of a free rigid body, or unchanged."""
    x, way = drawn.structure.coordinates, source.choice(["vector", "body", "body", ""])
    if way == "vector":
        return replace(drawn, terms=(*drawn.terms, small(source) * linear(source, x) ** 2 / 4))
    if way != "body":
        return drawn
    terms = [abs(small(source)) * v**2 for v in x]
    beside = [small(source) * source.choice(x)] if source.random() < 0.5 else []
    options = {k: v for k, v in drawn.options.items() if k != "composition"}
    return replace(drawn, terms=(*terms, *beside), options=options)


def _bodies(source: random.Random, drawn: Ordinary, options: dict[str, Any]) -> Ordinary:
    """Draw two or three bodies in a plane, the first one heavy, with Jacobi or democratic heliocentric coordinates for
    the step.
    """
    count, change = source.choice([2, 3, 3]), source.choice(["jacobi", "jacobi", "democratic_heliocentric"])
    names = [f"{axis}{i}" for axis in "xy" for i in range(count)]
    if source.random() < 0.5:
        names = [f"{axis}{i}" for i in range(count) for axis in "xy"]
    structure = paired([(name, f"p{name}") for name in names])
    mass = {str(i): 1 + abs(small(source)) if i == 0 else abs(small(source)) / 60 for i in range(count)}
    start, terms, at = dict[str, float](), [], Symbol
    for i, m in enumerate(mass.values()):
        terms.append((at(f"px{i}") ** 2 + at(f"py{i}") ** 2) / (2 * m))
        angle, radius = source.uniform(0, 6), source.uniform(0.9, 1.1) * i**1.5
        speed = float(sympy.sqrt(mass["0"] / radius)) * source.uniform(0.9, 1.1) if i else 0.0
        c, s = float(sympy.cos(angle)), float(sympy.sin(angle))
        start |= {f"x{i}": radius * c + 0.3, f"y{i}": radius * s - 0.2}
        start |= {f"px{i}": float(m) * (0.1 - speed * s), f"py{i}": float(m) * speed * c}
        for j in range(i):
            between = (at(f"x{i}") - at(f"x{j}")) ** 2 + (at(f"y{i}") - at(f"y{j}")) ** 2
            terms.append(-m * mass[str(j)] / sympy.sqrt(between))
    if change == "jacobi" and source.random() < 0.4:
        terms.append(small(source) * at("x1") ** 2 * at(f"y{count - 1}") / 400)
    spec_options = {"scheme": "splitting", "coordinates_from": change, "order": source.choice([2, 2, 4])}
    if count == 3 and source.random() < 0.7:
        spec_options["composition"] = source.choice(
            {2: ["saba-4-2", "wisdom-holman", "wisdom-holman-3"], 4: ["aba-8-4"]}[spec_options["order"]]
        )
    state = tuple(start[str(v)] for v in structure.coordinates)
    return replace(
        drawn, structure=structure, terms=tuple(terms), start=state, parameters={}, options={**options, **spec_options}
    )


def _any_terms(source: random.Random, structure: Structure, weight: Callable[[], Expr]) -> list[Expr]:
    """Draw terms of H: squares of coordinates, monomials, and functions of linear combinations."""
    x = structure.coordinates
    terms = [sympy.Rational(source.randint(1, 4), 4) * v**2 for v in x if source.random() < 0.8]
    for _ in range(source.randint(1, 3)):
        if source.random() < 0.5:
            terms.append(weight() * monomial(source, x, 3) / 4)
        else:
            terms.append(weight() * bounded(source, linear(source, x)) / 3)
    return terms


def _splittable(source: random.Random, structure: Structure, weight: Callable[[], Expr]) -> list[Expr]:
    """Draw terms of H with elementary flows for the structure."""
    x = structure.coordinates
    if structure.pairs:
        q, p = zip(*structure.pairs, strict=True)
        kinetic = [sympy.Rational(source.randint(1, 4), 4) * v**2 for v in p]
        wells = [weight() * bounded(source, linear(source, q)) / 3 for _ in range(source.randint(1, 2))]
        return [*kinetic, *wells, weight() * monomial(source, q, 4) / 4]
    if structure.positive:
        return [weight() * v for v in x]
    return [weight() * v ** source.choice([1, 2, 2]) / 3 for v in x if source.random() < 0.9] or [x[0]]


def _coupled(source: random.Random, structure: Structure, weight: Callable[[], Expr]) -> list[Expr]:
    """Draw the terms of H for a ring of oscillators."""
    q, p = zip(*structure.pairs, strict=True)
    power = source.choice([2, 4])
    kinetic, well = [v**2 / 2 for v in p], source.choice([0, 1])
    springs = [(a - b) ** 2 / 2 + (a - b) ** power / 3 for a, b in zip(q, (*q[1:], q[0]), strict=True)]
    return [*kinetic, *(well * v**4 / 4 for v in q if well), *springs, weight() * q[0] * q[1]]


def _acted_upon(source: random.Random, drawn: Ordinary, scheme: str, weight: Callable[[], Expr]) -> Ordinary:
    """Return the system with time dependence, forces, damping, a monitor or noise, or unchanged."""
    if drawn.structure.kind == "chain":
        return drawn
    what = source.choices(["", "time", "forces", "monitor", "noise", "forces, time"], [45, 14, 14, 12, 10, 5])[0]
    new: dict[str, Any] = {}
    if "time" in what:
        wave = source.choice([sympy.cos, sympy.sin])(small(source) * TIME)
        k = source.randrange(len(drawn.terms))
        new["terms"] = (*drawn.terms[:k], drawn.terms[k] * (1 + wave / 3), *drawn.terms[k + 1 :])
        new["timed"] = True
    if "forces" in what:
        new |= _forces(source, drawn, weight, timed="time" in what)
    if what == "noise":
        x = drawn.structure.coordinates
        chosen = source.sample(list(x), min(len(x), source.randint(1, 2)))
        sources = [(v if source.random() < 0.8 else v**2 / 2, abs(small(source)) / 4) for v in chosen]
        new["noise"] = {f"w{k}": pair for k, pair in enumerate(sources)}
        new |= {"damping": abs(small(source)) / 9} if source.random() < 0.3 else {}
    if what == "monitor":
        new |= _monitored(source, drawn, scheme)
    return replace(drawn, **new)


def _forces(source: random.Random, drawn: Ordinary, weight: Callable[[], Expr], *, timed: bool) -> dict[str, Any]:
    """Draw forces on coordinates, or damping."""
    x = drawn.structure.coordinates
    acting = source.choice(["covector", "vector", "damping", "vector", "covector, vector"])
    new: dict[str, Any] = {}
    for way in ("covector", "vector"):
        if way in acting:
            v = source.choice(list(x))
            strength = weight() * (source.choice([v, linear(source, x)]) if source.random() < 0.8 else 1) / 5
            new[way] = {str(v): strength * (sympy.cos(TIME) if timed and source.random() < 0.5 else 1)}
    if acting == "damping":
        positive = [Symbol(n) / 9 for n, (_, p) in drawn.parameters.items() if p]
        new["damping"] = source.choice([abs(small(source)) / 9, *positive])
    return new


def _monitored(source: random.Random, drawn: Ordinary, scheme: str) -> dict[str, Any]:
    """Draw a monitor. For a splitting of canonical pairs it is "log", with a kinetic energy and a negative
    potential.
    """
    x, pairs = drawn.structure.coordinates, drawn.structure.pairs
    if scheme == "series":
        v, w = source.choice(list(x)), source.choice(list(x))
        paces = [1 + v**2, 1 / (1 + v**2 + w**2), sympy.sqrt(1 + v**2), sympy.exp(-(v**2)) + 1]
        return {"monitor": source.choice(paces)}
    if not pairs:
        return {}
    q, p = zip(*pairs, strict=True)
    well = -source.choice([1 / sympy.sqrt(1 + sum(v**2 for v in q)), sympy.exp(-sum(v**2 for v in q) / 4) + 1])
    return {"monitor": "log", "attraction": well, "terms": (sum(v**2 for v in p) / 2, well)}


#: Orders with their probabilities (relative weights), for the schemes series and splitting.
_ORDERS = {"series": ([1, 2, 3, 4, 6, 8], [4, 44, 4, 30, 12, 6]), "splitting": ([2, 4, 6, 8], [35, 35, 20, 10])}

_COMPOSITIONS = {4: ["suzuki", "triple-jump"], 6: ["kahan-li", "yoshida"], 8: ["kahan-li", "yoshida"]}
_PARTS = ("by-hand", "ensemble", "kicks", "lanes", "members", "recurrences")


def _options(source: random.Random, drawn: Ordinary, scheme: str) -> dict[str, Any]:
    """Draw further keys of the spec."""
    chain, costly = drawn.structure.kind == "chain", drawn.structure.kind in ("nambu3", "nambu4", "pull-back")
    heavy = costly or drawn.forced or drawn.monitor is not None or len(drawn.structure.coordinates) > 4
    options: dict[str, Any] = {}
    if scheme == "splitting" or source.random() < 0.3:
        options["scheme"] = scheme
    orders, weights = _ORDERS[scheme]
    order = source.choices(orders, weights)[0]
    if scheme == "series" and heavy:
        order = 2 if chain else source.choice([2, 2, 4])
    options["order"] = 2 if drawn.noise and scheme == "series" else order
    options["profile"] = source.choice(["fast", "small", "certified"])
    if source.random() < 0.3:
        options["solver"] = source.choice([{"lanes": False}, {"lanes": False}, {"method": "newton"}])
    if scheme == "series":
        options |= _realised(source, drawn)
    if options["order"] in _COMPOSITIONS and source.random() < 0.3 and not drawn.noise:
        options["composition"] = source.choice(_COMPOSITIONS[options["order"]])
    if source.random() < 0.04:
        options |= {"real": "float", "profile": "small"}
    if source.random() < 0.12:
        options["without"] = source.sample(_PARTS, source.randint(1, 2))
    if drawn.structure.body and source.random() < 0.4:
        options["reconstruct"] = source.choice(["quaternion", "matrix"])
    return options


def _realised(source: random.Random, drawn: Ordinary) -> dict[str, Any]:
    """Draw the gauge and the bi-realisation for the scheme series."""
    chosen: dict[str, Any] = {}
    if source.random() < 0.5:
        chosen["gauge"] = "none"
    elif drawn.structure.casimirs and source.random() < 0.3 and not drawn.forced:
        chosen["gauge"] = {"C0": "1/3"}
    linear_one = drawn.structure.kind.startswith("algebra")
    if linear_one and source.random() < 0.2:
        chosen["birealisation"] = source.choice(["exponential", "cayley", "karasev"])
    elif drawn.structure.pairs and source.random() < 0.12 and drawn.structure.kind == "canonical":
        chosen["birealisation"] = {"kind": "canonical-euler", "side": source.choice(["q", "p"])}
        chosen["order"] = source.choice([1, 2])
    elif source.random() < 0.06 and drawn.structure.kind != "chain":
        chosen["birealisation"] = "karasev"
    return chosen


def _extras(source: random.Random, drawn: Ordinary) -> Ordinary:
    """Return the system with random requests for ``adjoint`` and ``tangent``, each in the spec or in the call of
    `phigen.compile`.
    """
    options, asked = dict(drawn.options), {}
    for name, chance in (("adjoint", 0.75), ("tangent", 0.4)):
        if name == "adjoint" and drawn.noise:
            continue
        if source.random() < chance:
            if source.random() < 0.5:
                options[name] = True
            else:
                asked[name] = True
    return replace(drawn, options=options, asked=asked)


def _chosen(source: random.Random, drawn: Ordinary) -> Ordinary:
    """Return the system with `scheme: auto` in a tenth of the cases, otherwise unchanged."""
    scheme = drawn.options.get("scheme", "series")
    if source.random() > 0.1 or "structure" in drawn.options or drawn.monitor == "log" or scheme == "splitting":
        return drawn
    return replace(drawn, options={**drawn.options, "scheme": "auto"})


#: Options that the scheme gauss refuses or that are drawn anew for it.
_NOT_OF_GAUSS = ("birealisation", "composition", "coordinates_from", "reconstruct", "solver")


def _collocated(source: random.Random, drawn: Ordinary) -> Ordinary:
    """Return the system with the scheme gauss in a quarter of the cases, otherwise unchanged."""
    if source.random() > 0.25 or drawn.noise or drawn.monitor == "log":
        return drawn
    options = {k: v for k, v in drawn.options.items() if k not in _NOT_OF_GAUSS}
    options |= {"scheme": "gauss", "order": source.choice([2, 4, 6, 8, 12, 16])}
    if source.random() < 0.4:
        options["structure"] = "to truncation"
    elif drawn.structure.body and not drawn.forced and source.random() < 0.5:
        options["reconstruct"] = "quaternion"
    if source.random() < 0.2:
        options["solver"] = {"lanes": False}
    if source.random() < 0.1:
        options |= {"real": "float", "profile": "small"}
    return replace(drawn, options=options)
