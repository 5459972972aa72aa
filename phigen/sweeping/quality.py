"""Detection of members of a sweep whose results are meaningless, since their energy errors are large."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import prod

import numpy as np

from phigen.geometry.conservation import SMALL, value_and_terms
from phigen.geometry.system import System
from phigen.lattice.cell import Cell
from phigen.sweeping.store import Job
from phigen.symbolic.arrays import Floats


@dataclass(frozen=True)
class EnergyErrors:
    """Number ``count`` of the members whose relative energy error exceeds a limit, and the ``largest`` error."""

    count: int = 0
    largest: float = 0.0


def energy_errors(job: Job, system: System, limit: float) -> EnergyErrors:
    """Return the number of members whose stored energy error exceeds ``limit``, and the largest error.

    Errors are relative to the initial energy. If the terms of H nearly cancel at the start, errors are relative to the
    sum of the absolute values of the terms. Members that failed or are not computed yet are not counted. If time,
    forces or noise change the energy, no member is counted.
    """

    def at_start(varied: Mapping[str, Floats], count: int) -> tuple[Floats, Floats]:
        starts = dict(zip(job.plan.coordinates, job.plan.initial, strict=True))
        values = {**job.plan.parameters, **starts, **varied}
        return value_and_terms(system.hamiltonian, system.coordinates, values)

    return EnergyErrors() if system.driven else _count_large_errors(job, at_start, limit)


def lattice_energy_errors(job: Job, cell: Cell, limit: float) -> EnergyErrors:
    """Return, for a lattice, the number of members whose energy error exceeds ``limit``, and the largest error.

    Errors are relative to the initial energy, or to the sum of |energy of a site| if the energies of the sites nearly
    cancel. The store does not contain the initial energies, so they are computed again.
    """
    if cell.driven or "energy_error" not in job.plan.keep:
        return EnergyErrors()
    from phigen.runtime.lattice import LatticeSolver
    from phigen.sweeping.lattice_members import energies_at_start

    solver = LatticeSolver(job.backend(), job.interface)  # type: ignore[arg-type]
    return _count_large_errors(job, lambda varied, count: energies_at_start(job, solver, varied, count), limit)


def _count_large_errors(
    job: Job, at_start: Callable[[Mapping[str, Floats], int], tuple[Floats, Floats]], limit: float
) -> EnergyErrors:
    """Return the number of members whose relative energy error exceeds ``limit``, and the largest error.

    ``at_start(varied, count)`` returns the initial energies of members, and for each member the sum of the |terms| of
    its initial energy.
    """
    if "energy_error" not in job.plan.keep:
        return EnergyErrors()
    count, largest = 0, 0.0
    for number in range(prod(job.plan.boxes)):
        region = job.plan.region(number)
        listed = {name: job.root[name][region] for name in job.plan.listed}
        errors = job.root["energy_error"][region].reshape(-1)
        with np.errstate(all="ignore"):
            value, terms = at_start(job.plan.varied(region, listed), len(errors))
            scale = np.where(np.abs(value) > SMALL * terms, np.abs(value), terms)
            relative = errors / scale
        relative = relative[np.isfinite(relative)]
        count += int(np.count_nonzero(relative > limit))
        largest = max(largest, float(relative.max(initial=0.0)))
    return EnergyErrors(count, largest)
