"""The exponential bi-realisation: closed forms found from structure constants, in any basis, with parameters and
cocycles.
"""

from dataclasses import replace
from fractions import Fraction

import mpmath
import pytest
from geometry.building import family, system, typed
from support import series_of, slow_but

from phigen.errors import SpecError
from phigen.geometry.system import hamiltonian_vector_field
from phigen.realisations import exponential
from phigen.realisations.axioms import check
from phigen.realisations.catalogue import realise
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.expression import call, gradient, number, symbol, symbols_of, total
from phigen.symbolic.numeric import evaluate_precisely
from phigen.symbolic.symbols import momentum
from phigen.symbolic.verdict import PROVED, REFUTED, decide_zero

CAYLEY, EXPONENTIAL = BirealisationChoice("cayley"), BirealisationChoice("exponential")
NAMED = [("so", 3), ("so", 4), ("sl", 2), ("gl", 2), ("se", 2), ("se", 3), ("aff", 1), ("heisenberg", 2), ("su", 2)]


def verdicts(s, realisation):
    return [statement.verdict for statement in check(s, realisation)]


@pytest.mark.parametrize("sign", slow_but([-1], [1, -1]))
@pytest.mark.parametrize(("name", "size"), NAMED)
def test_axioms_are_proved_for_the_named_algebras(name, size, sign):
    s = typed(family(name, size, sign))
    realisation = realise(s, EXPONENTIAL)
    assert realisation.symmetric
    assert not realisation.path
    assert verdicts(s, realisation) == [PROVED] * 5


@pytest.mark.parametrize(
    ("coordinates", "brackets", "form"),
    [
        ("x y z", "{x: {y: a*z, z: -b*y}, y: {z: c*x}}", "φ(s)"),  # so(3) or sl(2), by the signs of a, b, c
        ("x y z", "{x: {y: a*y, z: -a*z}}", "φ(s)"),  # se(1, 1)
        ("x y z", "{x: {y: sqrt(a)*z, z: -y}}", "φ(s)"),  # se(2), a function of a parameter
        ("j u v z", "{j: {u: v, v: -u}, u: {v: z}}", "φ(s)"),  # the oscillator algebra
        ("x y z w", "{x: {y: z, z: w}}", "finite sum of 2 terms"),  # the Engel algebra
        ("a1 b1 c1 d1 e1", "{a1: {b1: c1, c1: d1, d1: e1}}", "finite sum of 2 terms"),  # a filiform algebra
        ("x y z", "{x: {y: z + b}}", "no even part"),  # this bracket and the next ones are affine, not linear
        ("x y z", "{x: {y: z + b, z: -y}, y: {z: x}}", "φ(s)"),
        ("q p x y z", "{q: {p: 1}, x: {y: -z, z: y}, y: {z: -x}}", "φ(s)"),
        ("x y z u v w", "{x: {y: z + 1, z: -y}, y: {z: x}, u: {v: w + 1, w: -v}, v: {w: u}}", "φ(s)"),
        ("w1 w2 n a1 a2", "{w1: {n: w2}, w2: {n: -w1}, a1: {a2: b}}", "φ(s)"),
    ],
)
def test_closed_forms_are_found_with_parameters_and_cocycles(coordinates, brackets, form):
    s = system(coordinates, f"{{brackets: {brackets}}}", extra="parameters: {a: 1, b: 2, c: 3}")
    realisation = realise(s)
    assert realisation.kind == "exponential"
    assert form in realisation.explanation
    assert verdicts(s, realisation) == [PROVED] * 5
    assert verdicts(s, realise(s, EXPONENTIAL)) == [PROVED] * 5


@pytest.mark.parametrize(("name", "size"), NAMED)
def test_increment_is_the_hamiltonian_vector_field_of_the_covector(name, size):
    s = family(name, size)
    realisation = realise(s, EXPONENTIAL)
    momenta = [symbol(n) for n in realisation.covector]
    expected = hamiltonian_vector_field(s.poisson, momenta)
    assert all((a - b).is_zero for a, b in zip(realisation.increment, expected, strict=True))


def test_so3_is_the_formula_of_the_mathematics_page():
    s = family("so", 3, -1)  # π(x)v = x × v
    x = [symbol(c) for c in s.coordinates]
    p = [symbol(momentum(c)) for c in s.coordinates]

    def cross(u, v):
        return [u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3] for i in range(3)]

    phi = call("phi0", total(v**2 for v in p))
    residuals = [
        ("", a - (xi + once / 2 + phi * twice))
        for a, xi, once, twice in zip(realise(s, EXPONENTIAL).alpha, x, cross(p, x), cross(p, cross(p, x)), strict=True)
    ]
    assert decide_zero("α = x + ½ p×x + φ(|p|²) p×(p×x)", residuals).verdict == PROVED


def test_so4_is_split_into_its_ideals_over_the_rationals():
    realisation = realise(family("so", 4), EXPONENTIAL)
    assert "φ(s)" in realisation.explanation
    assert "phi1" not in str(realisation.alpha)


