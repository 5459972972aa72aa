"""Identifiers of the output: names of the user as they are where they can stand, else with underscores."""

from __future__ import annotations

import re
from collections.abc import Iterable

from phigen.symbolic.symbols import TEMPORARY, Symbol

_C = """auto break case char const continue default do double else enum extern float for goto if inline int long
register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
_Bool _Complex _Imaginary alignas alignof and and_eq asm bitand bitor bool catch char8_t char16_t char32_t class compl
concept consteval constexpr constinit const_cast co_await co_return co_yield decltype delete dynamic_cast explicit
export false friend mutable namespace new noexcept not not_eq nullptr operator or or_eq private protected public
reinterpret_cast requires static_assert static_cast template this thread_local throw true try typeid typename using
virtual wchar_t xor xor_eq typeof"""

# Macros that headers or compilers define, and everything that <math.h> and <stdlib.h> declare.
_MACROS = """I NULL EOF NAN INFINITY HUGE_VAL linux unix i386 near far small min max errno assert main DBL_MAX
DBL_MIN DBL_EPSILON size_t ptrdiff_t stdin stdout stderr signbit isnan isinf isfinite fpclassify complex imaginary"""
_LIBM = """acos asin atan atan2 ceil cos cosh exp fabs floor fmod frexp ldexp log log10 modf pow sin sinh sqrt tan tanh
acosh asinh atanh cbrt copysign erf erfc exp2 expm1 fdim fma fmax fmin hypot ilogb lgamma llrint llround log1p log2
logb lrint lround nan nearbyint nextafter nexttoward remainder remquo rint round scalbln scalbn tgamma trunc abs
j0 j1 jn y0 y1 yn gamma signgam div index time clock exit abort free malloc random"""

C_RESERVED = frozenset((_C + " " + _MACROS + " " + _LIBM).split())

_PYTHON = """False None True and as assert async await break class continue def del elif else except finally for from
global if import in is lambda nonlocal not or pass raise return try while with yield match case type np abs
print self DIM ORDER CASIMIRS DEFAULT_PARAMETERS StepError step integrate hamiltonian casimirs vector_field
x0 steps stride parameters _filled _sum _values"""

PYTHON_RESERVED = frozenset(_PYTHON.split())


class Scope:
    """Distinct identifiers for the names of one function."""

    def __init__(self, reserved: Iterable[str]) -> None:
        self._taken = set(reserved)
        self._given: dict[str, str] = {}

    def __getitem__(self, name: str) -> str:
        """The identifier of a symbol; temporary 12 becomes ``t12``."""
        if name not in self._given:
            temporary = isinstance(name, Symbol) and name.kind == TEMPORARY
            wanted = name.replace(":", "") if temporary else re.sub(r"\W", "_", name, flags=re.ASCII)
            # t12 is a temporary; a coordinate of that name gives way.
            while wanted in self._taken or (re.fullmatch(r"t\d+", wanted) and not temporary):
                wanted += "_"
            self._taken.add(wanted)
            self._given[name] = wanted
        return self._given[name]

    def bind(self, name: str, code: str) -> None:
        """Use a piece of code, such as ``coef[3]``, wherever the symbol occurs."""
        self._given[name] = code
