"""The Hamilton–Jacobi series: closed forms, parity, comparison with sympy, and agreement of its two representations, by
polynomials and by graphs.
"""

from fractions import Fraction
from itertools import product

import mpmath
import pytest
import sympy
from clock import processor_seconds_below
from support import BODY, NAMES, SPECIES, compile_text, compiled, described, series_of, slow_but, symbols, values

from phigen.series.hamilton_jacobi import graph_series, polynomial_series, residual
from phigen.symbolic.expression import ONE, PI, ZERO, Expression, call, number, power, sqrt, symbol
from phigen.symbolic.symbols import momentum
from phigen.symbolic.tower import Tower

q, p, a = symbols("q p p:q")
b = symbol(momentum("p"))
CAYLEY = "birealisation: cayley\norder: 2\n"
HALF = number(Fraction(1, 2))
MIDPOINT = (q - HALF * b, p + HALF * a)
ONE_SIDED = (q, p + a)


def series(compilation, terms, *, symmetric=True):
    """Return the series S_1 … S_terms of a compilation. With ``symmetric``, the even terms are set to 0 instead of
    computed.
    """
    system = compilation.system
    return polynomial_series(
        system.hamiltonian,
        compilation.realisation.alpha,
        system.coordinates,
        system.parameter_names,
        terms,
        symmetric=symmetric,
    )


def planar(hamiltonian, alpha, terms, *, symmetric=False):
    """Return the series of a Hamiltonian of one canonical pair (q, p), with the map α."""
    return polynomial_series(hamiltonian, alpha, ("q", "p"), ("g",), terms, symmetric=symmetric)


def same(terms, index, expected):
    """Whether S_index equals the expression exactly."""
    tower = terms.tower
    return tower.is_zero(terms.terms[index - 1] - tower.convert(expected))


def tangent_coefficients(count):
    """Return the first ``count`` coefficients of t, t³, t⁵, … in 2 tan(t/2)."""
    t = sympy.Symbol("t")
    poly = sympy.series(2 * sympy.tan(t / 2), t, 0, 2 * count).removeO()
    return [Fraction(int(c.p), int(c.q)) for c in (poly.coeff(t, 2 * k + 1) for k in range(count))]


# -- closed forms


def test_oscillator_in_the_midpoint_chart_is_a_tangent():
    """S_t = 2 tan(t/2) H, so S_3 = (q² + p²)/24 and S_5 = (q² + p²)/240."""
    energy = (q**2 + p**2) / 2
    algebra = planar(energy, MIDPOINT, 9)
    assert same(algebra, 3, (q**2 + p**2) / 24)
    assert same(algebra, 5, (q**2 + p**2) / 240)
    for k, c in enumerate(tangent_coefficients(5)):
        assert same(algebra, 2 * k + 1, number(c) * energy)


def test_linear_hamiltonian_on_so3_in_the_cayley_chart_is_a_tangent():
    """S_t = (2/|a|) tan(t|a|/2) H for H = a·x, so S_3 = |a|² H/12."""
    body = compile_text(BODY.replace("x1**2/2 + x2**2/4 + x3**2/6", "x1/2 - 3*x2 + 2*x3/7") + CAYLEY)
    energy, square = body.system.hamiltonian, Fraction(1, 4) + 9 + Fraction(4, 49)
    expansion = series(body, 7, symmetric=False)
    assert same(expansion, 3, number(square / 12) * energy)
    for k, c in enumerate(tangent_coefficients(4)):
        assert same(expansion, 2 * k + 1, number(c * square**k) * energy)


def test_linear_hamiltonian_on_so3_in_the_exponential_chart_is_its_own_series():
    """S_t = tH: the exponential is exact for linear Hamiltonians."""
    text = BODY.replace("x1**2/2 + x2**2/4 + x3**2/6", "x1/2 - 3*x2 + 2*x3/7")
    expansion = series(compile_text(text + "birealisation: exponential\norder: 2\n"), 5, symmetric=False)
    assert all(expansion.tower.is_zero(term) for term in expansion.terms[1:])


