"""Sizes of the kernels of ensembles on devices."""

from __future__ import annotations

from phigen.ir.launches import EnsembleLaunch
from phigen.scheme.policies import PredictorPolicy
from phigen.scheme.program import Program

#: Bytes of shared memory of a work group that all cards have, and bytes of a number.
_SHARED, _NUMBER = 48 * 1024, 8

#: Sizes of work groups, the largest first. 128 hides memory latency better than 256 if work items use many registers.
_GROUPS = (128, 64, 32, 16, 8, 4, 2, 1)


def predictors(program: Program) -> int:
    """Return the number of values of the predictors of a member, which are in shared memory."""
    if not program.step.kind.predicted or program.step.kind.collocates or program.noise:
        return 0
    return PredictorPolicy().differences * program.dimension * len(program.fractions)


def group_size(program: Program) -> int:
    """Return the largest number of work items in a group whose predictors fit into shared memory."""
    of_item = _NUMBER * predictors(program)
    return next((size for size in _GROUPS if size * of_item <= _SHARED), _GROUPS[-1])


#: Largest size in bytes of the coefficients that a CUDA kernel receives as an argument: all arguments together have at
#: most 4,096.
_COMMON_BYTES = 3_840


def has_common_coefficients(program: Program) -> bool:
    """Whether members with the same parameters, step and gauge may share the coefficients of their steps."""
    step = program.step
    if step.swept or step.refresh or step.kind.collocates or step.path is not None or program.monitor:
        return False
    size = 4 if program.single else 8
    return 0 < size * step.coefficients * len(program.fractions) <= _COMMON_BYTES


def ensemble_launch(program: Program) -> EnsembleLaunch:
    """Return the sizes of the kernel of an ensemble."""
    shared = program.step.coefficients * len(program.fractions) if has_common_coefficients(program) else 0
    return EnsembleLaunch(group_size(program), predictors(program), shared, len(program.held))
