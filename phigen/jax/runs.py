"""Runs of compiled solvers as functions of JAX with derivatives, for use with `jit` and `vmap`.

JAX calls the solver on the CPU, in double precision. Derivatives are computed by `Solver.pullback`; there are no second
derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NoReturn

import jax
import numpy as np
from jax import numpy as jnp
from jax.extend.core import Primitive
from jax.interpreters import batching, mlir

from phigen.runtime.lattice import LatticeSolver
from phigen.runtime.propagation import Propagation
from phigen.runtime.solver import Solver

#: Message of the error for derivatives of lattices in forward mode.
NO_FORWARD_MODE = (
    "lattices have no derivatives in forward mode (jax.jvp, jax.jacfwd, forward=True); "
    "use jax.grad, jax.vjp or jax.jacrev"
)

# Identity map for JAX. The error about forward mode is raised when JAX compiles or evaluates this map.
_refused_forward = Primitive("lattices_have_no_forward_mode")
_refused_forward.def_abstract_eval(lambda value: value)


@_refused_forward.def_impl  # type: ignore[untyped-decorator]
def _refuse_forward(*_: Any) -> NoReturn:
    raise TypeError(NO_FORWARD_MODE)


mlir.register_lowering(_refused_forward, _refuse_forward)
batching.primitive_batchers[_refused_forward] = lambda values, axes: (_refused_forward.bind(*values), axes[0])


def propagator(
    solver: Solver | LatticeSolver,
    *,
    h: float,
    steps: int,
    stride: int | None = None,
    t0: float | None = None,
    forward: bool = False,
    **shared: Any,
) -> Callable[..., Any]:
    """Return the run of a solver as a function ``f(x0, parameters={})`` of arrays.

    f returns the last state, of the same shape (…, DIM) as x0. With a ``stride``, f returns the rows that
    `Solver.integrate` stores, (…, rows, DIM). ``parameters`` are arrays by name, whose shapes broadcast to (…); missing
    parameters have their defaults. Results have the precision of x0, which is single unless ``jax_enable_x64`` is set.
    Under `vmap`, all members are integrated as one ensemble. If a step fails, the exception is raised where the result
    is used.

    Derivatives are exact to round-off, and need a solver compiled with ``adjoint=True``. `jax.grad` and `jax.vjp` take
    one reverse pass. `jax.jvp` and `jax.jacfwd` compute the Jacobian, which takes one reverse pass for each number of
    the result. With ``forward``, `jax.grad` and `jax.vjp` compute the Jacobian too.

    For lattices, DIM stands for (coordinates, *sizes), parameters at sites have the axes of the sites, and further
    arguments, such as ``bonds=``, apply to all runs. Lattices have no derivatives in forward mode.
    """
    runs = Propagation(solver, h, steps, stride, t0, shared)
    if forward and runs.axes > 1:
        raise TypeError(NO_FORWARD_MODE)
    shaped = partial(jax.pure_callback, vmap_method="broadcast_all")

    def called(x0: Any, parameters: Any) -> Any:
        batch, result = _Axes(runs, x0, parameters), jax.ShapeDtypeStruct(runs.shape(x0.shape), x0.dtype)
        return shaped(lambda x, p: runs.run(x, batch.aligned(p)).astype(x.dtype), result, x0, parameters)

    def pulled(arguments: Any, cotangent: Any) -> Any:
        batch = _Axes(runs, *arguments)

        def transposed(x0: Any, parameters: Any, bar: Any) -> Any:
            x0_bar, bars = runs.transposed(x0, batch.aligned(parameters), bar)
            shapes = {name: np.shape(value) for name, value in parameters.items()}
            return x0_bar.astype(x0.dtype), {name: bars[name].reshape(s).astype(x0.dtype) for name, s in shapes.items()}

        result = jax.tree.map(lambda v: jax.ShapeDtypeStruct(v.shape, v.dtype), arguments)
        return shaped(transposed, result, *arguments, cotangent)

    def moved(arguments: Any, directions: Any) -> Any:
        batch, (x0, parameters), (state_directions, changes) = _Axes(runs, *arguments), arguments, directions
        states = runs.shape(x0.shape)
        if runs.axes > 1:
            # In reverse mode JAX also traces this branch, but does not evaluate it, so the error is not raised.
            return _refused_forward.bind(jax.lax.full(states, 0, x0.dtype))

        def jacobian(x: Any, p: Any) -> Any:
            slopes = runs.jacobian(x, batch.aligned(p))
            return jax.tree.map(lambda v: v.astype(x.dtype), slopes)

        shapes = {name: jax.ShapeDtypeStruct(states, x0.dtype) for name in parameters}
        by_x0, shapes = shaped(
            jacobian, (jax.ShapeDtypeStruct((*states, states[-1]), x0.dtype), shapes), x0, parameters
        )
        rows = 1 + (stride is not None)
        result = jnp.einsum(
            "...ij,...j->...i", by_x0, state_directions[..., None, :] if rows == 2 else state_directions
        )
        for name, slopes in shapes.items():
            change = jnp.broadcast_to(changes[name], x0.shape[:-1])
            result = result + slopes * change.reshape(change.shape + (1,) * rows)
        return result

    def derived(arguments: Any, directions: Any) -> Any:
        runs.expect_pullback()
        arguments = _derived_once(arguments)
        if forward:
            return moved(arguments, directions)
        return _linear(
            lambda v: moved(arguments, v),
            lambda bar: pulled(arguments, bar),
            directions,
            runs.shape(arguments[0].shape),
        )

    run = jax.custom_jvp(called)
    run.defjvp(lambda at, directions: (run(*at), derived(at, directions)))

    def propagate(x0: Any, parameters: Mapping[str, Any] | None = None) -> Any:
        x = _real(x0, "x0")
        arrays = {
            name: _real(value, f"parameter {name!r}").astype(x.dtype) for name, value in (parameters or {}).items()
        }
        runs.expect(x.shape, {name: value.shape for name, value in arrays.items()})
        return run(x, arrays)

    return propagate


def _real(value: Any, argument: str) -> Any:
    """Return a real array in its own precision, or in the default precision of JAX for Python numbers."""
    array = jnp.asarray(value)
    if jnp.iscomplexobj(array):
        raise TypeError(f"{argument} must be real")
    return array.astype(jnp.result_type(float, array))


def _linear(
    apply: Callable[[Any], Any], transpose: Callable[[Any], Any], arguments: Any, shape: tuple[int, ...]
) -> Any:
    """Return ``apply(arguments)``, with ``transpose`` as the function by which JAX computes cotangents.

    ``apply`` is a linear map A, ``transpose`` is Aᵀ, and ``shape`` is the shape of the result. JAX accepts a transpose
    only for maps that solve linear equations. So a trivial equation is solved, whose solution is the pair (v, A v) with
    v = ``arguments``.
    """
    # JAX requires that all parts of the equation depend linearly on the arguments, even a right-hand side that is 0. So
    # this zero is computed from the arguments, and is added.
    zero = sum(0 * jnp.sum(leaf) for leaf in jax.tree.leaves(arguments))
    arguments, nothing = jax.tree.map(lambda leaf: leaf + zero, arguments), jnp.broadcast_to(zero, shape)

    def solve(_: Any, right: Any) -> Any:
        return right[0], apply(right[0])

    def back(_: Any, bars: Any) -> Any:
        return transpose(bars[1]), jnp.zeros_like(bars[1])

    return jax.lax.custom_linear_solve(lambda v: v, (arguments, nothing), solve, back)[1]


@jax.custom_jvp  # type: ignore[untyped-decorator]
def _derived_once(arguments: Any) -> Any:
    """Identity function whose derivative raises an error. Only second derivatives of a run need this derivative."""
    return arguments


@_derived_once.defjvp  # type: ignore[untyped-decorator]
def _derived_twice(*_: Any) -> Any:
    raise TypeError("second derivatives of runs are not offered: a derivative of phigen.jax is differentiated")


class _Axes:
    """Finds how many axes `vmap` has added in front of each argument of a run. The object stores how many axes each
    argument has without `vmap`.
    """

    def __init__(self, runs: Propagation, x0: Any, parameters: Mapping[str, Any]) -> None:
        self._leading = x0.ndim - runs.axes
        self._axes = {name: value.ndim for name, value in parameters.items()}
        self._sites = {name: runs.axes_of(name) for name in parameters}

    def aligned(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Return the parameters with axes of length 1 inserted, so that their axes match those of the states."""
        aligned = {}
        for name, value in parameters.items():
            array, axes = np.asarray(value), self._axes[name]
            leading_axes = array.ndim - axes
            missing_axes = self._leading + self._sites[name] - axes
            aligned[name] = array.reshape(array.shape[:leading_axes] + (1,) * missing_axes + array.shape[leading_axes:])
        return aligned
