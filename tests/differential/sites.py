"""Random lattices: the text of their spec, and their equations of motion, derived without phigen."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import sympy
from differential.formulas import TIME, Expr, gradient, numeric, symbols, text
from differential.reference import Floats
from numpy.typing import NDArray

from phigen.spec.names import REDUCTIONS

Places = NDArray[np.int64]
_INDEXED = re.compile(r"(\w+)(\[[^\]]*\])?$")


@dataclass(frozen=True)
class Parameter:
    """A parameter: whether it has one value (``all``) or a value at each site or bond (``sites``, ``bonds``), and its
    value as written in a spec.
    """

    at: str
    value: Any
    positive: bool = False


@dataclass(frozen=True)
class Lattice:
    """A random lattice.

    A lattice with ``axes`` is a grid, with a ``boundary`` for each axis; without axes it is a graph with ``bonds``, or
    all ``pairs`` of sites interact. ``pi`` has the brackets within a site; ``across`` lists the brackets between sites
    as (f, g, index of g, value). H is the sum of ``sites`` over all sites, and of ``ends`` over bonds or pairs.
    ``vector``, ``covector``, ``damping`` and ``noise`` have the meaning of docs/lattices.md. If ``monitored``, steps
    are equal in the fictitious time τ, and ``ends`` are the negative part of H.
    """

    seed: int
    fields: tuple[str, ...]
    poisson: Mapping[str, Any]
    pi: sympy.Matrix
    sites: tuple[Expr, ...]
    sizes: tuple[int, ...]
    axes: tuple[str, ...] = ()
    boundary: tuple[str, ...] = ()
    pairs: bool = False
    bonds: tuple[tuple[int, int], ...] = ()
    across: tuple[tuple[str, str, str, Expr], ...] = ()
    ends: tuple[Expr, ...] = ()
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    covector: Mapping[str, Expr] = field(default_factory=dict)
    vector: Mapping[str, Expr] = field(default_factory=dict)
    damping: Expr | None = None
    noise: Mapping[str, tuple[Expr, Expr]] = field(default_factory=dict)
    timed: bool = False
    casimir: Expr | None = None
    positive: bool = False
    initial: Any = None
    monitored: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)
    asked: Mapping[str, Any] = field(default_factory=dict)

    kind = "lattice"

    @property
    def graph(self) -> bool:
        """Whether the lattice is a graph, whose bonds connect sites."""
        return not (self.axes or self.pairs)

    @property
    def forced(self) -> bool:
        """Whether there are forces or damping."""
        return bool(self.covector or self.vector or self.damping is not None)

    # --- the spec

    @property
    def text(self) -> str:
        """Text of the spec; every value is written as JSON, which is valid YAML."""
        return "".join(f"{key}: {json.dumps(value)}\n" for key, value in self.entries())

    def entries(self) -> Iterator[tuple[str, Any]]:
        """Yield the top-level keys of the spec with their values."""
        yield from {"phigen": 1, "name": f"l{self.seed}", "lattice": self._relation()}.items()
        yield "coordinates", list(self.fields)
        if self.parameters:
            yield (
                "parameters",
                {n: {"value": p.value, "at": p.at, "positive": p.positive} for n, p in self.parameters.items()},
            )
        if self.timed:
            yield "time", str(TIME)
        yield "poisson", dict(self.poisson)
        sites, ends = (" + ".join(f"({text(e)})" for e in terms) for terms in (self.sites, self.ends))
        parts = {k: v for k, v in (("sites", sites), ("pairs" if self.pairs else "bonds", ends)) if v}
        yield "hamiltonian", sites if self.axes else parts or {"sites": "0"}
        if self.casimir is not None:
            yield "casimirs", {"C": text(self.casimir)}
        forces = {"covector": self.covector, "vector": self.vector}
        if any(forces.values()):
            yield "forces", {kind: {n: text(f) for n, f in by.items()} for kind, by in forces.items() if by}
        if self.damping is not None:
            yield "damping", text(self.damping)
        if self.monitored:
            yield "monitor", "log"
        if self.noise:
            yield "noise", {n: {"hamiltonian": text(g), "amplitude": text(s)} for n, (g, s) in self.noise.items()}
        observables: dict[str, Any] = {f"o{k}": {kind: self.fields[0]} for k, kind in enumerate(REDUCTIONS)}
        if not self.axes and self.ends:
            over = "pairs" if self.pairs else "bonds"
            observables |= {"apart": {"sum": text(self.ends[0]), "over": over}}
        yield "observables", observables | {"own": text(self.observed)}
        yield from self.options.items()
        run = {"sizes": list(self.sizes), "initial": self.initial, "step": 0.1, "steps": 4}
        if not self.axes:
            run["names"] = [f"site {k}" for k in range(self.count)]
        yield "runs", {"r": run | ({"bonds": [list(b) for b in self.bonds]} if self.graph else {})}

    def _relation(self) -> dict[str, Any]:
        if self.axes:
            return {"axes": list(self.axes), "boundary": list(self.boundary)}
        return {"pairs": "all"} if self.pairs else {"graph": "bonds"}

    # --- indices of sites

    @property
    def count(self) -> int:
        """Number of sites."""
        return int(np.prod(self.sizes))

    @property
    def edges(self) -> Places:
        """Bonds of a graph, or all pairs of sites, as an array (edges, 2)."""
        listed = list(itertools.combinations(range(self.count), 2)) if self.pairs else list(self.bonds)
        return np.array(listed, dtype=np.int64).reshape(-1, 2)

    def places(self, suffix: str, edges: bool) -> Places:
        """Return the site that an index such as ``[i+1]`` or ``[a]`` denotes, for every site or edge; −1 beyond an open
        end.
        """
        if edges:
            return self.edges[:, "ab".index(suffix[1])]
        grid = np.indices(self.sizes)
        inside = np.ones(self.sizes, dtype=bool)
        for part in filter(None, suffix[1:-1].split(",")):
            match = re.fullmatch(r"\s*(\w+?)\s*([+-]\s*\d+)?\s*", part)
            assert match
            k = self.axes.index(match[1])
            moved = grid[k] + int((match[2] or "0").replace(" ", ""))
            if self.boundary[k] == "open":
                inside &= (moved >= 0) & (moved < self.sizes[k])
            grid[k] = moved % self.sizes[k]
        return np.where(inside, np.ravel_multi_index(tuple(grid), self.sizes), -1).ravel()

    # --- the equations of motion

    def rates(self, values: Mapping[str, Any]) -> Callable[[float, Floats], Floats]:
        """Return the right-hand side without noise as a function of time and state (fields, sites)."""
        slopes = self._slopes
        pushes = {
            k: [self._term(e, self.fields.index(n)) for n, e in by.items()]
            for k, by in (("covector", self.covector), ("vector", self.vector))
        }
        entries = [(i, j, self._term(e)) for i, row in enumerate(self.pi.tolist()) for j, e in enumerate(row) if e != 0]
        across = [
            (self.fields.index(f), self.fields.index(g), p, self._term(e, edges=self.graph))
            for f, g, p, e in self.across
        ]
        damping = None if self.damping is None else self._term(self.damping)

        def turned(t: float, x: Floats, slope: Floats) -> Floats:
            """Return the product of π and a covector."""
            increments = np.zeros_like(x)
            for i, j, term in entries:
                increments[i] += term.at(t, x, values) * slope[j]
            for f, g, place, term in across:
                base = self.places("[a]", True) if self.graph else np.arange(self.count)
                other = self.places(place, self.graph)
                inside = other >= 0
                value = term.at(t, x, values)[inside]
                np.add.at(increments[f], base[inside], value * slope[g][other[inside]])
                np.add.at(increments[g], other[inside], -value * slope[f][base[inside]])
            return increments

        def rate(t: float, x: Floats) -> Floats:
            slope = np.zeros_like(x)
            for term in slopes:
                term.add(t, x, values, slope)
            pushed = slope.copy()
            for term in pushes["covector"]:
                pushed[term.target] += term.at(t, x, values)
            if damping is not None:
                pushed += damping.at(t, x, values) * turned(t, x, slope)
            increments = turned(t, x, pushed)
            for term in pushes["vector"]:
                increments[term.target] += term.at(t, x, values)
            return increments

        return rate

    @cached_property
    def _slopes(self) -> list[_Slope]:
        return [_Slope(self, e, False) for e in self.sites] + [_Slope(self, e, True) for e in self.ends]

    def _term(self, expression: Expr, target: int = -1, edges: bool = False) -> _Term:
        return _Term(self, [sympy.sympify(expression)], edges, target)

    def pace(self, values: Mapping[str, Any], x: Floats) -> float:
        """Return the derivative of t along the fictitious time τ at a state; without a monitor it is 1."""
        if not self.monitored:
            return 1.0
        well = sum(np.sum(self._term(e, edges=True).at(0.0, x, values)) for e in self.ends)
        with np.errstate(divide="ignore"):
            return float(-1 / np.float64(well))

    @property
    def observed(self) -> Expr:
        """Observable of each site, as an expression."""
        first, last = sympy.Symbol(self.fields[0], real=True), sympy.Symbol(self.fields[-1], real=True)
        return first * last + 2 * last

    def seen(self, values: Mapping[str, Any], x: Floats) -> dict[str, Floats]:
        """Return the observables of a state (fields, sites), by name."""
        named = {f"o{k}": np.array(getattr(np, kind)(x[0])) for k, kind in enumerate(REDUCTIONS)}
        if not self.axes and self.ends:
            named["apart"] = np.array(np.sum(self._term(self.ends[0], edges=True).at(0.0, x, values)))
        return named | {"own": (x[0] * x[-1] + 2 * x[-1]).reshape(self.sizes)}

    def densities(self, values: Mapping[str, Any], t: float, x: Floats) -> float:
        """Return the value of H at a state."""
        terms = [self._term(e) for e in self.sites] + [self._term(e, edges=True) for e in self.ends]
        return float(sum(np.sum(term.at(t, x, values)) for term in terms))

    def matrix(self, values: Mapping[str, Any], x: Floats) -> Floats:
        """Return π of the whole lattice, a square matrix of (fields · sites) rows."""
        n = self.count
        entries = np.zeros((len(x) * n, len(x) * n))
        for i, row in enumerate(self.pi.tolist()):
            for j, e in enumerate(row):
                if e != 0:
                    entries[i * n : (i + 1) * n, j * n : (j + 1) * n] += np.diag(self._term(e).at(0.0, x, values))
        for f, g, place, e in self.across:
            base = self.places("[a]", True) if self.graph else np.arange(n)
            other, value = self.places(place, self.graph), self._term(e, edges=self.graph).at(0.0, x, values)
            for a, b, v in zip(base, other, value, strict=True):
                if b >= 0:
                    i, j = self.fields.index(f) * n + a, self.fields.index(g) * n + b
                    entries[i, j] += v
                    entries[j, i] -= v
        return entries

    # --- shrinking

    def simpler(self) -> Iterator[Lattice]:
        """Yield simpler lattices, each with one term, option, bond or layer of sites removed."""
        for name in ("sites", "ends", "across"):
            parts = getattr(self, name)
            for k in range(len(parts)):
                if name != "across" and len(self.sites) + len(self.ends) > 1:
                    yield replace(self, **{name: parts[:k] + parts[k + 1 :]})
        for name in ("covector", "vector", "noise", "options", "asked"):
            parts = getattr(self, name)
            for key in parts:
                yield replace(self, **{name: {k: v for k, v in parts.items() if k != key}})
        if self.damping is not None:
            yield replace(self, damping=None)
        if self.monitored:
            yield replace(self, monitored=False)
        if self.casimir is not None:
            yield replace(self, casimir=None)
        if self.bonds:
            for k in range(len(self.bonds)):
                yield replace(self, bonds=self.bonds[:k] + self.bonds[k + 1 :], parameters=_shortened(self.parameters))
        used = " ".join(text(e) for e in self._expressions())
        for name in self.parameters:
            if not re.search(rf"\b{name}\b", used):
                yield replace(self, parameters={k: v for k, v in self.parameters.items() if k != name})
        if self.timed and not re.search(r"\bt\b", used):
            yield replace(self, timed=False)
        for k, size in enumerate(self.sizes):
            if size > 1 and not self.bonds:
                sizes = (*self.sizes[:k], size - 1, *self.sizes[k + 1 :])
                yield replace(self, sizes=sizes, parameters=_shortened(self.parameters), initial={"random": "uniform"})

    def _expressions(self) -> list[Expr]:
        noise = [e for pair in self.noise.values() for e in pair]
        damping = [] if self.damping is None else [self.damping]
        forces = [*self.covector.values(), *self.vector.values()]
        return [*self.sites, *self.ends, *(e for *_, e in self.across), *self.pi, *forces, *noise, *damping]


def _shortened(parameters: Mapping[str, Parameter]) -> dict[str, Parameter]:
    """Return the parameters with lists of values replaced by a number, as lists fit only one size of the lattice."""
    return {n: replace(p, value=1) if isinstance(p.value, list) else p for n, p in parameters.items()}


class _Term:
    """Expressions that are evaluated at every site or edge. They are 0 where they refer to a site beyond an
    open end.
    """

    def __init__(self, lattice: Lattice, expressions: Sequence[Expr], edges: bool, target: int = -1) -> None:
        self.lattice, self.edges, self.target = lattice, edges, target
        reach = set().union(*(e.free_symbols for e in expressions))
        self.names = sorted(str(s) for s in reach)
        self.compiled = numeric(expressions, symbols(self.names))
        self.read: dict[str, tuple[str, Places | None]] = {}
        self.inside = np.ones(len(lattice.edges) if edges else lattice.count, dtype=bool)
        for name in self.names:
            match = _INDEXED.match(name)
            assert match
            base, suffix = match[1], match[2] or ""
            array = base in lattice.fields or (base in lattice.parameters and lattice.parameters[base].at == "sites")
            places = lattice.places(suffix or "[]", edges) if array else None
            self.read[name] = (base, places)
            if places is not None:
                self.inside &= places >= 0

    def values(self, t: float, x: Floats, values: Mapping[str, Any]) -> list[Floats]:
        """Return the values of each expression at all sites or edges."""
        numbers = []
        for name in self.names:
            base, places = self.read[name]
            if base in self.lattice.fields:
                numbers.append(x[self.lattice.fields.index(base)][places])
            elif base in values:
                array = np.asarray(values[base], dtype=float).ravel()
                numbers.append(
                    array[places]
                    if places is not None and array.size > 1
                    else array
                    if array.size != 1
                    else float(array[0])
                )
            else:
                numbers.append(t)
        shape = self.inside.shape
        return [
            np.where(self.inside, np.broadcast_to(np.asarray(v, dtype=float), shape), 0.0)
            for v in self.compiled(*numbers)
        ]

    def at(self, t: float, x: Floats, values: Mapping[str, Any]) -> Floats:
        """Return the values of the first expression at all sites or edges."""
        return self.values(t, x, values)[0]


class _Slope:
    """Gradient of a term of H, as contributions to all sites that the term contains."""

    def __init__(self, lattice: Lattice, expression: Expr, edges: bool) -> None:
        names = sorted(str(s) for s in sympy.sympify(expression).free_symbols)
        self.reads = [n for n in names if _INDEXED.match(n)[1] in lattice.fields]  # type: ignore[index]
        self.term = _Term(lattice, [*gradient(expression, symbols(self.reads)), sympy.sympify(expression)], edges)

    def add(self, t: float, x: Floats, values: Mapping[str, Any], slope: Floats) -> None:
        """Add the gradient of the sum of the term over all sites or edges to ``slope``."""
        *arguments, _ = self.term.values(t, x, values)
        for name, value in zip(self.reads, arguments, strict=True):
            base, places = self.term.read[name]
            assert places is not None
            inside = self.term.inside
            np.add.at(slope[self.term.lattice.fields.index(base)], places[inside], value[inside])