def test_third_term_of_the_rigid_body():
    expansion = series(compile_text(BODY + CAYLEY), 4, symmetric=False)
    x1, x2, x3 = symbols("x1 x2 x3")
    quartic = 216 * x1**4 + 171 * x1**2 * x2**2 + 120 * x1**2 * x3**2 + 27 * x2**4 + 33 * x2**2 * x3**2 + 8 * x3**4
    assert same(expansion, 1, x1**2 / 2 + x2**2 / 4 + x3**2 / 6)
    assert same(expansion, 3, quartic / 2592)
    assert expansion.terms[1] == 0
    assert expansion.terms[3] == 0


def test_third_term_of_the_log_canonical_system_with_linear_hamiltonian():
    expansion = series(compile_text(SPECIES + "order: 2\n"), 3, symmetric=False)
    x1, x2, x3 = symbols("x1 x2 x3")
    assert same(expansion, 3, (x1 + x2) * (x1 + x3) * (x2 + x3) / 24)


def test_logarithmic_hamiltonian_of_a_log_canonical_system_is_its_own_series():
    """S_t = tH for H = Σ c_i log x_i, since α only multiplies the coordinates by constants."""
    text = SPECIES.replace("x1 + x2 + x3", "3*log(x1) - log(x2)/2 + 5*log(x3)")
    expansion = series(compile_text(text + "order: 2\n"), 4, symmetric=False)
    assert all(expansion.tower.is_zero(term) for term in expansion.terms[1:])


# -- parity, and the Hamilton–Jacobi equation


@pytest.mark.parametrize("name", [name for name in NAMES if described(name)[2].symmetric])
def test_even_terms_vanish_in_symmetric_realisations(name):
    """By the parity theorem, the even terms vanish in a symmetric bi-realisation. This series is computed without the
    theorem.
    """
    compilation = compiled(name)
    expansion = series(compilation, 4, symmetric=False)
    assert expansion.tower.is_zero(expansion.terms[1])
    assert expansion.tower.is_zero(expansion.terms[3])


def test_even_terms_of_a_one_sided_realisation_do_not_vanish():
    assert planar((q**2 + p**2) / 2, ONE_SIDED, 2).terms[1] != 0


@pytest.mark.parametrize("name", NAMES)
def test_series_solves_the_equation(name):
    compilation = compiled(name)
    expansion = series(compilation, min(compilation.order.terms, 5), symmetric=compilation.realisation.symmetric)
    rest = residual(
        expansion, compilation.system.hamiltonian, compilation.realisation.alpha, compilation.system.coordinates
    )
    assert all(expansion.tower.is_zero(r) for r in rest)


def test_residual_of_a_wrong_series_does_not_vanish():
    algebra = planar((q**2 + p**2) / 2, MIDPOINT, 3)
    wrong = type(algebra)(algebra.tower, (*algebra.terms[:2], 2 * algebra.terms[2]))
    assert residual(wrong, (q**2 + p**2) / 2, MIDPOINT, ("q", "p"))[2] != 0


def point_of(compilation):
    """Return numbers by name for the coordinates, near the start of the first run, and for the parameters."""
    run = next(iter(compilation.spec.runs.values()))
    numbers = {p.name: p.value for p in compilation.spec.parameters} | dict(run.parameters)
    moved = [Fraction(v) + Fraction(k + 3, 97) for k, v in enumerate(run.initial)]
    numbers |= dict(zip(compilation.system.coordinates, moved, strict=True))
    return {k: mpmath.mpf(v.numerator) / v.denominator for k, v in numbers.items()}


@pytest.mark.parametrize("name", NAMES)
def test_polynomials_and_graphs_give_the_same_series(name):
    compilation = compiled(name)
    system, realisation = compilation.system, compilation.realisation
    terms = min(compilation.order.terms, 5)
    symmetric = realisation.symmetric
    graph = graph_series(system.hamiltonian, realisation.alpha, system.coordinates, terms, symmetric=symmetric)
    expansion = series(compilation, terms, symmetric=symmetric)
    with mpmath.workdps(40):
        at = point_of(compilation)
        left = values(graph, at)
        right = values([expansion.tower.expression(t) for t in expansion.terms], at)
        assert all(abs(x - y) <= mpmath.mpf(10) ** -30 * (1 + abs(x)) for x, y in zip(left, right, strict=True))


