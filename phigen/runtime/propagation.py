"""A run of a solver as a function of arrays, with its Jacobian and its vector–Jacobian product.

`phigen.jax` and `phigen.torch` register these functions with their frameworks. Arguments and results are NumPy arrays;
each element of their leading axes is one member of an ensemble.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from phigen.runtime import arguments
from phigen.runtime.gradients import without_pullback
from phigen.runtime.interface import Floats, LatticeInterface, row_steps
from phigen.runtime.lattice import LatticeSolver, checked_bonds, missing_bonds
from phigen.runtime.solver import Solver

Values = Mapping[str, ArrayLike]


@dataclass(frozen=True, eq=False)
class Propagation:
    """A run of ``steps`` steps of size ``h`` from the time ``t0`` on, as a function of initial states and parameters.

    The value of the function is the final states or, with a ``stride``, all rows of `Solver.integrate`.

    States have the shape (…, DIM), rows (…, rows, DIM), parameters a shape that broadcasts to (…). For a lattice, DIM
    stands for (coordinates, *sizes), and parameters at sites or bonds have axes of sites or bonds after (…). ``shared``
    are arguments that all members have in common, such as the bonds of a graph.
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
        arguments.start_time(self.t0, self.solver.interface, {})
        if isinstance(self.solver, Solver):
            self.solver.values(self.shared, {})  # type: ignore[arg-type]
        else:
            self._expect_shared(self.solver.interface)
        arguments.step_size(self.h)
        arguments.count(self.steps, "steps", 0)
        if self.stride is not None:
            arguments.count(self.stride, "stride", 1)

    def _expect_shared(self, lattice: LatticeInterface) -> None:
        """Raise `TypeError` if ``shared`` lacks the ``bonds`` of a graph, or has a name that is not a parameter."""
        if lattice.graph and self.shared.get("bonds") is None:
            raise missing_bonds()
        arguments.expect_known([n for n in self.shared if n != "bonds" or not lattice.graph], lattice.parameters)

    def expect_pullback(self) -> None:
        """Raise `TypeError` if the solver was compiled without ``adjoint``."""
        if not self.solver.backend.has_pullback:
            raise without_pullback(self.solver.interface)

    @property
    def rows(self) -> int:
        """The number of rows of the trajectory of a member."""
        return len(row_steps(self.steps, self.stride or max(1, self.steps)))

    @property
    def axes(self) -> int:
        """The number of axes of the state of one member: 1, or for a lattice 1 + the number of its axes."""
        return 1 + len(self.solver.interface.axes) if isinstance(self.solver, LatticeSolver) else 1

    def axes_of(self, parameter: str) -> int:
        """Return the number of axes that the value of a parameter has for one member: 0 for a number."""
        if not isinstance(self.solver, LatticeSolver):
            return 0
        interface = self.solver.interface
        return len(interface.axes) if parameter in interface.at_sites else int(parameter in interface.at_bonds)

    def shape(self, start: tuple[int, ...]) -> tuple[int, ...]:
        """Return the shape of the result of `run` for initial states of shape ``start``."""
        return start if self.stride is None else (*start[: -self.axes], self.rows, *start[-self.axes :])

    def expect(self, start: tuple[int, ...], parameters: Mapping[str, tuple[int, ...]]) -> None:
        """Raise `ValueError` if the shapes of states and parameters do not fit, and `TypeError` for unknown
        parameters."""
        arguments.expect_known(parameters, self.solver.interface.parameters)
        if isinstance(self.solver, LatticeSolver):
            state = self.solver.state(np.zeros(start[-self.axes :]), "x0")
            if self.solver.interface.graph:
                checked_bonds(self.shared["bonds"], state.shape[1])
            return
        if start[-1:] != (self.solver.interface.dimension,):
            raise ValueError(f"x0 must have shape (…, {self.solver.interface.dimension}), not {start}")
        for name, shape in parameters.items():
            lengths = zip(reversed(shape), reversed(start[:-1]), strict=False)
            if len(shape) >= len(start) or any(
                parameter_length not in (1, length) for parameter_length, length in lengths
            ):
                members = f"{start[:-1]}, that of the members" if start[1:] else "()"
                raise ValueError(f"parameter {name!r} must have a shape that broadcasts to {members}, not {shape}")

    def run(self, x0: ArrayLike, parameters: Values) -> Floats:
        """Integrate all members, and return their final states (…, DIM) or, with a stride, all rows (…, rows, DIM)."""
        start, members, values = self._members(x0, parameters)
        if isinstance(self.solver, Solver) and not self.solver.backend.has_ensemble:
            rows = [self._rows(self.solver, x, {n: v[m] for n, v in values.items()}) for m, x in enumerate(members)]
            return np.reshape(rows, self.shape(start))
        states = self.solver.ensemble(members, self.h, self.steps, self.stride, t0=self.t0, parameters=values)
        if self.stride is not None:
            states = np.moveaxis(states, 0, 1)
        return states.reshape(self.shape(start))

    def _rows(self, solver: Solver, x: Floats, values: Mapping[str, float]) -> Floats:
        """Return the last state (DIM,) of one member or, with a stride, its rows (rows, DIM)."""
        stride = self.stride or max(1, self.steps)
        states = solver.integrate(x, self.h, self.steps, stride, t0=self.t0, parameters=values).x
        return states[-1] if self.stride is None else states

    def transposed(self, x0: ArrayLike, parameters: Values, cotangent: ArrayLike) -> tuple[Floats, dict[str, Floats]]:
        """Return the cotangents of x0 and of the parameters, in the shapes of x0 and parameters.

        ``cotangent`` is the cotangent of the result of `run`, in the shape of this result.
        """
        start, members, values = self._members(x0, parameters)
        rows = () if self.stride is None else (self.rows,)
        bars = np.asarray(cotangent, dtype=np.float64).reshape(-1, *rows, *start[-self.axes :])
        if self.stride is not None:
            bars = np.moveaxis(bars, 1, 0)
        h, steps, stride = self.h, self.steps, self.stride
        pulled_back = self.solver.pullback(members, h, steps, bars, stride, t0=self.t0, parameters=values)
        of_parameters = {}
        for name, value in parameters.items():
            bar = pulled_back.parameters_bar[name]
            of_parameters[name] = _summed(bar.reshape(start[: -self.axes] + bar.shape[1:]), np.shape(value))
        return pulled_back.x0_bar.reshape(start), of_parameters

    def jacobian(self, x0: ArrayLike, parameters: Values) -> tuple[Floats, dict[str, Floats]]:
        """Return the derivatives of the result of `run` with respect to x0 and, by name, to each parameter.

        Derivatives with respect to a parameter have the shape of the result. The derivative with respect to x0 has a
        further last axis (DIM,). One reverse pass is made for each component of a member's result. Solvers of lattices
        have no Jacobian.
        """
        start, members, values = self._members(x0, parameters)
        shape = self.shape((len(members), start[-1]))
        by_x0, by_parameters = np.empty((*shape, start[-1])), {name: np.empty(shape) for name in parameters}
        for index in np.ndindex(*shape[1:]):
            unit = np.zeros(shape)
            unit[(slice(None), *index)] = 1.0
            by_x0[(slice(None), *index)], bars = self.transposed(members, values, unit)
            for name, bar in bars.items():
                by_parameters[name][(slice(None), *index)] = bar
        result_shape = self.shape(start)
        return by_x0.reshape(*result_shape, start[-1]), {
            name: slopes.reshape(result_shape) for name, slopes in by_parameters.items()
        }

    def _members(self, x0: ArrayLike, parameters: Values) -> tuple[tuple[int, ...], Floats, dict[str, Floats]]:
        """Return three results: the shape of ``x0``, then ``x0`` as an array (members, …), and the parameters as arrays
        (members, …).
        """
        x, values = np.asarray(x0, dtype=np.float64), dict[str, Any](self.shared)
        for name, value in parameters.items():
            array = np.asarray(value, dtype=np.float64)
            tail = self._member_shape(name, x.shape)
            values[name] = np.array(np.broadcast_to(array, x.shape[: -self.axes] + tail)).reshape(-1, *tail)
        return x.shape, x.reshape(-1, *x.shape[-self.axes :]), values

    def _member_shape(self, parameter: str, state: tuple[int, ...]) -> tuple[int, ...]:
        """Return the shape of a parameter for one member; ``state`` is the shape of x0."""
        if not self.axes_of(parameter) or not isinstance(self.solver, LatticeSolver):
            return ()
        if parameter in self.solver.interface.at_sites:
            return state[1 - self.axes :]
        return (len(np.asarray(self.shared["bonds"])),)


def _summed(values: Floats, shape: tuple[int, ...]) -> Floats:
    """Return ``values`` summed over the axes along which an array of this ``shape`` was broadcast.

    This sum is the transpose of broadcasting.
    """
    extra = values.ndim - len(shape)
    values = values.sum(axis=tuple(range(extra)))
    ones = tuple(k for k, length in enumerate(shape) if length == 1 and values.shape[k] != 1)
    return values.sum(axis=ones, keepdims=True) if ones else values
