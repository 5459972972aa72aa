"""Units of errors of energy, Casimirs and invariants: the same wherever errors are measured, printed or drawn.

Errors are relative to the value at the start. If that value is much smaller than its terms, it depends on the choice
of the zero of energy; then errors are relative to the terms. For a system the terms are Σ |x_i ∂_i H| at the start:
the change of H by a relative change of the coordinates, independent of added constants. For a lattice they are the
magnitudes of the energies of the sites. If they are 0 too, errors are absolute.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from phigen.geometry.system import System
from phigen.symbolic.arrays import Floats, evaluate
from phigen.symbolic.expression import Expression, gradient

#: A value below this fraction of its terms counts as zero.
SMALL = 1e-3

#: Energy error, in its unit, above which users are warned: a tenth of the energy is not a small perturbation.
LARGE_ENERGY_ERROR = 0.1

RELATIVE, TERMS, SITES, ABSOLUTE = "relative", "of its terms", "of its sites", "absolute"

#: The quantity that every system has.
ENERGY = "energy"


def rounding(steps: int) -> float:
    """Bound of the round-off error of a quantity after ``steps`` steps, relative to its terms: a random walk."""
    return 1e-15 * (20 + math.sqrt(steps))


@dataclass(frozen=True)
class Unit:
    """Unit of the errors of a quantity: its ``size``, and the ``kind`` `RELATIVE`, `TERMS`, `SITES` or `ABSOLUTE`.

    ``terms`` are those of the quantity at the start, in this unit; rounding errors are proportional to them.
    ``moves`` says that time, forces or noise change the quantity, so that its changes are not errors.
    """

    size: float = 1.0
    kind: str = ABSOLUTE
    terms: float = 1.0
    moves: bool = False

    @property
    def adjective(self) -> str:
        """The kind of errors in this unit: ``relative`` or ``absolute``."""
        return ABSOLUTE if self.kind == ABSOLUTE else RELATIVE

    def errors(self, values: Floats, start: float) -> Floats:
        """The errors (rows,) of values (rows,)."""
        with np.errstate(invalid="ignore"):  # of energies that are not finite
            errors: Floats = np.abs(values - start) / self.size
        return errors


def units(
    quantities: Iterable[Expression], coordinates: Sequence[str], parameters: Mapping[str, float], start: Floats
) -> list[Unit]:
    """The unit of each quantity on a trajectory from the state ``start`` (DIM,)."""
    point_values = {**parameters, **dict(zip(coordinates, np.asarray(start).tolist(), strict=True))}
    values = (value_and_terms(q, coordinates, point_values) for q in quantities)
    return [unit_of(float(value), float(terms)) for value, terms in values]


def units_of(system: System, parameters: Mapping[str, float], start: Floats) -> dict[str, Unit]:
    """The units of the energy and the Casimirs of a system, by their names."""
    quantities = {ENERGY: system.hamiltonian, **system.casimirs}
    return dict(zip(quantities, units(quantities.values(), system.coordinates, parameters, start), strict=True))


def moving(system: System) -> list[str]:
    """The names of energy and Casimirs that time, forces or noise change."""
    return [ENERGY, *system.pushed] if system.driven else []


def unit_of(value: float, terms: float, kind: str = TERMS) -> Unit:
    """The unit of a quantity with the given value and sum of terms at the start, where terms are of the ``kind``."""
    if abs(value) > SMALL * terms and math.isfinite(value):
        return Unit(abs(value), RELATIVE, max(1.0, terms / abs(value)))
    return Unit(terms, kind) if 0 < terms < math.inf else Unit()


def value_and_terms(
    quantity: Expression, coordinates: Sequence[str], values: Mapping[str, Any]
) -> tuple[Floats, Floats]:
    """Q and Σ |x_i ∂_i Q|, at one state or at each of a trajectory."""
    value, *slopes = evaluate([quantity, *gradient(quantity, coordinates)], values)
    with np.errstate(all="ignore"):
        return value, np.asarray(sum(np.abs(values[c] * slope) for c, slope in zip(coordinates, slopes, strict=True)))


def largest_terms(quantity: Expression, coordinates: Sequence[str], values: Mapping[str, Any]) -> float:
    """The largest value or sum of terms along a trajectory, to which rounding errors are proportional."""
    value, terms = value_and_terms(quantity, coordinates, values)
    return float(np.max(np.maximum(np.abs(value), terms))) or 1.0


def stated(units_by_name: Mapping[str, Unit]) -> str:
    """The sentence that names the units of errors; ``units_by_name`` are units by the names of quantities."""
    errors = "Errors and changes" if any(unit.moves for unit in units_by_name.values()) else "Errors"
    relative = any(unit.kind == RELATIVE for unit in units_by_name.values())
    clauses = [f"{errors} are relative to the value at the start"] if relative else []
    for kind, description in (
        (TERMS, "relative to Σ |xᵢ ∂ᵢ{0}| at the start, since {0} is nearly 0 there"),
        (SITES, "relative to Σ |{0} of a site| at the start, since {0} is nearly 0 there"),
        (ABSOLUTE, "absolute, since {0} is 0 at the start"),
    ):
        for name in (name for name, unit in units_by_name.items() if unit.kind == kind):
            clauses.append(f"{'those' if clauses else errors} of {name} are {description.format(_letter(name))}")
    return f"{'; '.join(clauses)}."


def _letter(name: str) -> str:
    return "H" if name == ENERGY else name
