"""Redrawn figure of the paper, with measured numbers to compare with the numbers in the paper."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from phigen import resources, spec
from phigen.api import compilation_of, solver_of
from phigen.compilation import Compilation
from phigen.runtime.solver import Solver
from phigen.runtime.trajectory import Trajectory
from phigen.symbolic.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Finding:
    """A measured number, with a paraphrase of what the paper says about it."""

    quantity: str
    paper: str
    measured: float


@dataclass(frozen=True)
class Plate:
    """Figure with its title and the numbers that were measured for it."""

    title: str
    figure: Figure
    findings: tuple[Finding, ...]


def compiled(name: str, order: int, birealisation: str | None = None) -> tuple[Compilation, Solver]:
    """Compile the example system ``name`` with the order ``order``. Return the compilation and the C solver.

    ``birealisation`` names the kind of bi-realisation, by default that of the spec. Raises `ToolchainError` without a C
    compiler: NumPy would take too long for the runs of the paper.
    """
    source = spec.load(resources.bundled_specs() / f"{name}.yaml")
    if birealisation:
        source = replace(source, birealisation=replace(source.birealisation, kind=birealisation))
    compilation = compilation_of(source, order=order)
    return compilation, solver_of(compilation, "c")


def trajectory_of(solver: Solver, t: Floats, x: Floats, h: float, parameters: Mapping[str, float]) -> Trajectory:
    """Return the trajectory of a classical method, with energies and Casimirs.

    ``x`` (rows, DIM) are the states at the times ``t`` (rows,).
    """
    backend, names = solver.backend, solver.interface
    energy, values = backend.hamiltonian(x, parameters), backend.casimirs(x, parameters)
    casimirs = {name: values[:, i] for i, name in enumerate(names.casimirs)}
    return Trajectory(t, x, energy, casimirs, round(float(t[-1]) / h), h, dict(parameters), names.coordinates)


def relative(values: Floats) -> Floats:
    """Return |v − v₀|/|v₀| for values v and the first value v₀."""
    errors: Floats = np.abs(values / values[0] - 1)
    return errors
