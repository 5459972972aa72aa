"""A run of a solver as a function of arrays with leading axes, with its derivative and the transpose of that.

What `phigen.jax` and `phigen.torch` hand to their frameworks: NumPy arrays in and out, one member for each element of
the leading axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from phigen.runtime import arguments
from phigen.runtime.interface import Floats, row_steps
from phigen.runtime.solver import Solver

Values = Mapping[str, ArrayLike]


@dataclass(frozen=True, eq=False)
class Propagation:
    """``steps`` steps of size ``h`` from the time ``t0`` on; with a ``stride`` all rows of `Solver.integrate`.

    States have the shape (…, DIM), rows (…, rows, DIM), parameters one that broadcasts to (…).
    """

    solver: Solver
    h: float
    steps: int
    stride: int | None = None
    t0: float | None = None

    def __post_init__(self) -> None:
        arguments.step_size(self.h)
        arguments.count(self.steps, "steps", 0)
        if self.stride is not None:
            arguments.count(self.stride, "stride", 1)

    @property
    def rows(self) -> int:
        """How many rows there are, with a stride."""
        return len(row_steps(self.steps, self.stride or max(1, self.steps)))

    def shape(self, start: tuple[int, ...]) -> tuple[int, ...]:
        """The shape of the result, by that of the start."""
        return start if self.stride is None else (*start[:-1], self.rows, start[-1])

    def run(self, x0: ArrayLike, parameters: Values) -> Floats:
        """The states."""
        start, members, own = self._members(x0, parameters)
        states = self.solver.ensemble(members, self.h, self.steps, self.stride, t0=self.t0, parameters=own)
        return self._back(states, start)

    def transposed(self, x0: ArrayLike, parameters: Values, cotangent: ArrayLike) -> tuple[Floats, dict[str, Floats]]:
        """Cotangents of x0 and of the parameters, of the shapes that these have, from one of the states."""
        start, members, own = self._members(x0, parameters)
        bars = np.asarray(cotangent, dtype=np.float64).reshape(
            -1, *(() if self.stride is None else (self.rows,)), start[-1]
        )
        if self.stride is not None:
            bars = bars.transpose(1, 0, 2)
        h, steps, stride = self.h, self.steps, self.stride
        found = self.solver.pullback(members, h, steps, bars, stride, t0=self.t0, parameters=own)
        given = {name: np.shape(value) for name, value in parameters.items()}
        of_parameters = {
            name: _summed(found.parameters_bar[name].reshape(start[:-1]), given[name]) for name in parameters
        }
        return found.x0_bar.reshape(start), of_parameters

    def jacobian(self, x0: ArrayLike, parameters: Values) -> tuple[Floats, dict[str, Floats]]:
        """The derivatives of the states along x0, of one axis (DIM,) more, and along each parameter, of their shape.

        One run back for each number of a member's result.
        """
        start, members, own = self._members(x0, parameters)
        shape = self.shape((len(members), start[-1]))
        by_x0, by = np.empty((*shape, start[-1])), {name: np.empty(shape) for name in parameters}
        for place in np.ndindex(*shape[1:]):
            unit = np.zeros(shape)
            unit[(slice(None), *place)] = 1.0
            by_x0[(slice(None), *place)], bars = self.transposed(members, own, unit)
            for name, bar in bars.items():
                by[name][(slice(None), *place)] = bar
        whole = self.shape(start)
        return by_x0.reshape(*whole, start[-1]), {name: slopes.reshape(whole) for name, slopes in by.items()}

    def _members(self, x0: ArrayLike, parameters: Values) -> tuple[tuple[int, ...], Floats, dict[str, Floats]]:
        """The shape of the start, members (members, DIM), and their parameters (members,)."""
        x = np.asarray(x0, dtype=np.float64)
        own = {
            name: np.array(np.broadcast_to(np.asarray(value, dtype=np.float64), x.shape[:-1])).reshape(-1)
            for name, value in parameters.items()
        }
        return x.shape, x.reshape(-1, x.shape[-1]), own

    def _back(self, states: Floats, start: tuple[int, ...]) -> Floats:
        """States (members, DIM), or rows (rows, members, DIM), in the shape of the result."""
        if self.stride is not None:
            states = states.transpose(1, 0, 2)
        return states.reshape(self.shape(start))


def _summed(values: Floats, shape: tuple[int, ...]) -> Floats:
    """The transpose of broadcasting from a shape."""
    extra = values.ndim - len(shape)
    values = values.sum(axis=tuple(range(extra)))
    ones = tuple(k for k, length in enumerate(shape) if length == 1 and values.shape[k] != 1)
    return values.sum(axis=ones, keepdims=True) if ones else values
