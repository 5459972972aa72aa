"""Check that rounding explains the errors of matrix exponentials in floating-point arithmetic. Ball arithmetic bounds
the errors.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from flint import arb, arb_mat, ctx
from numpy.typing import NDArray

from phigen.splitting.matrices import MAX_PADE_NORM, PADE, MatrixExponential
from phigen.symbolic.numeric import DomainError, evaluate
from phigen.symbolic.verdict import CHECKED, REFUTED, UNDECIDED, Statement

#: Times t at which exp(tA) − 1 is checked, as multiples of 1/‖A‖.
TIMES = (1e-3, 1.0, 30.0)

#: Largest accepted error of exp(tA) − 1, divided by three factors: the norm of exp(tA) − 1, the machine precision, and
#: the sum of ‖tA‖ and the number of rows.
UNITS = 8.0

#: Precision of the ball arithmetic in bits.
BITS = 200


def enclosed(name: str, exponential: MatrixExponential, values: Mapping[str, float]) -> Statement:
    """Return the statement that exp(tA) − 1 is computed exactly up to rounding, for the ``values`` of the parameters in
    A.

    ``name`` is the name of the statement.
    """
    try:
        rates = np.array(evaluate(list(exponential.rates), values)).reshape(exponential.size, -1)
    except (DomainError, KeyError):
        return Statement(name, UNDECIDED, "A has no value with the default parameters")
    norm = float(np.abs(rates).sum(axis=1).max())
    errors = [_error(rates * (t / (norm or 1.0))) / (exponential.size + t) for t in TIMES]
    worst = max(errors) / np.finfo(float).eps
    return Statement(name, CHECKED if worst <= UNITS else REFUTED, f"‖tA‖ up to {TIMES[-1]:g}, by ball arithmetic")


def exponential_less_one(a: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return exp(a) − 1 for a square matrix, computed as in the generated code: Padé approximation, scaling and
    squaring."""
    n, norm = len(a), float(np.abs(a).sum(axis=1).max())
    if not np.isfinite(norm):
        return np.full_like(a, np.nan)
    squarings = 0
    while norm > MAX_PADE_NORM:
        norm, squarings = norm / 2, squarings + 1
    c, a, identity = [float(v) for v in PADE], a * 0.5**squarings, np.eye(n)
    b = a @ a
    even_part = ((c[6] * b + c[4] * identity) @ b + c[2] * identity) @ b + identity
    odd = a @ ((c[5] * b + c[3] * identity) @ b + c[1] * identity)
    f = np.linalg.solve(even_part - odd, 2 * odd)
    for _ in range(squarings):
        f = 2 * f + f @ f
    return np.asarray(f)


def _error(a: NDArray[np.float64]) -> float:
    """Return a bound for the errors of the matrix C that `exponential_less_one` computes for exp(a) − 1.

    The bound is the largest |error of an entry|, divided by the norm of C. Ball arithmetic encloses the exact entries.
    """
    computed, precision = exponential_less_one(a), ctx.prec
    try:
        ctx.prec = BITS
        exact = arb_mat([[arb(float(e)) for e in row] for row in a]).exp()
        n = len(a)
        differences = [abs(exact[i, j] - int(i == j) - arb(float(computed[i, j]))) for i in range(n) for j in range(n)]
        largest = max(float(d.mid() + d.rad()) for d in differences)
    finally:
        ctx.prec = precision
    scale = float(np.abs(computed).sum(axis=1).max())
    return largest / scale if scale else largest
