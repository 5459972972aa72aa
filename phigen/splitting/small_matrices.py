"""The increments exp(tA)w − w of the solution of linear equations with at most four rows, by the theorem of Cayley and
Hamilton.

The formulas are used if no shorter closed form is known. The entries of A may depend on coordinates that are constant
along the flow. If A⁴ = Σ_{j<4} a_j A^j, the increments are Σ F_k A^k w. The F_k are functions of t and the a_j, see
`phigen.symbolic.remainders`. A matrix with three rows is extended by zeros. For two rows, let τ be the trace of A and B
= A − τ/2. Then B² is a number −d, and exp(tA) = e^{τt/2}(cos(t√d) + B sin(t√d)/√d).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

from phigen.splitting.closure import LinearMotion
from phigen.splitting.exponential import Solution
from phigen.splitting.ring import TIME, Ring
from phigen.symbolic.expression import call, symbol, total
from phigen.symbolic.remainders import REMAINDERS
from phigen.symbolic.tower import Poly

#: Largest number of rows of a matrix A to which the formulas of this module apply.
MOST_ROWS = 4

#: Description of the motion, for reports.
BY_CAYLEY_HAMILTON = "moved by exp(tA), by the theorem of Cayley and Hamilton"

Matrix = Sequence[Sequence[Poly]]


def solve(ring: Ring, motion: LinearMotion) -> Solution | None:
    """Return the increments exp(tA)w − w of the solution of ẇ = Aw; None if A has more than `MOST_ROWS` rows."""
    rows = len(motion.basis)
    if rows > MOST_ROWS:
        return None
    if rows == 2:
        return _of_two_rows(ring, motion)
    coefficients = [ring.tower.zero] * (MOST_ROWS - rows) + list(_relation(ring, motion.matrix))
    arguments = [symbol(TIME), *map(ring.expression, coefficients)]
    functions = [call(name, *arguments) for name in REMAINDERS]
    image = [ring.monomial(m) for m in motion.basis]
    images = [image]
    while len(images) < MOST_ROWS:
        image = [ring.tower.combine(e * v for e, v in zip(row, image, strict=True)) for row in motion.matrix]
        images.append(image)
    first = int(coefficients[0] == 0)  # with a_0 = 0 the term of F_0 vanishes
    increments = [
        total(f * ring.expression(w[i]) for f, w in zip(functions[first:], images[first:], strict=True))
        for i in range(len(motion.coordinates))
    ]
    return Solution(tuple(increments), BY_CAYLEY_HAMILTON)


def _of_two_rows(ring: Ring, motion: LinearMotion) -> Solution:
    """Return the increments exp(tA)w − w of the solution of ẇ = Aw for a matrix A with two rows.

    The formula for exp(tA) is the last one at the head of the file. Let s = d·t² with the d of this formula. 1 − cos √s
    is computed as s sinroot(s/4)²/2, where sinroot(s) = sin(√s)/√s.
    """
    (a, b), (c, d) = motion.matrix
    half_trace = ring.tower.constant(Fraction(1, 2)) * (a + d)
    w = [ring.monomial(m) for m in motion.basis]
    rotated = [ring.expression((a - half_trace) * w[0] + b * w[1]), ring.expression(c * w[0] + (d - half_trace) * w[1])]
    t = symbol(TIME)
    s = t**2 * ring.expression(a * d - b * c - half_trace * half_trace)
    growth, sine_factor = call("expm1", t * ring.expression(half_trace)), call("sinroot", s / 4)
    sine, loss = t * sine_factor * call("cosroot", s / 4), s * sine_factor**2 / 2
    increments = [
        growth * e + (growth + 1) * (sine * v - loss * e) for e, v in zip(map(ring.expression, w), rotated, strict=True)
    ]
    return Solution(tuple(increments[: len(motion.coordinates)]), BY_CAYLEY_HAMILTON)


def _relation(ring: Ring, a: Matrix) -> Iterator[Poly]:
    """Yield the coefficients c_0 … c_{n−1} in the relation Aⁿ = Σ c_j A^j of an n×n matrix A, by the method of Faddeev
    and Leverrier.
    """
    n = range(len(a))
    zero, traces = ring.tower.zero, list[Poly]()
    power = [[zero] * len(a) for _ in n]
    for k in n:
        # Faddeev and Leverrier: M ← A(M − c_{n−k}) with the coefficient found last; then c_{n−k−1} = tr M/(k + 1).
        last = -ring.tower.constant(1) if k == 0 else traces[-1]
        power = [[power[i][j] - last if i == j else power[i][j] for j in n] for i in n]
        power = [[ring.tower.combine(a[i][m] * power[m][j] for m in n) for j in n] for i in n]
        traces.append(ring.tower.combine(power[i][i] for i in n) * ring.tower.constant(Fraction(1, k + 1)))
    yield from reversed(traces)
