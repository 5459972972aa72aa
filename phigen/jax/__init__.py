"""Runs of phigen as functions of JAX, with derivatives, for use with `jit` and `vmap`. Needs the package jax.

`propagator` calls a compiled solver. `flow` integrates in JAX: a system supplies the bracket, and H is any function
written in JAX.
"""

from phigen.errors import MissingPackageError

try:
    import jax as _jax  # noqa: F401
except ImportError as error:
    raise MissingPackageError("phigen.jax needs jax\n  hint: pip install jax") from error

from phigen.jax.flows import flow
from phigen.jax.runs import propagator

__all__ = ["flow", "propagator"]
