"""Systems from sympy, and formulas back to sympy."""

from fractions import Fraction

import pytest
import sympy
from support import NAMES, described

from phigen.errors import LimitError, SpecError
from phigen.geometry.shapes import LiePoisson
from phigen.geometry.sympy_bridge import expression, to_sympy
from phigen.geometry.system import System
from phigen.symbolic.elliptic import ELLIPTIC, THIRD
from phigen.symbolic.expression import call, symbol
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.remainders import QUOTIENTS, REMAINDERS
from phigen.symbolic.special import SPECIAL
from phigen.symbolic.symbols import momentum
from phigen.symbolic.universal import ANOMALY
from phigen.symbolic.verdict import PROVED, decide_zero

x, y, z = sympy.symbols("x y z")
a = sympy.Symbol("a", positive=True)


def test_rigid_body_from_sympy():
    s = System.from_sympy(
        [x, y, z],
        [[0, -z, y], [z, 0, -x], [-y, x, 0]],
        x**2 / (2 * a) + y**2,
        {a: sympy.Rational(5, 2)},
        casimirs={"C": x**2 + y**2 + z**2},
        invariants={"H2": x**2 / (2 * a) + y**2},
        name="body",
    )
    assert isinstance(s.shape, LiePoisson)
    assert (s.name, s.coordinates, s.parameter_names, s.positive) == ("body", ("x", "y", "z"), ("a",), ("a",))
    assert s.parameters[0].value == Fraction(5, 2)
    assert list(s.casimirs) == ["C"]
    assert str(s.vector_field()[0]) == "(-2)*(y*z)"


@pytest.mark.parametrize(
    "name", sorted(set(FUNCTIONS) - {"power", "choose", ANOMALY, *ELLIPTIC, THIRD, *REMAINDERS, *QUOTIENTS, *SPECIAL})
)
def test_every_function_goes_to_sympy_and_back(name):
    e = call(name, *[symbol("x"), symbol("y")][: FUNCTIONS[name].arity])
    back = expression(to_sympy(e))
    assert decide_zero("round trip", [("", back - e)], positive=["x"]).holds


def test_arithmetic_goes_to_sympy_and_back():
    u, v = symbol("u"), symbol(momentum("v"))
    e = (u - v) ** 3 / (1 + u * v) - 2 * u ** Fraction(1, 2) / 3
    (difference,) = [expression(to_sympy(e)) - e]
    assert "p_v" in str(difference)
    from phigen.symbolic.expression import substitute

    (difference,) = substitute([difference], {"p_v": v})
    assert decide_zero("round trip", [("", difference)]).verdict == PROVED


def test_floats_are_the_decimals_they_print():
    assert expression(sympy.Float("0.1")).value == Fraction(1, 10)
    assert expression(0.1).value == Fraction(1, 10)


def test_symbolic_exponents_and_constants():
    assert str(expression(x**a)) == "x**(a)"
    assert str(expression(sympy.exp(1) * sympy.pi)) == "pi*E"


@pytest.mark.parametrize("bad", [sympy.gamma(x), sympy.I * x, sympy.oo, sympy.zoo, sympy.Function("f")(x), "x**2"])
def test_what_has_no_counterpart_is_refused(bad):
    with pytest.raises(SpecError):
        expression(bad)


def test_a_refused_function_is_answered_with_the_functions_of_specs():
    with pytest.raises(SpecError, match=r"hint: functions are sqrt, exp, log, .*, abs$"):
        expression(sympy.erf(x))


OUT_OF_RANGE = {
    "integer": 10**400,
    "integer that cannot be printed": -(10**5000),
    "rational": sympy.Rational(1, 10**90),
    "large float": sympy.Float("1e9999"),
    "small float": sympy.Float("1e-400"),
    "exponent": x**1001,
}


@pytest.mark.parametrize("what", OUT_OF_RANGE)
def test_numbers_keep_the_limits_of_spec_files(what):
    """Numbers from sympy obey the limits for numbers in specs. Otherwise they would fail later, when they become
    doubles.
    """
    with pytest.raises(LimitError, match="out of range"):
        System.from_sympy([x, y], [[0, 1], [-1, 0]], x + OUT_OF_RANGE[what] * y)
    assert expression(sympy.Float("1e-30")).value == Fraction(1, 10**30)


def test_text_is_never_evaluated():
    with pytest.raises(SpecError, match="text"):
        System.from_sympy([x, y], [[0, 1], [-1, 0]], "__import__('os')")


def test_unknown_and_doubled_symbols_are_errors():
    with pytest.raises(SpecError, match="unknown symbol z"):
        System.from_sympy([x, y], [[0, 1], [-1, 0]], x * z)
    with pytest.raises(SpecError, match="declared twice"):
        System.from_sympy([x, x], [[0, 1], [-1, 0]], x)


def test_matrix_of_the_wrong_size_is_an_error():
    with pytest.raises(SpecError, match="2×2, but there are 3 coordinates"):
        System.from_sympy([x, y, z], [[0, 1], [-1, 0]], x)


@pytest.mark.parametrize("name", NAMES)
def test_systems_go_to_sympy_and_back(name):
    system = described(name)[1]
    there = system.to_sympy()
    back = System.from_sympy(
        there.coordinates,
        there.poisson,
        there.hamiltonian,
        there.parameters,
        casimirs=there.casimirs,
        invariants=there.invariants,
        name=there.name,
    )
    assert (back.name, back.coordinates, back.parameter_names) == (name, system.coordinates, system.parameter_names)
    assert [(p.value, p.positive) for p in back.parameters] == [(p.value, p.positive) for p in system.parameters]
    pairs = [(back.hamiltonian, system.hamiltonian)]
    pairs += [(a, b) for rows in zip(back.poisson, system.poisson, strict=True) for a, b in zip(*rows, strict=True)]
    for mine, theirs in ((back.casimirs, system.casimirs), (back.invariants, system.invariants)):
        assert list(mine) == list(theirs)
        pairs += [(mine[k], theirs[k]) for k in theirs]
    assert decide_zero("round trip", [("", a - b) for a, b in pairs], system.positive).verdict == PROVED


def test_symbols_in_sympy_carry_what_was_declared():
    there = described("vortices3")[1].to_sympy()
    assert all(c.is_real and c.is_positive is None for c in there.coordinates)
    b = sympy.Symbol("b")
    s = System.from_sympy([x, y], [[0, 1], [-1, 0]], x**2 * b + sympy.sqrt(a**2) * y, {a: 2, b: sympy.Rational(1, 3)})
    there = s.to_sympy()
    assert there.parameters == {a: 2, sympy.Symbol("b", real=True): sympy.Rational(1, 3)}
    assert sympy.diff(there.hamiltonian, there.coordinates[1]) == a
    assert there.poisson == sympy.Matrix([[0, 1], [-1, 0]])
