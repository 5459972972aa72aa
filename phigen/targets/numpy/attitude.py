"""Attitudes in NumPy, computed from the states of a run."""

from __future__ import annotations

from phigen.scheme.program import Attitude, Program
from phigen.targets.numpy.kernels import function
from phigen.targets.numpy.values import values_of
from phigen.targets.rendering import render


def pieces(program: Program, attitude: Attitude) -> list[str]:
    """Return the text of the kernels of attitudes, and of the functions that call these kernels."""
    group, step, rows = attitude.group, program.step, attitude.group.rows
    solved = "_path(stage[0], x, solved)[1]" if step.path else "solved"
    shown = f"Attitudes have shape (rows, ..., {rows}, {rows})" if rows else "Attitudes have shape (rows, ..., 4)"
    values = {
        **values_of(program),
        "size": group.size,
        "what": f"matrix of {rows} rows" if rows else "quaternion" + " and a position" * bool(group.translation),
        "rows": rows,
        "position": bool(group.translation),
        "exponential": attitude.exponential is not None,
        "uniform": attitude.rate is not None,
        "normalise": group.orthogonal,
        "splitting": step.kind.flows,
        "rates": f"_rate(parameters, {'gauge.T, ' * bool(program.gauge)}x)" if attitude.rate else "None",
        "turn_of_stage": _turn_of_stage(attitude, solved, collocates=step.kind.collocates),
        "lengthened": attitude.lengthened,
        "turn_of_flows": "_shorter(turn)" if attitude.lengthened else "turn",
        "shaped": _shaped(rows, bool(group.translation)),
        **_ordered(group.spatial),
        "shapes": shown + ", positions (rows, ..., 3)" * bool(group.translation),
    }
    turns = "TURNS = (" + ", ".join(f"_turn{k}" for k in range(1, len(attitude.turns) + 1)) + ",)\n"
    unused = attitude.turn if attitude.along else attitude.along
    functions = [function(program, kernel) for kernel in attitude.kernels if kernel is not unused]
    functions += [turns] if attitude.turns else []
    templates = ("matrices", "matrix_start") if rows else ("quaternions", "rotations", "start")
    parts = [*(f"attitude_{part}" for part in templates), "attitude", "reconstruct"]
    return [*functions, *(render("numpy", f"{part}.py", values) for part in parts)]


def _turn_of_stage(attitude: Attitude, solved: str, *, collocates: bool) -> str:
    """Return the Python expression for ΔF − 1. The group element ΔF is the attitude increment of a stage.

    ``solved`` is the expression for the solution of the stage. ``collocates`` says that the step is a Gauss step.
    """
    if collocates:  # the first axis of the kernel's input counts the unknowns
        return f"np.stack(_turn(stage[0], np.sum({solved}, axis=-1)), axis=-1)"
    turn = "_along(solved)" if attitude.along else f"_turn(stage[0], x + {solved})"
    return f"_of_covector({turn})" if attitude.group.matrices and not attitude.cayley else turn


def _shaped(rows: int, position: bool) -> str:
    """Return the expression that converts rows of group elements to the arrays of attitudes and positions."""
    if rows:
        return f"elements.reshape(shape + ({rows}, {rows}))"
    if not position:
        return "elements.reshape(shape + (4,))"
    return "elements[..., :4].reshape(shape + (4,)), elements[..., 4:].reshape(shape + (3,))"


def _ordered(spatial: bool) -> dict[str, str]:
    """Return the template values that depend on ``spatial``: pairs of arguments for products of group elements, and for
    the rotation of a vector.

    ``spatial`` says that momenta are in space coordinates. If so, the factor of the later motion is on the left,
    otherwise on the right.
    """
    pairs = {
        "uniform_first": ("first", "_uniform(rate, t)"),
        "element_first": ("first", "element"),
        "factor_element": ("element", "factor"),
        "quaternions": ("element[..., :4]", "turn[..., :4]"),
    }
    moved = "turn + np.eye(1, ELEMENT), element[..., 4:]" if spatial else "element, turn[..., 4:]"
    return {"moved": moved} | {name: ", ".join(p[::-1] if spatial else p) for name, p in pairs.items()}
