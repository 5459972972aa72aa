"""The types of real numbers in C: the spelling of types, literals, limits and library functions.

Functions of the loop IR are printed directly in the type of a program. The runtime and the templates are written for
``double``, and `Real.spelt` translates them to another type. The translation changes the values of thresholds only:
small numbers that are named by a ``#define`` and depend on the precision.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise

from phigen.scheme.program import OVERLOADED, Program
from phigen.targets.c.tokens import CToken, TokenKind, tokens
from phigen.targets.language import Language
from phigen.targets.rendering import render

#: Number of binary digits of float, divided by the number of binary digits of double.
DIGITS = 24 / 53

#: A number that is named by a ``#define`` counts as a threshold if it is at most this large.
THRESHOLD = 1e-5

#: Functions of the C library that exist in a version for each type.
_FUNCTIONS = frozenset(
    [
        "acos",
        "acosh",
        "asin",
        "asinh",
        "atan",
        "atanh",
        "cos",
        "cosh",
        "sin",
        "sinh",
        "tan",
        "tanh",
        "atan2",
        "cbrt",
        "ceil",
        "copysign",
        "erf",
        "erfc",
        "exp",
        "exp2",
        "expm1",
        "fabs",
        "fdim",
        "floor",
        "fma",
        "fmax",
        "fmin",
        "fmod",
        "frexp",
        "hypot",
        "ldexp",
        "lgamma",
        "log",
        "log10",
        "log1p",
        "log2",
        "logb",
        "nearbyint",
        "nextafter",
        "pow",
        "remainder",
        "rint",
        "round",
        "scalbn",
        "sqrt",
        "tgamma",
        "trunc",
    ]
)
_LEAST, _MOST = 2.0**-126, (2.0 - 2.0**-23) * 2.0**127


@dataclass(frozen=True)
class Real:
    """A type of real numbers in C: its ``name``, and ``words`` that take the place of the type double and its limits.

    ``function_suffix`` is appended to the names of library functions; it is "" if these are overloaded.
    """

    name: str
    words: Mapping[str, str] = field(default_factory=dict)
    function_suffix: str = ""

    def number(self, value: float) -> str:
        """Return the literal of a number."""
        return literal(value) if self.words else repr(value)

    def threshold(self, value: float) -> float:
        """Return the value of a named constant for this type; ``value`` is the value for double. Small constants are
        thresholds, which depend on the precision. Larger constants keep their values.
        """
        return threshold(value) if self.words and 0.0 < value < THRESHOLD else value

    def language(self, language: Language) -> Language:
        """Return the description of C with this type, from the description of C with double."""
        if not self.words:
            return language
        functions = {f: self._function(text) for f, text in language.functions.items()}
        constants = {name: self.spelt(text) for name, text in language.constants.items()}
        return replace(language, functions=functions, constants=constants, whole=self.number, real=self.number)

    def names(self) -> dict[str, str]:
        """The names of library functions and limits in this type, by their names for double. Only names that differ are
        included.
        """
        functions = {f: self._function(f) for f in _FUNCTIONS}
        return {**functions, **self.words, **{f"-{word}": f"-{text}" for word, text in self.words.items()}}

    def _function(self, text: str) -> str:
        """Return the spelling of a function for this type; ``text`` is its name, or a formula that calls functions."""
        if text.isidentifier():
            return f"{text}{self.function_suffix}" if text in _FUNCTIONS else text
        return self.spelt(text)

    def spelt(self, text: str) -> str:
        """Return code that computes in this type, from code that computes in double."""
        return "".join(self._spelt(text)) if self.words else text

    def _spelt(self, text: str) -> Iterator[str]:
        naming = False  # whether the line is a #define
        for token, after in pairwise([*tokens(text), CToken(TokenKind.SPACE, "")]):
            naming = (naming or token.text == "define") and "\n" not in token.text
            if token.kind is TokenKind.REAL and not token.text.endswith("f"):
                value = float.fromhex(token.text) if token.text.startswith("0x") else float(token.text)
                yield literal(self.threshold(value) if naming else value)
            elif token.kind is TokenKind.NAME and token.text in _FUNCTIONS and after.text == "(":
                yield f"{token.text}{self.function_suffix}"
            else:
                yield self.words.get(token.text, token.text) if token.kind is TokenKind.NAME else token.text


_FLOAT = {
    "double": "float",
    "DBL_MIN": "FLT_MIN",
    "DBL_MAX": "FLT_MAX",
    "DBL_EPSILON": "FLT_EPSILON",
    "HUGE_VAL": "HUGE_VALF",
}

DOUBLE = Real("double")
FLOAT = Real("float", _FLOAT, "f")
#: Single precision in dialects of C whose library functions are overloaded.
OVERLOADED_FLOAT = Real("float", _FLOAT)

#: The types by their names in programs.
_REALS = {"double": DOUBLE, "float": FLOAT, OVERLOADED: OVERLOADED_FLOAT}


def real_of(program: Program) -> Real:
    """Return the type of the real numbers of a program."""
    return _REALS[program.extras.real]


def rendered(program: Program, template: str, values: Mapping[str, object]) -> str:
    """Return the text of a C template, filled with ``values``. Real numbers in the text have the type that the program
    uses.
    """
    return real_of(program).spelt(render("c", template, {"NAME": program.name, **values}))


def threshold(value: float) -> float:
    """Return the threshold for single precision that corresponds to ``value`` in double precision.

    The threshold is ``value`` to the power 24/53, since float has 24 binary digits and double has 53.
    """
    return float(f"{value**DIGITS:.0e}")


def literal(value: float) -> str:
    """Return the shortest literal of the nearest float. Values beyond the largest float become the largest float."""
    if value < 0.0:
        return f"-{literal(-value)}"
    if value:
        value = min(max(value, _LEAST), _MOST)
    nearest = struct.unpack("f", struct.pack("f", value))[0]
    texts = (f"{nearest:.{digits}g}" for digits in range(1, 10))
    text = next(t for t in texts if struct.unpack("f", struct.pack("f", float(t)))[0] == nearest)
    return f"{text}f" if "." in text or "e" in text else f"{text}.0f"
