"""Energy balance of systems in which H depends on the time, or forces act: H − ∫ P dt is constant along the motion.

P = ∂_tH + ∇H·(πζ + f) is the power supplied by the time dependence of H and by the forces, a covector field ζ and a
vector field f. So ∫ P dt is the work. The work between successive stored states is computed by Hermite's rule of order
8. The rule uses P and its first three derivatives along the motion at both ends of an interval. So the integral can be
continued state by state, with any spacing in time. The difference from the rule of order 6 estimates the error.
"""

from __future__ import annotations

import numpy as np

from phigen.geometry.system import System
from phigen.symbolic.arrays import Floats
from phigen.symbolic.expression import ONE, Expression, gradient, total

#: Weights for the integral of the power P over an interval of length 1, from P and its first three derivatives at both
#: ends. FINE: the rule of order 8. COARSE: the rule of order 6. At the second end, weights of odd derivatives have the
#: opposite sign.
FINE, COARSE = (1 / 2, 3 / 28, 1 / 84, 1 / 1680), (1 / 2, 1 / 10, 1 / 120, 0.0)


def powers(system: System) -> list[Expression]:
    """Return the power P = dH/dt and its first three time derivatives along the motion, as expressions.

    The list is empty if H is constant along the motion, or if the system has noise.
    """
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
    """Return the integrals of a function between successive times ``t`` (rows,), and estimates of their errors, (rows −
    1,) each.

    ``f`` (4, rows) has the values of the function and of its first three derivatives.
    """
    h = np.diff(t)

    def by(weights: tuple[float, ...]) -> Floats:
        parts = [w * h ** (k + 1) * (f[k, :-1] + (-1) ** k * f[k, 1:]) for k, w in enumerate(weights)]
        return np.asarray(sum(parts))

    fine = by(FINE)
    return fine, np.abs(fine - by(COARSE))
