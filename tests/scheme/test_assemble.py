"""Assembly of programs: the number of terms of the series for an order, the choice of the cheapest form, the limit of
operations, and explicit steps.
"""

import mpmath
import pytest
from support import BODY, NAMES, compile_anew, compile_text, compiled, series_of, slow_but, values

from phigen.errors import LimitError
from phigen.scheme import discretisation
from phigen.scheme.collected import collect
from phigen.scheme.discretisation import MAX_GRAPH_TERMS, generating_function, hamilton_jacobi
from phigen.scheme.generating import STEP, collected_form, graph_form
from phigen.scheme.order import Order, plan_order
from phigen.scheme.staging import Coefficients
from phigen.scheme.steps import Explicit, Newton
from phigen.series.hamilton_jacobi import graph_series
from phigen.symbolic.symbols import coefficient

pytestmark = pytest.mark.corpus


@pytest.mark.parametrize(
    ("order", "terms", "symmetric", "expected"),
    [
        (1, None, True, (2, 1)),
        (2, None, True, (2, 1)),
        (3, None, True, (4, 3)),
        (4, None, True, (4, 3)),
        (5, None, True, (6, 5)),
        (12, None, True, (12, 11)),
        (1, None, False, (1, 1)),
        (2, None, False, (2, 2)),
        (5, None, False, (5, 5)),
        (None, 1, True, (2, 1)),
        (None, 2, True, (2, 1)),
        (None, 3, True, (4, 3)),
        (None, 6, True, (6, 5)),
        (None, 2, False, (2, 2)),
        (None, 3, False, (3, 3)),
    ],
)
def test_order_and_terms(order, terms, symmetric, expected):
    """S_1 … S_k gives order k, and k + 1 for odd k in a symmetric bi-realisation, where even S_k vanish."""
    plan = plan_order(order, terms, symmetric=symmetric)
    assert (plan.order, plan.terms) == expected


def test_rounding_up_of_the_order_is_reported():
    assert "order 3 was asked for" in plan_order(3, None, symmetric=True).note
    assert "S_2 = 0" in plan_order(None, 2, symmetric=True).note
    assert plan_order(4, None, symmetric=True) == Order(4, 3)
    assert "order 3 was asked for" in " ".join(compile_text(BODY + "order: 3\n").program.about.facts)


@pytest.mark.thin(1)
@pytest.mark.parametrize("name", slow_but({*NAMES} - {"vortices3", "ablowitz_ladik3", "guiding_centre"}))
def test_generating_function_is_the_cheapest_of_its_forms_and_all_are_equal(name):
    compilation = compiled(name)
    system, realisation, terms = compilation.system, compilation.realisation, compilation.order.terms
    coordinates, series = system.coordinates, hamilton_jacobi(system, realisation, terms)
    chosen = generating_function(system, series, terms)
    forms = list(collected_form(series.polynomial(terms), coordinates, series.static, 10**6))
    if terms <= MAX_GRAPH_TERMS:
        symmetric = realisation.symmetric
        graph = graph_series(system.hamiltonian, realisation.alpha, coordinates, terms, symmetric=symmetric)
        forms.append(graph_form(graph, coordinates, series.static))
    assert chosen.cost() == min(f.cost() for f in forms)
    with mpmath.workdps(40):
        at = {c: mpmath.mpf(7 + k) / 11 for k, c in enumerate([*coordinates, *system.parameter_names])} | {
            STEP: mpmath.mpf(1) / 8
        }
        values_of_forms = [evaluated(form, at) for form in forms]
        for other in values_of_forms[1:]:
            assert all(
                abs(u - v) <= mpmath.mpf(10) ** -25 * (1 + abs(u))
                for u, v in zip(values_of_forms[0], other, strict=True)
            )


def evaluated(form, at):
    """Return the entries of the gradient and the Hessian of the generating function in one of its forms, at a point."""
    table = values(form.coefficients.values, at)
    known = {**at, **{coefficient(k): v for k, v in enumerate(table)}}
    return values([*form.slope, *(e for row in form.hessian for e in row)], known)


def test_few_monomials_are_collected_and_many_stay_a_graph():
    assert "collected polynomial" in " ".join(compiled("rigid_body").program.about.facts)
    assert "shared graph" in " ".join(compiled("vortices3").program.about.facts)


def test_collected_polynomials_differentiate_like_the_tower():
    compilation = compiled("kepler")
    series = series_of(compilation.system, compilation.realisation, 3)
    coordinates = compilation.system.coordinates
    ring, (terms,) = collect(series.tower, [series.terms[2]], coordinates)
    with mpmath.workdps(30):
        at = {c: mpmath.mpf(3 + k) / 5 for k, c in enumerate([*coordinates, "mu"])}
        for j, c in enumerate(coordinates):
            table = Coefficients(["mu", STEP])
            mine = ring.expression(ring.derivative(terms, j), table)
            at |= {coefficient(k): v for k, v in enumerate(values(table.values, at))}
            theirs = series.tower.expression(series.tower.derivative(series.terms[2], c))
            assert mpmath.almosteq(*values([mine, theirs], at), mpmath.mpf(10) ** -25)


# -- the limit of operations


def test_a_program_beyond_the_budget_is_refused_with_a_hint(monkeypatch):
    monkeypatch.setattr(discretisation, "MOST_OPERATIONS", 100)
    with pytest.raises(LimitError) as caught:
        compile_anew(BODY + "order: 6\n")
    assert "order" in str(caught.value)
    assert "ask for a lower order" in str(caught.value)


# -- explicit steps

PAIR = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"


@pytest.mark.parametrize("side", ["q", "p"])
@pytest.mark.parametrize(
    ("hamiltonian", "order", "step"),
    [
        ("p**2/2 - cos(q)", 1, Explicit),
        ("p**4 + q**4", 1, Explicit),
        ("p**2/2 - cos(q)", 2, Newton),  # S_2 = H_q H_p/2 mixes q and p
        ("p**2*q + q**2", 1, Newton),
        ("p**2*(1 + q**2)", 1, Newton),
        ("p*q", 1, Newton),
    ],
)
def test_separable_hamiltonians_give_explicit_steps(hamiltonian, order, side, step):
    text = f"{PAIR}birealisation: {{kind: canonical-euler, side: {side}}}\n"
    assert isinstance(compile_text(f"{text}hamiltonian: {hamiltonian}\norder: {order}\n").program.step, step)


def test_symmetric_realisations_are_solved_by_newton_iteration():
    assert isinstance(compile_text(f"{PAIR}hamiltonian: p**2/2 - cos(q)\norder: 1\n").program.step, Newton)
