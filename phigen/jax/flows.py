"""Runs of ẋ = π∇H in JAX, by steps that are Poisson maps. A system supplies π, and H is any function written in JAX."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from os import PathLike
from typing import TYPE_CHECKING, Any

import jax
import numpy as np
from jax import numpy as jnp

from phigen.api import load
from phigen.errors import CheckError, Diagnostic, SpecError
from phigen.gauss import statements as gauss_statements
from phigen.gauss.realisation import Realisation, collective, direct
from phigen.gauss.stage_map import stage_map
from phigen.gauss.tableau import MOST_STAGES, tableau
from phigen.geometry.system import System, system_from_spec, system_of_lattice
from phigen.jax.collocation import Collocation
from phigen.proofs import statements
from phigen.runtime import arguments
from phigen.runtime.interface import row_steps
from phigen.spec.model import Spec
from phigen.symbolic.verdict import REFUTED

if TYPE_CHECKING:
    from phigen.lattice.lattice_system import LatticeSystem

#: Hint for a bracket for which no exact Poisson map is known.
TRUNCATION_HINT = 'structure="to truncation" takes every bracket; its steps are no Poisson maps'


def flow(
    system: str | PathLike[str] | Spec | System | LatticeSystem,
    hamiltonian: Callable[..., Any],
    h: float,
    steps: int,
    *,
    order: int = 4,
    stride: int | None = None,
    structure: str = "exact",
) -> Callable[..., Any]:
    """Return the run of ẋ = π∇H as a function ``f(x0, *arguments, **parameters)``.

    π is the Poisson tensor of ``system``, whose H and runs are not used. H is ``hamiltonian(x, *arguments)``, a
    function written in JAX that returns a number. x has the shape (DIM,), and ``arguments`` are arrays or trees of
    arrays, such as the weights of a network. ``parameters`` are parameters of π by name; missing parameters have their
    defaults.

    f returns the last state, of the same shape (…, DIM) as x0. With a ``stride``, f returns the rows that
    `Solver.integrate` stores, (…, rows, DIM). f is written in JAX and has the precision of x0. f can be used with `jit`
    and `vmap`, on every device of XLA. f has derivatives in forward and in reverse mode, computed from the linearised
    equations of each step.

    Steps are those of ``scheme: gauss`` at this order. They are Poisson maps for any H and step size if the bracket is
    constant, or if it is the bracket of a Lie algebra that phigen knows. ``structure="to truncation"`` accepts every
    bracket, but its steps are no Poisson maps. If a step fails because h is too large, all later states are NaN. H
    should be smooth, since the order depends on its derivatives.

    Raises `SpecError` if no Gauss step is known that is a Poisson map for this bracket, and `CheckError` if π is not a
    Poisson tensor.
    """
    arguments.step_size(h)
    arguments.count(steps, "steps", 0)
    if stride is not None:
        arguments.count(stride, "stride", 1)
    if order not in range(2, 2 * MOST_STAGES + 1, 2):
        raise ValueError(f"order must be even, from 2 to {2 * MOST_STAGES}, not {order!r}")
    bracket = _system_of(system)
    realisation = _realised(bracket, structure)
    _expect_proved(bracket, realisation, order // 2)
    slope = jax.grad(hamiltonian)
    method = Collocation(stage_map(bracket, realisation), slope, float(h), order // 2)
    return _run_of(method, bracket, steps, stride)


def _run_of(method: Collocation, bracket: System, steps: int, stride: int | None) -> Callable[..., Any]:
    defaults = {p.name: float(p.value) for p in bracket.parameters}
    counts = np.diff(row_steps(steps, stride or max(1, steps)))
    whole_rows = int(np.sum(counts == counts[0])) if len(counts) else 0

    def rows(x0: Any, arguments: Any, parameters: Mapping[str, Any]) -> Any:
        def advanced(carry: Any, count: int) -> Any:
            return jax.lax.scan(lambda c, _: (method.advance(c, arguments, parameters), None), carry, None, count)[0]

        def row(carry: Any, _: None) -> tuple[Any, Any]:
            carry = advanced(carry, int(counts[0]))
            return carry, carry[0]

        carry, row_states = method.start(x0), x0[None]
        if whole_rows:
            carry, following = jax.lax.scan(row, carry, None, whole_rows)
            row_states = jnp.concatenate([row_states, following])
        if whole_rows < len(counts):
            row_states = jnp.concatenate([row_states, advanced(carry, int(counts[-1]))[0][None]])
        return row_states if stride else row_states[-1]

    def batched(x: Any, arguments: Any, values: Mapping[str, Any]) -> Any:
        members: Callable[..., Any] = lambda x: rows(x, arguments, values)  # noqa: E731
        for _ in x.shape[:-1]:
            members = jax.vmap(members)
        return members(x)

    compiled: Callable[..., Any] = jax.jit(batched)

    def run(x0: Any, *arguments: Any, **parameters: Any) -> Any:
        x = _real_state(x0, bracket)
        unknown = parameters.keys() - defaults.keys()
        if unknown:
            raise TypeError(f"unknown parameter {min(unknown)!r}; those of {bracket.name} are {', '.join(defaults)}")
        values = {name: jnp.asarray(v, x.dtype) for name, v in (defaults | parameters).items()}
        # `jit` accepts only trees of arrays as arguments; with other leaves, such as functions, the run is not
        # compiled.
        of_arrays = all(
            isinstance(leaf, jax.Array | np.ndarray | np.number | float) for leaf in jax.tree.leaves(arguments)
        )
        return (compiled if of_arrays else batched)(x, arguments, values)

    return run


def _real_state(x0: Any, bracket: System) -> Any:
    """Return x0 as a real array in its own precision, or in the default precision of JAX for Python numbers.

    Raises `TypeError` for complex values, and `ValueError` for a wrong shape.
    """
    x = jnp.asarray(x0)
    if jnp.iscomplexobj(x):
        raise TypeError("x0 must be real")
    if not x.ndim or x.shape[-1] != bracket.dimension:
        raise ValueError(f"x0 must have shape (…, {bracket.dimension}), not {x.shape}")
    return x.astype(jnp.result_type(float, x))


def _system_of(source: str | PathLike[str] | Spec | System | LatticeSystem) -> System:
    """Return the system that a file, a spec or a system object describes.

    Raises `SpecError` if the motion depends on more than π and H(x), for instance on forces.
    """
    system = load(source) if isinstance(source, str | PathLike) else source
    system = system_from_spec(system) if isinstance(system, Spec) else system
    if not isinstance(system, System):
        raise system_of_lattice(system.spec)
    problems = [
        Diagnostic(f"phigen.jax.flow: {message}", system.locations.get((key,)), hint)
        for key, message, hint in _refused(system)
    ]
    if problems:
        raise SpecError(problems)
    return system


def _refused(system: System) -> Iterator[tuple[str, str, str]]:
    """Yield (key in the spec, message, hint) for each feature of a system that `flow` does not support."""
    if system.time:
        message = "the system depends on the time, but H is a function of x without the time"
        yield "time", message, "remove time, or use phigen.jax.propagator"
    if system.forces:
        yield "forces", "forces are not offered", "remove forces, or use phigen.jax.propagator"
    if system.noise:
        yield "noise", "noise is not offered", "remove noise"


def _realised(system: System, structure: str) -> Realisation:
    if structure not in ("exact", "to truncation"):
        raise ValueError(f"structure must be 'exact' or 'to truncation', not {structure!r}")
    realisation = direct(system) if structure == "to truncation" else collective(system)
    if realisation is None:
        message = f"phigen.jax.flow: no exact Poisson map is known for this bracket ({system.shape})"
        raise SpecError([Diagnostic(message, system.locations.get(("poisson",)), TRUNCATION_HINT)])
    return realisation


def _expect_proved(system: System, realisation: Realisation, stages: int) -> None:
    """Raise `CheckError` if π is not a Poisson tensor, or if a statement about the Gauss step is refuted."""
    statements_of_spec = [s for group in statements.tensor(system).values() for s in group]
    if not any(s.verdict == REFUTED for s in statements_of_spec):
        statements_of_spec += gauss_statements.check(system, system, realisation, tableau(stages))
    refuted_texts = [
        f"{s.name}: refuted{f', {s.residual}' if s.residual else ''}"
        for s in statements_of_spec
        if s.verdict == REFUTED
    ]
    if refuted_texts:
        raise CheckError("\n".join(f"{system.name}: {text}" for text in refuted_texts))
