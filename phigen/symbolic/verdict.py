"""Statements with their verdicts (proved, refuted, checked at points), and the decision whether expressions vanish."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from phigen.symbolic.expression import Expression, symbols_of
from phigen.symbolic.numeric import DomainError, evaluate_exactly, evaluate_with_scale, is_rational
from phigen.symbolic.readable import LONGEST, cut, of_polynomial
from phigen.symbolic.symbols import MOMENTUM, kind_of, plain
from phigen.symbolic.tower import Poly, Tower

PROVED = "proved"
REFUTED = "refuted"
CHECKED = "checked numerically"
UNDECIDED = "undecided"

POINTS = 8
DIGITS = 60
#: A value counts as zero if it is below 10**-ZERO_DIGITS times the largest intermediate result. Values are computed
#: with `DIGITS` digits, which are 20 more than ZERO_DIGITS.
ZERO_DIGITS = 40
_ATTEMPTS = 64
#: Largest number of failing parts in a refuted statement. It bounds the memory for systems of high dimension.
MOST_LISTED = 1000


@dataclass(frozen=True)
class Statement:
    """A statement with its verdict.

    ``verdict`` is one of four words or phrases. ``proved``: true in exact arithmetic, for all values of the symbols.
    ``refuted``: ``residual`` should be zero and is not. ``checked numerically``: ``detail`` gives the number of points
    and the tolerance. ``undecided``: phigen found no proof, and no point where all functions are defined.

    A refuted statement may have several parts, such as one for each triple of coordinates in the Jacobi identity.
    ``failing`` lists the parts that do not reduce to 0, as pairs (label, residual).
    """

    name: str
    verdict: str
    detail: str = ""
    residual: str = ""
    failing: tuple[tuple[str, str], ...] = ()

    @property
    def holds(self) -> bool:
        """Whether the statement was proved or passed every numerical check."""
        return self.verdict in (PROVED, CHECKED)

    def __str__(self) -> str:
        parts = [f"{self.name}: {self.verdict}"]
        if self.detail:
            parts.append(f" ({self.detail})")
        if self.residual:
            parts.append(f"; residual {self.residual}")
        return "".join(parts)


def decide_zero(
    name: str, residuals: Iterable[tuple[str, Expression]], positive: Collection[str] = (), detail: str = ""
) -> Statement:
    """Decide whether all residuals vanish identically in their symbols; return the statement ``name`` with its
    verdict.

    ``residuals`` are pairs (label, expression). If the statement is refuted, its text contains the label of a residual
    that does not vanish, such as ``(x1, x2, x3)``. ``positive`` are the symbols that take positive values only.
    ``detail`` is a remark that a proved statement carries.
    """
    nonzero = [(label, e) for label, e in residuals if not e.is_zero]
    try:
        tower = Tower(symbols_of(*(e for _, e in nonzero)), [e for _, e in nonzero])
        elements = tower.convert_all([e for _, e in nonzero])
    except OverflowError:
        return _at_points(name, nonzero, lambda k: str(nonzero[k][1]), positive)
    return decide_elements(
        name, tower, [(label, f) for (label, _), f in zip(nonzero, elements, strict=True)], positive, detail
    )


def decide_equivalent(
    name: str,
    alternatives: Iterable[Iterable[tuple[str, Expression]]],
    positive: Collection[str] = (),
    detail: str = "",
) -> Statement:
    """Decide a statement that has several equivalent forms. It is proved if all residuals of one form vanish.

    Each item of ``alternatives`` has the residuals of one form, and is read only if no earlier form is proved. If none
    is proved, the verdict is that of the first form. The other arguments are those of `decide_zero`.
    """
    statements = []
    for residuals in alternatives:
        statements.append(decide_zero(name, list(residuals), positive, detail))
        if statements[-1].verdict == PROVED:
            return statements[-1]
    return statements[0]


def decide_elements(
    name: str, tower: Tower, residuals: Iterable[tuple[str, Poly]], positive: Collection[str] = (), detail: str = ""
) -> Statement:
    """Decide whether elements of the ring ``tower`` are 0; return the statement ``name`` with its verdict.

    The other arguments are those of `decide_zero`.
    """
    pending = [(label, element) for label, element in residuals if not tower.is_zero(element)]
    if not pending:
        return Statement(name, PROVED, detail)
    return _at_points(
        name,
        [(label, tower.expression(element)) for label, element in pending],
        lambda k: str(of_polynomial(tower, tower.simplified(pending[k][1]))),
        positive,
    )


def _at_points(
    name: str, pending: Sequence[tuple[str, Expression]], describe: Callable[[int], str], positive: Collection[str]
) -> Statement:
    """Return the statement ``name``, decided by the values of its residuals (``pending``) at sample points.

    A nonzero value at one point refutes the statement. If some residual has no value at any point, the statement is
    undecided. Otherwise it is checked numerically. ``describe(k)`` returns residual number k as text.
    """
    fewest = POINTS
    for k, (label, expression) in enumerate(pending):
        point_or_count = _refuting_point(expression, positive)
        if isinstance(point_or_count, str):
            prefix = f"{label}, " if label else ""
            remaining_note = f"; {len(pending)} parts do not reduce to 0" if len(pending) > 1 else ""
            failing = tuple((part, cut(describe(i))) for i, (part, _) in enumerate(pending[:MOST_LISTED]) if part)
            return Statement(name, REFUTED, f"{prefix}{point_or_count}{remaining_note}", cut(describe(k)), failing)
        fewest = min(fewest, point_or_count)
    parts = ", ".join(label for label, _ in pending if label)
    parts_note = f" for {parts}" if parts and len(parts) <= LONGEST else ""
    if fewest == 0:
        return Statement(name, UNDECIDED, f"no proof{parts_note}, and no point of the domain among {_ATTEMPTS} tried")
    return Statement(name, CHECKED, f"{fewest} points, relative tolerance 1e-{ZERO_DIGITS}{parts_note}")


def _refuting_point(expression: Expression, positive: Collection[str]) -> str | int:
    """Return a point where the expression is not zero, with its value, as text: ``at x=11/7: -8.5``.

    If no such point is found, return the number of points where the expression was evaluated.
    """
    names = symbols_of(expression)
    tried_points = 0
    for k in range(_ATTEMPTS):
        point = sample_point(names, positive, k)
        try:
            value = _value(expression, point)
        except DomainError:
            continue
        if value:
            return refutation({plain(n): str(v) for n, v in point.items()}, k, value)
        tried_points += 1
        if tried_points == POINTS or not names:
            break
    return tried_points


def refutation(point: Mapping[str, str], number: int, value: str) -> str:
    """Return a point and the value at this point as text: ``at x=11/7: -8.5``. A long point is replaced by its
    ``number``.

    For an expression without symbols the text is ``everywhere -2``.
    """
    if not point:
        return f"everywhere {value}"
    where = ", ".join(f"{name}={coordinate}" for name, coordinate in point.items())
    return f"at {where if len(where) <= LONGEST else f'point {number}'}: {value}"


def _value(expression: Expression, point: dict[str, Fraction]) -> str:
    """Return the value of an expression at a point as text; "" if the value is zero."""
    if is_rational(expression):
        (exact,) = evaluate_exactly([expression], point)
        return f"{float(exact):.4g}" if exact else ""
    ((value, scale),) = evaluate_with_scale([expression], point, DIGITS)
    return f"{float(value):.4g}" if abs(value) > scale * 10**-ZERO_DIGITS else ""


def sample_point(names: Sequence[str], positive: Collection[str], index: int) -> dict[str, Fraction]:
    """Return point number ``index`` of a fixed sequence of rational points. Coordinates have magnitudes between
    1/5 and 3.

    A coordinate may be negative if the index is odd and the name is not in ``positive``. The sequence depends on the
    names only. Covectors (``p:NAME``) are 32 times smaller, since bi-realisations are defined near p = 0.
    """
    state = 88172645463325252 + 7919 * (index + 1)
    point = {}
    for name in names:
        draws = []
        for _ in range(3):
            state = (6364136223846793005 * state + 1442695040888963407) % 2**64
            draws.append(state >> 33)
        denominator = 5 + draws[0] % 13
        value = Fraction(1 + denominator // 5 + draws[1] % (3 * denominator - denominator // 5), denominator)
        if index % 2 and draws[2] % 2 and name not in positive:
            value = -value
        point[name] = value / 32 if kind_of(name) == MOMENTUM else value
    return point
