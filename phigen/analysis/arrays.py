"""Expressions evaluated on whole trajectories."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phigen.symbolic.expression import Expression, fold

Floats = NDArray[np.float64]

_NAMES = {
    "asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2",
    "asinh": "arcsinh", "acosh": "arccosh", "atanh": "arctanh",
}  # fmt: skip


def evaluate(roots: Sequence[Expression], values: Mapping[str, Any]) -> list[Floats]:
    """The roots for arrays (or numbers) of the symbols; NaN or infinity outside the domain.

    Raises `KeyError` for a symbol without value.
    """

    def visit(node: Expression, args: list[Any]) -> Any:
        match node.op:
            case "number":
                return float(node.value)
            case "symbol":
                return values[node.value]
            case "pi" | "E":
                return np.pi if node.op == "pi" else np.e
            case "add":
                return args[0] + args[1]
            case "sub":
                return args[0] - args[1]
            case "neg":
                return -args[0]
            case "mul":
                return args[0] * args[1]
            case "pow":
                return np.power(args[0], float(node.value))
            case "power":
                return np.power(args[0], args[1])
        return getattr(np, _NAMES.get(node.op, node.op))(*args)

    with np.errstate(all="ignore"):
        return [np.asarray(v, dtype=np.float64) for v in fold(roots, visit)]
