"""Members of a sweep whose energy error is too large for their numbers to mean anything."""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

from phigen.geometry.system import System
from phigen.study.conservation import SMALL, value_and_terms
from phigen.sweeping.store import Job


@dataclass(frozen=True)
class EnergyErrors:
    """``count`` members whose energy error is above a limit, and the ``largest`` error of all, both relative."""

    count: int = 0
    largest: float = 0.0


def energy_errors(job: Job, system: System, limit: float) -> EnergyErrors:
    """The stored energy errors of a sweep of an ordinary system, in the units of `phigen.study.conservation`.

    Members that failed, or wait, do not count, and none does where time, forces or noise change the energy.
    """
    if "energy_error" not in job.plan.keep or system.driven:
        return EnergyErrors()
    count, largest = 0, 0.0
    for number in range(prod(job.plan.boxes)):
        region = job.plan.region(number)
        listed = {name: job.root[name][region] for name in job.plan.listed}
        values: dict[str, Any] = {
            **job.plan.parameters,
            **dict(zip(job.plan.coordinates, job.plan.initial, strict=True)),
        }
        values |= job.plan.varied(region, listed)
        with np.errstate(all="ignore"):
            value, terms = value_and_terms(system.hamiltonian, system.coordinates, values)
            scale = np.where(np.abs(value) > SMALL * terms, np.abs(value), terms)
            relative = job.root["energy_error"][region].reshape(-1) / scale
        relative = relative[np.isfinite(relative)]
        count += int(np.count_nonzero(relative > limit))
        largest = max(largest, float(relative.max(initial=0.0)))
    return EnergyErrors(count, largest)
