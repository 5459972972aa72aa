"""Poisson sprays: the two examples of the paper (arXiv:2303.15883) step by step, closed forms, the formal series, and
refusals.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import pytest
from geometry.building import family, system
from realisations.exterior import (
    TIME,
    after,
    at_time,
    canonical,
    combine,
    differential,
    equal,
    integrated,
    is_flow,
    parts_in_p,
    pull_back,
    same,
    wedge,
)
from support import PreciseStep, compile_text

from phigen.errors import LimitError, SpecError
from phigen.realisations import karasev
from phigen.realisations.axioms import check
from phigen.realisations.catalogue import realise
from phigen.realisations.protocol import covector_names, covector_symbols
from phigen.realisations.spray_field import centred_form, lie_series, make_spray
from phigen.series.hamilton_jacobi import polynomial_series
from phigen.spec import loads
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.expression import ZERO, call, derivatives, gradient, number, substitute, symbol, total
from phigen.symbolic.symbols import ELAPSED, momentum
from phigen.symbolic.verdict import PROVED, REFUTED, decide_zero

HALF = Fraction(1, 2)
FLAT = BirealisationChoice("spray", spray="flat")
SO3 = "{brackets: {x: {y: -z, z: y}, y: {z: -x}}}"  # π(x)v = x × v
LOG3 = "{log_canonical: [[0, 1, 1], [-1, 0, 1], [-1, -1, 0]]}"
CUBIC = "{nambu: [x*y*z + x**3/3 + y**3/3 + z**3/3]}"
PLANE = "{brackets: {x: {y: 'exp(x)*y + 1/(1 + x**2)'}}}"


def verdicts(statements):
    return [s.verdict for s in statements]


def choice(text, coordinates="x y z", poisson=SO3, hamiltonian="x", order=4):
    """Return a system, and the choice of the bi-realisation in its spec."""
    names = ", ".join(coordinates.split())
    spec = loads(
        f"phigen: 1\nname: t\ncoordinates: [{names}]\npoisson: {poisson}\nhamiltonian: {hamiltonian}\norder: {order}\n"
        f"birealisation: {text}\n"
    )
    return system(coordinates, poisson, hamiltonian), spec.birealisation


def given(forces, **options):
    """Return a system, and the bi-realisation of the spray with these components. The options are those of `choice`."""
    s, c = choice(f"{{kind: spray, spray: {forces}}}", **options)
    return s, realise(s, c)


# -- the symplectic example of the paper -------------------------------------------------------------------------

Q, P, A, B = (symbol(n) for n in ("q", "p", momentum("q"), momentum("p")))  # q, p and the covector (ξ_q, ξ_p)
Z = ("q", "p", momentum("q"), momentum("p"))
PSI = [Q - HALF * B, P + HALF * A, A, B]


def test_symplectic_example_flow_form_and_psi():
    s = symbol(TIME)
    flow = [Q + s * B, P - s * A, A, B]
    assert is_flow(flow, [B, -A, ZERO, ZERO], Z)  # the flow of the spray X = ξ_p ∂_q − ξ_q ∂_p
    assert same(at_time(flow, 1)[:2], [Q + B, P - A])  # the map β̅, with β = β̅∘ψ

    moved = pull_back(canonical(2), flow, Z)
    omega = {key: integrated(w, 0, 1) for key, w in moved.items()}
    # The mean of Φˢ*ω over 0 ≤ s ≤ 1 is Ω = ω + dξ_p ∧ dξ_q.
    corrected = combine((1, canonical(2)), (-1, {(2, 3): number(1)}))
    assert equal(omega, corrected)
    assert equal(pull_back(corrected, PSI, Z), canonical(2))
    assert same(PSI, at_time(flow, -HALF))  # ψ is the flow of the spray for the time −½
    alpha, beta = PSI[:2], after(at_time(flow, 1), PSI, Z)[:2]
    assert same(alpha, [Q - HALF * B, P + HALF * A])
    assert same(beta, [Q + HALF * B, P - HALF * A])


def test_symplectic_example_is_what_the_kind_builds():
    realisation = realise(system("q p", "{canonical: {q: [q], p: [p]}}"), BirealisationChoice("spray"))
    assert realisation.exact
    assert realisation.symmetric
    assert same(realisation.alpha, [Q - HALF * B, P + HALF * A])
    assert same(realisation.beta, [Q + HALF * B, P - HALF * A])


def test_the_form_printed_in_the_paper_is_not_straightened_by_its_psi():
    # The paper prints Ω = ω + ½ dp∧dξ_p − ½ dξ_q∧dq − ⅓ dξ_q∧dξ_p. But the flow does not change ξ, so the coefficients
    # of dp∧dξ_p and dξ_q∧dq are those of ω. And the last coefficient is ∫ 2s ds = 1, not 1/3.
    printed = combine(
        (1, canonical(2)),
        (HALF, {(1, 3): number(1)}),
        (-HALF, {(0, 2): number(-1)}),
        (Fraction(-1, 3), {(2, 3): number(1)}),
    )
    assert not equal(pull_back(printed, PSI, Z), canonical(2))


def test_psi_of_the_other_sign_is_refuted():
    omega = combine((1, canonical(2)), (-1, {(2, 3): number(1)}))
    assert not equal(pull_back(omega, [Q + HALF * B, P - HALF * A, A, B], Z), canonical(2))


def test_psi_is_not_the_identity_to_first_order_but_its_centred_part_is():
    # The paper says that ψ is the identity to first order. But ψ moves x by −½πp. It is ψ₀ that is the identity to
    # first order, where ψ = Φ^{−½}∘ψ₀ and Φ is the flow of the spray.
    assert not same([derivatives([e], momentum("p"))[0] for e in PSI[:1]], [ZERO])
    for s in (system("x y z", SO3), system("x y z", CUBIC)):
        spray = make_spray(s, "flat")
        assert centred_form(spray, 2) == {1: spray.space.canonical()}


# -- the quadratic example of the paper ---------------------------------------------------------------------------

N = 3
X = [symbol(c) for c in "xyz"]
COVECTOR = covector_names("xyz")
PX = covector_symbols("xyz")
NAMES = ("x", "y", "z", *COVECTOR)
MATRIX = [[0, 1, 1], [-1, 0, 1], [-1, -1, 0]]
W = [x * p for x, p in zip(X, PX, strict=True)]
U = [total(number(MATRIX[i][j]) * W[i] for i in range(N)) for j in range(N)]  # u_j = Σ_i a_ij x_i p_i


def natural(sign):
    """Return the spray ẋ_j = sign u_j x_j, ṗ_j = −sign u_j p_j. The paper prints it with sign = +1. With sign = −1, ẋ =
    πp for {x_i, x_j} = a_ij x_i x_j.
    """
    return [sign * (x * u) for x, u in zip(X, U, strict=True)] + [-sign * (p * u) for p, u in zip(PX, U, strict=True)]


def exponential_map(factor):
    """Return the map (x_j, p_j) ↦ (x_j e^{c u_j}, p_j e^{−c u_j}) with c = ``factor``."""
    return [x * call("exp", factor * u) for x, u in zip(X, U, strict=True)] + [
        p * call("exp", -(factor * u)) for p, u in zip(PX, U, strict=True)
    ]


def test_quadratic_example_flow_form_and_psi():
    s = symbol(TIME)
    flow = exponential_map(-s)
    # The paper prints the spray with the opposite sign, for which ẋ = −πp.
    assert is_flow(flow, natural(-1), NAMES)
    sharp = [total(number(MATRIX[i][j]) * X[i] * X[j] * PX[j] for j in range(N)) for i in range(N)]
    assert same(natural(-1)[:N], sharp)
    assert not same(natural(+1)[:N], sharp)
    for w in W:
        assert same(after([w], flow, NAMES), [w])  # x_j p_j is invariant

    sigma = combine(*((1, wedge(differential(w, NAMES), differential(u, NAMES))) for w, u in zip(W, U, strict=True)))
    moved = pull_back(canonical(N), flow, NAMES)
    expected = {k: canonical(N).get(k, ZERO) + s * w for k, w in sigma.items()}
    assert equal(moved, expected)  # Φˢ*ω = ω + s Σ dw_j ∧ du_j
    omega = combine((1, canonical(N)), (HALF, sigma))

    psi = exponential_map(HALF)
    assert equal(pull_back(omega, psi, NAMES), canonical(N))
    assert not equal(pull_back(omega, exponential_map(-HALF), NAMES), canonical(N))  # the sign in the paper
    # β̅_j is x_j e^{−u_j} = x_j (e^{−½u_j})², and ψ leaves u_j unchanged.
    assert same(after(U, psi, NAMES), U)
    alpha, beta = psi[:N], [image * call("exp", -(HALF * u)) ** 2 for image, u in zip(psi, U, strict=False)]
    catalogue = realise(system("x y z", LOG3), BirealisationChoice("log-canonical"))
    assert same(alpha, catalogue.alpha)
    assert same(beta, catalogue.beta)


def test_the_printed_signs_belong_to_the_opposite_tensor():
    # The formulas of the paper are consistent with one another, but they are the bi-realisation of −π.
    flow = exponential_map(symbol(TIME))
    assert is_flow(flow, natural(+1), NAMES)
    opposite = realise(system("x y z", "{log_canonical: [[0, -1, -1], [1, 0, -1], [1, 1, 0]]}"))
    assert same(exponential_map(-HALF)[:N], opposite.alpha)


# -- closed forms ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("coordinates", "poisson", "parameters"),
    [
        ("q p", "{canonical: {q: [q], p: [p]}}", ""),
        ("x y z", "{matrix: [[0,b,1/m],[-b,0,0],[-1/m,0,0]]}", "parameters: {b: 1, m: 2}"),
        ("c q1 p1 p2 q2", "{canonical: {q: [q1, q2], p: [p1, p2]}}", ""),
    ],
)
def test_flat_spray_of_a_constant_tensor_is_the_constant_realisation(coordinates, poisson, parameters):
    s = system(coordinates, poisson, extra=parameters)
    realisation, other = realise(s, BirealisationChoice("spray")), realise(s, BirealisationChoice("constant"))
    assert (realisation.exact, realisation.symmetric, realisation.degree) == (True, True, None)
    assert same(realisation.alpha, other.alpha)
    assert same(realisation.increment, other.increment)
    assert verdicts(check(s, realisation)) == [PROVED] * 5


@pytest.mark.parametrize("word", ["auto", "natural"])
def test_natural_spray_of_a_log_canonical_tensor_is_the_formula_of_the_catalogue(word):
    s = system("x y z", "{log_canonical: [[0,a,b],[-a,0,1],[-b,-1,0]]}", extra="parameters: {a: 1, b: 2}")
    realisation, other = realise(s, BirealisationChoice("spray", spray=word)), realise(s)
    assert realisation.exact
    assert same(realisation.alpha, other.alpha)
    assert same(realisation.beta, other.beta)
    assert verdicts(check(s, realisation)) == [PROVED] * 5
    assert all("sinh" in str(e) for e in realisation.increment)


def test_natural_spray_typed_by_the_user_is_found_in_closed_form():
    s, realisation = given("[-p_x*(y*p_y + z*p_z), p_y*(x*p_x - z*p_z), p_z*(x*p_x + y*p_y)]", poisson=LOG3)
    assert realisation.exact
    assert same(realisation.alpha, realise(s).alpha)


def test_natural_spray_in_some_coordinates_and_constant_ones_in_others():
    poisson = "{brackets: {x: {y: 2*x*y}, q: {p: 1}}}"
    s, realisation = given("[-2*p_x*p_y*y, 2*p_y*p_x*x, 0, 0]", coordinates="x y q p", poisson=poisson)
    assert realisation.exact
    assert verdicts(check(s, realisation)) == [PROVED] * 5
    assert not realise(s, FLAT).exact


NILPOTENT = [
    "{E1: {E2: {E3: 1}}}",
    "{E1: {E2: {E3: 1}, E3: {E4: 1}}}",
    "{E1: {E2: {E3: 1}, E3: {E4: 1}, E4: {E5: 1}}}",
    "{E1: {E2: {E3: 1}, E3: {E4: 1}, E4: {E5: 1}}, E2: {E3: {E5: 1}}}",
]


@pytest.mark.parametrize("constants", NILPOTENT)
def test_flat_spray_of_a_nilpotent_algebra_is_exact_and_the_exponential_realisation(constants):
    n = int(max(c for c in constants if c.isdigit()))
    names = " ".join(f"x{i + 1}" for i in range(n))
    s = system(names, f"{{lie_algebra: {{structure_constants: {constants}}}}}")
    realisation = realise(s, BirealisationChoice("spray"))
    assert realisation.exact
    assert verdicts(check(s, realisation)) == [PROVED] * 5
    assert same(realisation.alpha, realise(s, BirealisationChoice("exponential")).alpha)


def test_nilpotent_flow_that_moves_the_covector():
    # With constant π and ṗ_y = p_x², the form Φˢ*ω is quadratic in s, and Moser's recursion ends.
    s, realisation = given("[0, p_x**2]", coordinates="x y", poisson="{brackets: {x: {y: 1}}}")
    assert realisation.exact
    assert realisation.symmetric
    assert verdicts(check(s, realisation)) == [PROVED] * 5
    assert not same(realisation.alpha, realise(s).alpha)


# -- the formal series ------------------------------------------------------------------------------------------------

SYSTEMS = [
    pytest.param("x y z", SO3, id="so(3)"),
    pytest.param("x y z", LOG3, id="log-canonical"),
    pytest.param("x y z", CUBIC, id="cubic"),
    pytest.param("x y", PLANE, id="not polynomial"),
]


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 5])
@pytest.mark.parametrize(("coordinates", "poisson"), SYSTEMS)
def test_axioms_of_a_truncation_hold_up_to_its_degree(coordinates, poisson, degree):
    s = system(coordinates, poisson)
    realisation = realise(s, replace(FLAT, degree=degree, order=1))
    assert (realisation.exact, realisation.symmetric, realisation.degree) == (False, True, degree)
    statements = check(s, realisation)
    assert verdicts(statements) == [PROVED] * 5
    assert statements[1].name.endswith(f"up to degree {degree - 1} in p")
    assert realisation.label == f"spray (approximate, Poisson up to degree {degree})"
    assert f"approximate, Poisson up to degree {degree}" in realisation.explanation


@pytest.mark.thin(2)
@pytest.mark.parametrize(("coordinates", "poisson"), SYSTEMS)
def test_axioms_of_a_truncation_fail_beyond_its_degree(coordinates, poisson):
    s = system(coordinates, poisson)
    realisation = realise(s, replace(FLAT, degree=3))
    assert REFUTED in verdicts(check(s, replace(realisation, degree=5)))
    assert REFUTED in verdicts(check(s, replace(realisation, exact=True)))


@pytest.mark.parametrize(
    "forces",
    ["[x*p_y*p_z, p_x**2, 0]", "[p_x*p_y, x**2*p_z**2, (y + z)*p_x*p_z]", "['exp(z)*p_x**2', 'p_y**2/(1 + x**2)', 0]"],
)
@pytest.mark.parametrize("poisson", [SO3, LOG3, CUBIC], ids=["so(3)", "log-canonical", "cubic"])
def test_every_spray_gives_the_axioms(poisson, forces):
    s, realisation = given(forces, poisson=poisson)
    assert not realisation.exact
    assert realisation.symmetric
    assert verdicts(check(s, realisation)) == [PROVED] * 5


def test_exchanged_maps_and_a_wrong_coefficient_are_refuted():
    s = system("x y z", SO3)
    realisation = realise(s, BirealisationChoice("spray"))
    swapped = replace(realisation, alpha=realisation.beta, beta=realisation.alpha)
    assert verdicts(check(s, swapped)) == [PROVED, REFUTED, REFUTED, PROVED, REFUTED]
    # The flow of the spray for the time −½, without the correction ψ₀, is only right in degree 1.
    spray = make_spray(s, "flat")
    half = [
        spray.space.tower.expression(
            spray.space.tower.combine(
                spray.space.scaled(f, Fraction(-1, 2) ** k) for k, f in enumerate(lie_series(spray, x, 3))
            )
        )
        for x in spray.space.variables[:3]
    ]
    wrong = replace(realisation, alpha=tuple(half), degree=3)
    assert verdicts(check(s, wrong))[1] == REFUTED


@pytest.mark.thin(2)
@pytest.mark.parametrize(("coordinates", "poisson"), SYSTEMS)
def test_flat_spray_is_karasevs_construction(coordinates, poisson):
    # In the flat spray ∫ Φˢ*ω ds = Σ d(mean_i) ∧ dp_i, where mean is the mean of x along the flow, and p·(mean − x) =
    # 0. So Moser's map ψ₀ leaves p unchanged, as in Karasev's construction.
    s = system(coordinates, poisson)
    degree = 4
    realisation = realise(s, replace(FLAT, degree=degree))
    powers = dict(zip(s.coordinates, karasev.series(s, degree), strict=True))
    for c, mine in zip(s.coordinates, realisation.alpha, strict=True):
        scaled = {name: symbol(ELAPSED) * symbol(name) for name in realisation.covector}
        e = substitute([mine - powers[c]], scaled)[0]
        for _ in range(degree + 1):  # the coefficients of t⁰ … t^degree
            assert decide_zero("", [("", substitute([e], {ELAPSED: ZERO})[0])]).verdict == PROVED
            e = derivatives([e], ELAPSED)[0]


def test_flat_spray_of_so3_is_the_exponential_series():
    # The expected map is α = x + ½ p×x + φ(|p|²) p×(p×x) with φ(s) = 1/12 + s/720 + s²/30240 + …
    s = system("x y z", SO3)
    realisation = realise(s, replace(FLAT, degree=6))

    def cross(a, b):
        return [a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3] for i in range(3)]

    norm = total(p**2 for p in PX)
    once, twice = cross(PX, X), cross(PX, cross(PX, X))
    phi = number(Fraction(1, 12)) + norm / 720 + norm**2 / 30240
    assert same(realisation.alpha, [x + HALF * a + phi * b for x, a, b in zip(X, once, twice, strict=True)])
    assert same(realisation.increment, [-a for a in once])  # β − α = πp, with no further terms


# -- S_3 of different sprays ------------------------------------------------------------------------------------------

HAMILTONIANS = ["x**2/2 + y**2/4 + z**2/6", "x*y + z", "x*y*z + y**2", "exp(x) + y*z"]


def terms_of(s, realisation, count):
    """Return the terms S_1 … S_count of the series of a bi-realisation, as expressions."""
    series = polynomial_series(s.hamiltonian, realisation.alpha, s.coordinates, [], count, symmetric=True)
    return [series.tower.expression(term) for term in series.terms]


@pytest.mark.parametrize("hamiltonian", HAMILTONIANS[:2])
def test_series_of_the_flat_spray_equal_those_of_karasev(hamiltonian):
    s = system("x y z", SO3, hamiltonian)
    mine = terms_of(s, realise(s, FLAT), 5)
    series = karasev.series(s, 4)
    reference = replace(realise(s, FLAT), alpha=tuple(series))
    assert same(mine, terms_of(s, reference, 5))


@pytest.mark.parametrize("forces", ["[x*p_y*p_z, p_x**2, 0]", "[p_x*p_y, x**2*p_z**2, (y + z)*p_x*p_z]"])
def test_two_sprays_differ_in_s3_by_a_gauge_term_cubic_in_the_slope(forces):
    # The maps of two sprays are related by α' = α∘φ with a symplectic map φ = 1 + {·, G} + …, where G(x, p) is cubic in
    # p. Hence S_3' = S_3 + G(x, ∇H) for every H.
    covector = covector_names("xyz")
    for hamiltonian in HAMILTONIANS:
        s, other = given(forces, hamiltonian=hamiltonian)
        flat = realise(s, FLAT)
        second = [parts_in_p(a - b, covector).get(2, ZERO) for a, b in zip(other.alpha, flat.alpha, strict=True)]
        generator = total(p * d for p, d in zip(PX, second, strict=True)) / 3
        assert same(second, gradient(generator, covector))
        assert decide_zero("G", [("", generator)]).verdict == REFUTED
        slope = dict(zip(covector, gradient(s.hamiltonian, s.coordinates), strict=True))
        difference = terms_of(s, other, 3)[2] - terms_of(s, flat, 3)[2]
        assert same([difference], substitute([generator], slope))


def test_natural_and_flat_spray_of_a_log_canonical_tensor_differ_by_a_gauge_term():
    s = system("x y z", LOG3, "x + y + z")
    exact, flat = realise(s), realise(s, FLAT)
    x, y, z = X
    assert same([terms_of(s, exact, 3)[2]], [(x + y) * (x + z) * (y + z) / 24])
    assert not same(terms_of(s, exact, 3), terms_of(s, flat, 3))


# -- the solver -----------------------------------------------------------------------------------------------------

BODY = f"coordinates: [x, y, z]\npoisson: {SO3}\nhamiltonian: x**2/2 + y**2/4 + z**2/6\n"
START = (1.0, 0.5, -0.75)


@pytest.mark.parametrize("degree", [3, 4, 5])
def test_poisson_defect_of_a_truncation_is_of_its_degree(degree):
    compilation = compile_text(f"{BODY}birealisation: {{kind: spray, degree: {degree}}}\norder: 4\n")
    defects = [PreciseStep(compilation, {}, h).defect(START) for h in (1 / 64, 1 / 128)]
    # For so(3), α has no terms of odd degree above 1, so degree 4 gives the same map as degree 5.
    expected = {3: 4, 4: 6, 5: 6}[degree]
    assert defects[0] / defects[1] >= 0.8 * 2**expected
    assert defects[1] > 1e-25  # not only round-off, since the bi-realisation is approximate


def test_an_exact_spray_has_no_defect():
    compilation = compile_text(
        f"coordinates: [x, y, z]\npoisson: {LOG3}\nhamiltonian: x + y + z\nbirealisation: spray\norder: 4\n"
    )
    assert PreciseStep(compilation, {}, 1 / 16).defect(START) < 1e-40
    assert not any("approximate" in fact for fact in compilation.program.about.facts)


def test_the_program_says_that_it_is_approximate():
    facts = " ".join(compile_text(f"{BODY}birealisation: spray\norder: 4\n").program.about.facts)
    assert "approximate: alpha and beta are cut off at degree 5 in p" in facts


@pytest.mark.parametrize(("order", "degree"), [(1, 3), (2, 3), (3, 5), (4, 5), (6, 7)])
def test_degree_follows_from_the_order(order, degree):
    assert compile_text(f"{BODY}birealisation: spray\norder: {order}\n").realisation.degree == degree
    assert compile_text(f"{BODY}birealisation: spray\norder: 2\n", order=order).realisation.degree == degree


# -- what is refused ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "forces",
    [
        "[p_x**3, 0, 0]",
        "[p_x, 0, 0]",
        "[x, 0, 0]",
        "[0, 'exp(p_x)', 0]",
        "[0, 0, p_x**3/p_y]",
        "[p_x**2 + p_y, 0, 0]",
    ],
)
def test_a_spray_that_is_not_quadratic_in_the_covector_is_refused(forces):
    with pytest.raises(SpecError, match="not homogeneous of degree 2 in the covector") as caught:
        given(forces)
    assert caught.value.diagnostics[0].hint


def test_the_natural_spray_needs_a_log_canonical_tensor():
    with pytest.raises(SpecError, match="the natural spray is that of"):
        realise(family("so", 3), BirealisationChoice("spray", spray="natural"))


def test_sprays_of_the_wrong_size_or_with_unknown_symbols_are_refused():
    s = system("x y", PLANE)
    with pytest.raises(SpecError, match="spray has 1 components for 2 coordinates"):
        realise(s, BirealisationChoice("spray", spray=(ZERO,)))
    with pytest.raises(SpecError, match="spray uses p_z"):
        realise(s, BirealisationChoice("spray", spray=(ZERO, symbol(momentum("z")) ** 2)))
    with pytest.raises(SpecError, match="unknown spray 'round'"):
        realise(s, BirealisationChoice("spray", spray="round"))


def test_a_degree_below_the_order_is_refused():
    with pytest.raises(SpecError, match="degree 2 is too small for order 4"):
        compile_text(f"{BODY}birealisation: {{kind: spray, degree: 2}}\norder: 4\n")


def test_series_beyond_the_limit_are_a_limit_error():
    s = system("a b c d e f", "{lie_algebra: {name: so(4)}}")
    spray = make_spray(s, "flat")
    with pytest.raises(LimitError, match="more than 10 terms"):
        lie_series(spray, spray.space.variables[0], 8, most_terms=10)
