"""What several tests share: the corpus compiled, solvers of it, and an independent one-step map in many digits."""

from __future__ import annotations

import ctypes
import os
import shlex
import shutil
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest

from phigen import resources, spec
from phigen.compiler import Compilation, compile_spec, emit
from phigen.geometry.system import System, system_from_spec
from phigen.realisations.catalogue import realise
from phigen.realisations.protocol import BiRealisation
from phigen.runtime import cache as library_cache
from phigen.runtime.c_solver import CSolver
from phigen.runtime.interface import Interface
from phigen.runtime.numpy_solver import NumpySolver
from phigen.runtime.solver import Solver
from phigen.scheme.discretisation import hamilton_jacobi
from phigen.series.hamilton_jacobi import graph_series
from phigen.spec.model import Run
from phigen.symbolic.expression import Expression, derivatives, fold, gradient, number, symbol, total
from phigen.symbolic.numeric import evaluate_with_scale
from phigen.symbolic.symbols import momentum

#: The corpus.
NAMES = sorted(path.stem for path in resources.bundled_specs().glob("*.yaml"))
TARGETS = ("c", "numpy")
COMMAND = "phigen build"
DIGITS = 50


def plain(given: spec.Spec) -> spec.Spec:
    """The spec with no gauge where it leaves that to phigen: tests/generated/test_gauge.py is about gauges."""
    return replace(given, gauge="none") if given.gauge == "auto" else given


def compile_text(text: str, order: int | None = None, scheme: str | None = None, **more: Any) -> Compilation:
    """The compilation of a spec given as YAML without its first two keys."""
    return compile_spec(plain(spec.loads(f"phigen: 1\nname: t\n{text}")), order=order, scheme=scheme, **more)


@cache
def compiled(name: str, order: int | None = None, scheme: str | None = None) -> Compilation:
    """The compilation of a system of the corpus."""
    found = plain(spec.load(resources.bundled_specs() / f"{name}.yaml"))
    return compile_spec(found, order=order, scheme=scheme)


@cache
def described(name: str) -> tuple[spec.Spec, System, BiRealisation]:
    """What is known of a system of the corpus before anything of its solver is made: quick, for choosing tests."""
    found = spec.load(resources.bundled_specs() / f"{name}.yaml")
    system = system_from_spec(found)
    return found, system, realise(system, found.birealisation)


_made: dict[tuple[Any, ...], tuple[Compilation, Any]] = {}


def _once(compilation: Compilation, key: str, make: Callable[[], Any]) -> Any:
    """What was made of a compilation before, which is kept alive with it; compilations cannot be hashed."""
    place = (key, id(compilation))
    if place not in _made:
        _made[place] = compilation, make()
    return _made[place][1]


def files(compilation: Compilation, target: str) -> Mapping[str, str]:
    """The generated files."""
    return _once(compilation, f"files {target}", lambda: emit(compilation.program, target, COMMAND))


def interface(compilation: Compilation) -> Interface:
    """The names that the runtime needs."""
    program = compilation.program
    return Interface(
        program.name,
        program.coordinates,
        program.order,
        {p.name: float(p.value) for p in program.parameters},
        frozenset(p.name for p in program.parameters if p.positive),
        program.casimirs,
    )


def solver(compilation: Compilation, target: str) -> Solver:
    """A solver of one target; compiled C comes from the cache."""
    return _once(compilation, f"solver {target}", lambda: _solver(compilation, target))


def _solver(compilation: Compilation, target: str) -> Solver:
    names = interface(compilation)
    if target == "c":
        return Solver(CSolver.compile(files(compilation, "c"), names), names)
    return Solver(NumpySolver.from_source(files(compilation, "numpy")[f"{names.name}.py"], names), names)


#: Every run of the corpus, as pairs of names.
RUNS = [(name, run) for name in NAMES for run in spec.load(resources.bundled_specs() / f"{name}.yaml").runs]


