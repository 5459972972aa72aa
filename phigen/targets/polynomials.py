"""Polynomials in one variable as C, arranged so that few operations wait for the result of another operation."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

#: Number of coefficients in one line of output.
_BLOCK = 4


def estrin(coefficients: Sequence[Fraction], variable: str, first: str = "a") -> tuple[list[str], str]:
    """Return C for the value of Σ c_k variable^k: statements that define variables, and an expression in these
    variables.

    Estrin's scheme combines blocks of four coefficients. The value of each block is a variable. The names of these
    variables are successive letters, from ``first`` on.
    """
    v = variable
    blocks = [coefficients[i : i + _BLOCK] for i in range(0, len(coefficients), _BLOCK)]
    names = [chr(ord(first) + k) for k in range(len(blocks))]
    powers = [f"{v}2 = {v} * {v}"] * (len(coefficients) > 2) + [f"{v}4 = {v}2 * {v}2"] * (len(blocks) > 1)
    lines = [f"const double {', '.join(powers)};"] if powers else []
    lines += [f"const double {n} = {_block(b, v)};" for n, b in zip(names, blocks, strict=True)]
    value = names[-1]
    for name in reversed(names[:-1]):
        value = f"{name} + {v}4 * ({value})" if " " in value else f"{name} + {v}4 * {value}"
    return lines, value


def _block(coefficients: Sequence[Fraction], v: str) -> str:
    pairs = [coefficients[i : i + 2] for i in range(0, len(coefficients), 2)]
    texts = [_sum(p, v) for p in pairs]
    if len(texts) == 1:
        return texts[0]
    return f"({texts[0]}) + {v}2 * ({texts[1]})" if " " in texts[1] else f"({texts[0]}) + {v}2 * {texts[1]}"


def _sum(pair: Sequence[Fraction], v: str) -> str:
    return repr(float(pair[0])) + (f" + {float(pair[1])!r} * {v}" if len(pair) > 1 else "")
