"""Paths in lanes, in C: the recurrences of all series and of their derivatives."""

from __future__ import annotations

from collections.abc import Sequence

from phigen.scheme.lowering import expand_powers
from phigen.scheme.path import ConvolutionTerm, NodeSeries, PathSlopes, Recurrences, SeriesEntry
from phigen.scheme.program import Program
from phigen.scheme.steps import Path
from phigen.symbolic.expression import Expression
from phigen.symbolic.symbols import FIXED, SERIES, Symbol, coefficient, momentum
from phigen.targets.c.language import FUNCTIONS, printer
from phigen.targets.names import Scope
from phigen.targets.rendering import render
from phigen.targets.reserved import Reserved

#: Longest loop over lanes, in statements.
LONGEST_LOOP = 60


def sizes(slopes: PathSlopes, slope_terms: int) -> list[tuple[str, int, str]]:
    """The constants of paths in lanes."""
    return [
        ("SLOPE_TERMS", slope_terms, "most of the expansion of the derivatives of a path"),
        ("SLOPE_SERIES", max(1, len(slopes.series)), "further series that these need"),
        ("SLOPE_FIXED", max(1, len(slopes.fixed)), "further values that are constant along a path"),
    ]


def printed(program: Program, step: Path, slopes: PathSlopes) -> str:
    """The recurrences of all series in lanes."""
    path, n = step.recurrences, program.dimension
    show = _Show(program, path, slopes)
    every, base = [*path.series, *slopes.series], len(path.series)
    follow, further = (
        _rules(program, show, every, range(n, base)),
        _rules(program, show, every, range(base, len(every))),
    )
    used = step.back.used if step.back else ()
    values = {
        "NAME": program.name,
        "follow": [
            ("follow", "the series that follow from those of the coordinates", *follow),
            ("follow_slopes", "the further series", *further),
        ],
        "vary": _variation(show, slopes.jacobian, 2 * n),
        "source": _source(show, slopes),
        "count": len(used),
        "vary_along": _variation(show, slopes.jacobian, len(used)),
        "source_along": [
            f"to[{e.row * len(used) + e.column}][lane] += share * {show.series(e.series)}[k][lane];"
            for e in slopes.along
        ],
    }
    along = "\n" + render("c", "path_along_lanes.c", values) if used else ""
    return render("c", "path_lanes.c", values) + along


class _Show:
    """Printer of accesses to series, in one lane."""

    def __init__(self, program: Program, path: Recurrences, slopes: PathSlopes) -> None:
        self._base, self.dimension = len(path.series), program.dimension
        scope = Scope(Reserved())
        for i, c in enumerate(program.coordinates):
            scope.bind(momentum(c), f"e->p[{i}][lane]")
        for i in range(program.step.coefficients):
            scope.bind(coefficient(i), f"coef[{i}][lane]")
        for i in range(len(path.series) + len(slopes.series)):
            scope.bind(Symbol(SERIES, i), f"{self.series(i)}[0][lane]")
        for i in range(len(path.fixed) + len(slopes.fixed)):
            further = i - len(path.fixed)
            scope.bind(Symbol(FIXED, i), f"e->fixed[{i}][lane]" if further < 0 else f"e->slope_fixed[{further}][lane]")
        self._printer = printer(scope, FUNCTIONS)

    def series(self, i: int) -> str:
        """Return the array of the series with number i."""
        return f"e->s[{i}]" if i < self._base else f"e->slope[{i - self._base}]"

    def __call__(self, e: Expression) -> str:
        """An expression as C."""
        return self._printer(expand_powers([e])[0])


