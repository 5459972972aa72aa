"""The independent derivation of the series by sympy: closed forms, Karasev's paths, the axioms of α and β, and which
expressions it proves to be 0.
"""

from itertools import islice
from math import prod

import pytest
import sympy
from sympy import Abs, Matrix, Rational, cos, cosh, cot, exp, log, pi, sin, sinh, sqrt, symbols, tan, tanh

from phigen.series.reference import closed_form, generating_function, taylor
from phigen.series.reference_axioms import defects
from phigen.series.reference_functions import Functions, Sign, derivative
from phigen.series.reference_paths import paths, source_of_paths

x = symbols("x1:4", real=True)
p = symbols("p1:4", real=True)
s = sympy.Symbol("s")
HALF = Rational(1, 2)


def vector(*entries):
    return Matrix(entries)


def so3(m):
    """Return the matrix π(m) with π(m)p = m × p."""
    return Matrix([[0, -m[2], m[1]], [m[2], 0, -m[0]], [-m[1], m[0], 0]])


def log_canonical(m):
    return Matrix([[0, m[0] * m[1], m[0] * m[2]], [-m[0] * m[1], 0, m[1] * m[2]], [-m[0] * m[2], -m[1] * m[2], 0]])


def exponents(m, q):
    return [sum(m[i] * q[i] * ((j > i) - (i > j)) for i in range(3)) for j in range(3)]


def series(hamiltonian, source, coordinates, terms):
    return list(islice(generating_function(hamiltonian, source, coordinates), terms))


# -- the series S_1, S_2, …


def tangents(terms):
    """Return the coefficients of t … t^terms in 2 tan(t/2)."""
    t = sympy.Symbol("t")
    return [(2 * tan(t / 2)).series(t, 0, terms + 1).removeO().coeff(t, i) for i in range(1, terms + 1)]


def test_midpoint_rule_for_the_oscillator():
    (q, u), (a, b) = x[:2], p[:2]
    energy = (q**2 + u**2) / 2
    expansion = series(energy, closed_form([q - b / 2, u + a / 2], (a, b)), (q, u), 7)
    assert all(sympy.expand(S - c * energy) == 0 for S, c in zip(expansion, tangents(7), strict=True))


def test_linear_hamiltonian_on_so3():
    a = (1, 2, 2)
    energy = sum(ai * xi for ai, xi in zip(a, x, strict=True))
    v, m = vector(*p), vector(*x)
    cayley = m + v.cross(m) / 2 + v * v.dot(m) / 4
    expansion = series(energy, closed_form(list(cayley), p), x, 6)
    assert all(
        sympy.expand(S - c * 3**i * energy) == 0 for i, (S, c) in enumerate(zip(expansion, tangents(6), strict=True))
    )
    assert series(energy, source_of_paths(so3(x), x, p), x, 5) == [energy, 0, 0, 0, 0]


def test_log_canonical_series_of_a_sum():
    alpha = [xi * exp(u / 2) for xi, u in zip(x, exponents(x, p), strict=True)]
    expansion = series(sum(x), closed_form(alpha, p), x, 3)
    assert expansion[1] == 0
    assert sympy.expand(24 * expansion[2] - (x[0] + x[1]) * (x[0] + x[2]) * (x[1] + x[2])) == 0


@pytest.mark.parametrize("f", [exp, log, sqrt, lambda q: 1 / q, lambda q: tan(q) * pi, lambda q: Abs(q) * q])
def test_series_of_a_shift_is_a_taylor_expansion(f):
    """For H = f(q) + u and α = (q, u + a), S_t = F(q + t) − F(q) + tu with F′ = f."""
    (q, u), (a, b) = x[:2], p[:2]
    expansion = series(f(q) + u, closed_form([q, u + a], (a, b)), (q, u), 5)
    g = f(sympy.Symbol("g", positive=True))
    (at,) = g.free_symbols
    expected = [sympy.diff(g, at, i).subs(at, Rational(13, 11)) / sympy.factorial(i + 1) for i in range(5)]
    values = [S.subs({q: Rational(13, 11), u: 0}) for S in expansion]
    assert all(abs(sympy.N(v - e, 40)) < 1e-30 for v, e in zip(values, expected, strict=True))


def test_taylor_reaches_each_multi_index_once():
    f = x[0] ** 2 * x[1] + x[1] ** 3
    shift = {q: q + d for q, d in zip(x, p, strict=True)}
    taylor_sum = sum(c * prod(d**e for d, e in zip(p, mu, strict=True)) for mu, c in taylor(f, x, 3).items())
    assert sympy.expand(f.subs(shift, simultaneous=True) - taylor_sum) == 0


# -- Karasev's paths


def test_paths_of_linear_tensors_are_bernoulli_polynomials():
    """For a linear tensor π, Karasev's path is m(s) = Σ B_k(s)/k! M^k x with the Bernoulli polynomials B_k and Mx =
    π(x)p.
    """
    M = so3([-c for c in p])
    for k, part in enumerate(islice(paths(so3(x), x, p, s), 5), 1):
        expected = sympy.bernoulli(k, s) / sympy.factorial(k) * M**k * vector(*x)
        assert sympy.expand(vector(*part) - expected) == sympy.zeros(3, 1)


