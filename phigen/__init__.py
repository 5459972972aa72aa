"""phigen: a compiler from specs of Poisson systems ẋ = π(x)∇H(x) to standalone solvers.

The public names are loaded on first use, so that ``import phigen`` and ``phigen --help`` do not import sympy and
numpy.
"""

from __future__ import annotations

from phigen._version import __version__

TYPE_CHECKING = False  # Assigned here, since importing typing takes longer than the rest of this module.
if TYPE_CHECKING:
    from typing import Any

    from phigen.api import compile, formulas, load
    from phigen.errors import (
        CheckError,
        DeviceError,
        LimitError,
        MissingPackageError,
        ParameterError,
        PhigenError,
        PhigenWarning,
        SpecError,
        StepError,
        ToolchainError,
    )
    from phigen.geometry.system import System
    from phigen.initial_value import solve_ivp
    from phigen.lattice.lattice_system import LatticeSystem
    from phigen.runtime.lattice import LatticeSolver, LatticeTrajectory
    from phigen.runtime.solver import Solver
    from phigen.runtime.trajectory import Trajectory
    from phigen.study.averages import averages
    from phigen.sweeping.api import sweep

_HOMES = {
    "load": "phigen.api",
    "compile": "phigen.api",
    "formulas": "phigen.api",
    "sweep": "phigen.sweeping.api",
    "averages": "phigen.study.averages",
    "System": "phigen.geometry.system",
    "LatticeSolver": "phigen.runtime.lattice",
    "LatticeSystem": "phigen.lattice.lattice_system",
    "LatticeTrajectory": "phigen.runtime.lattice",
    "Solver": "phigen.runtime.solver",
    "solve_ivp": "phigen.initial_value",
    "Trajectory": "phigen.runtime.trajectory",
    "CheckError": "phigen.errors",
    "DeviceError": "phigen.errors",
    "LimitError": "phigen.errors",
    "MissingPackageError": "phigen.errors",
    "ParameterError": "phigen.errors",
    "PhigenError": "phigen.errors",
    "PhigenWarning": "phigen.errors",
    "SpecError": "phigen.errors",
    "StepError": "phigen.errors",
    "ToolchainError": "phigen.errors",
}

__all__ = [
    "CheckError",
    "DeviceError",
    "LatticeSolver",
    "LatticeSystem",
    "LatticeTrajectory",
    "LimitError",
    "MissingPackageError",
    "ParameterError",
    "PhigenError",
    "PhigenWarning",
    "Solver",
    "SpecError",
    "StepError",
    "System",
    "ToolchainError",
    "Trajectory",
    "__version__",
    "averages",
    "compile",
    "formulas",
    "load",
    "solve_ivp",
    "sweep",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'phigen' has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