def first_run(compilation: Compilation) -> Run:
    """The first run of a spec."""
    return next(iter(compilation.spec.runs.values()))


@dataclass(frozen=True)
class Setting:
    """The numbers of a run: state, step size, parameters (all of them)."""

    x: tuple[float, ...]
    h: float
    parameters: Mapping[str, float]


def setting(compilation: Compilation, name: str | None = None) -> Setting:
    """The numbers of a run of the spec, the first unless another is named."""
    run = compilation.spec.runs[name] if name else first_run(compilation)
    defaults = {p.name: float(p.value) for p in compilation.spec.parameters}
    return Setting(
        tuple(float(v) for v in run.initial),
        float(run.step),
        {**defaults, **{k: float(v) for k, v in run.parameters.items()}},
    )


def casimir_scales(compilation: Compilation, at: Setting) -> list[float]:
    """The size of each Casimir at a state: the largest term that occurs in it, at least its value."""
    values = _fractions(compilation.spec.coordinates, at)
    pairs = evaluate_with_scale(list(compilation.system.casimirs.values()), values, 30)
    return [max(abs(float(value)), 1e-300) for value, _ in pairs]


def _fractions(coordinates: Sequence[str], at: Setting) -> dict[str, Fraction]:
    return {k: Fraction(v) for k, v in [*zip(coordinates, at.x, strict=True), *at.parameters.items()]}


def precisely(function: Callable[..., Any]) -> Callable[..., Any]:
    """Run with `DIGITS` digits of mpmath."""

    def wrapped(*args: Any, **kwargs: Any) -> Any:
        with mpmath.workdps(DIGITS):
            return function(*args, **kwargs)

    wrapped.__name__, wrapped.__doc__ = function.__name__, function.__doc__
    return wrapped


# -- the struct of the C solver, looked at from outside ------------------------------------------------------------


class RawC:
    """A generated C library called as a C program would, with a view of ``x`` and ``carry`` in the solver's struct."""

    def __init__(self, compilation: Compilation) -> None:
        self.name, self.n = compilation.program.name, compilation.program.dimension
        self._library = library_cache.load(files(compilation, "c"))
        self._parameters = [p.name for p in compilation.program.parameters]
        self.memory = np.zeros(self.call("solver_size", ctypes.c_size_t), dtype=np.uint8)
        doubles = self.memory[: 16 * self.n].view(np.float64)
        self.x, self.carry = doubles[: self.n], doubles[self.n :]
        counters = self.memory[16 * self.n :][: 2 * ctypes.sizeof(ctypes.c_size_t)].view(np.uintp)
        self.counters = counters  # steps, evaluations

    def call(self, function: str, result: Any, *args: Any) -> Any:
        """Call ``NAME_function`` with arguments that are ctypes objects already."""
        f = getattr(self._library, f"{self.name}_{function}")
        f.restype = result
        return f(*args)

    @property
    def here(self) -> ctypes.c_void_p:
        """The address of the struct."""
        return ctypes.c_void_p(self.memory.ctypes.data)

    def init(self, x0: Sequence[float], parameters: Mapping[str, float] | None = None) -> int:
        """``NAME_init``; parameters None passes a null pointer."""
        start = np.array(x0, dtype=float)
        packed = None
        if parameters is not None:
            array = np.array([parameters[p] for p in self._parameters] or [0.0])
            packed = ctypes.c_void_p(array.ctypes.data)
        return self.call("init", ctypes.c_int, self.here, packed, ctypes.c_void_p(start.ctypes.data))

    def step(self, h: float) -> int:
        """``NAME_step``."""
        return self.call("step", ctypes.c_int, self.here, ctypes.c_double(h))

    def integrate(self, h: float, steps: int) -> int:
        """``NAME_integrate``."""
        return self.call("integrate", ctypes.c_int, self.here, ctypes.c_double(h), ctypes.c_size_t(steps))

    @precisely
    def exact_state(self) -> list[Any]:
        """x + carry, in many digits."""
        return [mpmath.mpf(float(x)) + mpmath.mpf(float(c)) for x, c in zip(self.x, self.carry, strict=True)]


