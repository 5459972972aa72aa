"""Expressions evaluated on whole trajectories."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phigen.symbolic.arithmetic import Arithmetic
from phigen.symbolic.expression import Expression
from phigen.symbolic.functions import FUNCTIONS

Floats = NDArray[np.float64]


class Arrays(Arithmetic[Any]):
    """Arrays of doubles, with the functions of NumPy."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self._values = values

    def constant(self, value: Fraction) -> Any:
        """The nearest double."""
        return float(value)

    def variable(self, name: str) -> Any:
        """The array given for a symbol."""
        return self._values[name]

    def power(self, base: Any, exponent: Fraction) -> Any:
        """An array to a rational power."""
        return np.power(base, float(exponent))

    def function(self, name: str, args: list[Any]) -> Any:
        """A function that NumPy has."""
        if not args:
            return np.pi if name == "pi" else np.e
        if name == "choose":
            return np.where(args[0] > 0, args[1], args[2])
        return getattr(np, FUNCTIONS[name].written["numpy"].removeprefix("np."))(*args)


def evaluate(roots: Sequence[Expression], values: Mapping[str, Any]) -> list[Floats]:
    """The roots for arrays (or numbers) of the symbols; NaN or infinity outside the domain.

    Raises `KeyError` for a symbol without value.
    """
    with np.errstate(all="ignore"):
        return [np.asarray(v, dtype=np.float64) for v in Arrays(values).values(roots)]