@pytest.mark.parametrize(("name", "size"), [("so", 3), ("sl", 2), ("se", 3), ("so", 4), ("aff", 1)])
def test_alpha_is_the_series_of_b_at_a_point(name, size):
    # The expected value is the series Σ B_k M^k x/k! with Bernoulli numbers B_k and Mx = π(x)p, in 40 digits.
    s = family(name, size)
    n = s.dimension
    point = {c: Fraction(3 * i + 1, 7) for i, c in enumerate(s.coordinates)}
    covector = {momentum(c): Fraction((-1) ** i * (i + 1), 9) for i, c in enumerate(s.coordinates)}
    values = evaluate_precisely(realise(s, EXPONENTIAL).alpha, point | covector, 40)
    with mpmath.workdps(40):
        rows = [[mpmath.mpf(0)] * n for _ in range(n)]
        for i in range(n):
            for j in range(n):
                for k, c in s.lie_algebra.bracket(i, j).items():
                    v = c.value * covector[momentum(s.coordinates[j])]
                    rows[i][k] += mpmath.mpf(v.numerator) / v.denominator
        m = mpmath.matrix(rows)
        power = mpmath.matrix([mpmath.mpf(v.numerator) / v.denominator for v in point.values()])
        expected = power.copy()
        for k in range(1, 80):
            power = m * power
            # Add the term of degree k; mpmath has B_1 = −½, as the series needs.
            expected += (mpmath.bernoulli(k) / mpmath.factorial(k)) * power
        for a, b in zip(values, expected, strict=True):
            assert abs(mpmath.mpf(str(a)) - b) < 1e-24


@pytest.mark.parametrize(("name", "size"), [("so", 3), ("se", 3), ("sl", 2), ("heisenberg", 1)])
def test_linear_hamiltonians_are_generated_exactly(name, size):
    s = family(name, size)
    linear = replace(s, hamiltonian=total((i + 1) * symbol(c) for i, c in enumerate(s.coordinates)))
    series = series_of(linear, realise(linear, EXPONENTIAL), 7)
    assert [series.tower.is_zero(term) for term in series.terms] == [False] + [True] * 6


def test_cayley_and_exponential_are_different_realisations_of_one_tensor():
    s = family("so", 3, -1)
    energy = total(symbol(c) ** 2 * number(Fraction(1, i + 2)) for i, c in enumerate(s.coordinates))
    s = replace(s, hamiltonian=energy)
    expansions = []
    for choice in (CAYLEY, EXPONENTIAL):
        realisation = realise(s, choice)
        assert verdicts(s, realisation) == [PROVED] * 5
        series = series_of(s, realisation, 4)
        assert series.tower.is_zero(series.terms[1])
        assert series.tower.is_zero(series.terms[3])
        expansions.append(series.tower.expression(series.terms[2]))
    # Both S_3 would vanish for an H that is constant on coadjoint orbits. For this H they differ, and so do their
    # Hamiltonian vector fields.
    fields = [hamiltonian_vector_field(s.poisson, gradient(e, s.coordinates)) for e in expansions]
    residuals = [("", a - b) for a, b in zip(*fields, strict=True)]
    assert decide_zero("the same S_3", residuals).verdict == REFUTED


@pytest.mark.parametrize("factor", [-1, 2])
def test_a_wrong_quadratic_term_is_refuted(factor):
    s = family("so", 3)
    realisation = realise(s, EXPONENTIAL)
    half = number(Fraction(1, 2))
    curvature = [d + half * m for d, m in zip(realisation.displacement, realisation.increment, strict=True)]
    wrong = replace(
        realisation,
        alpha=tuple(a + (factor - 1) * c for a, c in zip(realisation.alpha, curvature, strict=True)),
        beta=tuple(b + (factor - 1) * c for b, c in zip(realisation.beta, curvature, strict=True)),
        displacement=tuple(d + (factor - 1) * c for d, c in zip(realisation.displacement, curvature, strict=True)),
    )
    assert verdicts(s, wrong)[1:4] == [REFUTED] * 3


def test_a_nonlinear_tensor_is_refused():
    with pytest.raises(SpecError, match="needs a linear or affine π; this π is log-canonical"):
        realise(system("x y", "{brackets: {x: {y: x*y}}}"), EXPONENTIAL)


@pytest.mark.parametrize(("name", "size"), [("sl", 3), ("so", 5)])
def test_without_a_closed_form_the_path_is_followed(name, size):
    s = family(name, size)
    assert exponential.closed_form(s) is None
    realisation = realise(s, EXPONENTIAL)
    assert realisation.path
    assert realisation.kind == "exponential"


def test_auto_says_why_it_prefers_what():
    assert "preferred to the Cayley transform" in realise(family("so", 3)).explanation
    assert "no closed form" in realise(family("so", 5)).explanation
    assert realise(family("so", 5)).kind == "cayley"
    assert "no Cayley transform either" in realise(family("sl", 3)).explanation


def test_blocks_stay_apart():
    s = system("x y z u v w", "{brackets: {x: {y: -z, z: y}, y: {z: -x}, u: {v: w}}}")
    realisation = realise(s)
    for d in realisation.displacement[:3]:
        assert set(symbols_of(d)) <= {*"xyz", momentum("x"), momentum("y"), momentum("z")}
    assert realisation.displacement[5].is_zero
