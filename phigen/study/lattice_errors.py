"""Errors of conserved quantities (energy, Casimirs, invariants) of a lattice at each stored state of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from phigen.errors import StepError
from phigen.geometry.conservation import SITES, Unit, unit_of
from phigen.lattice.cell import Cell
from phigen.lattice.energy_balance import FINE_NODES, Power, inside_ends, integral, shifted
from phigen.runtime.arguments import Beginning
from phigen.runtime.interface import BackendError
from phigen.runtime.lattice import LatticeTrajectory
from phigen.symbolic.arrays import Floats, evaluate
from phigen.symbolic.expression import Expression

#: Names of the quantities that are reported for the energy. ENERGY: the energy, if it is conserved. BALANCE: otherwise
#: the energy minus the work done. CHANGE: the change of the energy, if the work is not computed.
ENERGY, BALANCE, CHANGE = "energy", "energy balance", "change of the energy"
#: Largest product steps × sites of a run for which the work is computed. The computation takes long, since it repeats
#: the run step by step.
MAX_BALANCED_SITE_STEPS = 20_000_000


def errors_of(cell: Cell, run: LatticeTrajectory) -> dict[str, Floats]:
    """Return the deviations of energy, Casimirs and invariants from their initial values, by name, each (frames,).

    Deviations of energy and invariants are in the units of `units_of`. For a Casimir at every site, the deviation is
    the largest change at a site. If H depends on the time, or forces act, the work done is subtracted from the energy.
    The work is not subtracted if the run is too long, continues an earlier run, has noise, or contains steps that were
    split because they failed.
    """
    errors = _of_energy(cell, run) | run.casimir_changes()
    for name, density in cell.invariants.items():
        times = [{t: time} for time in run.t.tolist() for t in cell.times] or [{}] * len(run)
        sums = np.array([summed(cell, density, x, {**run.parameters, **t}) for x, t in zip(run.x, times, strict=True)])
        errors[name] = _relative(sums[:, 0], unit_of(float(sums[0, 0]), float(sums[0, 1]), SITES))
    return errors


def units_of(cell: Cell, run: LatticeTrajectory) -> dict[str, Unit]:
    """Return the units in which errors of the energy and the invariants of a run are measured, by name."""
    values = {**run.parameters, **{t: float(run.t[0]) for t in cell.times}}
    invariants = {name: summed(cell, density, run.x[0], values) for name, density in cell.invariants.items()}
    units = {name: unit_of(value, terms, SITES) for name, (value, terms) in invariants.items()}
    return {"energy": replace(run.energy_unit, moves=cell.driven), **units}


def _of_energy(cell: Cell, run: LatticeTrajectory) -> dict[str, Floats]:
    if not cell.driven:
        return {ENERGY: _relative(run.energy, run.energy_unit)}
    balanced = not (cell.noise or run.joined or run.retried)
    if balanced and run.steps * run.x[0, 0].size <= MAX_BALANCED_SITE_STEPS:
        try:
            work, _ = works(cell, run)
            return {BALANCE: _relative(run.energy - work, run.energy_unit)}
        except StepError:
            pass
    return {CHANGE: _relative(run.energy, run.energy_unit)}


def works(cell: Cell, run: LatticeTrajectory) -> tuple[Floats, float]:
    """Return the work done up to each stored state (frames,), and an estimate of its error.

    The run is repeated step by step, and the power is evaluated after every step. The power is integrated as a
    polynomial through several of its values. If a run is short, or its last row is inside a step, further steps are
    made after its end to obtain enough values. Raises `StepError` if a step fails before there are enough values.
    """
    power, solver, start_time = Power(cell), run.solver, float(run.t[0])
    session, powers = solver.started(Beginning(run.x[0], run.h, run.parameters, start_time)), []
    count = max(run.steps + 2, FINE_NODES)
    for step in range(count):
        times = dict.fromkeys(cell.times, start_time + step * run.h)
        powers.append(power(session.state(), session.vector_field(), {**run.parameters, **times}))
        if step + 1 < count:
            try:
                session.advance(run.h, 1)
            except BackendError as error:
                if len(powers) > max(run.steps, FINE_NODES - 1):
                    break
                raise StepError(str(error), step=step, status=error.status) from error
    return integral(np.array(powers), run.h, (run.t - start_time) / run.h)


def _relative(values: Floats, unit: Unit) -> Floats:
    return unit.errors(values, float(values[0]))


def summed(cell: Cell, density: Expression, x: Floats, parameters: Mapping[str, Any]) -> tuple[float, float]:
    """Return the sum of a density over the sites, and the same sum with the absolute values of its terms."""
    sums = [_term(cell, term, x, parameters) for term in cell.additive_terms(density)]
    return float(sum(values.sum() for values in sums)), float(sum(np.abs(values).sum() for values in sums))


def _term(cell: Cell, term: Expression, x: Floats, parameters: Mapping[str, Any]) -> Floats:
    """Return the values of a term of a density at all sites; 0 where the term needs a site beyond an open end."""
    sizes = x.shape[1:]
    values: dict[str, Any] = {n: v for n, v in parameters.items() if np.ndim(v) == 0}
    for name, (base, offset) in cell.places(term).items():
        array = x[cell.fields.index(base)] if base in cell.fields else np.broadcast_to(parameters[base], sizes)
        values[name] = shifted(array, offset)
    is_inside = inside_ends(cell, cell.extent(term), sizes)
    return np.where(is_inside, np.broadcast_to(evaluate([term], values)[0], sizes), 0.0)
