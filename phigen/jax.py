"""Runs of solvers as functions of JAX: with derivatives, under `jit` and `vmap`. Needs jax.

The solver runs on the CPU, in double precision, as a callback. Derivatives are those of `Solver.pullback`; second ones
are not offered.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from phigen.errors import MissingPackageError
from phigen.runtime.lattice import LatticeSolver
from phigen.runtime.propagation import Propagation
from phigen.runtime.solver import Solver

try:
    import jax
    from jax import numpy as jnp
except ImportError as error:
    raise MissingPackageError("phigen.jax needs jax\n  hint: pip install jax") from error


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
    `jax.grad` and `jax.vjp` take one run back. With ``forward`` they are of the tangent map, for `jax.jvp` and
    `jax.jacfwd` too, one run back for each number of a result. Of a lattice DIM is (coordinates, *sizes), parameters at
    sites have axes of theirs, and further arguments, such as ``bonds=``, are those of all its runs.
    """
    made = Propagation(solver, h, steps, stride, t0, shared)
    shaped = partial(jax.pure_callback, vmap_method="broadcast_all")

    def called(x0: Any, parameters: Any) -> Any:
        own, result = _Own(made, x0, parameters), jax.ShapeDtypeStruct(made.shape(x0.shape), x0.dtype)
        return shaped(lambda x, p: made.run(x, own.aligned(p)).astype(x.dtype), result, x0, parameters)

    def pulled(at: Any, cotangent: Any) -> Any:
        own = _Own(made, *at)

        def transposed(x0: Any, parameters: Any, bar: Any) -> Any:
            x0_bar, bars = made.transposed(x0, own.aligned(parameters), bar)
            shapes = {name: np.shape(value) for name, value in parameters.items()}
            return x0_bar.astype(x0.dtype), {name: bars[name].reshape(s).astype(x0.dtype) for name, s in shapes.items()}

        result = jax.tree.map(lambda v: jax.ShapeDtypeStruct(v.shape, v.dtype), at)
        return shaped(transposed, result, *at, cotangent)

    def moved(at: Any, directions: Any) -> Any:
        own, (x0, parameters), (along, changes) = _Own(made, *at), at, directions
        states = made.shape(x0.shape)

        def jacobian(x: Any, p: Any) -> Any:
            found = made.jacobian(x, own.aligned(p))
            return jax.tree.map(lambda v: v.astype(x.dtype), found)

        by = {name: jax.ShapeDtypeStruct(states, x0.dtype) for name in parameters}
        by_x0, by = shaped(jacobian, (jax.ShapeDtypeStruct((*states, states[-1]), x0.dtype), by), x0, parameters)
        rows = 1 + (stride is not None)
        result = jnp.einsum("...ij,...j->...i", by_x0, along[..., None, :] if rows == 2 else along)
        for name, slopes in by.items():
            change = jnp.broadcast_to(changes[name], x0.shape[:-1])
            result = result + slopes * change.reshape(change.shape + (1,) * rows)
        return result

    if forward:
        run = jax.custom_jvp(called)
        run.defjvp(lambda at, directions: (run(*at), moved(at, directions)))
    else:
        run = jax.custom_vjp(called)
        run.defvjp(lambda *at: (called(*at), at), pulled)

    def propagate(x0: Any, parameters: Mapping[str, Any] | None = None) -> Any:
        x = jnp.asarray(x0, dtype=jnp.result_type(float, x0))
        made.expect(x.shape, parameters or {})
        return run(x, {name: jnp.asarray(v, dtype=x.dtype) for name, v in (parameters or {}).items()})

    return propagate


class _Own:
    """What arguments of a function are, to tell the axes that `vmap` puts before theirs."""

    def __init__(self, made: Propagation, x0: Any, parameters: Mapping[str, Any]) -> None:
        self._leading = x0.ndim - made.axes
        self._axes = {name: value.ndim for name, value in parameters.items()}
        self._sites = {name: made.axes_of(name) for name in parameters}

    def aligned(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """The parameters with axes of length 1 where states have more of their own."""
        found = {}
        for name, value in parameters.items():
            array, own = np.asarray(value), self._axes[name]
            before = array.ndim - own
            missing = self._leading + self._sites[name] - own
            found[name] = array.reshape(array.shape[:before] + (1,) * missing + array.shape[before:])
        return found
