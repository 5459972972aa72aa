"""Evaluation of expressions at all states of a trajectory at once, with arrays."""

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
    """Arithmetic of arrays, with the functions of NumPy or of another ``library`` with the same function names."""

    def __init__(self, values: Mapping[str, Any], library: Any = np) -> None:
        self._values, self._library = values, library

    def constant(self, value: Fraction) -> Any:
        """Return the double that is nearest to a rational number."""
        return float(value)

    def variable(self, name: str) -> Any:
        """Return the array of a symbol."""
        return self._values[name]

    def power(self, base: Any, exponent: Fraction) -> Any:
        """Return a rational power of an array."""
        return self._library.power(base, float(exponent))

    def function(self, name: str, args: list[Any]) -> Any:
        """Return the value of a function at arrays, elementwise, by the function of the library."""
        if not args:
            return np.pi if name == "pi" else np.e
        if name == "choose":
            return self._library.where(args[0] > 0, args[1], args[2])
        return getattr(self._library, FUNCTIONS[name].written["numpy"].removeprefix("np."))(*args)


def evaluate(roots: Sequence[Expression], values: Mapping[str, Any]) -> list[Floats]:
    """Return the values of expressions as arrays, computed elementwise.

    ``values`` maps the name of each symbol to an array or a number. Outside its domain a function gives NaN or
    infinity. Raises `KeyError` for a symbol without a value.
    """
    with np.errstate(all="ignore"):
        return [np.asarray(v, dtype=np.float64) for v in Arrays(values).values(roots)]
