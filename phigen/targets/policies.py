"""Policies, such as tolerances and limits of iterations (`phigen.scheme.policies`), as constants in generated code."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass

from phigen.scheme.policies import POLICIES, MeasurePolicy, Policy, PolicyConstant
from phigen.scheme.program import Program

#: A power of two is printed as a power if its exponent is smaller than this number. The powers that are printed in this
#: way are bounds on rounding errors.
_LEAST_EXPONENT = -20


def policies_of(program: Program) -> dict[str, Policy]:
    """Return the numerical constants of the runtime for a program. The result maps the name of a runtime file to the
    constants that the file defines.

    If coordinates keep their signs during a step, errors are measured relative to each coordinate.
    """
    if program.step.inner_solve and program.step.inner_solve.relative:
        return {**POLICIES, "measure_policy": MeasurePolicy(floor=0.0)}
    return POLICIES


@dataclass(frozen=True)
class PolicySpelling:
    """The way a language declares the constants of a `Policy`, such as tolerances and limits of iterations.

    ``power`` is the format of a power of two with a negative exponent. ``written`` returns the text that declares
    constants. ``rounded`` prints real numbers for solvers whose precision is not double.
    """

    power: str
    written: Callable[[list[tuple[PolicyConstant, str]]], str]
    rounded: Callable[[float], str] | None = None

    def value(self, value: float) -> str:
        """Return a number as text."""
        if self.rounded and isinstance(value, float):
            return self.rounded(value)
        part, exponent = math.frexp(value)
        if part == 0.5 and exponent - 1 < _LEAST_EXPONENT:
            return self.power.format(exponent - 1)
        return repr(value).replace("e-0", "e-")

    def text(self, policy: Policy, omitted: Collection[str] = ()) -> str:
        """Return the declarations of the constants of a policy, except those in ``omitted``."""
        constants = [c for c in policy.constants() if c.name not in omitted]
        return self.written([(c, self.value(c.value)) for c in constants])


def _c(constants: list[tuple[PolicyConstant, str]]) -> str:
    """Return declarations in C: macros for real numbers, and enumerators for integers."""
    whole = [(f"PHI_{c.name} = {value},", c.about) for c, value in constants if isinstance(c.value, int)]
    real = [(f"#define PHI_{c.name} {value}", c.about) for c, value in constants if isinstance(c.value, float)]
    lines = ["enum {", *(f"    {line}" for line in _aligned(whole)), "};"] if whole else []
    return "\n".join([*lines, *_aligned(real)])


def _aligned(lines: list[tuple[str, str]]) -> list[str]:
    width = max((len(text) for text, _ in lines), default=0)
    return [f"{text:{width}} /* {about} */" for text, about in lines]


def _js(constants: list[tuple[PolicyConstant, str]]) -> str:
    sentences = [f"{c.about[:1].upper()}{c.about[1:].rstrip(';.')}." for c, _ in constants]
    lines = zip(sentences, constants, strict=True)
    return "\n".join(f"/** {sentence} */\nconst {c.name} = {value};" for sentence, (c, value) in lines)


def _python(constants: list[tuple[PolicyConstant, str]]) -> str:
    return "\n".join(f"{c.name} = {value}  # {c.about}" for c, value in constants)


C = PolicySpelling("0x1p{}", _c)
JAVASCRIPT = PolicySpelling("2 ** {}", _js)
PYTHON = PolicySpelling("2.0**{}", _python)
