"""``phigen demo``: the Lotka–Volterra system of the paper (arXiv:2303.15883), until shortly before a singularity."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

import click

from phigen.cli.arguments import target_option
from phigen.cli.console import Console, heading, out, pass_console, table, verbosity
from phigen.cli.experiment import Experiment, loaded, prepared

if TYPE_CHECKING:
    from phigen.compilation import Compilation
    from phigen.geometry.system import System
    from phigen.runtime.interface import Floats

SPEC, RUN = "lotka_volterra", "blow_up"

#: Orders of the two solvers of phigen in the table. The paper (arXiv:2303.15883) uses order 2.
ORDERS = (2, 8)
CLASSICAL = "rk2"

_ROWS_AT = (0.1, 0.2, 0.24, 0.25, 0.254, 0.255)


@click.command("demo")
@target_option
@verbosity
@pass_console
def command(console: Console, target: str) -> None:
    """Compile a Lotka–Volterra system, run it until shortly before the singularity of the solution, and print the
    errors of the solvers.

    The solution has a closed form and becomes infinite in finite time. The table compares two solvers of phigen and
    RK2, all with one step size. It lists the distances from the closed form, and the errors of the Casimir.
    """
    import numpy as np

    from phigen import resources, spec
    from phigen.api import compilation_of
    from phigen.study import classical

    start = time.perf_counter()
    source = spec.load(resources.bundled_specs() / f"{SPEC}.yaml")
    experiment = prepared(source, RUN)
    solutions: dict[str, Floats] = {}
    for order in ORDERS:
        compilation = compilation_of(source, order=order)
        solver = loaded(compilation, target, console)
        target = solver.target  # so that a fallback from C to NumPy is reported only once
        run = experiment.run
        trajectory = solver.integrate(experiment.initial, experiment.h, run.steps, run.stride)
        solutions[f"phigen {order}"] = trajectory.x
    x0 = np.array(experiment.initial)
    states = classical.integrate(CLASSICAL, solver.vector_field, x0, experiment.h, run.steps, run.stride)
    solutions[CLASSICAL.upper()] = states
    _print(compilation, experiment, solver.target, trajectory.t, solutions)
    console.note(f"compiled, run and compared in {time.perf_counter() - start:.1f} s")


def _print(
    compilation: Compilation, experiment: Experiment, target: str, t: Floats, solutions: dict[str, Floats]
) -> None:
    run, system = experiment.run, compilation.system
    out(heading(compilation.spec.title) + f", compiled to {'C' if target == 'c' else 'NumPy'}")
    out("  x1' = x1 (x2 + x3),  x2' = x2 (x3 - x1),  x3' = -x3 (x1 + x2);  Casimir C = x1 x3/x2")
    start = ", ".join(f"{v:g}" for v in experiment.initial)
    end = singularity(experiment)
    out(f"  from ({start}) in {run.steps} steps of {float(run.step):g}; infinite at t* = {end:.7f}\n")
    errors = {name: _errors(system, experiment, t, x) for name, x in solutions.items()}
    exact = next(iter(errors.values()))[2]
    head = ["", "", *(["error of x"] + [""] * (len(errors) - 1)), *(["error of C"] + [""] * (len(errors) - 1))]
    rows = [head, ["t", "x1 exact", *errors, *errors]]
    for row in [round(mark / float(run.step) / run.stride) for mark in _ROWS_AT]:
        cells = [f"{e[kind][row]:.1e}" for kind in (0, 1) for e in errors.values()]
        rows.append([f"{t[row]:.3f}", f"{exact[row, 0]:.4f}", *cells])
    for line in table(rows, right=range(len(head))):
        out(f"  {line}")
    out(f"\n  phigen K: Poisson Hamiltonian integrator of order K (in the paper {ORDERS[0]}). Errors are relative.")
    out("  phigen's error of the Casimir stays at round-off to the end. RK2 leaves the level set of the Casimir.")


def singularity(experiment: Experiment) -> float:
    """Return the time at which x1 becomes infinite.

    The sum E = x1 + x2 + x3 is constant, so x1 satisfies x1' = x1 (E − x1).
    """
    total, first = sum(experiment.initial), experiment.initial[0]
    return math.log((total - first) / -first) / total


def _errors(system: System, experiment: Experiment, t: Floats, x: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the relative errors (rows,) of the state and of the Casimir, and the exact states (rows, DIM)."""
    import numpy as np

    from phigen.study.summary import exact_solution
    from phigen.symbolic.arrays import evaluate

    solution = exact_solution(system, experiment.run, experiment.parameters, x[0], t)
    exact = np.column_stack([solution[c] for c in system.coordinates])
    distance = np.max(np.abs(x - exact), axis=1) / np.max(np.abs(exact), axis=1)
    columns = {c: x[:, i] for i, c in enumerate(system.coordinates)}
    (casimir,) = evaluate(list(system.casimirs.values())[:1], {**columns, **experiment.parameters})
    return distance, np.abs(casimir / casimir[0] - 1), exact