# -- the scheme in many digits, without anything of phigen.scheme and phigen.targets --------------------------------


def values(roots: Sequence[Expression], at: Mapping[str, Any]) -> list[Any]:
    """Values of expressions as mpmath numbers of the current precision, by rules of its own."""
    return fold(roots, lambda e, args: _value(e, args, at))


def _value(e: Expression, args: list[Any], at: Mapping[str, Any]) -> Any:
    match e.op:
        case "number":
            return mpmath.mpf(e.value.numerator) / e.value.denominator
        case "symbol":
            return mpmath.mpf(at[e.value])
        case "pi":
            return +mpmath.pi
        case "E":
            return +mpmath.e
        case "add":
            return args[0] + args[1]
        case "sub":
            return args[0] - args[1]
        case "neg":
            return -args[0]
        case "mul":
            return args[0] * args[1]
        case "pow":
            if e.value.denominator == 1:
                return args[0] ** int(e.value)
            return mpmath.power(args[0], mpmath.mpf(e.value.numerator) / e.value.denominator)
        case "power":
            return mpmath.power(*args)
        case "abs":
            return abs(args[0])
        case "sign":
            return mpmath.sign(args[0])
        case "versin":
            return 1 - mpmath.cos(args[0])
        case "inv":
            return 1 / args[0] if args[0] > 0 else mpmath.nan
        case "phi0" | "phi1" | "phi2":
            return _phi(int(e.op[3:]), args[0])
        case "cosroot" | "sinroot" | "sinroot1" | "arcroot" | "exprel" | "exprel1":
            return _entire(e.op, args[0])
    return getattr(mpmath, e.op)(*args)


def _entire(name: str, s: Any) -> Any:
    """cos √s, sin(√s)/√s, (e^s − 1)/s or a derivative, by complex arithmetic: one formula for s of either sign."""

    def closed(z: Any) -> Any:
        root = mpmath.sqrt(z)
        if name.startswith("exprel"):
            return (mpmath.exp(z) - 1) / z
        if name == "arcroot":
            return (root - mpmath.sin(root)) / root**3
        return mpmath.cos(root) if name == "cosroot" else mpmath.sin(root) / root

    return mpmath.re(mpmath.diff(closed, mpmath.mpc(s)) if name.endswith("1") else closed(mpmath.mpc(s)))


def _phi(order: int, s: Any) -> Any:
    """φ(s) = (1 − w cot w)/s, w = √s/2, or a derivative: from its Taylor coefficients 2ζ(2n+2)/(4π²)^(n+1) near 0."""
    if abs(s) > 12:

        def closed(u: Any) -> Any:
            w = mpmath.sqrt(u) / 2
            return (1 - w * mpmath.cot(w)) / u

        with mpmath.extradps(20):
            return mpmath.re(mpmath.diff(closed, mpmath.mpc(s), order))
    result, n = mpmath.mpf(0), 0
    while True:
        power = n + order + 1
        term = 2 * mpmath.zeta(2 * power) / (4 * mpmath.pi**2) ** power * mpmath.rf(n + 1, order) * s**n
        result, n = result + term, n + 1
        if abs(term) <= mpmath.eps * abs(result):
            return result


