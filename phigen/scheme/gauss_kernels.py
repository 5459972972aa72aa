"""Kernels of a Gauss step: the vector field of a stage, the increment of the coordinates, and the change of frame."""

from __future__ import annotations

from collections.abc import Sequence

from phigen.gauss.stage_map import StageMap, at_unknowns, derivatives_in_next_frame, lifted_functionals, vector_field
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.lowering import operation_counts
from phigen.scheme.staging import Coefficients
from phigen.symbolic.expression import Expression, fold, raw, substitute, symbol
from phigen.symbolic.symbols import Symbol, kind_of

#: Two kinds of symbols. The first is for derivatives of the unknowns, in the kernel that transforms these derivatives
#: to the frame of the next step. The second is for velocities in Lie algebras.
SLOPE, VELOCITY = "k", "velocity"

#: The symbol of the weight of stage j: the step size h times the weight b_j of the quadrature.
WEIGHT = Symbol("w")


def field_kernel(points: StageMap, coefficients: Coefficients) -> Kernel:
    """Return the kernel of the derivatives of the unknowns at a stage j, times the weight h b_j of the stage."""
    forms = [_field(points, coefficients, collected=collected) for collected in (False, True)]
    values = min(forms, key=lambda form: operation_counts(form)["multiplications"])
    return Kernel(
        "stage_field",
        "derivatives of the unknowns (offsets from the start x) at a stage, times its weight w",
        {"coef": coefficients.slots, "x": points.start, "z": points.unknowns, "w": (WEIGHT,)},
        (Output("move", tuple(values)),),
    )


def _field(points: StageMap, coefficients: Coefficients, *, collected: bool) -> list[Expression]:
    velocities: list[Expression] = []

    def hold(value: Expression) -> Expression:
        if not value.args:
            return value
        velocities.append(value)
        return symbol(Symbol(VELOCITY, len(velocities) - 1))

    slopes = vector_field(points, at_unknowns(points), symbol(WEIGHT), hold, collected=collected)
    return _inserted(coefficients.hoist(slopes), _with_scaled_weights(coefficients.hoist(velocities)))


def _inserted(roots: Sequence[Expression], velocities: Sequence[Expression]) -> list[Expression]:
    """Return the expressions ``roots``, with the symbols of velocities replaced by the ``velocities``."""

    def visit(e: Expression, args: list[Expression]) -> Expression:
        if e.op == "symbol" and kind_of(e.value) == VELOCITY:
            number_of_velocity: int = e.value.key[0]
            return velocities[number_of_velocity]
        return raw(e.op, tuple(args), e.value) if e.args else e

    return fold(roots, visit)


def _with_scaled_weights(roots: Sequence[Expression]) -> list[Expression]:
    """Return the roots with (c·w)·e in place of c·(w·e), where w is the weight of a stage and c a number.

    A compiler then computes c·w once for all sweeps of a step.
    """
    weight = symbol(WEIGHT)

    def visit(e: Expression, args: list[Expression]) -> Expression:
        if e.op == "mul" and args[0].op == "number" and args[1].op == "mul" and args[1].args[0] == weight:
            return raw("mul", (raw("mul", (args[0], weight)), args[1].args[1]))
        return raw(e.op, tuple(args), e.value) if e.args else e

    return fold(roots, visit)


def elapsed_kernel(points: StageMap, monitor: Expression, coefficients: Coefficients) -> Kernel:
    """Return the kernel of the physical time t that one stage contributes to a step.

    This time is the weight of the stage times dt/dτ. τ is the time of the monitor, in which steps have equal size.
    """
    (rate,) = coefficients.hoist(substitute([monitor], at_unknowns(points)))
    return Kernel(
        "elapsed",
        "the rate dt/dtau at a stage, times the weight w of the stage",
        {"coef": coefficients.slots, "x": points.start, "z": points.unknowns, "w": (WEIGHT,)},
        (Output("elapsed", (symbol(WEIGHT) * rate,)),),
    )


def change_kernel(points: StageMap, coefficients: Coefficients) -> Kernel:
    """Return the kernel that computes the increment of the coordinates from the unknowns at the end of a step."""
    return Kernel(
        "stage_change",
        "the increment of the coordinates from x, as a function of the unknowns",
        {"coef": coefficients.slots, "x": points.start, "z": points.unknowns},
        (Output("change", tuple(coefficients.hoist(points.change))),),
    )


def lift_kernel(points: StageMap, coefficients: Coefficients) -> Kernel:
    """Return the kernel of the vectors y that determine the frames at the start of a step.

    A frame is a quaternion F with y = F* k F, where k is the third imaginary unit. The algebra of the group elements
    contains copies of the quaternions, and there is one frame for each copy.
    """
    return Kernel(
        "functionals",
        "the vectors y = F* k F for the frame F of each group element at the start of a step",
        {"coef": coefficients.slots, "x": points.system.coordinates},
        (Output("values", tuple(coefficients.hoist(lifted_functionals(points)))),),
    )


def frame_kernel(points: StageMap, coefficients: Coefficients) -> Kernel | None:
    """Return the kernel that transforms derivatives of the unknowns to the frame in which the next step starts.

    The derivatives predict the stages of the next step. Each step starts with the group element 1, so derivatives of a
    group element that ends at G are multiplied by G* = G⁻¹ from the left. Returns None if nothing is to be transformed:
    there are no group elements, or all of them have frames F (see `phigen.gauss.lift`).
    """
    if all(group.copies for group in points.realisation.groups):
        return None
    slopes = tuple(Symbol(SLOPE, k) for k in range(len(points.unknowns)))
    values = derivatives_in_next_frame(points, [symbol(s) for s in slopes])
    return Kernel(
        "next_frame",
        "at the end of a step, where the unknowns are `z`, transform their derivatives `k` for the next step",
        {"coef": coefficients.slots, "x": points.start, "z": points.unknowns, "k": slopes},
        (Output("seen", tuple(coefficients.hoist(values))),),
    )
