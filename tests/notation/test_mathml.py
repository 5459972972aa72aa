"""Formulas in MathML have the values of the expressions, and are well-formed for any names."""

from fractions import Fraction
from xml.etree import ElementTree

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mathml_value import value_of

from phigen import resources, spec
from phigen.geometry.system import system_from_spec
from phigen.notation import mathml, named_parts
from phigen.realisations.catalogue import realise
from phigen.symbolic.elliptic import ELLIPTIC, THIRD
from phigen.symbolic.expression import (
    EULER,
    PI,
    add,
    call,
    mul,
    neg,
    number,
    power,
    raw,
    sqrt,
    sub,
    symbol,
    topological,
)
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.numeric import evaluate
from phigen.symbolic.readable import expanded
from phigen.symbolic.remainders import QUOTIENTS, REMAINDERS
from phigen.symbolic.symbols import GAUGE, STEP, Symbol, momentum

GAUGED = Symbol(GAUGE, "C")
VALUES = {"x": 1.3, "y1": 0.7, "omega_2": 2.1, "prey": 0.4, momentum("y1"): 0.11, GAUGED: 0.2, "lambda": 1.9}
x, y, w, prey, p, lam = (symbol(n) for n in ("x", "y1", "omega_2", "prey", momentum("y1"), "lambda"))
HEAD = "phigen: 1\nname: t\ncoordinates: [x, y1, prey]\npoisson: {matrix: [[0, 0, 0], [0, 0, 0], [0, 0, 0]]}\n"


def value(e):
    return evaluate([e], VALUES)[0]


def agrees(e):
    assert value_of(mathml.expression(e), VALUES) == pytest.approx(value(e), rel=1e-12)
    assert joined_value(mathml.pieces(e)) == pytest.approx(value(e), rel=1e-12)


def joined_value(pieces, values=VALUES, functions=None):
    """Return the value of pieces of MathML that are set one after another."""
    return value_of(f"<mrow>{''.join(pieces)}</mrow>", values, functions)


#: Functions that other tests cover, and functions of flows, which are written by their names only.
OTHERS = {"phi0", "phi1", "phi2", "acosh", "anomaly", *ELLIPTIC, THIRD, *REMAINDERS, *QUOTIENTS}


@pytest.mark.parametrize("function", [f for f in FUNCTIONS if f not in OTHERS])
def test_function_keeps_its_value(function):
    agrees(call(function, *[prey, y, x][: FUNCTIONS[function].arity]) * 3 - x)
    agrees(power(call(function, *[prey, y, x][: FUNCTIONS[function].arity]), 3) / y)


def test_equal_terms_and_equal_factors_are_collected():
    shown = {e: mathml.expression(e) for e in (add(sub(x, y), sub(y, x)), add(x * y, y * x), mul(x + y, x + y))}
    assert shown[add(sub(x, y), sub(y, x))] == "<mn>0</mn>"
    assert [markup.count("<mi>x</mi>") for markup in shown.values()] == [0, 1, 1]
    for e in shown:
        agrees(e)


def test_functions_without_other_test():
    agrees(call("acosh", x + 1))
    assert "<mi>φ</mi>" in mathml.expression(call("phi0", x))
    assert "<mi>φ″</mi>" in mathml.expression(call("phi2", x))


@pytest.mark.parametrize(
    "e",
    [
        number(0), number(7), number(-7), number(Fraction(-2, 3)), number(Fraction(6667, 10000)), PI, EULER * x,
        x, p, -x, x + y, x - y, sub(x, add(y, w)), neg(add(x, y)), mul(x, neg(y)), x * y * prey * w,
        (x + y) * (x - y), x / y, x / (y * w), x / (y + w), 1 / x, (x + y) / (x - y) / w,
        mul(number(Fraction(1, 2)), x + y),
        x**2, (x * y) ** 2, (x + y) ** 3, power(x**2, Fraction(1, 3)), power(power(x, Fraction(2, 3)), 2), power(x, -3),
        y**2, power(y, Fraction(-3, 2)), sqrt(x + y), 1 / sqrt(x), power(x, y), power(x + y, -x), power(number(2), x),
        power(number(Fraction(3, 2)), Fraction(1, 2)), power(number(2), Fraction(1, 2)), sqrt(x) ** 3,
        call("exp", -x / y), call("sin", x) ** 2 * call("cos", x), call("exp", call("exp", x) / 10),
        power(call("exp", x), 3), raw("pow", (raw("pow", (x,), Fraction(2)),), Fraction(3)), lam * prey, prey * 2,
        symbol(GAUGED) * x, 2 - x, x - 2, x + 1 - y + 1, (x - y) ** 2 - (y - x),
        -(x - y) * (x + y) * (x + 2 * y) / 3,
        raw("pow", (3 * x / y,), Fraction(-1)), raw("pow", (-2 * x,), Fraction(-2)), raw("pow", (1 / x,), Fraction(3)),
        -(x + y + w + prey + lam) / (2 * y), (x + y + w + prey) * 1, call("abs", x - 2 * y) * x,
    ],
    ids=str,
)  # fmt: skip
def test_structure_keeps_its_value(e):
    agrees(e)


