"""A run of a solver as a function of arrays with leading axes, with its derivative and the transpose of that.

What `phigen.jax` and `phigen.torch` hand to their frameworks: NumPy arrays in and out, one member for each element of
the leading axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from phigen.runtime import arguments
from phigen.runtime.interface import Floats, row_steps
from phigen.runtime.lattice import LatticeSolver
from phigen.runtime.solver import Solver

Values = Mapping[str, ArrayLike]


@dataclass(frozen=True, eq=False)
class Propagation:
    """``steps`` steps of size ``h`` from the time ``t0`` on; with a ``stride`` all rows of `Solver.integrate`.

    States have the shape (…, DIM), rows (…, rows, DIM), parameters one that broadcasts to (…). Of a lattice DIM is
    (coordinates, *sizes), and parameters at sites or bonds have axes of their own after those. ``shared`` is what all
    members have, such as the bonds of a graph.
    """

    solver: Solver | LatticeSolver
    h: float
    steps: int
    stride: int | None = None
    t0: float | None = None
    shared: Mapping[str, ArrayLike] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.solver, Solver | LatticeSolver):
            raise TypeError(f"a propagator needs a compiled solver, not {self.solver!r}")
        if isinstance(self.solver, Solver):
            arguments.start_time(self.t0, self.solver.interface, {})
            self.solver.values(self.shared, {})  # type: ignore[arg-type]
        arguments.step_size(self.h)
        arguments.count(self.steps, "steps", 0)
        if self.stride is not None:
            arguments.count(self.stride, "stride", 1)

    @property
    def rows(self) -> int:
        """How many rows there are, with a stride."""
        return len(row_steps(self.steps, self.stride or max(1, self.steps)))

    @property
    def axes(self) -> int:
        """Axes of a state."""
        return 1 + len(self.solver.interface.axes) if isinstance(self.solver, LatticeSolver) else 1

    def axes_of(self, parameter: str) -> int:
        """Axes of a parameter of one member."""
        if not isinstance(self.solver, LatticeSolver):
            return 0
        about = self.solver.interface
        return len(about.axes) if parameter in about.at_sites else int(parameter in about.at_bonds)

    def shape(self, start: tuple[int, ...]) -> tuple[int, ...]:
        """The shape of the result, by that of the start."""
        return start if self.stride is None else (*start[: -self.axes], self.rows, *start[-self.axes :])

    def expect(self, start: tuple[int, ...], parameters: Mapping[str, tuple[int, ...]]) -> None:
        """Raises `TypeError` and `ValueError` for shapes of arguments that no run can have, and for unknown names."""
        arguments.expect_known(parameters, self.solver.interface.parameters)
        if isinstance(self.solver, LatticeSolver):
            return
        if start[-1:] != (self.solver.interface.dimension,):
            raise ValueError(f"x0 must have shape (…, {self.solver.interface.dimension}), not {start}")
        for name, shape in parameters.items():
            lengths = zip(reversed(shape), reversed(start[:-1]), strict=False)
            if len(shape) >= len(start) or any(own not in (1, length) for own, length in lengths):
                members = f"{start[:-1]}, that of the members" if start[1:] else "()"
                raise ValueError(f"parameter {name!r} must have a shape that broadcasts to {members}, not {shape}")

    def run(self, x0: ArrayLike, parameters: Values) -> Floats:
        """The states."""
        start, members, own = self._members(x0, parameters)
        states = self.solver.ensemble(members, self.h, self.steps, self.stride, **self._from, parameters=own)
        if self.stride is not None:
            states = np.moveaxis(states, 0, 1)
        return states.reshape(self.shape(start))

    def transposed(self, x0: ArrayLike, parameters: Values, cotangent: ArrayLike) -> tuple[Floats, dict[str, Floats]]:
        """Cotangents of x0 and of the parameters, of the shapes that these have, from one of the states."""
        start, members, own = self._members(x0, parameters)
        rows = () if self.stride is None else (self.rows,)
        bars = np.asarray(cotangent, dtype=np.float64).reshape(-1, *rows, *start[-self.axes :])
        if self.stride is not None:
            bars = np.moveaxis(bars, 1, 0)
        h, steps, stride = self.h, self.steps, self.stride
        found = self.solver.pullback(members, h, steps, bars, stride, **self._from, parameters=own)
        of_parameters = {}
        for name, value in parameters.items():
            bar = found.parameters_bar[name]
            of_parameters[name] = _summed(bar.reshape(start[: -self.axes] + bar.shape[1:]), np.shape(value))
        return found.x0_bar.reshape(start), of_parameters

    def jacobian(self, x0: ArrayLike, parameters: Values) -> tuple[Floats, dict[str, Floats]]:
        """The derivatives of the states along x0, of one axis (DIM,) more, and along each parameter, of their shape.

        One run back for each number of a member's result. Not for lattices.
        """
        if self.axes > 1:
            raise TypeError("lattices have no full Jacobians; use reverse mode, forward=False")
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
        """The shape of the start, members (members, DIM), and their parameters (members, …)."""
        x, own = np.asarray(x0, dtype=np.float64), dict[str, Any](self.shared)
        for name, value in parameters.items():
            array = np.asarray(value, dtype=np.float64)
            tail = self._own_shape(name, x.shape)
            own[name] = np.array(np.broadcast_to(array, x.shape[: -self.axes] + tail)).reshape(-1, *tail)
        return x.shape, x.reshape(-1, *x.shape[-self.axes :]), own

    def _own_shape(self, parameter: str, state: tuple[int, ...]) -> tuple[int, ...]:
        """The shape of a parameter of one member."""
        if not self.axes_of(parameter) or not isinstance(self.solver, LatticeSolver):
            return ()
        if parameter in self.solver.interface.at_sites:
            return state[1 - self.axes :]
        return (len(np.asarray(self.shared["bonds"])),)

    @property
    def _from(self) -> dict[str, Any]:
        """When runs begin."""
        return {} if isinstance(self.solver, LatticeSolver) and not self.solver.interface.time else {"t0": self.t0}


def _summed(values: Floats, shape: tuple[int, ...]) -> Floats:
    """The transpose of broadcasting from a shape."""
    extra = values.ndim - len(shape)
    values = values.sum(axis=tuple(range(extra)))
    ones = tuple(k for k, length in enumerate(shape) if length == 1 and values.shape[k] != 1)
    return values.sum(axis=ones, keepdims=True) if ones else values
