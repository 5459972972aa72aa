"""Sizes for the kernels of ensembles on devices: work groups, shared memory, common coefficients."""

from __future__ import annotations

from phigen.ir.launches import EnsembleLaunch
from phigen.scheme.policies import PredictorPolicy
from phigen.scheme.program import Program

#: Number of bytes of shared memory that a work group can have on every graphics card, and number of bytes of a double.
_SHARED, _NUMBER = 48 * 1024, 8

#: Sizes of work groups to try, the largest first. Larger groups are not tried: if work items use many registers, 128
#: work items hide the latency of memory better than 256.
_GROUPS = (128, 64, 32, 16, 8, 4, 2, 1)


def predictors(program: Program) -> int:
    """Return the number of values that the predictors of one member store. The values are in shared memory."""
    if not program.step.kind.predicted or program.step.kind.collocates or program.noise:
        return 0
    return PredictorPolicy().differences * program.dimension * len(program.fractions)


def group_size(program: Program) -> int:
    """Return the size of a work group: the largest size for which the predictors of all its work items fit into shared
    memory.
    """
    of_item = _NUMBER * predictors(program)
    return next((size for size in _GROUPS if size * of_item <= _SHARED), _GROUPS[-1])


#: Largest size in bytes of coefficients that are passed as an argument of a kernel. In CUDA, all arguments together may
#: have 4,096 bytes.
_COMMON_BYTES = 3_840


def has_common_coefficients(program: Program) -> bool:
    """Whether members of an ensemble that have the same parameters, step and gauge can share coefficients."""
    step = program.step
    if step.swept or step.refresh or step.kind.collocates or step.path is not None or program.monitor:
        return False
    size = 4 if program.single else 8
    return 0 < size * step.coefficients * len(program.fractions) <= _COMMON_BYTES


def ensemble_launch(program: Program) -> EnsembleLaunch:
    """Return the data for launching the kernel of an ensemble."""
    shared = program.step.coefficients * len(program.fractions) if has_common_coefficients(program) else 0
    return EnsembleLaunch(group_size(program), predictors(program), shared, len(program.held))
