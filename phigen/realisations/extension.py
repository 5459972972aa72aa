"""Linear and affine π as one case: π on the dual of a Lie algebra, or on the hyperplane z = 1 in the dual of its
central extension."""

from __future__ import annotations

from dataclasses import dataclass

from phigen.geometry.lie_algebra import LieAlgebra
from phigen.geometry.shapes import Affine, LiePoisson
from phigen.geometry.system import System
from phigen.realisations.protocol import covector_symbols
from phigen.symbolic.expression import ONE, ZERO, Expression, symbol


@dataclass(frozen=True)
class Dual:
    """The coordinates x as a point of the dual of a Lie ``algebra``, and the covector p as an element of the algebra.

    For an affine π the algebra is the central extension, and the last components are x_z = 1 and p_z = 0. x_z is a
    Casimir, so the hyperplane x_z = 1 is a Poisson submanifold. Maps that do not depend on p_z can be restricted to
    this hyperplane.
    """

    algebra: LieAlgebra
    x: tuple[Expression, ...]
    p: tuple[Expression, ...]


def dual_of(system: System) -> Dual | None:
    """Return the coordinates x and the covector p of a linear or affine π as a `Dual`: x is in the dual of a Lie
    algebra, and p in the algebra.

    Returns None for any other π.
    """
    x, p = [symbol(c) for c in system.coordinates], covector_symbols(system.coordinates)
    match system.shape:
        case LiePoisson(algebra):
            return Dual(algebra, tuple(x), tuple(p))
        case Affine(extension):
            return Dual(extension, (*x, ONE), (*p, ZERO))
    return None