class PreciseStep:
    """The one-step map in many digits: ``step(x)``, and ``defect(x)``, how far it is from a Poisson map at x.

    Made from the bi-realisation and the graph series alone, by Newton's method on α(y, ∇S_h(y)) = x and
    x' = β(y, ∇S_h(y)); the tangent map comes from implicit differentiation. For paths see precise_path.py.
    """

    def __init__(self, compilation: Compilation, parameters: Mapping[str, float], h: float) -> None:
        self.n, self._poisson = compilation.system.dimension, [e for row in compilation.system.poisson for e in row]
        self.coordinates, self._parameters = compilation.system.coordinates, dict(parameters)
        fractions = compilation.program.fractions
        self._stages = [_Stage(compilation, parameters, Fraction(f) * Fraction(h)) for f in fractions]

    @precisely
    def __call__(self, x: Sequence[Any]) -> list[Any]:
        """Φ(x)."""
        for stage in self._stages:
            x = stage.solve(x)
        return list(x)

    def poisson(self, x: Sequence[Any]) -> Any:
        """The matrix π(x)."""
        at = {**self._parameters, **dict(zip(self.coordinates, x, strict=True))}
        return _columns(values(self._poisson, at), self.n, self.n).T

    @precisely
    def tangent(self, x: Sequence[Any]) -> tuple[list[Any], Any]:
        """Φ(x) and DΦ(x)."""
        product = mpmath.eye(self.n)
        for stage in self._stages:
            x, tangent = stage.solve_with_tangent(x)
            product = tangent * product
        return list(x), product

    @precisely
    def defect(self, x: Sequence[Any]) -> float:
        """|DΦ π DΦᵀ − π∘Φ| relative to |π∘Φ| at x."""
        image, tangent = self.tangent(x)
        return relative_defect(tangent, self.poisson(x), self.poisson(image))


class _Stage:
    def __init__(self, compilation: Compilation, parameters: Mapping[str, float], h: Fraction) -> None:
        realisation, self.coordinates = compilation.realisation, compilation.system.coordinates
        self.n, self._parameters = len(self.coordinates), dict(parameters)
        slope = _slope(compilation, h)
        hessian = [d for c in self.coordinates for d in derivatives(slope, c)]  # column by column
        self._momenta = [*slope, *hessian]
        both = [*realisation.alpha, *realisation.beta]
        names = [*self.coordinates, *realisation.covector]
        self._maps = [*both, *(d for name in names for d in derivatives(both, name))]
        self._covector = realisation.covector

    def _linearised(self, y: Sequence[Any]) -> tuple[Any, Any, Any, Any]:
        n, at = self.n, {**self._parameters, **dict(zip(self.coordinates, y, strict=True))}
        momenta = values(self._momenta, at)
        hessian = _columns(momenta[n:], n, n)
        maps = values(self._maps, {**at, **dict(zip(self._covector, momenta[:n], strict=True))})
        by_x, by_p = _columns(maps[2 * n :][: 2 * n * n], 2 * n, n), _columns(maps[2 * n :][2 * n * n :], 2 * n, n)
        total_derivative = by_x + by_p * hessian
        alpha, beta = mpmath.matrix(maps[:n]), mpmath.matrix(maps[n : 2 * n])
        return alpha, beta, total_derivative[:n, :], total_derivative[n:, :]

    def _solved(self, x: Sequence[Any]) -> tuple[Any, Any, Any]:
        """β, Dα and Dβ, the derivatives along y, where α = x."""
        y, x = mpmath.matrix(list(x)), mpmath.matrix(list(x))
        for _ in range(60):
            alpha, beta, d_alpha, d_beta = self._linearised(list(y))
            delta = mpmath.lu_solve(d_alpha, alpha - x)
            if mpmath.norm(delta, mpmath.inf) <= mpmath.norm(y, mpmath.inf) * mpmath.mpf(10) ** (4 - DIGITS):
                return beta, d_alpha, d_beta
            y -= delta
        raise ArithmeticError("no convergence")

    def solve(self, x: Sequence[Any]) -> list[Any]:
        return list(self._solved(x)[0])

    def solve_with_tangent(self, x: Sequence[Any]) -> tuple[list[Any], Any]:
        beta, d_alpha, d_beta = self._solved(x)
        return list(beta), d_beta * mpmath.inverse(d_alpha)


