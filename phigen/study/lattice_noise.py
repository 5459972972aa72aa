"""Measurement of the strong order of lattice solvers. The noise has an independent Wiener path for each site."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from phigen.api import lattice_solver_of
from phigen.compilation import Compilation
from phigen.compiler import compile_spec
from phigen.runtime.arguments import Beginning
from phigen.runtime.interface import BackendError
from phigen.runtime.lattice import LatticeSolver
from phigen.scheme.program import MAX_NORMAL_VARIATE
from phigen.spec.model import Spec, SpecForces
from phigen.study.methods import size_of
from phigen.study.stochastic import BEYOND, LEVELS, SEED, SIGNS, observed_power
from phigen.symbolic.arrays import Floats
from phigen.symbolic.expression import ZERO

#: Number of steps along a Wiener path at the largest step size. Runs with smaller steps follow the same paths.
STEPS = 2


def strong_order(
    compilation: Compilation,
    x0: Floats,
    parameters: Mapping[str, Any],
    t0: float | None,
    h: float,
    paths: int,
) -> float:
    """Return the strong order of the NumPy solver; NaN if a step fails.

    Errors at the end of a run are measured with the steps h, h/2, h/4, … along the same Wiener paths. The strong order
    is the power of the step size with which these errors decrease. Reference solutions follow the piecewise linear
    interpolation of a path; they use only the vector fields. ``x0`` has the shape (coordinates, *sizes). ``paths`` is
    the number of paths.
    """
    solver = lattice_solver_of(compilation, "numpy")
    noise = compilation.program.noise
    assert noise is not None
    kinds, parts = len(noise.sources), noise.parts
    fields = [_field(compilation.spec, name) for name in noise.sources]
    finest = STEPS << (LEVELS + BEYOND)
    random, errors, size = np.random.default_rng(SEED), np.zeros(LEVELS), 0.0
    for _ in range(paths):
        # The path consists of increments over equal times. A step of the finest size uses `parts` of them.
        deviation = np.sqrt(abs(h) * STEPS / finest / parts)
        path = random.normal(size=(finest * parts, kinds, *x0.shape[1:])) * deviation
        end = _along_lines(solver, fields, x0, parameters, t0, h * STEPS / finest, path, parts)
        size = max(size, size_of(end))
        for level in range(LEVELS):
            step_count = STEPS << level
            coarse = path.reshape(step_count, parts, -1, *path.shape[1:]).sum(axis=2)
            session = _session(solver, x0, parameters, t0)
            try:
                session.advance_along(h / 2**level, coarse)
            except BackendError:
                return np.nan
            errors[level] += np.sum((session.state() - end) ** 2)
    return observed_power(np.sqrt(errors / (paths * x0.size)), size)


def failures(compilation: Compilation, x0: Floats, parameters: Mapping[str, Any], t0: float | None, h: float) -> int:
    """Make steps with the largest possible increments of the noise, and return the number of steps that fail.

    `SIGNS` steps are made from the state ``x0``. The signs of the increments are random.
    """
    solver, noise = lattice_solver_of(compilation, "numpy"), compilation.program.noise
    assert noise is not None
    random, failed = np.random.default_rng(SEED), 0
    for _ in range(SIGNS):
        signs = random.choice([-1.0, 1.0], size=(1, noise.parts, len(noise.sources), *x0.shape[1:]))
        try:
            _session(solver, x0, parameters, t0).advance_along(
                h, MAX_NORMAL_VARIATE * np.sqrt(abs(h) / noise.parts) * signs
            )
        except BackendError:
            failed += 1
    return failed


def _field(spec: Spec, name: str) -> LatticeSolver:
    """Return a solver without noise, which has the Hamiltonian of the noise source ``name`` instead of H.

    The vector field of the solver is σπ∇g, where σ is the amplitude and g the Hamiltonian of the source.
    """
    source = spec.noise[name]
    quiet = replace(spec, hamiltonian=source.amplitude * source.hamiltonian, noise={}, forces=SpecForces(), order=2)
    quiet = replace(quiet, casimirs={}, invariants={}, runs={}, terms=None, composition="auto", scheme="auto")
    if quiet.lattice:
        quiet = replace(quiet, lattice=replace(quiet.lattice, bonds=ZERO))
    return lattice_solver_of(compile_spec(quiet), "numpy")


def _along_lines(
    solver: LatticeSolver,
    sources: Sequence[LatticeSolver],
    x: Floats,
    parameters: Mapping[str, Any],
    t0: float | None,
    h: float,
    path: Floats,
    parts: int,
) -> Floats:
    """Return the final state of a solution that begins at ``x`` and follows a piecewise linear Wiener path.

    The solution is computed by RK4 steps of size h. ``path`` has increments of shape (steps·parts, sources, *sizes),
    and the increment of a step is the sum of ``parts`` of them. The drift is the vector field of ``solver``. The vector
    fields of ``sources`` are multiplied by the increments.
    """
    drift, *spread = (_slope(s, x, parameters, t0) for s in (solver, *sources))
    begin = t0 or 0.0
    for k, dw in enumerate(path.reshape(-1, parts, *path.shape[1:]).sum(axis=1)):

        def push(state: Floats, t: float, dw: Floats = dw) -> Floats:
            return np.asarray(
                h * drift(state, t) + sum(w * field(state, t) for w, field in zip(dw, spread, strict=True))
            )

        t = begin + k * h
        first = push(x, t)
        second = push(x + first / 2, t + h / 2)
        third = push(x + second / 2, t + h / 2)
        x = x + (first + 2 * second + 2 * third + push(x + third, t + h)) / 6
    return x


def _slope(
    solver: LatticeSolver, x: Floats, parameters: Mapping[str, Any], t0: float | None
) -> Callable[[Floats, float], Floats]:
    """Return the vector field of a NumPy solver as a function of state and time, without checks of the arguments."""
    session = _session(solver, x, parameters, t0)

    def slope(state: Floats, t: float) -> Floats:
        session.place(state)
        session._sites.t = t
        field: Floats = session.vector_field()
        return field

    return slope


def _session(solver: LatticeSolver, x: Floats, parameters: Mapping[str, Any], t0: float | None) -> Any:
    """Return a session of a NumPy solver at the state ``x`` and the time ``t0``. Sessions make single steps."""
    return solver.started(Beginning(x, 1.0, solver.values(parameters, {}, x.shape[1:]), t0 or 0.0))
