"""Conversions of expressions and systems to sympy and back.

Only modules that need sympy import this module, since importing sympy takes a quarter of a second.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Protocol

import sympy

from phigen.errors import Diagnostic, LimitError, SpecError
from phigen.spec import limits
from phigen.spec.model import MatrixForm, Parameter
from phigen.spec.names import SPEC_FUNCTIONS
from phigen.symbolic.arithmetic import Arithmetic
from phigen.symbolic.expression import (
    EULER,
    PI,
    Expression,
    call,
    familiar,
    number,
    power,
    product,
    symbol,
    symbols_of,
    total,
)
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.special import SPECIAL, order_of
from phigen.symbolic.symbols import plain

#: Functions with different names in sympy and phigen: name in sympy → name in phigen.
_FROM_SYMPY = {"Abs": "abs"}
_TO_SYMPY = {"abs": "Abs"}


def expression(value: Any) -> Expression:
    """Return a sympy expression or a number as an `Expression`.

    A Float becomes the decimal number that sympy prints for it. Raises `SpecError` for functions and constants that
    phigen does not have, and for text, which sympy would evaluate as Python. Raises `LimitError` for numbers out of
    range.
    """
    if isinstance(value, str):
        raise SpecError([Diagnostic(f"{value!r} is text, not a sympy expression")])
    return _convert(sympy.sympify(value, strict=True), {})


def _convert(e: Any, symbols_by_name: dict[Any, Expression]) -> Expression:
    converted = symbols_by_name.get(e)
    if converted is None:
        converted = symbols_by_name[e] = _node(e, [_convert(a, symbols_by_name) for a in e.args])
    return converted


def _node(e: Any, args: list[Expression]) -> Expression:
    if e.is_Symbol:
        return symbol(e.name)
    if e.is_Rational or (e.is_Float and e.is_finite):
        return number(_rational(e))
    if e is sympy.pi:
        return PI
    if e is sympy.E:
        return EULER
    if e.is_Add:
        return total(args)
    if e.is_Mul:
        return product(args)
    if isinstance(e, sympy.Pow):
        if args[1].is_number and abs(args[1].value) > limits.EXPONENT:
            hint = f"exponents are between -{limits.EXPONENT} and {limits.EXPONENT}"
            raise LimitError([Diagnostic("an exponent is out of range", hint=hint)])
        return power(args[0], args[1])
    name = type(e).__name__
    name = _FROM_SYMPY.get(name, name)
    function = FUNCTIONS.get(name)
    if function and function.arity == len(args) and (name == "sign" or not function.own):
        return call(name, *args)
    hint = f"functions are {', '.join(SPEC_FUNCTIONS)}"
    raise SpecError([Diagnostic(f"{e} has no counterpart in phigen", hint=hint)])


def _rational(e: Any) -> Fraction:
    """Return a sympy number as a fraction. Raises `LimitError` for a number that is too large or too long for a
    spec.
    """
    # The size is checked before the conversion: as a fraction, a Float of 1e999999 has a million digits.
    if abs(e) < limits.NUMBER and (e == 0 or abs(e) > Fraction(1, limits.DENOMINATOR)):
        value = Fraction(str(e)) if e.is_Float else Fraction(int(e.p), int(e.q))
        if limits.number_is_bounded(value):
            return value
    hint = "constants are below 1e40, with at most 79 decimals"
    raise LimitError([Diagnostic("a number is out of range", hint=hint)])


def named_function(order: int, s: Any) -> Any:
    """Return φ, φ′ or φ″ at s as a function symbol, for display in formulas; ``order`` is the number of primes.

    φ is the function of `phigen.symbolic.special`.
    """
    return sympy.Function(r"\varphi" + "'" * order)(s)


def closed_function(order: int, s: Any) -> Any:
    """Return φ(s) = (1 − (√s/2) cot(√s/2))/s in closed form, or its derivative of order ``order``."""
    u = sympy.Dummy("u")
    return sympy.diff((1 - sympy.sqrt(u) / 2 * sympy.cot(sympy.sqrt(u) / 2)) / u, u, order).subs(u, s)


def expanded_function(order: int, s: Any, degree: int) -> Any:
    """Return the power series of φ(s) = Σ |B_{2n+2}| s^n/(2n+2)!, or of a derivative of φ, up to a ``degree`` in s.

    ``order`` is the order of the derivative. The B_k are Bernoulli numbers.
    """
    u = sympy.Dummy("u")
    terms = (abs(sympy.bernoulli(2 * n + 2)) / sympy.factorial(2 * n + 2) * u**n for n in range(degree + order + 1))
    return sympy.diff(sum(terms), u, order).subs(u, s)


class _Sympy(Arithmetic[Any]):
    """Visitor that converts an `Expression` to sympy; see `to_sympy`."""

    def __init__(self, symbols: Mapping[str, Any], special: Callable[[int, Any], Any]) -> None:
        self._symbols, self._special = symbols, special

    def constant(self, value: Fraction) -> Any:
        return sympy.Rational(value.numerator, value.denominator)

    def variable(self, name: str) -> Any:
        letters = plain(name).replace("λ_", "lambda_")
        return self._symbols.get(name) or sympy.Symbol(letters, real=True)

    def power(self, base: Any, exponent: Fraction) -> Any:
        return base ** self.constant(exponent)

    def function(self, name: str, args: list[Any]) -> Any:
        if not args:
            return sympy.pi if name == "pi" else sympy.E
        if name in SPECIAL:
            return self._special(order_of(name), *args)
        return args[0] ** args[1] if name == "power" else getattr(sympy, _TO_SYMPY.get(name, name))(*args)


def to_sympy(
    e: Expression,
    symbols: Mapping[str, Any] | None = None,
    special: Callable[[int, Any], Any] = named_function,
) -> Any:
    """Return an expression as a sympy object, for instance for ``sympy.latex``.

    ``symbols`` maps names to sympy symbols. Other names become real symbols, and the momentum of x becomes ``p_x``.
    ``special(k, s)`` returns the k-th derivative of φ at s as a sympy object, as `named_function` and `closed_function`
    do. φ is the function of `phigen.symbolic.special`.
    """
    return _Sympy(symbols or {}, special).values(familiar([e]))[0]


@dataclass(frozen=True)
class SympySystem:
    """A `System` as sympy objects; `System.from_sympy` converts it back.

    Symbols are real, and positive for parameters that are positive in the system. ``poisson`` is an immutable n×n
    matrix. ``parameters`` maps symbols to default values. ``casimirs`` has the declared Casimirs, then those that
    phigen found. ``time`` is the symbol of the time, or None.
    """

    name: str
    coordinates: tuple[Any, ...]
    poisson: Any
    hamiltonian: Any
    parameters: Mapping[Any, Any]
    casimirs: Mapping[str, Any]
    invariants: Mapping[str, Any]
    time: Any = None


class Described(Protocol):
    """Protocol of the attributes of a `System` that are converted to sympy."""

    @property
    def name(self) -> str: ...
    @property
    def coordinates(self) -> tuple[str, ...]: ...
    @property
    def time(self) -> str: ...
    @property
    def times(self) -> tuple[str, ...]: ...
    @property
    def parameters(self) -> tuple[Parameter, ...]: ...
    @property
    def poisson(self) -> tuple[tuple[Expression, ...], ...]: ...
    @property
    def hamiltonian(self) -> Expression: ...
    @property
    def casimirs(self) -> Mapping[str, Expression]: ...
    @property
    def invariants(self) -> Mapping[str, Expression]: ...


def symbols_in_sympy(system: Described) -> dict[str, Any]:
    """Return the sympy symbols of the coordinates, the parameters and the time of a system, by name."""
    real = {c: sympy.Symbol(c, real=True) for c in (*system.coordinates, *system.times)}
    parameters = {p.name: sympy.Symbol(p.name, **_assumed(p)) for p in system.parameters}
    return real | parameters


def _assumed(parameter: Parameter) -> dict[str, bool]:
    return {parameter.bound or "real": True}


def free_symbols(names: Iterable[str], used_names: Iterable[str]) -> list[Any]:
    """Return real sympy symbols with these names; a name that is already used gets a trailing underscore."""
    taken_names = {str(name) for name in used_names}
    result = []
    for name in names:
        while name in taken_names:
            name += "_"
        taken_names.add(name)
        result.append(sympy.Symbol(name, real=True))
    return result


def given_back(system: Described) -> SympySystem:
    """Return a system as sympy objects, for `System.to_sympy`."""
    symbols = symbols_in_sympy(system)

    def formula(e: Expression) -> Any:
        return to_sympy(e, symbols)

    return SympySystem(
        system.name,
        tuple(symbols[c] for c in system.coordinates),
        sympy.ImmutableMatrix([[formula(e) for e in row] for row in system.poisson]),
        formula(system.hamiltonian),
        {symbols[p.name]: sympy.Rational(p.value.numerator, p.value.denominator) for p in system.parameters},
        {name: formula(e) for name, e in system.casimirs.items()},
        {name: formula(e) for name, e in system.invariants.items()},
        symbols.get(system.time),
    )


def parts(
    coordinates: Sequence[Any],
    poisson: Any,
    hamiltonian: Any,
    parameters: Mapping[Any, Any] | None,
    casimirs: Mapping[str, Any] | None,
    invariants: Mapping[str, Any] | None,
    time: Any = None,
) -> dict[str, Any]:
    """Return the arguments of `build_system` for a system that is given by sympy objects, for `System.from_sympy`."""
    when = "" if time is None else _name(time)
    names = tuple(_name(c) for c in coordinates)
    matrix = sympy.Matrix(poisson)
    rows = tuple(tuple(expression(matrix[i, j]) for j in range(matrix.cols)) for i in range(matrix.rows))
    declared = tuple(_parameter(p, value) for p, value in (parameters or {}).items())
    formulas = {key: expression(e) for key, e in {**(casimirs or {}), **(invariants or {})}.items()}
    energy = expression(hamiltonian)
    casimir_formulas = [formulas[key] for key in casimirs or {}]
    _expect_known(names, declared, [*(e for row in rows for e in row), *casimir_formulas])
    _expect_known((*names, *filter(None, [when])), declared, [energy, *formulas.values()])
    return {
        "coordinates": names,
        "parameters": declared,
        "form": MatrixForm(rows),
        "hamiltonian": energy,
        "casimirs": {key: formulas[key] for key in casimirs or {}},
        "time": when,
        "invariants": {key: formulas[key] for key in invariants or {}},
    }


def _name(name_or_symbol: Any) -> str:
    return name_or_symbol if isinstance(name_or_symbol, str) else str(name_or_symbol.name)


def _parameter(name_or_symbol: Any, value: Any) -> Parameter:
    default = expression(value)
    if not default.is_number:
        raise SpecError(
            [Diagnostic(f"parameter {_name(name_or_symbol)}: its default {value} is not a rational number")]
        )
    positive = not isinstance(name_or_symbol, str) and name_or_symbol.is_positive is True
    return Parameter(_name(name_or_symbol), default.value, positive)


def _expect_known(names: Sequence[str], parameters: Sequence[Parameter], roots: Sequence[Expression]) -> None:
    everything = [*names, *(p.name for p in parameters)]
    doubled = sorted(n for n in set(everything) if everything.count(n) > 1)
    if doubled:
        raise SpecError([Diagnostic(f"{doubled[0]} is declared twice")])
    unknown = [s for s in symbols_of(*roots) if s not in everything]
    if unknown:
        raise SpecError([Diagnostic(f"unknown symbol {unknown[0]}: it is neither a coordinate nor a parameter")])
