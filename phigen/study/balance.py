"""Energy balance if H depends on the time or forces act: H − ∫ P dt is constant along the motion, H is not.

P = ∂_tH + ∇H·(πζ + f) is the power supplied by the explicit time dependence and by the forces. The integral is
evaluated between successive stored states by Hermite's rule of order 8. The rule needs only P and its first three
derivatives along the motion at both ends of an interval, so the integral can be continued state by state, at any
spacing. The difference from the rule of order 6 estimates the error.
"""

from __future__ import annotations

import numpy as np

from phigen.geometry.system import System
from phigen.symbolic.arrays import Floats
from phigen.symbolic.expression import ONE, Expression, gradient, total

#: Weights of f, f′, … at both ends of an interval of length 1, for the rules of order 8 and of order 6.
FINE, COARSE = (1 / 2, 3 / 28, 1 / 84, 1 / 1680), (1 / 2, 1 / 10, 1 / 120, 0.0)


def powers(system: System) -> list[Expression]:
    """Return P and its derivatives along the motion; no expressions if H is an invariant, or if noise changes H as
    well."""
    if not system.driven or system.noise:
        return []
    time_derivatives, field = [], [*system.vector_field(), *(ONE for _ in system.times)]
    power = total([*gradient(system.hamiltonian, system.times), system.forced_rate(system.hamiltonian)])
    for _ in FINE:
        time_derivatives.append(power)
        slopes = gradient(power, [*system.coordinates, *system.times])
        power = total(s * f for s, f in zip(slopes, field, strict=True))
    return time_derivatives


def works(t: Floats, f: Floats) -> tuple[Floats, Floats]:
    """Return ∫ f dt over each interval between times (rows,), and the estimated errors.

    ``f`` (4, rows) has the values of f and of its first three derivatives.
    """
    h = np.diff(t)

    def by(weights: tuple[float, ...]) -> Floats:
        parts = [w * h ** (k + 1) * (f[k, :-1] + (-1) ** k * f[k, 1:]) for k, w in enumerate(weights)]
        return np.asarray(sum(parts))

    fine = by(FINE)
    return fine, np.abs(fine - by(COARSE))