@pytest.mark.thin(2)
@pytest.mark.parametrize(
    "tensor",
    [so3(x), log_canonical(x), pytest.param((1 + x[0]) * so3(x), marks=pytest.mark.slow), exp(x[1]) * so3(x)],
)
def test_paths_satisfy_the_axioms(tensor):
    alpha, beta = (source_of_paths(tensor, x, p, end)(3) for end in (0, 1))
    assert list(defects(tensor, alpha, beta, x, p, 3)) == []


# -- axioms of α and β


def wrong_signs():
    w = exponents(x, p)
    yield log_canonical(x), [xi * exp(-wi / 2) for xi, wi in zip(x, w, strict=True)]
    yield log_canonical(x), [x[0] * exp(-w[0] / 2), x[1] * exp(w[1] / 2), x[2] * exp(w[2] / 2)]
    m, q = vector(*x), vector(*p)
    yield so3(x), list(m + q.cross(m) / 2 - q * q.dot(m) / 4)


@pytest.mark.parametrize(("tensor", "alpha"), list(wrong_signs()), ids=["all", "one of three", "quadratic part"])
def test_wrong_signs_violate_the_axioms(tensor, alpha):
    mirrored = [a.subs({q: -q for q in p}, simultaneous=True) for a in alpha]
    assert any(True for _ in defects(tensor, *(closed_form(m, p)(3) for m in (alpha, mirrored)), x, p, 3))


# -- proofs that an expression is 0

u, v = x[0], x[1]
ZEROS = [
    (u + v) ** 3 - u**3 - 3 * u**2 * v - 3 * u * v**2 - v**3,
    sin(u) ** 2 + cos(u) ** 2 - 1,
    tan(u) * cos(u) - sin(u),
    cot(u * v) * tan(u * v) - 1,
    cosh(u) ** 2 - sinh(u) ** 2 - 1,
    tanh(u) * cosh(u) - sinh(u),
    exp(u + v) - exp(u) * exp(v),
    exp(-u) * exp(u) - 1,
    exp(u - v) * exp(v) - exp(u),
    sqrt(u**2 + v**2) ** 3 - (u**2 + v**2) * sqrt(u**2 + v**2),
    (u**2 + v**2) ** Rational(-3, 2) * (u**2 + v**2) ** 2 - sqrt(u**2 + v**2),
    1 / (u - v) + 1 / (v - u),
    1 / (2 * u - 2 * v) - 1 / (u - v) / 2,
    u / (u + v) + v / (u + v) - 1,
    1 / (1 + sqrt(2)) - sqrt(2) + 1,
    sqrt(2 * u + 4 * v**2) - sqrt(2) * sqrt(u + 2 * v**2),
    1 / (4 + (u * Rational(2, 5) + v / 2) ** Rational(3, 2)) * (8 + 2 * (u * Rational(2, 5) + v / 2) ** Rational(3, 2))
    - 2,
    1 / (sqrt(u) + 1) - (sqrt(u) - 1) / (u - 1),
    log((u + v) ** 2 + 1) - log(u**2 + 2 * u * v + v**2 + 1),
    Abs(u * v - 1) ** 2 - (u * v - 1) ** 2,
    sympy.sign(u - v) + sympy.sign(v - u),
    u ** (v + 2) - u**v * u**2,
    u ** (-v) * u**v - 1,
    pi * (1 / pi) * u - u,
]


@pytest.mark.parametrize("e", ZEROS, ids=str)
def test_identities_are_proved(e):
    functions = Functions([e])
    assert functions.vanishes(functions.element(e))
    wrong = Functions([e, u])
    assert not wrong.vanishes(wrong.element(e) + wrong.element(u) * 2 - wrong.ring(1))


@pytest.mark.parametrize("e", [sin(u), exp(u) - 1 - u, sqrt(u**2 + 1) - u, tan(u) - u, Abs(u) - u, exp(2 * u) - exp(u)])
def test_what_is_not_zero_is_not_taken_for_it(e):
    functions = Functions([e])
    assert not functions.vanishes(functions.element(e))


def test_the_sign_has_no_derivative():
    assert derivative(Abs(u) * v, u) == Sign(u) * v
    assert derivative(derivative(Abs(u**2 - log(v)), v), v) == Sign(u**2 - log(v)) / v**2
    assert Sign(v - u) == -Sign(u - v)


def test_even_terms_are_zero_without_simplification():
    """The even terms are the number 0 before any relations between functions are used. Otherwise they would be large
    expressions equal to 0, which would enter all later terms.
    """
    (q, w), (a, b) = x[:2], p[:2]
    energy = w**2 / (1 + sqrt(q**2 + 1) ** 3) + Abs(q) * tan(w)
    expansion = series(energy, closed_form([q - b / 2, w + a / 2], (a, b)), (q, w), 4)
    assert (expansion[1], expansion[3]) == (0, 0)
    assert expansion[2] != 0
