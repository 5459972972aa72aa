"""Benchmark of gradients of runs against diffrax; ``pip install -e '.[bench]'`` installs diffrax.

The gradient is that of w·x(T), a weighted sum of the final coordinates, with respect to all initial values and
parameters. phigen computes the exact gradient of its numerical solution, with the order and step size that reach the
accuracy fastest. diffrax integrates by Dopri8 with adaptive steps, with the largest tolerance that reaches the
accuracy; it differentiates by its checkpointed adjoint, which is compiled beforehand. The reference is diffrax with
tolerance 1e-13. Times are CPU times of one core, the least of repetitions in turn.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from typing import Any

os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np
import sympy

import phigen

#: System of the corpus → time to integrate, and the pairs of scheme and order that are tried.
PROBLEMS: dict[str, tuple[float, tuple[tuple[str, int], ...]]] = {
    "rigid_body": (100.0, (("series", 8), ("series", 10), ("series", 12))),
    "lagrange_top": (20.0, (("series", 6), ("series", 8), ("splitting", 8))),
    "spin_chain5": (20.0, (("series", 6), ("splitting", 6), ("splitting", 8))),
}
ACCURACY = 1e-8

#: Tolerances of diffrax from coarse to fine, three per factor of ten.
TOLERANCES = [10.0 ** (-k / 3) for k in range(18, 40)]

Gradient = tuple[np.ndarray, dict[str, float]]


def compared(name: str) -> str:
    """Return the row of the table for one system."""
    time_, settings = PROBLEMS[name]
    system = phigen.load(name)
    initial = np.array([float(v) for v in next(iter(system.spec.runs.values())).initial])
    weights = np.random.default_rng(1).normal(size=len(initial))
    peer = _diffrax(system, initial, weights, time_)
    exact = peer(1e-13)()
    tolerance, theirs = _cheapest([_to_the_first(peer, exact)], exact)
    ours = []
    for scheme, order in settings:
        solver = phigen.compile(system, order=order, scheme=scheme, adjoint=True, target="c", profile="fast")
        label = f"{scheme}, order {order}" if scheme != "series" else f"order {order}"
        ours.append(
            [(f"{label}, h = {time_ / n:.3g}", _phigen(solver, initial, weights, time_ / n, n)) for n in _counts(time_)]
        )
    setting, mine = _cheapest(ours, exact)
    forward = _alone(mine)
    times = {"phigen": np.inf, "diffrax": np.inf, "forward": np.inf}
    for _ in range(15):
        for who, work in (("phigen", mine), ("diffrax", theirs), ("forward", forward)):
            times[who] = min(times[who], _seconds(work))
    ratio, passes = times["diffrax"] / times["phigen"], times["phigen"] / times["forward"]
    return (
        f"| {name} | {time_:g} | {setting} | {_error(mine(), exact):.0e} | {1e3 * times['phigen']:.3f} | {passes:.1f} |"
        f" {tolerance} | {_error(theirs(), exact):.0e} | {1e3 * times['diffrax']:.1f} | {ratio:.0f} |"
    )


def _to_the_first(peer: Callable[[float], Any], exact: Gradient) -> list[tuple[str, Any]]:
    """Return runs of diffrax with decreasing tolerances, up to the first that reaches the accuracy; finer ones take
    longer."""
    grid = []
    for tolerance in TOLERANCES:
        work = peer(tolerance)
        grid.append((f"tolerance {tolerance:.1e}", work))
        if _error(work(), exact) <= ACCURACY:
            break
    return grid


def _counts(time_: float) -> list[int]:
    """Return numbers of steps for a time of integration, from few to many."""
    return [round(time_ * 2 ** (k / 3)) for k in range(-9, 21)]


def _error(found: Gradient, exact: Gradient) -> float:
    """Return the largest error of a gradient: along the state relative to its largest entry, likewise along the
    parameters."""
    by_state = np.max(np.abs(found[0] - exact[0])) / np.max(np.abs(exact[0]))
    size = max((abs(v) for v in exact[1].values()), default=1.0)
    return max([by_state, *(abs(found[1][k] - v) / size for k, v in exact[1].items())])


def _cheapest(grids: list[list[tuple[str, Callable[[], Gradient]]]], exact: Gradient) -> tuple[str, Any]:
    """Return label and function of the fastest setting that reaches the accuracy.

    Raises `ValueError` if this is the coarsest setting of its grid, since a coarser one might be faster.
    """
    good = []
    for grid in grids:
        for setting, work in grid:
            try:
                if _error(work(), exact) <= ACCURACY:
                    good.append((min(_seconds(work) for _ in range(3)), setting, work))
            except phigen.StepError:
                continue
    _, setting, work = min(good, key=lambda g: g[0])
    if setting in [grid[0][0] for grid in grids]:
        raise ValueError(f"the cheapest setting, {setting}, is the coarsest of its grid")
    return setting, work


def _seconds(work: Callable[[], Any]) -> float:
    begun = time.process_time()
    work()
    return time.process_time() - begun


def _phigen(solver: Any, initial: np.ndarray, weights: np.ndarray, h: float, steps: int) -> Callable[[], Gradient]:
    def work() -> Gradient:
        found = solver.pullback(initial, h, steps, weights)
        return found.x0_bar, found.parameters_bar

    work.alone = lambda: solver.session(initial).step(h, steps)  # type: ignore[attr-defined]
    return work


def _alone(work: Any) -> Callable[[], Any]:
    """Return the run without a gradient that belongs to a run with a gradient."""
    return work.alone


def _diffrax(system: Any, initial: np.ndarray, weights: np.ndarray, time_: float) -> Callable[[float], Any]:
    """Return a function of the tolerance that returns a compiled function, which computes the gradient by diffrax."""
    import diffrax
    import jax
    from jax import numpy as jnp

    jax.config.update("jax_enable_x64", True)
    known = system.to_sympy()
    names = [p.name for p in system.parameters]
    values = {p.name: jnp.float64(float(p.value)) for p in system.parameters}
    gradient = sympy.Matrix([known.hamiltonian]).jacobian(list(known.coordinates)).T
    field = sympy.Matrix(known.poisson) * gradient
    symbols = {s.name: s for s in field.free_symbols} | {str(c): c for c in known.coordinates}
    f = sympy.lambdify(
        [list(known.coordinates), [symbols.get(n, sympy.Symbol(n)) for n in names]], list(field), "jax", cse=True
    )

    def right(t: Any, x: Any, parameters: Any) -> Any:
        return jnp.stack([jnp.asarray(v) for v in f(x, [parameters[n] for n in names])])

    def at(tolerance: float) -> Callable[[], Gradient]:
        def loss(x0: Any, parameters: Any) -> Any:
            found = diffrax.diffeqsolve(
                diffrax.ODETerm(right), diffrax.Dopri8(), 0.0, time_, 0.05, x0, parameters,
                stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
                adjoint=diffrax.RecursiveCheckpointAdjoint(), saveat=diffrax.SaveAt(t1=True), max_steps=200_000,
            )  # fmt: skip
            return jnp.dot(weights, found.ys[0])

        compiled = jax.jit(jax.grad(loss, argnums=(0, 1)))

        def work() -> Gradient:
            by_state, by = jax.block_until_ready(compiled(jnp.asarray(initial), values))
            return np.asarray(by_state), {n: float(v) for n, v in by.items()}

        work()
        return work

    return at


if __name__ == "__main__":
    print("| system | T | phigen | error | ms | over the run alone | diffrax | error | ms | diffrax / phigen |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for problem in list(PROBLEMS)[:1] if "--quick" in sys.argv else PROBLEMS:
        print(compared(problem), flush=True)
