"""Classical one-step methods of fixed step size, for comparison with solvers. The methods use the vector field only."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from phigen.runtime.interface import row_steps
from phigen.study import dop853

Floats = NDArray[np.float64]
#: Methods with which a solver is compared if the run has no key ``compare``.
COMPARED = ("rk4",)

Field = Callable[[Floats], Floats]
Step = Callable[[Field, Floats, float], Floats]

#: Largest number of fixed-point iterations in a step of the implicit midpoint rule. Each iteration multiplies the error
#: by O(h).
_ITERATIONS = 100
_TOLERANCE = 4e-16
#: A long run yields its rows in portions, each after this number of steps, so that the memory is bounded.
_PIECE = 500


def euler(f: Field, x: Floats, h: float) -> Floats:
    """Return the state after a step of explicit Euler, order 1."""
    return x + h * f(x)


def rk2(f: Field, x: Floats, h: float) -> Floats:
    """Return the state after a step of the explicit midpoint rule of Runge, order 2."""
    return x + h * f(x + h / 2 * f(x))


def rk4(f: Field, x: Floats, h: float) -> Floats:
    """Return the state after a step of the classical method of Runge and Kutta, order 4."""
    a = f(x)
    b = f(x + h / 2 * a)
    c = f(x + h / 2 * b)
    d = f(x + h * c)
    return x + h / 6 * (a + 2 * b + 2 * c + d)


def implicit_midpoint(f: Field, x: Floats, h: float) -> Floats:
    """Return the state after a step of the implicit midpoint rule, order 2; NaN if its fixed-point iteration does
    not converge."""
    change, size = h * f(x), np.inf
    for _ in range(_ITERATIONS):
        following = h * f(x + change / 2)
        last, size = size, float(np.max(np.abs(following - change)))
        change = following
        floor = _TOLERANCE * float(np.max(np.abs(x)))
        # The iteration ends when corrections are rounding errors: below the floor, or near it and no longer decreasing.
        if size <= floor or (size <= 100 * floor and size >= last):
            return x + change
        if not np.isfinite(size):
            break
    return np.full_like(x, np.nan)


def dormand_prince(f: Field, x: Floats, h: float) -> Floats:
    """Return the state after a step of DOP853, the method of Dormand and Prince with the order 8."""
    stages: list[Floats] = []
    for row in dop853.A:
        stages.append(f(x + h * _combination(stages, row)))
    return x + h * _combination(stages, dop853.B)


def _combination(stages: list[Floats], weights: Mapping[int, float]) -> Floats | float:
    return sum((w * stages[j] for j, w in weights.items()), 0.0)


#: Name of a method in specs → the function that makes a step of the method, and its order.
METHODS: Mapping[str, tuple[Step, int]] = {
    "euler": (euler, 1),
    "rk2": (rk2, 2),
    "rk4": (rk4, 4),
    "implicit-midpoint": (implicit_midpoint, 2),
    "dop853": (dormand_prince, 8),
}


def integrate(method: str, field: Field, x0: Floats, h: float, steps: int, stride: int = 1) -> Floats:
    """Return the states (rows, DIM) after 0, stride, 2·stride, … steps and after the last step.

    If the method fails, the rows from the failure on are NaN.
    """
    rows = row_steps(steps, stride)
    row_parts = [x for _, x in pieces_of(method, field, x0, h, rows.tolist())]
    states = np.full((len(rows), len(x0)), np.nan)
    computed = np.concatenate(row_parts)
    states[: len(computed)] = computed
    return states


def pieces_of(
    method: str, field: Field, x0: Floats, h: float, rows: Iterable[float]
) -> Iterator[tuple[Floats, Floats]]:
    """Yield the rows of a run in parts: arrays of step numbers (rows,), and of states (rows, DIM) at these steps.

    ``rows`` are the requested step numbers, increasing, from 0 on. A number may have a fraction: then the state is
    computed by a shorter step from the last whole step, and the run continues from the whole step. If the method fails,
    the run ends with the last finite row.
    """
    step, _ = METHODS[method]
    x = np.array(x0, dtype=np.float64)
    carry = np.zeros_like(x)
    numbers: list[float] = []
    states: list[Floats] = []
    steps_done = 0
    for number in rows:
        whole_steps = round(number) if abs(number - round(number)) <= 1e-12 * max(1.0, number) else int(number)
        while steps_done < whole_steps:
            with np.errstate(all="ignore"):
                # The changes of x are added by compensated summation, as in solvers of phigen. So the results of a
                # classical method and of phigen differ by the methods alone.
                change = (step(field, x, h) - x) + carry
                following = x + change
                carry = change - (following - x)
                x = following
            steps_done += 1
            if steps_done % _PIECE == 0 and states:
                yield np.array(numbers), np.array(states)
                numbers, states = [], []
        with np.errstate(all="ignore"):
            row_state = x if number <= whole_steps else step(field, x, (number - whole_steps) * h)
        if not np.isfinite(row_state).all():
            break
        numbers.append(float(number))
        states.append(row_state)
    if states:
        yield np.array(numbers), np.array(states)
