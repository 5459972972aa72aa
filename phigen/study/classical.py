"""Classical one-step methods of fixed step size, to compare with: they know the vector field and nothing else."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from phigen.runtime.interface import row_steps
from phigen.study import dop853

Floats = NDArray[np.float64]
Field = Callable[[Floats], Floats]
Step = Callable[[Field, Floats, float], Floats]

#: Iterations after which the implicit midpoint rule gives up; each gains a factor of order h.
_ITERATIONS = 100
_TOLERANCE = 4e-16
#: Steps between two pieces of a long run.
_PIECE = 500


def euler(f: Field, x: Floats, h: float) -> Floats:
    """Explicit Euler, order 1."""
    return x + h * f(x)


def rk2(f: Field, x: Floats, h: float) -> Floats:
    """The explicit midpoint rule of Runge, order 2."""
    return x + h * f(x + h / 2 * f(x))


def rk4(f: Field, x: Floats, h: float) -> Floats:
    """The classical method of Runge and Kutta, order 4."""
    a = f(x)
    b = f(x + h / 2 * a)
    c = f(x + h / 2 * b)
    d = f(x + h * c)
    return x + h / 6 * (a + 2 * b + 2 * c + d)


def implicit_midpoint(f: Field, x: Floats, h: float) -> Floats:
    """The implicit midpoint rule, order 2; NaN where its fixed-point iteration does not converge."""
    change, size = h * f(x), np.inf
    for _ in range(_ITERATIONS):
        following = h * f(x + change / 2)
        last, size = size, float(np.max(np.abs(following - change)))
        change = following
        floor = _TOLERANCE * float(np.max(np.abs(x)))
        # At the level of rounding the corrections no longer shrink.
        if size <= floor or (size <= 100 * floor and size >= last):
            return x + change
        if not np.isfinite(size):
            break
    return np.full_like(x, np.nan)


def dormand_prince(f: Field, x: Floats, h: float) -> Floats:
    """DOP853 with fixed step size, order 8."""
    stages: list[Floats] = []
    for row in dop853.A:
        stages.append(f(x + h * _combination(stages, row)))
    return x + h * _combination(stages, dop853.B)


def _combination(stages: list[Floats], weights: Mapping[int, float]) -> Floats | float:
    return sum((w * stages[j] for j, w in weights.items()), 0.0)


#: The methods by their name in a spec, and their order.
METHODS: Mapping[str, tuple[Step, int]] = {
    "euler": (euler, 1),
    "rk2": (rk2, 2),
    "rk4": (rk4, 4),
    "implicit-midpoint": (implicit_midpoint, 2),
    "dop853": (dormand_prince, 8),
}


def integrate(method: str, field: Field, x0: Floats, h: float, steps: int, stride: int = 1) -> Floats:
    """States (rows, DIM) of the steps 0, stride, 2·stride, … and the last; rows after a failure are NaN."""
    pieces = [x for _, x in pieces_of(method, field, x0, h, steps, stride)]
    states = np.full((len(row_steps(steps, stride)), len(x0)), np.nan)
    found = np.concatenate(pieces)
    states[: len(found)] = found
    return states


def pieces_of(
    method: str, field: Field, x0: Floats, h: float, steps: int, stride: int = 1
) -> Iterator[tuple[NDArray[np.int64], Floats]]:
    """Numbers (rows,) and states (rows, DIM) of the steps 0, stride, 2·stride, … and the last, in pieces.

    Ends with the last finite row if the method fails.
    """
    step, _ = METHODS[method]
    x = np.array(x0, dtype=np.float64)
    carry = np.zeros_like(x)
    numbers, states = [0], [x]
    for done in range(1, steps + 1):
        with np.errstate(all="ignore"):
            # Compensated, as phigen's solvers are: the comparison is about the methods.
            change = (step(field, x, h) - x) + carry
            following = x + change
            carry = change - (following - x)
            x = following
        if done % stride == 0 or done == steps:
            if not np.isfinite(x).all():
                break
            numbers.append(done)
            states.append(x)
        if done % _PIECE == 0:
            yield np.array(numbers, dtype=np.int64), np.array(states).reshape(-1, len(x))
            numbers, states = [], []
    yield np.array(numbers, dtype=np.int64), np.array(states).reshape(-1, len(x))
