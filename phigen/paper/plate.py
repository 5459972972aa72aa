"""A redrawn figure of the paper, and measured numbers to compare with those of the paper."""

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
    """One measured number, and the paper's statement about it, paraphrased."""

    quantity: str
    paper: str
    measured: float


@dataclass(frozen=True)
class Plate:
    """A figure with its title and its findings."""

    title: str
    figure: Figure
    findings: tuple[Finding, ...]


def compiled(name: str, order: int, birealisation: str | None = None) -> tuple[Compilation, Solver]:
    """A system of the corpus and its solver in C, of this order, with another bi-realisation if one is named.

    Raises `ToolchainError` without a C compiler: the runs of the paper are long.
    """
    source = spec.load(resources.bundled_specs() / f"{name}.yaml")
    if birealisation:
        source = replace(source, birealisation=replace(source.birealisation, kind=birealisation))
    compilation = compilation_of(source, order=order)
    return compilation, solver_of(compilation, "c")


def trajectory_of(solver: Solver, t: Floats, x: Floats, h: float, parameters: Mapping[str, float]) -> Trajectory:
    """States (rows, DIM) of another method at times (rows,), with energy and Casimirs as the solver has them."""
    backend, names = solver.backend, solver.interface
    energy, values = backend.hamiltonian(x, parameters), backend.casimirs(x, parameters)
    casimirs = {name: values[:, i] for i, name in enumerate(names.casimirs)}
    return Trajectory(t, x, energy, casimirs, round(float(t[-1]) / h), h, dict(parameters), names.coordinates)


def relative(values: Floats) -> Floats:
    """Errors relative to the first value."""
    errors: Floats = np.abs(values / values[0] - 1)
    return errors
