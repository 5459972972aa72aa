"""Every operator, function and constant, rendered, compiled and evaluated for each target."""

from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from support import TARGETS, compile_text, solver, values

from phigen.scheme.kernel import Kernel, Output
from phigen.symbolic.entire import ENTIRE
from phigen.symbolic.expression import EULER, ONE, PI, call, number, power, raw, symbol
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.special import SPECIAL

x, y, z = symbol("x"), symbol("y"), symbol("z")
HALF = Fraction(1, 2)

POINTS = np.array([[0.4, 0.7, 1.9], [0.013, 0.99, 12.5], [0.73, 0.25, 3.0]])  # x, y in (0, 1); z > 1

#: Arguments that are in the domain of the function at every point.
ARGUMENTS = dict.fromkeys(("exp", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"), (-x,))
ARGUMENTS |= {
    "asinh": (-z,),
    "acosh": (z,),
    "atanh": (-y,),
    "log": (x,),
    "expm1": (y,),
    "versin": (y,),
    "log1p": (-x,),
    "inv": (y + z,),
    "inv0": (y + z,),
    "abs": (y - z,),
    "sign": (x - y,),
}
ARGUMENTS |= {"atan2": (-x, y - z), "power": (z, y - 3 * x), "tanhalf": (call("sin", y), call("versin", y))}
ARGUMENTS |= {"choose": (x - y, x * z, y - z), "anomaly": (x + y, z, x - y, y / 2 - x, y, x)}
ARGUMENTS |= dict.fromkeys(("amplitude", "amplitude1", "amplitude2"), (z / 4, x + y, x))
ARGUMENTS |= {"amplitude3": (z / 4, x + y, x, -y)}  # 1 − nS² ≥ 1
ARGUMENTS |= {f"{name}{k}": (z / 4, x, -y, x - y, x) for name in ("exprem", "expquo") for k in range(4)}

#: Arguments of φ and its derivatives: near 0, larger, and beyond 16, with both signs.
SPECIAL_ARGUMENTS = {"near": x / 5, "near-": -x / 5, "far": 9 * z - 20 * y, "far-": 17 * x - 20 * z}

EXPONENTS = [2, 3, -1, HALF, -HALF, Fraction(1, 3), Fraction(-3, 2), Fraction(5, 7)]
EXPONENTS += [-2, -3, 7, 12, Fraction(2, 3), Fraction(-4, 3), Fraction(7, 2), Fraction(-5, 7)]

NUMBERS = [Fraction(n) for n in (1, -1, 3, -7, 2**53 - 1, 2**53, 2**53 + 1, 10**22 + 1, -(10**39))]
NUMBERS += [Fraction(1, 3), Fraction(-7, 11), Fraction(1, 1024), Fraction(123456789, 1000003), Fraction(10**7 + 1, 3)]
NUMBERS += [Fraction(1, 10**39), Fraction(-1, 10**17), Fraction("0.1"), Fraction("-3.14159"), Fraction(2, 10**6 + 3)]

#: Bounds relative to the value. φ' and φ'' occur only in Newton matrices, and as factors of a last correction.
BOUNDS = {"phi1": 1e-13, "phi2": 1e-13, "sinroot1": 1e-14, "arcroot1": 1e-14, "exprel1": 1e-14}
#: Derivatives of elliptic integrals occur in gradients and tangent maps; exponentials of matrices round at each
#: doubling of t.
BOUNDS |= {"amplitude1": 1e-14, "amplitude2": 1e-14, **{f"exprem{k}": 3e-15 for k in range(4)}}


def binary(op, a, b):
    """Return a binary node without simplification."""
    return raw(op, (a, b))


def cases():
    """Yield names and expressions."""
    for name in FUNCTIONS:
        if name in SPECIAL:
            yield from ((f"{name} {where}", call(name, e)) for where, e in SPECIAL_ARGUMENTS.items())
        elif name in ENTIRE:
            yield from ((f"{name} of {e}", call(name, e)) for e in (x / 5, -x / 5, y, z, -z))
        else:
            yield name, call(name, *ARGUMENTS[name])
    for exponent in EXPONENTS:
        yield f"z**({exponent})", power(z, exponent)
        yield f"(y+z)**({exponent})", power(y + z, exponent)
    for exponent in (2, 3, -1, -2, 5):
        yield f"(y-z)**({exponent})", power(y - z, exponent)
        yield f"(-z)**({exponent})", raw("pow", (-z,), Fraction(exponent))
    for value in NUMBERS:
        yield f"{value}", number(value)
        yield f"z*({value})", binary("mul", z, number(value))
        yield f"({value})*z", binary("mul", number(value), z)
        yield f"z-({value})", binary("sub", z, number(value))
        yield f"({value})/z", binary("mul", number(value), power(z, -1))
        yield f"z/({value})", binary("mul", z, raw("pow", (number(value),), Fraction(-1)))
    yield from {"pi": PI, "E": EULER, "pi*x": PI * x, "E**y": call("power", EULER, y), "1": ONE}.items()
    yield from nested()


def nested():
    """Yield every operator as the operand of every other one, each with its own constant, since shared subexpressions
    become temporaries.
    """
    constants = (number(1 + Fraction(k, 1024)) for k in range(1000))

    def made(form):
        c = next(constants)
        match form:
            case "add" | "sub" | "mul":
                return binary(form, x, c)
            case "quotient":
                return binary("mul", binary("add", x, c), power(y, -1))
            case "reverse":
                return binary("mul", power(y, -1), binary("add", x, c))
            case "neg":
                return raw("neg", (binary("mul", x, c),))
            case "reciprocal":
                return raw("pow", (binary("add", x, c),), Fraction(-1))
            case "square":
                return raw("pow", (binary("add", x, c),), Fraction(2))
        return c

    for form in ("add", "sub", "mul", "quotient", "reverse", "neg", "reciprocal", "square", "number"):
        for outer in ("add", "sub", "mul"):
            yield f"({form}) {outer} z", binary(outer, made(form), z)
            yield f"z {outer} ({form})", binary(outer, z, made(form))
            yield f"({form}) {outer} (add)", binary(outer, made(form), made("add"))
            yield f"({form}) {outer} (sub)", binary(outer, made(form), made("sub"))
            yield f"({form}) {outer} (neg)", binary(outer, made(form), made("neg"))
        yield f"neg {form}", raw("neg", (made(form),))
        yield f"neg neg {form}", raw("neg", (raw("neg", (made(form),)),))
        yield f"1/({form})", raw("pow", (made(form),), Fraction(-1))
        yield f"1/(1/({form}))", raw("pow", (raw("pow", (made(form),), Fraction(-1)),), Fraction(-1))
        yield f"z/({form})", binary("mul", z, raw("pow", (made(form),), Fraction(-1)))
        yield f"1/(z)/({form})", binary("mul", power(z, -1), raw("pow", (made(form),), Fraction(-1)))
        yield f"sqrt({form})**2", raw("pow", (raw("pow", (call("abs", made(form)),), HALF),), Fraction(2))
        yield f"({form})**2*z", binary("mul", raw("pow", (made(form),), Fraction(2)), z)
        yield f"z/({form})**2", binary("mul", z, raw("pow", (raw("pow", (made(form),), Fraction(2)),), Fraction(-1)))


@pytest.fixture(scope="module")
def everything():
    """Return a program whose Casimirs are all the cases."""
    base = compile_text(
        "coordinates: [x, y, z]\npoisson: {matrix: [[0, 1, 0], [-1, 0, 0], [0, 0, 0]]}\nhamiltonian: x\n"
    )
    named = list(cases())
    kernel = replace(base.program.observables.casimirs, outputs=(Output("out", tuple(e for _, e in named)),))
    program = replace(
        base.program,
        casimirs=tuple(f"C{k}" for k in range(len(named))),
        observables=replace(base.program.observables, casimirs=kernel),
    )
    return replace(base, program=program), named


def size_of_operands(e, value_of):
    """Return the magnitude to which rounding errors are relative: the value, or the operands of its outermost sum."""
    return max(abs(value_of[node]) for node in ([e, *e.args] if e.op in ("add", "sub") else [e]))


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", TARGETS)
def test_everything_that_can_be_written_is_computed_right(everything, target):
    compilation, named = everything
    assert {e.op for _, e in named} >= {*FUNCTIONS, "number", "pi", "E", "add", "sub", "neg", "mul", "pow"}
    integrator = solver(compilation, target).casimirs(POINTS)
    wrong = []
    with mpmath.workdps(40):
        for i, point in enumerate(POINTS):
            at = dict(zip("xyz", map(mpmath.mpf, point), strict=True))
            nodes = [node for _, e in named for node in (e, *e.args)]
            value_of = dict(zip(nodes, values(nodes, at), strict=True))
            for k, (name, e) in enumerate(named):
                error = abs(mpmath.mpf(float(integrator[f"C{k}"][i])) - value_of[e])
                if not error <= BOUNDS.get(e.op, 1e-15) * size_of_operands(e, value_of):
                    wrong.append(f"{name} at {dict(at)}: {integrator[f'C{k}'][i]!r} instead of {value_of[e]}")
    assert not wrong, "\n".join(wrong)


def test_kernels_of_that_program_are_not_constant(everything):
    compilation, _ = everything
    kernel = compilation.program.observables.casimirs
    assert isinstance(kernel, Kernel)
    assert len(set(kernel.roots)) > 150