# -- functions beyond polynomials

HAMILTONIANS = [
    "exp(q - p)*(1 + q**2)",
    "log(1 + q**2 + p)",
    "p**2/2 - cos(q)*p + sin(q)",
    "sqrt(q**2 + p**2 + 1)",
    "p**2/2 - 1/q",
    "1/(q*p + q**2)",
    "q**(5/3)*p - p**(3/2)",
    "(q + p**2)**(-3/2)",
    "tan(q/3)*p**2",
    "atan2(p, q)*q",
    "abs(q - p)*q**2",
    "q**g*p + p**2",
    "(q + p)**(g*q)",
    "asin(q/5)*p + acos(p/5)*q + atan(q*p)",
    "sinh(q)*p + cosh(p/2) + tanh(q*p)",
    "asinh(q)*p**2 + acosh(2 + p)*q + atanh(q*p/9)",
    "exp(sin(q)*sqrt(p + 2))",
    "pi*q**2*p + E*cos(p*q)",
]

VALUES = {"q": Fraction(5, 7), "p": Fraction(9, 8), "g": Fraction(4, 3)}


def parsed(text):
    """Return the Hamiltonian of a spec as an expression, from its text."""
    return compile_text(
        f"coordinates: [q, p]\nparameters: {{g: 1.5}}\npoisson: {{canonical: {{q: [q], p: [p]}}}}\n"
        f"hamiltonian: {text}\norder: 2\n"
    ).system.hamiltonian


def by_sympy(text, one_sided, terms):
    """Return the values of S_1 … S_terms at `VALUES` as decimal texts, computed from the recursion by sympy's
    derivatives.
    """
    names = {n: sympy.Symbol(n, positive=True) for n in ("q", "p", "g", "t")}
    sq, sp, t = names["q"], names["p"], names["t"]
    energy = sympy.sympify(text, locals={**names, "abs": sympy.Abs}, rational=True)
    series_terms = [energy]
    for i in range(1, terms):
        partial = sum((t ** (k + 1) * s for k, s in enumerate(series_terms)), sympy.Integer(0))
        slope_q, slope_p = partial.diff(sq), partial.diff(sp)
        half = sympy.Rational(1, 2)
        moved = (sq, sp + slope_q) if one_sided else (sq - half * slope_p, sp + half * slope_q)
        inside = energy.subs({sq: moved[0], sp: moved[1]}, simultaneous=True)
        series_terms.append(inside.diff(t, i).subs(t, 0) / sympy.factorial(i) / (i + 1))
    at = {names[k]: sympy.Rational(v.numerator, v.denominator) for k, v in VALUES.items()}
    return [str(sympy.N(s.subs(at), 32)) for s in series_terms]


#: Charts and Hamiltonians. The one-sided chart already differentiates each function twice. In the midpoint chart sympy
#: takes many times longer, so only six functions are tested in it.
IN_BOTH_CHARTS = [*product(["one-sided"], HAMILTONIANS), *product(["midpoint"], HAMILTONIANS[:6])]


QUICK = [(chart, text) for chart, text in IN_BOTH_CHARTS[:-4] if "asin" not in text]


