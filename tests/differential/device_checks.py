"""Random systems on a device, run by OpenCL on the processor and compared with C."""

from __future__ import annotations

import importlib.util
import os
from typing import Any

import numpy as np
from differential.reference import expect_close

from phigen.api import lattice_solver_of, solver_of

#: One in ONE_IN seeds is tested on a device, as kernels take a second to compile.
ONE_IN = 50

#: Option that compiles kernels without optimisation, in a fifth of the time.
os.environ.setdefault("PYOPENCL_BUILD_OPTIONS", "-cl-opt-disable")


def applies(seed: int) -> bool:
    """Whether a system with this seed is tested on a device."""
    return seed % ONE_IN == 11 and importlib.util.find_spec("pyopencl") is not None


def lattice(trial: Any) -> None:
    """Check that states, energies, Casimirs and observables of a run of a lattice agree with those in C."""
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
    """Check that ensembles whose members differ in parameters, steps and start times agree with those in C."""
    device, c = solver_of(trial.compilation, "opencl"), trial.solvers["c"]
    x, sizes, parameters, since = many
    ours, theirs = (s.ensemble(x, sizes, 6, 4, **since, **parameters) for s in (device, c))
    expect_close(ours, theirs, trial.part("c", 1e-12), "members of OpenCL and C", float(np.abs(theirs).max()))
