"""The elementary functions: one record for each, with all its properties.

Properties that are formulas, such as derivatives, are Python functions that use arithmetic and an argument ``call``,
which applies a function by its name. So the same formula serves expressions, sympy, numbers and elements of a ring.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from typing import Any

from phigen.symbolic import elliptic, entire, remainders, special, universal
from phigen.symbolic.entire import ENTIRE
from phigen.symbolic.special import SPECIAL

HALF = Fraction(1, 2)

#: Type of ``call``, which applies a function to arguments: ``call("sin", x)``.
Call = Callable[..., Any]


def _everywhere(*arguments: Fraction) -> bool:
    return True


@dataclass(frozen=True)
class Function:
    """A function that may occur in expressions.

    ``slopes(call, f, *arguments)`` returns the partial derivatives, where f is the value of the function; ``slopes`` is
    None if they are unknown. ``known(call, *arguments)`` expresses the function by well-known functions.
    ``value(library, *arguments)`` computes the function by other functions from a library, `math` or an mpmath context;
    if ``value`` is None, the library must have a function of the same name. ``at_zero`` is the value at 0, or None if
    it is not rational. ``parity`` is even or odd. ``inverse`` is the name of the inverse function. ``defined`` tests
    whether the function has a value at rational arguments, and ``rational`` is true if this value is rational. ``cost``
    is the time of a call in units of one addition. An ``own`` function is internal: a spec cannot use it.

    ``written`` maps a language to the spelling of the function: a name, or a text with ``{0}``, ``{1}`` for the
    arguments. In languages without an entry, the generated file defines the function. ``lanes`` is the spelling in C
    loops over SIMD lanes: the name of a vectorised version, or a formula that contains only vectorised functions.
    ``inline`` is true if compiled C computes the function by arithmetic or one instruction, without a call. ``near`` is
    true if flows replace the function by a polynomial for small arguments. ``letters`` is the name in mathematics.
    """

    name: str
    arity: int = 1
    own: bool = False
    slopes: Callable[..., tuple[Any, ...]] | None = None
    known: Callable[..., Any] | None = None
    value: Callable[..., Any] | None = None
    at_zero: Fraction | None = Fraction(0)
    parity: str = ""
    inverse: str = ""
    defined: Callable[..., bool] = _everywhere
    rational: bool = False
    cost: int = 20
    written: Mapping[str, str] = field(default_factory=dict)
    lanes: str = ""
    inline: bool = False
    near: bool = False
    letters: str = ""


#: Spelling of the name ``{}`` of a library function in each language.
_LIBRARIES = {"c": "{}", "numpy": "np.{}", "js": "Math.{}"}


def _library(name: str, **other_names: str) -> dict[str, str]:
    """Return format strings, by language, for a function that the libraries of all languages have.

    ``other_names`` maps a language to the name of the function in its library, where this name is not ``name``.
    """
    return {language: call.format(other_names.get(language, name)) for language, call in _LIBRARIES.items()}


def _inverse(library: Any, a: Any) -> Any:
    if a <= 0:
        raise ValueError("inv of a value that is not positive")
    return 1 / a


_LISTED = (
    Function(
        "exp",
        slopes=lambda call, f, a: (f,),
        at_zero=Fraction(1),
        inverse="log",
        written=_library("exp"),
        lanes="exp",
    ),
    Function(  # exp(a) − 1 without cancellation
        "expm1",
        own=True,
        slopes=lambda call, f, a: (1 + f,),
        known=lambda call, a: call("exp", a) - 1,
        written=_library("expm1"),
        lanes="expm1",
        near=True,
    ),
    Function(  # 1 − cos(a) without cancellation
        "versin",
        own=True,
        slopes=lambda call, f, a: (call("sin", a),),
        known=lambda call, a: 1 - call("cos", a),
        parity="even",
        value=lambda library, a: 2 * library.sin(a / 2) ** 2,
        written={
            "c": "(2.0 * sin(0.5 * ({0})) * sin(0.5 * ({0})))",
            "numpy": "(2.0 * np.sin(0.5 * ({0})) ** 2)",
            "js": "(2.0 * Math.sin(0.5 * ({0})) ** 2)",
        },
        lanes="(2.0 * {sin}(0.5 * ({{0}})) * {sin}(0.5 * ({{0}})))",
        near=True,
    ),
    Function(  # tan(θ/2) from a = sin θ and b = 1 − cos θ, without cancellation for any θ
        "tanhalf",
        arity=2,
        own=True,
        known=lambda call, a, b: a * call("inv", 2 - b),
        value=lambda library, a, b: a / (2 - b) if b < 1 else b / a,
        at_zero=None,
        cost=5,
        written={
            "c": "({1} < 1.0 ? ({0}) / (2.0 - ({1})) : ({1}) / ({0}))",
            "numpy": "np.where({1} < 1.0, ({0}) / (2.0 - ({1})), ({1}) / ({0}))",
            "js": "({1} < 1.0 ? ({0}) / (2.0 - ({1})) : ({1}) / ({0}))",
        },
        inline=True,
    ),
    Function(  # log(1 + a) without cancellation
        "log1p",
        own=True,
        slopes=lambda call, f, a: (1 / (1 + a),),
        known=lambda call, a: call("log", 1 + a),
        written=_library("log1p"),
    ),
    Function(  # 1/a for a > 0, else NaN: a flow with this factor ends where a reaches 0
        "inv",
        own=True,
        slopes=lambda call, f, a: (-(f**2),),
        known=lambda call, a: 1 / a,
        value=_inverse,
        at_zero=None,
        cost=5,
        written={
            "c": "({0} > 0.0 ? 1.0 / ({0}) : (double)NAN)",
            "numpy": "np.where({0} > 0.0, 1.0 / ({0}), np.nan)",
            "js": "({0} > 0.0 ? 1.0 / ({0}) : NaN)",
        },
        inline=True,
    ),
    Function(  # 1/a for a > 0, else 0; used in products whose second factor is 0 for a ≤ 0
        "inv0",
        own=True,
        slopes=lambda call, f, a: (-(f**2),),
        known=lambda call, a: 1 / a,
        value=lambda library, a: 1 / a if a > 0 else 0 * a,
        at_zero=None,
        cost=5,
        written={
            "c": "({0} > 0.0 ? 1.0 / ({0}) : 0.0)",
            "numpy": "np.where({0} > 0.0, 1.0 / ({0}), 0.0)",
            "js": "({0} > 0.0 ? 1.0 / ({0}) : 0.0)",
        },
        inline=True,
    ),
    Function(
        "log",
        slopes=lambda call, f, a: (1 / a,),
        at_zero=None,
        inverse="exp",
        defined=lambda a: a > 0,
        written=_library("log"),
        lanes="log",
    ),
    Function(
        "sin",
        slopes=lambda call, f, a: (call("cos", a),),
        parity="odd",
        written=_library("sin"),
        lanes="sin",
        near=True,
    ),
    Function(
        "cos",
        slopes=lambda call, f, a: (-call("sin", a),),
        at_zero=Fraction(1),
        parity="even",
        written=_library("cos"),
        lanes="cos",
    ),
    Function("tan", slopes=lambda call, f, a: (1 + f**2,), parity="odd", written=_library("tan")),
    Function(
        "asin",
        slopes=lambda call, f, a: ((1 - a**2) ** -HALF,),
        parity="odd",
        defined=lambda a: abs(a) <= 1,
        written=_library("asin", numpy="arcsin"),
        letters="arcsin",
    ),
    Function(
        "acos",
        slopes=lambda call, f, a: (-((1 - a**2) ** -HALF),),
        at_zero=None,
        defined=lambda a: abs(a) <= 1,
        written=_library("acos", numpy="arccos"),
        letters="arccos",
    ),
    Function(
        "atan",
        slopes=lambda call, f, a: (1 / (1 + a**2),),
        parity="odd",
        inverse="tan",
        written=_library("atan", numpy="arctan"),
        letters="arctan",
    ),
    Function(
        "atan2",
        arity=2,
        slopes=lambda call, f, a, b: (b * (radius := 1 / (a**2 + b**2)), -a * radius),
        at_zero=None,
        defined=lambda a, b: a != 0 or b != 0,
        written=_library("atan2", numpy="arctan2"),
    ),
    Function(
        "sinh",
        slopes=lambda call, f, a: (call("cosh", a),),
        parity="odd",
        inverse="asinh",
        written=_library("sinh"),
        lanes="(0.5 * ({expm1}({{0}}) - {expm1}(-({{0}}))))",
    ),
    Function(
        "cosh",
        slopes=lambda call, f, a: (call("sinh", a),),
        at_zero=Fraction(1),
        parity="even",
        written=_library("cosh"),
        lanes="(0.5 * ({exp}({{0}}) + {exp}(-({{0}}))))",
    ),
    Function(
        "tanh",
        slopes=lambda call, f, a: (1 - f**2,),
        parity="odd",
        inverse="atanh",
        written=_library("tanh"),
        lanes="({expm1}(2.0 * ({{0}})) / ({expm1}(2.0 * ({{0}})) + 2.0))",
    ),
    Function(
        "asinh",
        slopes=lambda call, f, a: ((1 + a**2) ** -HALF,),
        parity="odd",
        inverse="sinh",
        written=_library("asinh", numpy="arcsinh"),
        letters="arsinh",
    ),
    Function(
        "acosh",
        slopes=lambda call, f, a: ((a**2 - 1) ** -HALF,),
        at_zero=None,
        defined=lambda a: a >= 1,
        written=_library("acosh", numpy="arccosh"),
        letters="arcosh",
    ),
    Function(
        "atanh",
        slopes=lambda call, f, a: (1 / (1 - a**2),),
        parity="odd",
        defined=lambda a: abs(a) < 1,
        written=_library("atanh", numpy="arctanh"),
        letters="artanh",
    ),
    Function(
        "abs",
        slopes=lambda call, f, a: (call("sign", a),),
        value=lambda library, a: abs(a),
        rational=True,
        written=_library("abs", c="fabs"),
        inline=True,
    ),
    Function(  # the derivative of abs
        "sign",
        own=True,
        slopes=lambda call, f, a: (0,),
        value=lambda library, a: (a > 0) - (a < 0),
        rational=True,
        parity="odd",
        written={"c": "(double)(({0} > 0.0) - ({0} < 0.0))", "numpy": "np.sign", "js": "Math.sign"},
        inline=True,
        letters="sgn",
    ),
    Function(  # b where a > 0, else c
        "choose",
        arity=3,
        own=True,
        slopes=lambda call, f, a, b, c: (0, call("choose", a, one := 1 + 0 * b, 0 * b), call("choose", a, 0 * b, one)),
        value=lambda library, a, b, c: b if a > 0 else c,
        at_zero=None,
        rational=True,
        cost=2,
        written={
            "c": "({0} > 0.0 ? {1} : {2})",
            "numpy": "np.where({0} > 0.0, {1}, {2})",
            "js": "({0} > 0.0 ? {1} : {2})",
        },
        inline=True,
    ),
    Function(  # base**exponent with an exponent that is not a rational number
        "power",
        arity=2,
        own=True,
        slopes=lambda call, f, a, b: (f * b / a, f * call("log", a)),
        at_zero=None,
        written=_library("pow", numpy="power"),
    ),
)


def _phi(order: int) -> Function:
    """Return the record of φ (`phigen.symbolic.special`) for ``order`` 0, or of the derivative φ′ or φ″ for ``order`` 1
    or 2.

    The ``cost`` in the record is the time for small arguments: a series of nine terms, and a test of the argument.
    """
    name, further = SPECIAL[order], SPECIAL[order + 1 : order + 2]
    return Function(
        name,
        own=True,
        slopes=(lambda call, f, s: (call(*further, s),)) if further else None,
        value=lambda library, s: special.value(library, order, s),
        at_zero=special.coefficient(order, 0),
        cost=18,
        lanes=name,
        letters=("φ", "φ′", "φ″")[order],
    )


def _entire(name: str) -> Function:
    """Return the record of a function of `phigen.symbolic.entire`.

    In flows, calls with small arguments use a polynomial in place of the function.
    """
    series = ENTIRE[name]
    return Function(
        name,
        own=True,
        slopes=series.slopes,
        known=series.known,
        value=lambda library, s: entire.value(library, name, s),
        at_zero=series.coefficient(0),
        cost=18,
        near=True,
    )


#: All functions by name. Generated files define and list functions in this order.
FUNCTIONS: dict[str, Function] = {f.name: f for f in _LISTED}
FUNCTIONS |= {name: _phi(order) for order, name in enumerate(SPECIAL)}
FUNCTIONS |= {name: _entire(name) for name in ENTIRE}
FUNCTIONS[universal.ANOMALY] = Function(  # for Kepler motions, computed by iteration; see `phigen.symbolic.universal`
    universal.ANOMALY,
    arity=6,
    own=True,
    slopes=universal.slopes,
    value=universal.value,
    at_zero=None,
    cost=120,
    near=True,
)
#: Elliptic functions, in which the motion of free rigid bodies is written; see `phigen.symbolic.elliptic`.
FUNCTIONS |= {
    name: Function(
        name,
        arity=3,
        own=True,
        slopes=elliptic.slopes if name == elliptic.AMPLITUDE else None,
        value=value,
        cost=120,
        near=True,
    )
    for name, value in zip(elliptic.ELLIPTIC, (elliptic.value, elliptic.squares, elliptic.ratios), strict=True)
}
FUNCTIONS[elliptic.THIRD] = Function(elliptic.THIRD, arity=4, own=True, value=elliptic.third, cost=160)
#: Functions in which exponentials of matrices are written; see `phigen.symbolic.remainders`.
FUNCTIONS |= {
    name: Function(
        name,
        arity=5,
        own=True,
        slopes=remainders.slopes(k) if name in remainders.REMAINDERS else None,
        value=partial(value, k),
        cost=160,
        near=True,
    )
    for names, value in ((remainders.REMAINDERS, remainders.value), (remainders.QUOTIENTS, remainders.quotient))
    for k, name in enumerate(names)
}

#: The square root and the cube root. Expressions write them as powers with the exponents ½ and ⅓, but languages have
#: functions for them.
ROOTS = {"sqrt": _library("sqrt"), "cbrt": _library("cbrt")}


def written_in(language: str) -> dict[str, str]:
    """Return the spelling, in a language, of the functions and roots that the generated file does not define."""
    spellings = {f.name: f.written[language] for f in FUNCTIONS.values() if language in f.written}
    return spellings | {name: forms[language] for name, forms in ROOTS.items()}