def _rules(
    program: Program, show: _Show, every: Sequence[NodeSeries], numbers: range
) -> tuple[list[str], int, list[str], list[str]]:
    """Return the code of coefficient k ≥ 1 of the series of these numbers: the first lines of the function, the
    number of sums over orders, loops over lanes that add the contribution of orders j and k − j to these sums, and
    loops for the remaining terms, which may need coefficients of order k."""
    between: list[str] = []
    ends: list[str] = []
    for i in numbers:
        q, parts = every[i], []
        for t in q.terms:
            weight, share, end = _orders(show, t)
            parts.append(f"{share}sum[{len(between)}][lane] + {end}")
            a, b = show.series(t.a), show.series(t.b)
            between.append(f"sum[{len(between)}][lane] += {weight}{a}[j][lane] * {b}[k - j][lane];")
        value = " + ".join(parts) or _linear(show, q) or "0.0"
        if q.divisor is not None:
            value = f"({value}) / {show.series(q.divisor)}[0][lane]"
        ends.append(f"{show.series(i)}[k][lane] = {value};")
    text = "\n".join([*between, *ends])
    head = ["const double share = 1.0 / (double)k;"] if "share" in text else []
    head += [f"(void){name};" for name, use in (("coef", "coef["), ("e", "e->")) if use not in text]
    return head, max(1, len(between)), _loops(program, between), _loops(program, ends)


def _loops(program: Program, statements: Sequence[str]) -> list[str]:
    """Statements for one lane, in loops over all lanes of limited length."""
    lines: list[str] = []
    for start in range(0, len(statements), LONGEST_LOOP):
        lines += [f"{program.name}_EACH_LANE", f"for (int lane = 0; lane < {program.name}_LANES; ++lane) {{"]
        lines += [f"    {line}" for line in statements[start : start + LONGEST_LOOP]]
        lines.append("}")
    return lines


def _orders(show: _Show, t: ConvolutionTerm) -> tuple[str, str, str]:
    """Return the parts of one sum over orders j (see `ConvolutionTerm`).

    They are the weight of a_j b_{k-j}, the factor of the sum, and the terms outside it, with a coefficient of order
    0.
    """
    a, b = show.series(t.a), show.series(t.b)
    last = f"{a}[k][lane] * {b}[0][lane]"
    match t.kind:
        case "product" if t.a == t.b:
            return "", "", f"2.0 * {last}"
        case "product":
            return "", "", f"{a}[0][lane] * {b}[k][lane] + {last}"
        case "chain":
            return "(double)j * ", "share * ", last
    r = f"{t.exponent.numerator}.0 / {t.exponent.denominator}.0"
    return f"(({r} + 1.0) * (double)j - (double)k) * ", "share * ", f"{r} * {last}"


def _linear(show: _Show, q: NodeSeries) -> str:
    text = ""
    for index, factor in q.linear:
        value = f"{show.series(index)}[k][lane]"
        if factor.is_number and abs(factor.value) == 1:
            sign = "-" if factor.value < 0 else "+"
        else:
            sign, value = "+", f"{show(factor)} * {value}"
        text += f" {sign} {value}" if text else value if sign == "+" else f"-{value}"
    return text


def _variation(show: _Show, jacobian: Sequence[SeriesEntry], width: int) -> list[str]:
    """The product of ∂(π p)/∂m and the derivatives so far, rows of this width, to be added."""
    n = show.dimension
    lines = [f"const double a{e.row}_{e.column} = share * {show.series(e.series)}[j][lane];" for e in jacobian]
    for row in range(n):
        columns = [e.column for e in jacobian if e.row == row]
        for k in range(width if columns else 0):
            products = " + ".join(f"a{row}_{c} * from[{c * width + k}][lane]" for c in columns)
            lines.append(f"to[{row * width + k}][lane] += {products};")
    return lines or ["(void)from, (void)to, (void)share;"]


def _source(show: _Show, slopes: PathSlopes) -> list[str]:
    """Return the statements that add order k of ∂(π p)/∂m, and of ½π: the derivative by p is that of ½π(m)p."""
    n = show.dimension
    along_m = [(e.row * 2 * n + e.column, "share", e) for e in slopes.jacobian]
    along_p = [(e.row * 2 * n + n + e.column, "0.5 * share", e) for e in slopes.tensor]
    every = [*along_m, *along_p]
    return [f"to[{i}][lane] += {factor} * {show.series(e.series)}[k][lane];" for i, factor, e in every]
