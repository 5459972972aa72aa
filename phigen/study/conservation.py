"""What errors of energy, Casimirs and invariants are counted in: the same wherever they are measured, printed, drawn.

Errors are relative to the value at the start. Where that is much less than the terms it is the sum of, it says where
the zero of energies lies and not how large energies are; errors are then relative to Σ |x_i ∂_i H| at the start: what
a relative change of the coordinates changes H by, whatever constant is added to it. Where that is 0 too they are
absolute.
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

#: A value below this part of its terms counts as zero.
SMALL = 1e-3

RELATIVE, TERMS, SITES, ABSOLUTE = "relative", "of its terms", "of its sites", "absolute"

#: The quantity that every system has.
ENERGY = "energy"


def rounding(steps: int) -> float:
    """What round-off may make of a quantity in so many steps, in parts of its terms: a random walk of last places."""
    return 1e-15 * (20 + math.sqrt(steps))


@dataclass(frozen=True)
class Unit:
    """What errors of a quantity are divided by: ``size``, of the ``kind`` `RELATIVE`, `TERMS`, `SITES` or `ABSOLUTE`.

    ``terms`` are those of the quantity at the start, which rounding is in proportion to, in this unit. ``moves`` tells
    that the quantity is no invariant, since time, forces or noise change it: what it differs by is no error.
    """

    size: float = 1.0
    kind: str = ABSOLUTE
    terms: float = 1.0
    moves: bool = False

    @property
    def noun(self) -> str:
        """``error`` or ``change``."""
        return "change" if self.moves else "error"

    @property
    def adjective(self) -> str:
        """``relative`` or ``absolute``."""
        return ABSOLUTE if self.kind == ABSOLUTE else RELATIVE

    def errors(self, values: Floats, start: float) -> Floats:
        """The errors (rows,) of values (rows,)."""
        found: Floats = np.abs(values - start) / self.size
        return found


def units(
    quantities: Iterable[Expression], coordinates: Sequence[str], parameters: Mapping[str, float], start: Floats
) -> list[Unit]:
    """The unit of each quantity on a trajectory from the state ``start`` (DIM,)."""
    at = {**parameters, **dict(zip(coordinates, np.asarray(start).tolist(), strict=True))}
    found = (value_and_terms(q, coordinates, at) for q in quantities)
    return [unit_of(float(value), float(terms)) for value, terms in found]


def units_of(system: System, parameters: Mapping[str, float], start: Floats) -> dict[str, Unit]:
    """The units of the energy and the Casimirs of a system, by their names."""
    named = {ENERGY: system.hamiltonian, **system.casimirs}
    return dict(zip(named, units(named.values(), system.coordinates, parameters, start), strict=True))


def moving(system: System) -> list[str]:
    """The names of energy and Casimirs that time, forces or noise change."""
    return [ENERGY, *system.pushed] if system.driven else []


def unit_of(value: float, terms: float) -> Unit:
    """The unit of a quantity with that value at the start and that sum of terms."""
    if abs(value) > SMALL * terms and math.isfinite(value):
        return Unit(abs(value), RELATIVE, max(1.0, terms / abs(value)))
    return Unit(terms, TERMS) if 0 < terms < math.inf else Unit()


def value_and_terms(
    quantity: Expression, coordinates: Sequence[str], values: Mapping[str, Any]
) -> tuple[Floats, Floats]:
    """Q and Σ |x_i ∂_i Q|, at one state or at each of a trajectory."""
    value, *slopes = evaluate([quantity, *gradient(quantity, coordinates)], values)
    with np.errstate(all="ignore"):
        return value, np.asarray(sum(np.abs(values[c] * slope) for c, slope in zip(coordinates, slopes, strict=True)))


def largest_terms(quantity: Expression, coordinates: Sequence[str], values: Mapping[str, Any]) -> float:
    """The largest value or sum of terms along a trajectory: what rounding is in proportion to."""
    value, terms = value_and_terms(quantity, coordinates, values)
    return float(np.max(np.maximum(np.abs(value), terms))) or 1.0


def stated(found: Mapping[str, Unit]) -> str:
    """What errors are relative to, in a sentence; ``found`` are units by the names of quantities."""
    if found and all(unit.kind == SITES for unit in found.values()):
        return "Errors are relative to the sum of the magnitudes of the energies of the sites at the start."
    said = ["relative to the value at the start"]
    for kind, how in (
        (TERMS, "relative to Σ |xᵢ ∂ᵢ{0}| there, since {0} is nearly 0"),
        (ABSOLUTE, "absolute, since {0} is 0 there"),
    ):
        said += [f"of {name} {how.format(_letter(name))}" for name, unit in found.items() if unit.kind == kind]
    return f"Errors are {'; '.join(said)}."


def _letter(name: str) -> str:
    return "H" if name == ENERGY else name
