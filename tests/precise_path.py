"""A step of Karasev's scheme in many digits, with its tangent map. It uses neither a series of the path nor anything of
phigen.scheme.

The path ṁ = π(m)p, its mean and the variational equations are integrated by extrapolation of the explicit midpoint
rule. Newton's method solves the equation p = ∇S_h(mean), and the tangent map follows by implicit differentiation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import mpmath
from support import RawC, Setting, relative_defect, spec_of, values

from phigen import spec
from phigen.compilation import Compilation
from phigen.compiler import compile_spec
from phigen.realisations import karasev
from phigen.series.hamilton_jacobi import graph_series
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.expression import derivatives, gradient, number, symbol, total
from phigen.symbolic.symbols import Symbol, momentum

PATH_DIGITS = 30

#: Symbol for the step size of one stage of a composition.
STAGE = Symbol("h", "stage")


@cache
def by_paths(name: str, order: int | None = None) -> Compilation:
    """Compile a system of the corpus with the bi-realisation karasev, instead of the one in its spec."""
    return with_paths(spec_of(name), order)


def with_paths(specification: spec.Spec, order: int | None = None, composition: str = "auto") -> Compilation:
    """Compile a spec with the bi-realisation karasev."""
    chosen = replace(specification, birealisation=BirealisationChoice("karasev"), composition=composition, gauge="none")
    return compile_spec(chosen, order=order)


@cache
def compile_paths(text: str, order: int | None = None, composition: str = "auto") -> Compilation:
    """Compile a spec, given as YAML without its first two keys, with the bi-realisation karasev."""
    return with_paths(spec.loads(f"phigen: 1\nname: t\n{text}"), order, composition)


def numbers(compilation: Compilation, run: str) -> Setting:
    """Return the initial state, step size and parameters of a run of the spec."""
    run_of_spec, parameters = compilation.spec.runs[run], {p.name: float(p.value) for p in compilation.spec.parameters}
    parameters |= {k: float(v) for k, v in run_of_spec.parameters.items()}
    return Setting(tuple(float(v) for v in run_of_spec.initial), float(run_of_spec.step), parameters)


def state_of(raw: RawC) -> list[Any]:
    """Return the state of a C solver plus its compensation terms, in many digits."""
    return [mpmath.mpf(float(x)) + mpmath.mpf(float(c)) for x, c in zip(raw.x, raw.carry, strict=True)]


def flow_at_one(field: Callable[[list[Any]], list[Any]], start: Sequence[Any]) -> list[Any]:
    """Return the flow of a vector field at time 1, by extrapolation of the explicit midpoint rule. The time is divided
    into 1, 2, 4, … intervals, until in each interval two successive columns of the extrapolation agree.
    """
    pieces, target = 1, mpmath.mpf(10) ** (6 - mpmath.mp.dps)
    while pieces <= 1024:
        state, good = list(start), True
        for _ in range(pieces):
            extrapolated = _extrapolate(field, state, mpmath.mpf(1) / pieces, target)
            if extrapolated is None:
                good = False
                break
            state = extrapolated
        if good:
            return state
        pieces *= 2
    raise ArithmeticError("the path needs more than 1024 intervals")


def _extrapolate(field: Callable[[list[Any]], list[Any]], state: list[Any], big: Any, target: Any) -> list[Any] | None:
    table: list[list[Any]] = []
    slope = field(state)
    for row in range(14):
        count = 2 * (row + 1)
        h = big / count
        before, now = state, [s + h * f for s, f in zip(state, slope, strict=True)]
        for _ in range(count - 1):
            before, now = now, [b + 2 * h * f for b, f in zip(before, field(now), strict=True)]
        new = [now]
        for k in range(row):
            ratio = (mpmath.mpf(count) / (2 * (row - k))) ** 2 - 1
            new.append([a + (a - b) / ratio for a, b in zip(new[k], table[k], strict=True)])
        table = new
        if row >= 3:
            scale = max(abs(v) for v in new[-1])
            if max(abs(a - b) for a, b in zip(new[-1], new[-2], strict=True)) <= target * scale:
                return new[-1]
    return None


class PreciseSystem:
    """A Poisson system in many digits: values of π, and solutions of the equation ṁ = π(m)p of a path."""

    def __init__(self, compilation: Compilation, parameters: Mapping[str, float]) -> None:
        system = compilation.system
        self.system, self.coordinates, self.n = system, system.coordinates, len(system.coordinates)
        self.parameters = dict(parameters)
        n, covector = self.n, [momentum(c) for c in self.coordinates]
        slopes = [total(system.poisson[i][j] * symbol(covector[j]) for j in range(n)) for i in range(n)]
        columns = [derivatives(slopes, c) for c in self.coordinates]
        self._covector = covector
        self._slopes = slopes
        self._linearised = [*slopes, *(columns[j][i] for i in range(n) for j in range(n)), *_flat(system.poisson)]

    def at(self, x: Sequence[Any], p: Sequence[Any] = ()) -> dict[str, Any]:
        """Return the values of all symbols: parameters, coordinates and, if given, covector."""
        pairs = [*zip(self.coordinates, x, strict=True), *(zip(self._covector, p, strict=True) if p else ())]
        return {**self.parameters, **dict(pairs)}

    def poisson(self, x: Sequence[Any]) -> Any:
        """Return the Poisson matrix π(x)."""
        return mpmath.matrix(self.n, self.n) + _square(values(_flat(self.system.poisson), self.at(x)), self.n)

    def path(self, x: Sequence[Any], p: Sequence[Any]) -> tuple[list[Any], list[Any]]:
        """Return the end and the mean of the path ṁ = π(m)p, m(0) = x, over the time from 0 to 1."""
        n = self.n

        def field(state: list[Any]) -> list[Any]:
            return [*values(self._slopes, self.at(state[:n], list(p))), *state[:n]]

        state = flow_at_one(field, [*x, *[mpmath.mpf(0)] * n])
        return state[:n], state[n:]

    def varied(self, x: Sequence[Any], p: Sequence[Any]) -> tuple[list[Any], list[Any], Any, Any, Any, Any]:
        """Return the end m and the mean μ of the path, and the matrices ∂m/∂x, ∂m/∂p, ∂μ/∂x, ∂μ/∂p."""
        n = self.n

        def field(state: list[Any]) -> list[Any]:
            both = values(self._linearised, self.at(state[:n], list(p)))
            jacobian, pi = _square(both[n : n + n * n], n), _square(both[n + n * n :], n)
            by_x, by_p = _square(state[2 * n : 2 * n + n * n], n), _square(state[2 * n + n * n : 2 * n + 2 * n * n], n)
            return [
                *both[:n],
                *state[:n],
                *(jacobian * by_x),
                *(jacobian * by_p + pi),
                *state[2 * n : 2 * n + 2 * n * n],
            ]

        zeros = [mpmath.mpf(0)] * (n * n)
        state = flow_at_one(field, [*x, *zeros[:n], *mpmath.eye(n), *zeros, *zeros, *zeros])
        blocks = [_square(state[2 * n + k * n * n : 2 * n + (k + 1) * n * n], n) for k in range(4)]
        return state[:n], state[n : 2 * n], blocks[0], blocks[1], blocks[2], blocks[3]


class PrecisePathStep(PreciseSystem):
    """One step, with one or several stages: ``step(x)`` returns Φ(x), ``step.solve(x)`` returns Φ(x) and DΦ(x)."""

    def __init__(self, compilation: Compilation, parameters: Mapping[str, float], h: float) -> None:
        super().__init__(compilation, parameters)
        fractions = compilation.program.fractions
        terms = compilation.order.terms if len(fractions) == 1 else 1
        system = compilation.system
        alpha = karasev.series(system, max(terms - 1, 1))
        series = graph_series(system.hamiltonian, alpha, self.coordinates, terms, symmetric=True)
        self.parameters[STAGE] = mpmath.mpf(0)
        s = total(_power(i + 1) * term for i, term in enumerate(series))
        slope = gradient(s, self.coordinates)
        hessian = [d for c in self.coordinates for d in derivatives(slope, c)]  # symmetric: rows = columns
        self._momenta = [*slope, *hessian]
        # The solver multiplies h by the fraction of the stage in double precision, but this step in many digits.
        self.steps = [mpmath.mpf(h) * mpmath.mpf(f) for f in fractions]

    def _generate(self, mean: Sequence[Any]) -> tuple[Any, Any]:
        generated = values(self._momenta, self.at(mean))
        return mpmath.matrix(generated[: self.n]), _square(generated[self.n :], self.n)

    def __call__(self, x: Sequence[Any]) -> list[Any]:
        """Return Φ(x), the state after one step from x."""
        with mpmath.workdps(PATH_DIGITS):
            state = [mpmath.mpf(v) for v in x]
            for h in self.steps:
                p = self._covector_of(state, h)
                state = self.path(state, list(p))[0]
            return state

    def _covector_of(self, x: list[Any], h: Any) -> Any:
        """Return the solution p of p = ∇S_h(mean). The Newton iteration keeps the matrix of the first point while the
        residual halves at least.
        """
        self.parameters[STAGE] = h
        slope, hessian = self._generate(x)
        inverse = mpmath.inverse(mpmath.eye(self.n) - hessian * self.poisson(x) / 2)
        p, last = slope, mpmath.inf
        for _ in range(80):
            residual = p - self._generate(self.path(x, list(p))[1])[0]
            size = mpmath.norm(residual, mpmath.inf)
            if size <= mpmath.mpf(10) ** (8 - PATH_DIGITS) * (mpmath.norm(p, mpmath.inf) + mpmath.eps):
                return p
            if size > last / 2:  # slow convergence: use the exact Newton matrix
                by_p = self.varied(x, list(p))[5]
                inverse = mpmath.inverse(mpmath.eye(self.n) - self._generate(self.path(x, list(p))[1])[1] * by_p)
            last = size
            p = p - inverse * residual
        raise ArithmeticError("Newton's method for the covector does not converge")

    def solve(self, x: Sequence[Any]) -> tuple[list[Any], Any]:
        """Return Φ(x), the state after one step from x, and the tangent map DΦ(x)."""
        with mpmath.workdps(PATH_DIGITS):
            state, tangent = [mpmath.mpf(v) for v in x], mpmath.eye(self.n)
            for h in self.steps:
                p = self._covector_of(state, h)
                end, mean, m_x, m_p, mean_x, mean_p = self.varied(state, list(p))
                hessian = self._generate(mean)[1]
                p_x = mpmath.inverse(mpmath.eye(self.n) - hessian * mean_p) * hessian * mean_x
                state, tangent = end, (m_x + m_p * p_x) * tangent
            return state, tangent

    def defect(self, x: Sequence[Any]) -> float:
        """Return the largest entry of DΦ π DΦᵀ − π∘Φ at x relative to that of π∘Φ; it is 0 for a Poisson map."""
        with mpmath.workdps(PATH_DIGITS):
            image, tangent = self.solve(x)
            return relative_defect(tangent, self.poisson(x), self.poisson(image))


def _power(exponent: int) -> Any:
    step = symbol(STAGE)
    result = number(Fraction(1))
    for _ in range(exponent):
        result = result * step
    return result


def _flat(matrix: Sequence[Sequence[Any]]) -> list[Any]:
    return [e for row in matrix for e in row]


def _square(entries: Sequence[Any], n: int) -> Any:
    result = mpmath.matrix(n, n)
    for k, e in enumerate(entries):
        result[k // n, k % n] = e
    return result
