"""What solvers are compared with: flows by SciPy's DOP853, derivatives by differences, orders by halved steps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Floats = NDArray[np.float64]
Field = Callable[[float, Floats], Floats]

EPS = float(np.finfo(float).eps)

#: Halvings of the step after which a method of some order must show that order, or an error at round-off.
_HALVINGS = {1: 8, 2: 7, 3: 6, 4: 5}
#: How far below the order the observed one may be on the finest pair of steps.
_SLACK = 0.5


class DisagreementError(AssertionError):
    """Two ways of computing one thing differ."""


def expect(holds: bool, message: str) -> None:
    """Raise `DisagreementError` unless something holds."""
    if not holds:
        raise DisagreementError(message)


def expect_close(value: Floats, reference: Floats, part: float, what: str, scale: float | None = None) -> None:
    """Expect two arrays to agree to ``part`` of ``scale``, by default of the largest number in them."""
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
    """Expect two arrays to be equal bit by bit."""
    value, reference = np.asarray(value, dtype=float), np.asarray(reference, dtype=float)
    expect(value.shape == reference.shape, f"{what}: shapes {value.shape} and {reference.shape}")
    off = float(np.abs(value - reference).max()) if value.size else 0.0
    expect(value.tobytes() == reference.tobytes(), f"{what}: not the same bits, off by {off:.2e}")


def flow(field: Field, t0: float, x0: Floats, span: float) -> Floats:
    """Return the state after a span of time, to about 1e-12."""
    solution = solve_ivp(field, (t0, t0 + span), x0, method="DOP853", rtol=2.5e-14, atol=1e-15)
    return np.asarray(solution.y[:, -1], dtype=float) if solution.success else np.full_like(x0, np.nan)


def speed_of(field: Field, t0: float, x0: Floats) -> float:
    """Return the larger of the norm of the derivative of a field and its relative size at a state."""
    columns = [(field(t0, x0 + 1e-6 * e) - field(t0, x0 - 1e-6 * e)) / 2e-6 for e in np.eye(len(x0))]
    relative = float(np.linalg.norm(field(t0, x0)) / max(np.linalg.norm(x0), 0.1))
    return max(float(np.linalg.norm(np.array(columns), 2)), relative, 0.05)


def expect_order(
    ends: Callable[[int], Floats], exact: Floats, order: int, floor: float, what: str, least: int = 4
) -> None:
    """Expect errors of ``ends(steps)``, states after a fixed time, to fall as a method of some order lets them.

    The step is halved until the last two errors show the order, or the error is at ``floor``.
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