@pytest.mark.thin(3)
@pytest.mark.parametrize(("chart", "text"), slow_but(QUICK, IN_BOTH_CHARTS))
def test_series_of_other_functions_agrees_with_sympy(text, chart):
    one_sided = chart == "one-sided"
    expected = by_sympy(text, one_sided, 3)
    energy, alpha = parsed(text), ONE_SIDED if one_sided else MIDPOINT
    with mpmath.workdps(30):
        at = {k: mpmath.mpf(v.numerator) / v.denominator for k, v in VALUES.items()}
        algebra = planar(energy, alpha, 3)
        in_tower = values([algebra.tower.expression(t) for t in algebra.terms], at)
        as_graph = values(graph_series(energy, alpha, ("q", "p"), 3, symmetric=False), at)
        for i, value in enumerate(map(mpmath.mpf, expected)):
            bound = mpmath.mpf(10) ** -25 * (1 + abs(value))
            assert abs(in_tower[i] - value) < bound, f"S_{i + 1} in the tower"
            assert abs(as_graph[i] - value) < bound, f"S_{i + 1} as a graph"


FREE_OF_MOMENTUM = [
    (call("exp", q), lambda x: mpmath.exp(x)),
    (call("log", q), lambda x: mpmath.log(x)),
    (sqrt(q), lambda x: mpmath.sqrt(x)),
    (1 / q, lambda x: 1 / x),
    (power(q, Fraction(-7, 3)), lambda x: mpmath.power(x, mpmath.mpf(-7) / 3)),
    (call("tan", q) * PI, lambda x: mpmath.tan(x) * mpmath.pi),
    (call("atan2", q, ONE), lambda x: mpmath.atan2(x, 1)),
    (call("abs", q) * q, lambda x: abs(x) * x),
    (sqrt(power(symbol("g"), Fraction(2))) * q, lambda x: x),  # √g² is a constant factor, 1 at g = 1
]


@pytest.mark.parametrize(("function", "exact"), FREE_OF_MOMENTUM, ids=[str(f) for f, _ in FREE_OF_MOMENTUM])
def test_series_of_a_shift_is_a_taylor_expansion(function, exact):
    """For H = f(q) + p in the one-sided chart α = (q, p + a), S_t = F(q + t) − F(q) + tp with F′ = f. So S_i is
    f^(i−1)(q)/i!, plus p for i = 1.
    """
    algebra = planar(function + p, ONE_SIDED, 7)
    with mpmath.workdps(50):
        at = {"q": mpmath.mpf(13) / 11, "p": mpmath.mpf(2), "g": mpmath.mpf(1)}
        computed = values([algebra.tower.expression(t) for t in algebra.terms], at)
        expansion = mpmath.taylor(exact, at["q"], 6)
        expected = [c / (i + 1) for i, c in enumerate(expansion)]
        expected[0] += at["p"]
        assert all(abs(x - y) < mpmath.mpf(10) ** -18 * (1 + abs(y)) for x, y in zip(computed, expected, strict=True))


# -- time and memory


def test_order_twelve_of_the_rigid_body_is_quick():
    compilation = compiled("rigid_body")
    # It takes about a second; with expression trees instead of polynomials it would take minutes.
    with processor_seconds_below(30):
        expansion = series_of(compilation.system, compilation.realisation, 11)
    assert expansion.terms[10].total_degree() > 0
    assert all(term == 0 for term in expansion.terms[1::2])


@pytest.mark.parametrize("terms", [1, 2, 5])
def test_as_many_terms_as_were_asked_for(terms):
    algebra = planar((q**2 + p**2) / 2, MIDPOINT, terms, symmetric=True)
    assert len(algebra.terms) == terms
    assert isinstance(algebra.tower, Tower)
    graph = graph_series((q**2 + p**2) / 2, MIDPOINT, ("q", "p"), terms, symmetric=True)
    assert all(isinstance(term, Expression) for term in graph)
    assert all(term is ZERO for term in graph[1::2])


def test_nested_definitions_are_left_unexpanded():
    """The definitions of the spec are thirteen nested sines. If these were expanded, their derivatives would have 2^13
    terms, and products of the derivatives would exhaust the memory.
    """
    lines = [f"  a{k}: a{k - 1} + sin(a{k - 1})" if k else "  a0: q + sin(p)" for k in range(13)]
    canonical = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
    text = canonical + "definitions:\n" + "\n".join(lines) + "\nhamiltonian: p**2/2 + a12\norder: 4\n"
    assert compile_text(text).program.about.operations["functions"] < 100
