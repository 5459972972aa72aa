"""Poincaré sections of specs: conversion of expressions to functions, whose arguments are arrays of states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from phigen.runtime.crossings import Function
from phigen.symbolic.arrays import Floats, evaluate
from phigen.symbolic.expression import Expression


def function_of(
    section: Expression, coordinates: Sequence[str], parameters: Mapping[str, float], time: str = ""
) -> Function:
    """Return an expression as a function of states (rows, DIM) and, if the spec has a time, of times (rows,).

    The function returns the values (rows,) of the expression.
    """

    def g(states: Floats, *t: Floats) -> Floats:
        values = {**parameters, **{c: states[:, i] for i, c in enumerate(coordinates)}, **dict.fromkeys([time], *t)}
        return np.broadcast_to(evaluate([section], values)[0], len(states))

    return g
