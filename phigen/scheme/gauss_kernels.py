"""Kernels of a Gauss step: the vector field of a stage, the increment of x, and the change of frame."""

from __future__ import annotations

from collections.abc import Sequence

from phigen.gauss.stage_map import StageMap, at_unknowns, derivatives_in_next_frame, lifted_functionals, vector_field
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.lowering import operation_counts
from phigen.scheme.staging import Coefficients
from phigen.symbolic.expression import Expression, fold, raw, substitute, symbol
from phigen.symbolic.symbols import Symbol, kind_of

#: Kinds of symbols: of derivatives that are transformed to a new frame, and of velocities in Lie algebras.
SLOPE, VELOCITY = "k", "velocity"

#: The symbol of h b_j, the weight of a stage.
WEIGHT = Symbol("w")


def field_kernel(points: StageMap, coefficients: Coefficients) -> Kernel:
    """Return the kernel of the vector field of the unknowns at a stage, times the weight h b_j of the stage."""
    forms = [_field(points, coefficients, collected=collected) for collected in (False, True)]
    values = min(forms, key=lambda form: operation_counts(form)["multiplications"])
    return Kernel(
        "stage_field",
        "w times the derivatives of the unknowns of a stage, which are offsets from x, the start of the step",
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
    """Return the roots with the velocities substituted, without moving numerical factors into the products."""

    def visit(e: Expression, args: list[Expression]) -> Expression:
        if e.op == "symbol" and kind_of(e.value) == VELOCITY:
            number_of_velocity: int = e.value.key[0]
            return velocities[number_of_velocity]
        return raw(e.op, tuple(args), e.value) if e.args else e

    return fold(roots, visit)


def _with_scaled_weights(roots: Sequence[Expression]) -> list[Expression]:
    """Return roots with (c·w)·e in place of c·(w·e): compilers then compute c·w once for all sweeps of a step."""
    weight = symbol(WEIGHT)

    def visit(e: Expression, args: list[Expression]) -> Expression:
        if e.op == "mul" and args[0].op == "number" and args[1].op == "mul" and args[1].args[0] == weight:
            return raw("mul", (raw("mul", (args[0], weight)), args[1].args[1]))
        return raw(e.op, tuple(args), e.value) if e.args else e

    return fold(roots, visit)


def elapsed_kernel(points: StageMap, monitor: Expression, coefficients: Coefficients) -> Kernel:
    """Return the kernel of the time that passes at a stage: the weight times dt/dτ."""
    (rate,) = coefficients.hoist(substitute([monitor], at_unknowns(points)))
    return Kernel(
        "elapsed",
        "w times dt/dtau at a stage",
        {"coef": coefficients.slots, "x": points.start, "z": points.unknowns, "w": (WEIGHT,)},
        (Output("elapsed", (symbol(WEIGHT) * rate,)),),
    )


def change_kernel(points: StageMap, coefficients: Coefficients) -> Kernel:
    """Return the kernel of the increment of the coordinates in a step."""
    return Kernel(
        "stage_change",
        "the change of the coordinates from x, by the unknowns",
        {"coef": coefficients.slots, "x": points.start, "z": points.unknowns},
        (Output("change", tuple(coefficients.hoist(points.change))),),
    )


def lift_kernel(points: StageMap, coefficients: Coefficients) -> Kernel:
    """Return the kernel of the functionals y of copies of the quaternions, of which the frames F are lifts."""
    return Kernel(
        "functionals",
        "y = F* k F for the frame F of each group element at the start of a step",
        {"coef": coefficients.slots, "x": points.system.coordinates},
        (Output("values", tuple(coefficients.hoist(lifted_functionals(points)))),),
    )


def frame_kernel(points: StageMap, coefficients: Coefficients) -> Kernel | None:
    """Return the kernel of the derivatives of group elements in the frame of the next step: G* = G⁻¹ times the
    derivatives.

    None without group elements.
    """
    if all(group.copies for group in points.realisation.groups):
        return None
    slopes = tuple(Symbol(SLOPE, k) for k in range(len(points.unknowns)))
    values = derivatives_in_next_frame(points, [symbol(s) for s in slopes])
    return Kernel(
        "next_frame",
        "derivatives k of the unknowns in the frame of the end z of a step from x, where the next one starts",
        {"coef": coefficients.slots, "x": points.start, "z": points.unknowns, "k": slopes},
        (Output("seen", tuple(coefficients.hoist(values))),),
    )
