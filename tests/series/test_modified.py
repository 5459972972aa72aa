"""The modified Hamiltonian: closed forms, its first correction, its constancy along trajectories, and the
time-dependent Hamiltonian that generates the steps of all sizes.
"""

import math
from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from support import BODY, PreciseStep, compile_text, compiled, precisely, series_of, setting, solver, values

from phigen.compiler import compile_spec
from phigen.realisations import karasev
from phigen.scheme.discretisation import formal_alpha
from phigen.series.modified import FRACTION, modified_series
from phigen.symbolic.arrays import evaluate
from phigen.symbolic.symbols import ELAPSED
from phigen.symbolic.tower import rational

SWING = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: (q**2 + p**2)/2\n"


def modified(compilation, power, terms=None):
    system, realisation = compilation.system, compilation.realisation
    return modified_series(
        system.hamiltonian,
        formal_alpha(system, realisation, power + 1),
        system.coordinates,
        system.parameter_names,
        terms or compilation.order.terms,
        power,
        symmetric=realisation.symmetric,
    )


def arctangent(power):
    """Return the coefficients of h^0 … h^power in (2/h) arctan(h/2)."""
    return [Fraction((-1) ** (j // 2), (j + 1) * 2**j) if j % 2 == 0 else Fraction(0) for j in range(power + 1)]


def test_midpoint_rule_for_the_harmonic_oscillator():
    corrections = modified(compile_text(f"{SWING}order: 2\n"), 8)
    h = corrections.terms[0]
    for coefficient, term in zip(arctangent(8), corrections.terms, strict=True):
        assert term == h * corrections.tower.constant(coefficient)


def test_symplectic_euler_for_the_harmonic_oscillator():
    """The modified Hamiltonian is H̃ = arcsin(h/2)/(h/2)/√(1 − h²/4) (H ∓ h qp/2). Its level sets are the invariant
    ellipses of the method, and its factor gives the period of the orbits.
    """
    corrections = modified(compile_text(f"{SWING}order: 1\nbirealisation: canonical-euler\n"), 6)
    h = 0.3
    at = {"q": 0.7, "p": -0.4, FRACTION: 0.0}
    value = sum(
        h**j * float(evaluate([corrections.tower.expression(t)], at)[0]) for j, t in enumerate(corrections.terms)
    )
    factor = 2 / h * math.asin(h / 2) / math.sqrt(1 - h * h / 4)
    both = [factor * ((0.49 + 0.16) / 2 + sign * h / 2 * 0.7 * -0.4) for sign in (1, -1)]
    assert min(abs(value - b) for b in both) < 1e-6


def test_linear_hamiltonian_with_cayley():
    """For H = a·x, one step of the Cayley method rotates x about a by the angle 2 arctan(h|a|/2)."""
    text = BODY.replace("x1**2/2 + x2**2/4 + x3**2/6", "x1 + 2*x2 + 2*x3")
    corrections = modified(compile_text(f"{text}order: 2\nbirealisation: cayley\n"), 6)
    h = corrections.terms[0]
    for j, (coefficient, term) in enumerate(zip(arctangent(6), corrections.terms, strict=True)):
        assert term == h * corrections.tower.constant(coefficient * 3**j)


@pytest.mark.parametrize(("text", "terms"), [(BODY, 1), (BODY, 3), (SWING + "birealisation: canonical-euler\n", 2)])
def test_first_correction_is_minus_the_first_term_left_out(text, terms):
    compilation = compile_text(f"{text}terms: {terms}\n")
    power = compilation.order.order
    corrections = modified(compilation, power)
    series = series_of(compilation.system, compilation.realisation, power + 1)
    expected = {tuple(m)[:2]: rational(c) for m, c in (-series.terms[power]).to_dict().items()}
    assert {tuple(m)[:2]: rational(c) for m, c in corrections.terms[power].to_dict().items()} == expected
    assert all(t == 0 for t in corrections.terms[1:power])


@pytest.mark.thin(3)
@pytest.mark.parametrize(
    ("name", "order"),
    [
        ("rigid_body", 2),
        ("rigid_body", 4),
        ("pendulum", 2),
        ("lotka_volterra", 2),
        ("pendulum_euler", 1),
        ("sir_epidemic", 2),
    ],
)
def test_constant_to_higher_order_for_each_term(name, order):
    """The modified Hamiltonian Σ h^j H_j, truncated before the power m, varies along a trajectory by O(h^m)."""
    compilation = compile_spec(replace(compiled(name).spec, gauge="none"), order=order)
    at = setting(compilation)
    stride = 2 if compilation.realisation.symmetric else 1
    powers = [order + stride * k for k in range(3)]
    corrections = modified(compilation, powers[-1])
    integrator = solver(compilation, "c")
    speed = float(np.max(np.abs(integrator.vector_field(at.x, parameters=at.parameters))))
    h = min(20 * at.h, 0.2 * max(map(abs, at.x)) / speed)
    spreads = []
    for step in (h, h / 2):
        x = integrator.integrate(at.x, step, round(8 * h / step), parameters=at.parameters).x
        known = {**at.parameters, **{c: x[:, i] for i, c in enumerate(compilation.system.coordinates)}}
        terms = evaluate([corrections.tower.expression(t) for t in corrections.terms], known)
        sums = [sum(step**j * terms[j] for j in range(p)) for p in powers]
        spreads.append([np.ptp(s) / np.max(np.abs(s)) for s in sums])
    for power, coarse, fine in zip(powers, *spreads, strict=True):
        assert fine < 1e-14 or math.log2(coarse / fine) > power - 0.6, (power, coarse, fine)


def time_dependent(series, time):
    """Return ∂_tS_t(y) = Σ i t^(i−1) S_i(y), a function of y and t.

    At the y with α(y, ∇S_t(y)) = x, this is a Hamiltonian H_t(x). It generates the steps Φ_t: x ↦ β(y, ∇S_t(y)) of all
    sizes t: ∂_tΦ_t(x) = DΦ_t(x) π(x) ∇H_t(x). For the series without truncation, H_t = H. ``time`` is the name of the
    symbol t in the tower.
    """
    t, tower = series.tower.variable(time), series.tower
    return tower.expression(
        tower.combine([s * tower.constant(i) * t ** (i - 1) for i, s in enumerate(series.terms, 1)])
    )


@precisely
def test_time_dependent_hamiltonian_generates_the_steps_of_all_sizes():
    compilation = compile_text(f"{BODY}order: 2\n")
    series = series_of(compilation.system, compilation.realisation, 1, (ELAPSED,))
    function = time_dependent(series, ELAPSED)
    coordinates, t, width = compilation.system.coordinates, mpmath.mpf(1) / 5, mpmath.mpf(10) ** -12
    x = [mpmath.mpf(v) / 10 for v in (3, 9, -4)]

    def point(step, state):
        """Return the solution y of α(y, ∇S_t(y)) = state."""
        y = mpmath.matrix(state)
        for _ in range(12):
            alpha, _, d_alpha, _ = step._stages[0]._linearised(list(y))
            y -= mpmath.lu_solve(d_alpha, alpha - mpmath.matrix(state))
        return list(y)

    step = PreciseStep(compilation, {}, Fraction(1, 5))

    def hamiltonian(state):
        return values([function], {ELAPSED: t, **dict(zip(coordinates, point(step, state), strict=True))})[0]

    slope = mpmath.matrix(3, 1)
    for j in range(3):
        moved = [[v + sign * width * (i == j) for i, v in enumerate(x)] for sign in (1, -1)]
        slope[j] = (hamiltonian(moved[0]) - hamiltonian(moved[1])) / (2 * width)
    generated = step.tangent(x)[1] * step.poisson(x) * slope
    near = [PreciseStep(compilation, {}, Fraction(1, 5) + sign * Fraction(1, 10**12))(x) for sign in (1, -1)]
    velocity = (mpmath.matrix(near[0]) - mpmath.matrix(near[1])) / (2 * width)
    assert mpmath.norm(velocity - generated) < mpmath.mpf(10) ** -20


def test_paths_use_their_formal_series():
    compilation = compile_text(f"{BODY}order: 2\nbirealisation: karasev\n")
    assert compilation.realisation.kind == karasev.KIND
    exponential = compile_text(f"{BODY}order: 2\nbirealisation: exponential\n")
    mine, theirs = (modified(c, 4) for c in (compilation, exponential))
    known = {"x1": 0.3, "x2": 0.8, "x3": -0.5}
    for a, b in zip(mine.terms, theirs.terms, strict=True):
        left, right = (float(evaluate([m.tower.expression(t)], known)[0]) for m, t in ((mine, a), (theirs, b)))
        assert left == pytest.approx(right, rel=1e-13, abs=1e-16)
