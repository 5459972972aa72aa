"""Random systems on a device, by OpenCL on the processor, against C."""

from __future__ import annotations

import importlib.util
import os
from typing import Any

import numpy as np
from differential.reference import expect_close

from phigen.api import lattice_solver_of, solver_of

#: One in so many seeds: kernels take a second to compile.
ONE_IN = 50

#: Kernels compile in a fifth of the time without optimisation.
os.environ.setdefault("PYOPENCL_BUILD_OPTIONS", "-cl-opt-disable")


def applies(seed: int) -> bool:
    """Whether a system with this seed is tried on a device."""
    return seed % ONE_IN == 11 and importlib.util.find_spec("pyopencl") is not None


def lattice(trial: Any) -> None:
    """A run has the states, energies, Casimirs and observables of C."""
    device, c = lattice_solver_of(trial.compilation, "opencl"), trial.solvers["c"]
    ours, theirs = (s.integrate(trial.x0, trial.h, 7, 3, **trial.since, **trial.given) for s in (device, c))
    part, scale = trial.part("c", 1e-12), float(np.abs(theirs.x).max())
    expect_close(ours.x, theirs.x, part, "states of OpenCL and C", scale)
    unit = 1 + float(np.abs(theirs.energy).max())
    expect_close(ours.energy, theirs.energy, 20 * part, "energies of OpenCL and C", unit)
    for name in ("casimirs", "observables"):
        values, expected = getattr(ours, name), getattr(theirs, name)
        for key, value in expected.items():
            expect_close(values[key], value, 20 * part, f"{name} of OpenCL and C", 1 + float(np.abs(value).max()))


def members(trial: Any, many: Any) -> None:
    """Members with parameters, steps and times of their own are those of C."""
    device, c = solver_of(trial.compilation, "opencl"), trial.solvers["c"]
    x, sizes, parameters, since = many
    ours, theirs = (s.ensemble(x, sizes, 6, 4, **since, **parameters) for s in (device, c))
    expect_close(ours, theirs, trial.part("c", 1e-12), "members of OpenCL and C", float(np.abs(theirs).max()))
