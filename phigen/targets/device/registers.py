"""Warnings about steps that need more registers than graphics cards have.

The warnings rely on measurements with the CUDA compiler; see docs/devices.md.
"""

from __future__ import annotations

from dataclasses import dataclass

from phigen.scheme.program import Program


@dataclass(frozen=True)
class Spills:
    """Measurement for one system. The CUDA compiler compiled steps with ``scheme: series`` for the architecture
    sm_90.

    ``size`` is the number of bytes of one member that are in memory, because they do not fit into registers.
    """

    name: str
    order: int
    coordinates: int
    coefficients: int
    size: int

    def is_within(self, coordinates: int, coefficients: int) -> bool:
        """Whether the measured system has at most these numbers of ``coordinates`` and ``coefficients``."""
        return self.coordinates <= coordinates and self.coefficients <= coefficients


#: Measurements, from which two rules follow. First, a step spills values from registers to memory if it has at least as
#: many coordinates and coefficients as a measured system; it spills about as many bytes as that system, or more.
#: Second, steps with fewer than 6 coordinates and at most 40 coefficients do not spill. The rules were checked on 52
#: builds of 19 example systems in ``specs``, at the orders 2 to 6.
_MEASURED = (
    Spills("spin_chain5", 4, 15, 33, 44_000),
    Spills("so4_manakov", 6, 6, 216, 8_900),
    Spills("rigid_body", 8, 3, 80, 8_100),
    Spills("satellite", 4, 9, 7, 6_100),
    Spills("kepler", 6, 4, 118, 2_800),
    Spills("so4_manakov", 4, 6, 32, 2_000),
    Spills("seasonal_predator_prey", 6, 2, 54, 720),
    Spills("toda3", 6, 5, 41, 640),
    Spills("lagrange_top", 2, 6, 6, 350),
)

#: Factor by which single precision reduces the need for registers: a number takes one register instead of two.
_SINGLE = 2


def spilling(program: Program) -> str:
    """Return a warning with a hint if steps of a system need more registers than graphics cards have; else "". There
    are no warnings for lattices.
    """
    step = program.step
    if step.kind.sites:
        return ""
    if step.path is not None or step.kind.collocates:
        return f"the steps of {program.name} keep arrays in the memory of cards, which is slow: try scheme: splitting"
    if not step.kind.predicted:
        return ""
    parts = _SINGLE if program.single else 1
    coordinates, coefficients = program.dimension // parts, step.coefficients // parts
    smaller = [m for m in _MEASURED if m.is_within(coordinates, coefficients)]
    if not smaller:
        return ""
    nearest = [m for m in smaller if not any(m.is_within(n.coordinates, n.coefficients) and n != m for n in smaller)]
    most = max(nearest, key=lambda m: m.size)
    about = f"{program.dimension} coordinates, {step.coefficients} coefficients"
    measured = f"{most.name} of order {most.order} spills {most.size / 1000:.1f} kB"
    hint = "take a lower order, or scheme: splitting"
    if program.dimension < _MEASURED[-1].coordinates:
        hint += "; members that share coefficients need less"
    return f"the steps of {program.name} ({about}) need more registers than cards have ({measured}): {hint}"