expressions = st.recursive(
    st.sampled_from([x, y, w, prey, p, number(2), number(-3), number(Fraction(5, 7)), number(Fraction(-1, 2))]),
    lambda inner: st.one_of(
        st.tuples(st.sampled_from([add, sub, mul]), inner, inner).map(lambda t: t[0](t[1], t[2])),
        inner.map(neg),
        st.tuples(inner, st.sampled_from([-2, -1, 2, 3])).map(
            lambda t: power(t[0], t[1]) if not t[0].is_zero else t[0]
        ),
        inner.map(lambda e: call("sin", e)),
        inner.map(lambda e: sqrt(e * e + 1)),
    ),
    max_leaves=14,
)


@settings(max_examples=150, deadline=None)
@given(expressions)
def test_any_expression_keeps_its_value(e):
    try:
        expected = value(e)
    except ArithmeticError:
        return
    if 1e-9 < abs(expected) < 1e9:
        size = sum(abs(v) for v in map(value, [n for n in topological([e]) if n.op not in ("pow",)]))
        assert value_of(mathml.expression(e), VALUES) == pytest.approx(expected, rel=1e-9, abs=1e-9 * size)


def test_sums_and_products_are_in_the_order_of_their_names():
    e = spec.loads(f"{HEAD}hamiltonian: prey*x + x**2 - 3 + y1 + 1/2\n").hamiltonian
    text = "".join(ElementTree.fromstring(mathml.expression(e)).itertext())
    assert text.replace("\u2062", "") == "prey·x+x2+y1−52"


def test_decimals_stay_decimals():
    assert mathml.number(Fraction("0.6666666666666666")) == "<mn>0.6666666666666666</mn>"
    assert mathml.number(Fraction("12.0001")) == "<mn>12.0001</mn>"
    assert mathml.number(Fraction(1, 8)) == "<mfrac><mn>1</mn><mn>8</mn></mfrac>"


@pytest.mark.parametrize(
    ("identifier", "shown"),
    [("x", "x"), ("x12", "x_(12)"), ("omega_1", "ω_(1)"), (momentum("x1"), "p_(x_(1))"), (GAUGED, "λ_(C)"),
     ("_a", "_a"), ("gamma", "γ"), ("curlz", "curlz"), ("a_b_c", "a_(b_(c))"), (STEP, "h"),
     ("q1dot", "q1dot"), ("x_", "x_")],
)  # fmt: skip
def test_name(identifier, shown):
    from mathml_value import text_of

    assert text_of(ElementTree.fromstring(mathml.name(identifier))) == shown


@pytest.mark.parametrize(
    "name", ["<script>alert(1)</script>", "a&b", "</mi></math>", '"', "]]>", momentum("<b>"), Symbol(GAUGE, "&")]
)
def test_no_name_breaks_the_markup(name):
    e = symbol(name) ** 2 + 1
    element = ElementTree.fromstring(mathml.math("".join(mathml.pieces(e))))
    assert {child.tag for child in element.iter()} <= {"math", "mrow", "msup", "msub", "msubsup", "mi", "mn", "mo"}
    assert "".join(element.itertext()).find(name.split(":")[-1]) >= 0


def doubled(e, times=60):
    """Return an expression with common subexpressions, which would have 2**times leaves if these were written out."""
    for _ in range(times):
        e = e * call("cos", e) + call("sin", e)
    return e


def test_names_for_shared_parts_keep_formulas_short():
    named, (root,) = named_parts.with_names([doubled(x * y)])
    assert 50 < len(named) < 200
    assert sum(named_parts.leaves(part) for _, part in named) + named_parts.leaves(root) < 1000


def test_names_for_shared_parts_keep_the_value():
    e = doubled(x * y + w * prey * y, 5)
    known, (named, (root,)) = dict(VALUES), named_parts.with_names([e])
    for name, part in named:
        known[name] = value_of(mathml.expression(part), known)
    assert value_of(mathml.expression(root), known) == pytest.approx(value(e), rel=1e-12)


@pytest.mark.parametrize("name", ["rigid_body", "kowalevski_top", "gaussian_moments", "poisson_not_hamiltonian"])
def test_readable_realisation_says_what_alpha_is(name):
    system = system_from_spec(spec.load(resources.bundled_specs() / f"{name}.yaml"))
    realisation = realise(system, system.spec.birealisation)
    symbols = [*system.coordinates, *realisation.covector, *system.parameter_names]
    values = {s: 0.3 + 0.1 * i for i, s in enumerate(symbols)}
    formulas = named_parts.readable(realisation.alpha)
    known = dict(values)
    phi = {k: (lambda v, k=k: evaluate([call(k, symbol("s"))], {"s": v})[0]) for k in ("phi0", "phi1", "phi2")}
    functions = {"φ": phi["phi0"], "φ′": phi["phi1"], "φ″": phi["phi2"]}
    plain = {s.replace("p:", "p_"): v for s, v in values.items() if s.startswith("p:")}
    for part, e in formulas.parts:
        known[part] = value_of(mathml.expression(e), known, functions)
    for form, e in zip(formulas.forms, realisation.alpha, strict=True):
        got = joined_value(mathml.pieces(form), {**plain, **known}, functions)
        assert got == pytest.approx(evaluate([e], values)[0], rel=1e-12)


def test_a_long_formula_is_cut_but_stays_markup():
    markup = mathml.expression(doubled(x))
    assert len(markup) < 5 * mathml.LONGEST
    assert "…" in markup
    ElementTree.fromstring(markup)


def test_hidden_terms_are_dots():
    e = sum((symbol(f"x{i}") for i in range(20)), number(0))
    (formula,) = expanded([e / 3], 5)
    written = mathml.pieces(formula)
    assert "…" in written[-1]
    assert len(written) == 6
    ElementTree.fromstring(mathml.math("".join(written)))
