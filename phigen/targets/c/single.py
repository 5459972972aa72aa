"""C in single precision: the same text with ``float`` for ``double``.

Types, literals, functions and limits of the library become those of ``float``. What is computed stays the same but for
the thresholds, small numbers that a ``#define`` names: they say at how many digits something counts as rounding.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator

#: Digits of float in those of double.
DIGITS = 24 / 53

#: Below this a number that is named by a ``#define`` is a threshold.
_THRESHOLD = 1e-5

_TOKEN = re.compile(
    r'(?P<comment>/\*.*?\*/)|(?P<text>"(?:\\.|[^"\\])*")'
    r"|(?P<real>0x[0-9a-fA-F.]+p[-+]?[0-9]+|(?:[0-9]+\.[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|[0-9]+[eE][-+]?[0-9]+)(?P<suffix>f?)"
    r"|(?P<whole>[0-9]\w*)|(?P<name>[A-Za-z_]\w*)|(?P<other>[^A-Za-z_0-9/\"]+|.)",
    re.DOTALL,
)
_NAMES = {
    "double": "float",
    "DBL_MIN": "FLT_MIN",
    "DBL_MAX": "FLT_MAX",
    "DBL_EPSILON": "FLT_EPSILON",
    "HUGE_VAL": "HUGE_VALF",
}
_FUNCTION = re.compile(
    "a?(cos|sin|tan)h?|atan2|cbrt|ceil|copysign|erfc?|exp2?|expm1|fabs|fdim|floor|fma|fmax|fmin|fmod|frexp|hypot|ldexp"
    "|lgamma|log|log10|log1p|log2|logb|nearbyint|nextafter|pow|remainder|rint|round|scalbn|sqrt|tgamma|trunc"
)
_LEAST, _MOST = 2.0**-126, (2.0 - 2.0**-23) * 2.0**127


def single(text: str, *, overloaded: bool = False) -> str:
    """Return C in single precision from C in double precision; functions that are ``overloaded`` keep their names."""
    return "".join(_rewritten(text, overloaded))


def _rewritten(text: str, overloaded: bool) -> Iterator[str]:
    naming = False  # whether this is the line of a #define
    for match in _TOKEN.finditer(text):
        token, kind = match[0], match.lastgroup
        if match["real"] and not match["suffix"]:
            token = match["real"]
            value = float.fromhex(token) if token.startswith("0x") else float(token)
            yield literal(threshold(value) if naming and 0.0 < value < _THRESHOLD else value)
        elif kind == "name" and token in _NAMES:
            yield _NAMES[token]
        elif kind == "name" and not overloaded and _FUNCTION.fullmatch(token) and text.startswith("(", match.end()):
            yield f"{token}f"
        else:
            naming = (naming or token == "define") and "\n" not in token
            yield token


def threshold(value: float) -> float:
    """Return the threshold in single precision that has the same share of the digits as ``value`` in double."""
    return float(f"{value**DIGITS:.0e}")


def literal(value: float) -> str:
    """Return the shortest literal of the nearest float; values beyond the range of floats become its limits."""
    if value:
        value = min(max(value, _LEAST), _MOST)
    nearest = struct.unpack("f", struct.pack("f", value))[0]
    texts = (f"{nearest:.{digits}g}" for digits in range(1, 10))
    text = next(t for t in texts if struct.unpack("f", struct.pack("f", float(t)))[0] == nearest)
    return f"{text}f" if re.search(r"[.e]", text) else f"{text}.0f"
