"""Runs of solvers as functions of JAX: with derivatives, under `jit` and `vmap`.

The solver runs on the CPU, in double precision, as a callback. Derivatives are those of `Solver.pullback`; second ones
are not offered.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import jax
import numpy as np
from jax import numpy as jnp

from phigen.runtime.lattice import LatticeSolver
from phigen.runtime.propagation import Propagation
from phigen.runtime.solver import Solver


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
    """The run of a solver as ``f(x0, parameters={})``: the last state, of the shape (…, DIM) of ``x0``.

    With a ``stride`` all rows of `Solver.integrate`, (…, rows, DIM). ``parameters`` are arrays by name, of shapes that
    broadcast to (…); what is not given has its default. Results have the precision of x0, which is single unless
    ``jax_enable_x64`` is set. Under `vmap` members are those of one ensemble. A step that fails raises where the result
    is asked for. Derivatives are exact to round-off, and ask for a solver compiled with ``adjoint=True``: those of
    `jax.grad` and `jax.vjp` take one run back; those of `jax.jvp` and `jax.jacfwd` are by the tangent map, one run back
    for each number of a result, as all are with ``forward``. Of a lattice, which has no tangent map here, DIM is
    (coordinates, *sizes), parameters at sites have axes of theirs, and further arguments, such as ``bonds=``, are those
    of all its runs.
    """
    runs = Propagation(solver, h, steps, stride, t0, shared)
    shaped = partial(jax.pure_callback, vmap_method="broadcast_all")

    def called(x0: Any, parameters: Any) -> Any:
        batch, result = _Axes(runs, x0, parameters), jax.ShapeDtypeStruct(runs.shape(x0.shape), x0.dtype)
        return shaped(lambda x, p: runs.run(x, batch.aligned(p)).astype(x.dtype), result, x0, parameters)

    def pulled(at: Any, cotangent: Any) -> Any:
        batch = _Axes(runs, *at)

        def transposed(x0: Any, parameters: Any, bar: Any) -> Any:
            x0_bar, bars = runs.transposed(x0, batch.aligned(parameters), bar)
            shapes = {name: np.shape(value) for name, value in parameters.items()}
            return x0_bar.astype(x0.dtype), {name: bars[name].reshape(s).astype(x0.dtype) for name, s in shapes.items()}

        result = jax.tree.map(lambda v: jax.ShapeDtypeStruct(v.shape, v.dtype), at)
        return shaped(transposed, result, *at, cotangent)

    def moved(at: Any, directions: Any) -> Any:
        batch, (x0, parameters), (along, changes) = _Axes(runs, *at), at, directions
        if runs.axes > 1:
            return shaped(
                runs.jacobian, jax.ShapeDtypeStruct(runs.shape(x0.shape), x0.dtype), *at
            )  # which refuses them
        states = runs.shape(x0.shape)

        def jacobian(x: Any, p: Any) -> Any:
            slopes = runs.jacobian(x, batch.aligned(p))
            return jax.tree.map(lambda v: v.astype(x.dtype), slopes)

        by = {name: jax.ShapeDtypeStruct(states, x0.dtype) for name in parameters}
        by_x0, by = shaped(jacobian, (jax.ShapeDtypeStruct((*states, states[-1]), x0.dtype), by), x0, parameters)
        rows = 1 + (stride is not None)
        result = jnp.einsum("...ij,...j->...i", by_x0, along[..., None, :] if rows == 2 else along)
        for name, slopes in by.items():
            change = jnp.broadcast_to(changes[name], x0.shape[:-1])
            result = result + slopes * change.reshape(change.shape + (1,) * rows)
        return result

    def derived(at: Any, directions: Any) -> Any:
        at = _derived_once(at)
        if forward:
            return moved(at, directions)
        return _linear(lambda v: moved(at, v), lambda bar: pulled(at, bar), directions, runs.shape(at[0].shape))

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


def _real(value: Any, what: str) -> Any:
    """An array of real numbers of a precision of its own, of that of JAX if it has none."""
    array = jnp.asarray(value)
    if jnp.iscomplexobj(array):
        raise TypeError(f"{what} must be real")
    return array.astype(jnp.result_type(float, array))


def _linear(apply: Callable[[Any], Any], transpose: Callable[[Any], Any], at: Any, shape: tuple[int, ...]) -> Any:
    """A linear map at a place, of results of that shape, whose transpose is known.

    JAX lets the transpose of a solution be given: here that of (u, y) = (v, A v), with nothing to solve.
    """
    zero = sum(0 * jnp.sum(leaf) for leaf in jax.tree.leaves(at))  # linear in v, as all that is solved for has to be
    at, nothing = jax.tree.map(lambda leaf: leaf + zero, at), jnp.broadcast_to(zero, shape)

    def solve(_: Any, right: Any) -> Any:
        return right[0], apply(right[0])

    def back(_: Any, bars: Any) -> Any:
        return transpose(bars[1]), jnp.zeros_like(bars[1])

    return jax.lax.custom_linear_solve(lambda v: v, (at, nothing), solve, back)[1]


@jax.custom_jvp  # type: ignore[untyped-decorator]
def _derived_once(at: Any) -> Any:
    """The same; where it is differentiated, a derivative is."""
    return at


@_derived_once.defjvp  # type: ignore[untyped-decorator]
def _derived_twice(*_: Any) -> Any:
    raise TypeError("second derivatives of runs are not offered: a derivative of phigen.jax is differentiated")


class _Axes:
    """Numbers of axes of the arguments of a function, from which those that `vmap` puts before them follow."""

    def __init__(self, runs: Propagation, x0: Any, parameters: Mapping[str, Any]) -> None:
        self._leading = x0.ndim - runs.axes
        self._axes = {name: value.ndim for name, value in parameters.items()}
        self._sites = {name: runs.axes_of(name) for name in parameters}

    def aligned(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """The parameters with axes of length 1 where states have more of their own."""
        aligned = {}
        for name, value in parameters.items():
            array, axes = np.asarray(value), self._axes[name]
            before = array.ndim - axes
            missing = self._leading + self._sites[name] - axes
            aligned[name] = array.reshape(array.shape[:before] + (1,) * missing + array.shape[before:])
        return aligned
