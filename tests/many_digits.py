"""A one-step map of the scheme in many digits, which uses nothing of phigen.scheme and phigen.targets."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache, partial
from typing import Any

import mpmath

from phigen.compilation import Compilation
from phigen.series.hamilton_jacobi import graph_series
from phigen.symbolic.expression import Expression, derivatives, gradient, number, topological, total

DIGITS = 50


def precisely(function: Callable[..., Any]) -> Callable[..., Any]:
    """Decorator: run the function with `DIGITS` digits of mpmath."""

    def wrapped(*args: Any, **kwargs: Any) -> Any:
        with mpmath.workdps(DIGITS):
            return function(*args, **kwargs)

    wrapped.__name__, wrapped.__doc__ = function.__name__, function.__doc__
    return wrapped


def values(roots: Sequence[Expression], at: Mapping[str, Any]) -> list[Any]:
    """Return the values of expressions as mpmath numbers of the current precision; the functions are computed by
    `_RULES`, not by code of phigen.
    """
    plan, ends = _plan(tuple(roots))
    results: list[Any] = []
    for rule, places in plan:
        results.append(mpmath.mpf(at[rule]) if isinstance(rule, str) else rule(*[results[i] for i in places]))
    return [results[i] for i in ends]


@lru_cache(maxsize=1024)
def _plan(roots: tuple[Expression, ...]) -> tuple[list[tuple[Any, tuple[int, ...]]], list[int]]:
    """Return the nodes of the expressions in the order of their evaluation, each as its rule and the positions of its
    arguments, and the positions of the roots.

    The result is cached, because the vector field of a path is evaluated thousands of times.
    """
    places: dict[Expression, int] = {}
    plan = []
    for node in topological(roots):
        plan.append((_rule(node), tuple(places[a] for a in node.args)))
        places[node] = len(places)
    return plan, [places[root] for root in roots]


def _rule(e: Expression) -> Any:
    """Return the name if the node is a symbol, otherwise the function that computes its value from the values of its
    arguments.
    """
    if e.op == "symbol":
        return e.value
    if e.op == "number":
        return lambda: mpmath.mpf(e.value.numerator) / e.value.denominator
    if e.op == "pow" and e.value.denominator == 1:
        return lambda s: s ** int(e.value)
    if e.op == "pow":
        return lambda s: mpmath.power(s, mpmath.mpf(e.value.numerator) / e.value.denominator)
    return _RULES.get(e.op) or getattr(mpmath, e.op)


def _entire(name: str, s: Any) -> Any:
    """Return cos √s, sin(√s)/√s, (√s − sin √s)/√s³, (e^s − 1)/s, or the derivative of such a function if ``name`` ends
    with 1. Complex arithmetic allows one formula for both signs of s.
    """

    def closed(z: Any) -> Any:
        root = mpmath.sqrt(z)
        if name.startswith("exprel"):
            return (mpmath.exp(z) - 1) / z
        if name.startswith("arcroot"):
            return (root - mpmath.sin(root)) / root**3
        return mpmath.cos(root) if name == "cosroot" else mpmath.sin(root) / root

    return mpmath.re(mpmath.diff(closed, mpmath.mpc(s)) if name.endswith("1") else closed(mpmath.mpc(s)))


def _phi(order: int, s: Any) -> Any:
    """Return φ(s) = (1 − w cot w)/s with w = √s/2, or its derivative of the given order: for |s| ≤ 12 from the Taylor
    coefficients 2ζ(2n+2)/(4π²)^(n+1).
    """
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


def _anomaly(t: Any, r: Any, eta: Any, beta: Any, mu: Any, _spin: Any) -> Any:
    """Return the universal anomaly of a Kepler motion, as the root of its equation."""

    def residual(s: Any) -> Any:
        z = beta * s**2
        g2 = (1 - _entire("cosroot", z)) / beta
        return r * s * _entire("sinroot", z) + eta * g2 + mu * s**3 * _entire("arcroot", z) - t

    high = t / r
    while residual(high) * t < 0:
        high *= 2
    return mpmath.findroot(residual, (high / 10**9, high), solver="anderson")


def _amplitude(t: Any, p: Any, r: Any) -> Any:
    """Return tan(φ/4)/√p, where φ is the Jacobi amplitude am(√p t) for the parameter 1 − r/p."""
    sn, cn = (mpmath.ellipfun(name, mpmath.sqrt(p) * t, m=1 - r / p) for name in ("sn", "cn"))
    return mpmath.tan(mpmath.atan2(sn, cn) / 4) / mpmath.sqrt(p)


def _amplitude_integral(kind: str, t: Any, p: Any, r: Any) -> Any:
    """Return the integral over u from 0 to t of sn(√p u)²/p if ``kind`` is sn, or of sd(√p u)²/p if it is sd. Jacobi's
    functions have the parameter 1 − r/p.
    """

    def integrand(u: Any) -> Any:
        return mpmath.ellipfun(kind, mpmath.sqrt(p) * u, m=1 - r / p) ** 2 / p

    return mpmath.quad(integrand, mpmath.linspace(0, t, 9))


def _third(t: Any, p: Any, r: Any, n: Any) -> Any:
    """Return the integral of S²/(1 − n S²) over u from 0 to t, where S = sn(√p u)/√p with the parameter 1 − r/p."""

    def integrand(u: Any) -> Any:
        square = mpmath.ellipfun("sn", mpmath.sqrt(p) * u, m=1 - r / p) ** 2 / p
        return square / (1 - n * square)

    return mpmath.quad(integrand, mpmath.linspace(0, t, 9))


def _companion(coefficients: Any) -> Any:
    """Return the matrix of the multiplication by x modulo xⁿ − Σ c_k x^k."""
    matrix = mpmath.matrix(len(coefficients))
    for k, c in enumerate(coefficients):
        matrix[k, len(coefficients) - 1] = c
        if k:
            matrix[k, k - 1] = 1
    return matrix


def _remainder(k: int, t: Any, *a: Any) -> Any:
    """Return the coefficient of x^k in the remainder of e^{tx} − 1 on division by p = x⁴ − Σ a_j x^j."""
    return mpmath.expm(t * _companion(a))[k, 0] - (k == 0)


def _quotient(k: int, t: Any, *a: Any) -> Any:
    """Return the coefficient of x^k in g, defined by: (e^{tx} mod p²) = (e^{tx} mod p) + p·g, with p = x⁴ − Σ
    a_j x^j.
    """
    square = [
        -sum((p[i] * p[n - i] for i in range(5) if 0 <= n - i < 5), mpmath.mpf(0))
        for p in [[*(-c for c in a), mpmath.mpf(1)]]
        for n in range(8)
    ]
    column = mpmath.expm(t * _companion(square))[:, 0]
    g = [mpmath.mpf(0)] * 4
    for n in (3, 2, 1, 0):
        g[n] = column[4 + n] + sum((a[4 + n - m] * g[m] for m in range(n + 1, 4)), mpmath.mpf(0))
    return g[k]


_RULES: dict[str, Callable[..., Any]] = {
    "add": operator.add,
    "sub": operator.sub,
    "neg": operator.neg,
    "mul": operator.mul,
    "abs": abs,
    "power": mpmath.power,
    "choose": lambda a, b, c: b if a > 0 else c,
    "pi": lambda: +mpmath.pi,
    "E": lambda: +mpmath.e,
    "versin": lambda s: 1 - mpmath.cos(s),
    "tanhalf": lambda s, v: s / (2 - v),
    "inv": lambda s: 1 / s if s > 0 else mpmath.nan,
    "inv0": lambda s: 1 / s if s > 0 else mpmath.mpf(0),
    **{f"phi{order}": partial(_phi, order) for order in range(3)},
    "anomaly": _anomaly,
    "amplitude": _amplitude,
    "amplitude1": partial(_amplitude_integral, "sn"),
    "amplitude3": _third,
    "amplitude2": partial(_amplitude_integral, "sd"),
    **{f"exprem{k}": partial(_remainder, k) for k in range(4)},
    **{f"expquo{k}": partial(_quotient, k) for k in range(4)},
    **{
        name: partial(_entire, name)
        for name in ("cosroot", "sinroot", "sinroot1", "arcroot", "arcroot1", "exprel", "exprel1")
    },
}


def in_many_digits(function: str, s: float) -> Any:
    """Return the value at s of a function that expressions may contain, in the current precision of mpmath."""
    rule = _RULES.get(function) or getattr(mpmath, function)
    return rule(mpmath.mpf(s))


class PreciseStep:
    """One-step map in many digits. ``step(x)`` is the next state; ``defect(x)`` measures the deviation from a Poisson
    map at x.

    The map uses only the bi-realisation (α, β) and the series S_h: Newton's method solves α(y, ∇S_h(y)) = x, then the
    next state is β(y, ∇S_h(y)). The tangent map comes from implicit differentiation. For steps along paths see
    precise_path.py.
    """

    def __init__(self, compilation: Compilation, parameters: Mapping[str, float], h: float) -> None:
        self.n, self._poisson = compilation.system.dimension, [e for row in compilation.system.poisson for e in row]
        self.coordinates, self._parameters = compilation.system.coordinates, dict(parameters)
        fractions = compilation.program.fractions
        self._stages = [_Stage(compilation, parameters, Fraction(f) * Fraction(h)) for f in fractions]

    @precisely
    def __call__(self, x: Sequence[Any]) -> list[Any]:
        """Return Φ(x), the state after one step from x."""
        for stage in self._stages:
            x = stage.solve(x)
        return list(x)

    def poisson(self, x: Sequence[Any]) -> Any:
        """Return the Poisson matrix π(x)."""
        at = {**self._parameters, **dict(zip(self.coordinates, x, strict=True))}
        return _columns(values(self._poisson, at), self.n, self.n).T

    @precisely
    def tangent(self, x: Sequence[Any]) -> tuple[list[Any], Any]:
        """Return Φ(x), the state after one step from x, and the tangent map DΦ(x)."""
        product = mpmath.eye(self.n)
        for stage in self._stages:
            x, tangent = stage.solve_with_tangent(x)
            product = tangent * product
        return list(x), product

    @precisely
    def defect(self, x: Sequence[Any]) -> float:
        """Return the largest entry of DΦ π DΦᵀ − π∘Φ at x relative to that of π∘Φ; it is 0 for a Poisson map."""
        image, tangent = self.tangent(x)
        return relative_defect(tangent, self.poisson(x), self.poisson(image))


class _Stage:
    def __init__(self, compilation: Compilation, parameters: Mapping[str, float], h: Fraction) -> None:
        realisation, self.coordinates = compilation.realisation, compilation.system.coordinates
        self.n, self._parameters = len(self.coordinates), dict(parameters)
        slope = _slope(compilation, h)
        hessian = [d for c in self.coordinates for d in derivatives(slope, c)]  # the Hessian, by columns
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
        """Solve α(y, ∇S_h(y)) = x for y; return β and the derivatives of α and β along y at the solution."""
        y, x = mpmath.matrix(list(x)), mpmath.matrix(list(x))
        for _ in range(60):
            alpha, beta, d_alpha, d_beta = self._linearised(list(y))
            delta = mpmath.lu_solve(d_alpha, alpha - x)
            if mpmath.norm(delta, mpmath.inf) <= mpmath.norm(y, mpmath.inf) * mpmath.mpf(10) ** (4 - DIGITS):
                return beta, d_alpha, d_beta
            y -= delta
        raise ArithmeticError("Newton's method for the step does not converge")

    def solve(self, x: Sequence[Any]) -> list[Any]:
        return list(self._solved(x)[0])

    def solve_with_tangent(self, x: Sequence[Any]) -> tuple[list[Any], Any]:
        beta, d_alpha, d_beta = self._solved(x)
        return list(beta), d_beta * mpmath.inverse(d_alpha)


def _slope(compilation: Compilation, h: Fraction) -> list[Expression]:
    """Return expressions for the gradient of the generating function S_h, with a number as the step size h."""
    # The stages of a composition are steps of order 2, which need S_1 only.
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
    """Return the largest entry of T π(x) Tᵀ − π(x') relative to that of π(x'), where T is the tangent map from
    x to x'.
    """
    return float(_largest(tangent * before * tangent.T - after) / _largest(after))


def _largest(matrix: Any) -> Any:
    return max(abs(e) for e in matrix)


@precisely
def tangent_by_differences(step: Callable[[Sequence[Any]], Sequence[Any]], x: Sequence[Any]) -> Any:
    """Return the derivative of a map by central differences. If the map is given in many digits, at least a third of
    them are correct.
    """
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
    """Return the largest entry of DΦ π DΦᵀ − π∘Φ relative to that of π∘Φ at x, for any map Φ; DΦ is computed by
    differences in many digits.
    """
    return relative_defect(tangent_by_differences(step, x), poisson(x), poisson(step(x)))
