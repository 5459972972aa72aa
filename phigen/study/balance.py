"""The balance of energy where H depends on the time: H − ∫ ∂_tH dt is constant along the motion, H is not.

The integral is taken along the stored states, from one to the next by Hermite's rule of order 8, which needs ∂_tH and
its first three derivatives along the motion at both ends, and nothing else: so it can be added up as states come,
whatever they are apart. How much the rule of order 6 differs tells how far the sum may be off.
"""

from __future__ import annotations

import numpy as np

from phigen.geometry.system import System
from phigen.symbolic.arrays import Floats
from phigen.symbolic.expression import Expression, gradient, total

#: Weights of f, f′, … at both ends of an interval, in units of powers of its length: order 8, and order 6.
FINE, COARSE = (1 / 2, 3 / 28, 1 / 84, 1 / 1680), (1 / 2, 1 / 10, 1 / 120, 0.0)


def powers(system: System) -> list[Expression]:
    """∂_tH, the power that the time puts in, and its derivatives along the motion; empty without a time."""
    found: list[Expression] = []
    for time in system.times:
        field, rate = system.vector_field(), gradient(system.hamiltonian, [time])[0]
        for _ in FINE:
            found.append(rate)
            slopes = gradient(rate, [*system.coordinates, time])
            rate = total([*(s * f for s, f in zip(slopes, field, strict=False)), slopes[-1]])
    return found


def works(t: Floats, f: Floats) -> tuple[Floats, Floats]:
    """∫ f dt over each interval between times (rows,), from f and derivatives (4, rows); and how far it may be off."""
    h = np.diff(t)

    def by(weights: tuple[float, ...]) -> Floats:
        parts = [w * h ** (k + 1) * (f[k, :-1] + (-1) ** k * f[k, 1:]) for k, w in enumerate(weights)]
        return np.asarray(sum(parts))

    fine = by(FINE)
    return fine, np.abs(fine - by(COARSE))
