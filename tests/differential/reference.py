"""References for solvers: flows by SciPy's DOP853, derivatives by differences, orders by halved steps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Floats = NDArray[np.float64]
Field = Callable[[float, Floats], Floats]

EPS = float(np.finfo(float).eps)

#: Number of halvings of the step, by order, after which errors must show the order or be at round-off.
_HALVINGS = {1: 8, 2: 7, 3: 6, 4: 5}
#: The order observed with the two smallest steps may be lower than the stated one by this much.
_SLACK = 0.5


class DisagreementError(AssertionError):
    """Two computations of the same quantity differ."""


def expect(holds: bool, message: str) -> None:
    """Raise `DisagreementError` with a message if ``holds`` is false."""
    if not holds:
        raise DisagreementError(message)


def expect_close(value: Floats, reference: Floats, part: float, what: str, scale: float | None = None) -> None:
    """Raise `DisagreementError` if two arrays differ by more than ``part`` times ``scale``, which is by default the
    largest absolute value in the arrays.
    """
    value, reference = np.asarray(value, dtype=float), np.asarray(reference, dtype=float)
    expect(value.shape == reference.shape, f"{what}: shapes {value.shape} and {reference.shape}")
    expect(bool(np.isfinite(value).all()), f"{what}: not finite: {value.ravel()[:8]}")
    if value.size == 0:
        return
    unit = max(float(np.abs(reference).max()), float(np.abs(value).max())) if scale is None else scale
    off = float(np.abs(value - reference).max())
    if off > part * max(unit, 1e-300):
        at = np.unravel_index(int(np.abs(value - reference).argmax()), value.shape)
        place = tuple(int(k) for k in at)
        raise DisagreementError(f"{what}: {value[at]!r} and {reference[at]!r} at {place}, off by {off:.2e}")


def expect_same_bits(value: Floats, reference: Floats, what: str) -> None:
    """Raise `DisagreementError` unless two arrays are equal bit by bit."""
    value, reference = np.asarray(value, dtype=float), np.asarray(reference, dtype=float)
    expect(value.shape == reference.shape, f"{what}: shapes {value.shape} and {reference.shape}")
    off = float(np.abs(value - reference).max()) if value.size else 0.0
    expect(value.tobytes() == reference.tobytes(), f"{what}: not the same bits, off by {off:.2e}")


def flow(field: Field, t0: float, x0: Floats, span: float) -> Floats:
    """Return the solution of an ODE after the time ``span``, to about 1e-12; NaN if the integration fails."""
    solution = solve_ivp(field, (t0, t0 + span), x0, method="DOP853", rtol=2.5e-14, atol=1e-15)
    return np.asarray(solution.y[:, -1], dtype=float) if solution.success else np.full_like(x0, np.nan)


def speed_of(field: Field, t0: float, x0: Floats) -> float:
    """Return the rate at which a vector field changes a state: the largest of the norm of its Jacobian, its size
    relative to that of the state, and 0.05.
    """
    columns = [(field(t0, x0 + 1e-6 * e) - field(t0, x0 - 1e-6 * e)) / 2e-6 for e in np.eye(len(x0))]
    relative = float(np.linalg.norm(field(t0, x0)) / max(np.linalg.norm(x0), 0.1))
    return max(float(np.linalg.norm(np.array(columns), 2)), relative, 0.05)


def expect_order(
    ends: Callable[[int], Floats], exact: Floats, order: int, floor: float, what: str, least: int = 4
) -> None:
    """Raise `DisagreementError` unless the errors of ``ends(steps)``, the state at a fixed time, decrease with the
    stated order.

    The step is halved until the last two errors show the order, or until the error is at most ``floor``.
    """
    errors: list[float] = []
    for halving in range(_HALVINGS.get(order, 4) + 1):
        errors.append(float(np.abs(ends(least * 2**halving) - exact).max()))
        expect(np.isfinite(errors[-1]), f"{what}: not finite with {least * 2**halving} steps")
        if errors[-1] <= floor:
            return
        if len(errors) > 1 and np.log2(errors[-2] / errors[-1]) > order - _SLACK:
            return
    shown = ", ".join(f"{e:.2e}" for e in errors)
    raise DisagreementError(f"{what}: order {order} is stated, errors with halved steps are {shown}")


def derivative(function: Callable[[float], Floats], size: float = 2e-3) -> tuple[Floats, Floats]:
    """Return the derivative of a function at 0 and an estimate of its error, by Richardson's extrapolation."""

    def slope(e: float) -> Floats:
        return np.asarray((function(e) - function(-e)) / (2 * e), dtype=float)

    first, second, third = slope(size), slope(size / 2), slope(size / 4)
    coarse, fine = (4 * second - first) / 3, (4 * third - second) / 3
    return (16 * fine - coarse) / 15, np.abs(fine - coarse)
