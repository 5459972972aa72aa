"""Units of the errors of energy, Casimirs and invariants, for measurements, tables and figures.

An error is relative to the value of the quantity at the start. If the terms of the quantity nearly cancel at the start,
as for an energy near its arbitrary zero, the error is relative to the size of the terms instead. For a system, this
size is Σ |x_i ∂_i H| at the start: if each coordinate changes by a small fraction ε of its value, H changes by up to ε
times this sum. Constants in H do not change the sum. For a lattice the size is the sum of the absolute energies of the
sites. If this size is 0 too, the error is absolute.
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

#: A value counts as 0 if it is below this fraction of the size of its terms.
SMALL = 1e-3

#: Relative energy error above which users are warned: a tenth of the energy is not a small perturbation.
LARGE_ENERGY_ERROR = 0.1

RELATIVE, TERMS, SITES, ABSOLUTE = "relative", "of its terms", "of its sites", "absolute"

#: `Unit.kind` for a quantity that is infinite or NaN at the start. The errors of this quantity are unknown.
UNDEFINED = "no value at the start"

#: Name of the energy among the conserved quantities of a system.
ENERGY = "energy"


def rounding(steps: int) -> float:
    """Return a bound for the round-off error of a quantity after a number of steps.

    The bound is relative to the size of the terms of the quantity. It grows as √steps.
    """
    return 1e-15 * (20 + math.sqrt(steps))


@dataclass(frozen=True)
class Unit:
    """The unit in which errors of a quantity are measured: errors are divided by the number ``size``.

    ``kind`` says what ``size`` is. `RELATIVE`: the absolute value of the quantity at the start. `TERMS`: the size of
    its terms at the start. `SITES`: the sum of the absolute energies of the sites at the start. `ABSOLUTE` and
    `UNDEFINED`: 1. ``terms`` is the size of the terms in this unit; rounding errors are proportional to it. ``moves``
    is true if time, forces or noise change the quantity, so that its changes are no errors.
    """

    size: float = 1.0
    kind: str = ABSOLUTE
    terms: float = 1.0
    moves: bool = False

    @property
    def adjective(self) -> str:
        """The word for errors in this unit: ``relative`` or ``absolute``."""
        return ABSOLUTE if self.kind in (ABSOLUTE, UNDEFINED) else RELATIVE

    def errors(self, values: Floats, start: float) -> Floats:
        """Return the error |value − ``start``|/``size`` for each of the ``values``.

        ``values`` has the values of a quantity along a trajectory, and ``start`` is its value at the start. ``values``
        and the result have the shape (rows,).
        """
        with np.errstate(invalid="ignore"):  # values may be infinite or NaN, without warnings
            errors: Floats = np.abs(values - start) / self.size
        return errors


def units(
    quantities: Iterable[Expression], coordinates: Sequence[str], parameters: Mapping[str, float], start: Floats
) -> list[Unit]:
    """Return, for each quantity, the unit in which its errors along a trajectory are measured.

    The trajectory begins at the state ``start`` of shape (DIM,).
    """
    point_values = {**parameters, **dict(zip(coordinates, np.asarray(start).tolist(), strict=True))}
    values = (value_and_terms(q, coordinates, point_values) for q in quantities)
    return [unit_of(float(value), float(terms)) for value, terms in values]


def units_of(system: System, parameters: Mapping[str, float], start: Floats) -> dict[str, Unit]:
    """Return a map: `ENERGY` or the name of a Casimir → the unit for errors of this quantity.

    The errors are those along a trajectory that begins at the state ``start`` of shape (DIM,).
    """
    quantities = {ENERGY: system.hamiltonian, **system.casimirs}
    return dict(zip(quantities, units(quantities.values(), system.coordinates, parameters, start), strict=True))


def moving(system: System) -> list[str]:
    """Return the names of the quantities among energy and Casimirs that time, forces or noise change."""
    return [ENERGY, *system.pushed] if system.driven else []


def unit_of(value: float, terms: float, kind: str = TERMS) -> Unit:
    """Return the unit in which the errors of a quantity are measured.

    ``value`` is the quantity at the start of a trajectory, and ``terms`` is the size of the terms in its sum. If
    ``value`` is small compared with ``terms``, errors are relative to ``terms``. The ``kind`` of the result is then the
    argument ``kind``, which is `TERMS` or `SITES`.
    """
    if not math.isfinite(value):
        return Unit(kind=UNDEFINED)
    if abs(value) > SMALL * terms:
        return Unit(abs(value), RELATIVE, max(1.0, terms / abs(value)))
    return Unit(terms, kind) if 0 < terms < math.inf else Unit()


def value_and_terms(
    quantity: Expression, coordinates: Sequence[str], values: Mapping[str, Any]
) -> tuple[Floats, Floats]:
    """Return the values of a quantity Q and the sizes Σ |x_i ∂_i Q| of its terms.

    ``values`` maps each symbol to its value at one state, or to an array of its values along a trajectory.
    """
    value, *slopes = evaluate([quantity, *gradient(quantity, coordinates)], values)
    with np.errstate(all="ignore"):
        return value, np.asarray(sum(np.abs(values[c] * slope) for c, slope in zip(coordinates, slopes, strict=True)))


def largest_terms(quantity: Expression, coordinates: Sequence[str], values: Mapping[str, Any]) -> float:
    """Return one number: the largest value that |Q| or Σ |x_i ∂_i Q| has along a trajectory. Rounding errors of Q are
    proportional to this number.
    """
    value, terms = value_and_terms(quantity, coordinates, values)
    return float(np.max(np.maximum(np.abs(value), terms))) or 1.0


def stated(units_by_name: Mapping[str, Unit]) -> str:
    """Return a sentence for a figure or table: the units of the errors in it.

    ``units_by_name`` has the unit of each quantity.
    """
    errors = "Errors and changes" if any(unit.moves for unit in units_by_name.values()) else "Errors"
    relative = any(unit.kind == RELATIVE for unit in units_by_name.values())
    clauses = [f"{errors} are relative to the value at the start"] if relative else []
    for kind, description in (
        (TERMS, "relative to Σ |xᵢ ∂ᵢ{0}| at the start, since {0} is nearly 0 there"),
        (SITES, "relative to Σ |{0} of a site| at the start, since {0} is nearly 0 there"),
        (ABSOLUTE, "absolute, since {0} is 0 at the start"),
        (UNDEFINED, "unknown, since {0} has no value at the start"),
    ):
        for name in (name for name, unit in units_by_name.items() if unit.kind == kind):
            clauses.append(f"{'those' if clauses else errors} of {name} are {description.format(_letter(name))}")
    return f"{'; '.join(clauses)}."


def _letter(name: str) -> str:
    return "H" if name == ENERGY else name