def _slope(compilation: Compilation, h: Fraction) -> list[Expression]:
    """∇S_h as a graph, with h a number."""
    # A composition is made of steps of order 2.
    system, terms = compilation.system, compilation.order.terms if len(compilation.program.fractions) == 1 else 1
    realisation = compilation.realisation
    series = graph_series(
        system.hamiltonian, realisation.alpha, system.coordinates, terms, symmetric=realisation.symmetric
    )
    return gradient(total(number(h) ** (i + 1) * s for i, s in enumerate(series)), system.coordinates)


def _columns(entries: Sequence[Any], rows: int, columns: int) -> Any:
    matrix = mpmath.matrix(rows, columns)
    for k, e in enumerate(entries):
        matrix[k % rows, k // rows] = e
    return matrix


def relative_defect(tangent: Any, before: Any, after: Any) -> float:
    """|T π(x) Tᵀ − π(x')| relative to |π(x')|."""
    return float(_largest(tangent * before * tangent.T - after) / _largest(after))


def _largest(matrix: Any) -> Any:
    return max(abs(e) for e in matrix)


@precisely
def tangent_by_differences(step: Callable[[Sequence[Any]], Sequence[Any]], x: Sequence[Any]) -> Any:
    """The derivative of a map given in many digits, by central differences: good to a third of the digits or more."""
    n, width = len(x), mpmath.mpf(10) ** (-DIGITS // 3)
    tangent = mpmath.matrix(n, n)
    for j in range(n):
        ends = []
        for sign in (1, -1):
            moved = [mpmath.mpf(v) for v in x]
            moved[j] += sign * width
            ends.append(step(moved))
        for i in range(n):
            tangent[i, j] = (ends[0][i] - ends[1][i]) / (2 * width)
    return tangent


@precisely
def defect_of_map(
    step: Callable[[Sequence[Any]], Sequence[Any]], poisson: Callable[[Sequence[Any]], Any], x: Sequence[Any]
) -> float:
    """|DΦ π DΦᵀ − π∘Φ| relative to |π∘Φ| of any map, by differences in many digits."""
    return relative_defect(tangent_by_differences(step, x), poisson(x), poisson(step(x)))


# -- systems beside the corpus --------------------------------------------------------------------------------------

BODY = """coordinates: [x1, x2, x3]
poisson: {brackets: {x1: {x2: -x3, x3: x2}, x2: {x3: -x1}}}
hamiltonian: x1**2/2 + x2**2/4 + x3**2/6
"""

SPECIES = """coordinates: [x1, x2, x3]
poisson: {log_canonical: [[0, 1, 1], [-1, 0, 1], [-1, -1, 0]]}
hamiltonian: x1 + x2 + x3
"""


def symbols(names: str) -> list[Expression]:
    """Symbols from names separated by spaces; ``p:x`` is the momentum of x."""
    return [symbol(momentum(n[2:]) if n.startswith("p:") else n) for n in names.split()]


def tool(name: str) -> str:
    """The path of a program; without it the test is skipped, or fails where PHIGEN_ALL_TOOLS is set."""
    path = shutil.which(name)
    if path is None:
        if os.environ.get("PHIGEN_ALL_TOOLS"):
            pytest.fail(f"{name} is not installed")
        pytest.skip(f"{name} is not installed")
    return path


def run(command: Sequence[str | Path], folder: Path, **environment: str) -> str:
    """What a command prints; the test fails if it fails."""
    done = subprocess.run(
        [str(c) for c in command],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, f"{shlex.join(map(str, command))}\n{done.stdout[-2000:]}{done.stderr[-4000:]}"
    return done.stdout


def write(folder: Path, texts: Mapping[str, str]) -> None:
    """Put files into a folder."""
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")


def series_of(system, realisation, terms, static=()):
    """S_1 … S_terms of a system in a tower."""
    return hamilton_jacobi(system, realisation, terms, static).polynomial(terms)
