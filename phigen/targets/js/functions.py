"""Definitions of elementary functions that JavaScript lacks: polynomials for small arguments, and formulas for all
others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, cast

from phigen.symbolic.entire import ENTIRE
from phigen.symbolic.special import near_coefficients, order_of, rest_coefficients
from phigen.targets import special
from phigen.targets.names import Scope
from phigen.targets.printer import Printer
from phigen.targets.rendering import render


def definitions(
    phis: Sequence[str], entire: Sequence[str], printer: Callable[[Scope], Printer], *, anomaly: bool = False
) -> list[str]:
    """Return the definitions of functions of `SPECIAL` (``phis``) and `ENTIRE` (``entire``).

    With ``anomaly``, the universal anomaly of Kepler motions is defined as well.
    """
    texts = [render("js", "phi.mjs", _phi(f)) for f in phis] + [
        render("js", "entire.mjs", _entire(f, printer)) for f in entire
    ]
    texts += [_anomaly()] if anomaly else []
    polynomial = [render("js", "polynomial.mjs", {})] if texts else []
    return [text.strip("\n") for text in (*polynomial, *texts)]


def elliptic_definitions(names: Sequence[str]) -> list[str]:
    """Return the definitions of elliptic functions."""
    texts = special.elliptic_texts(names, lambda t, values: render("js", f"{t}.mjs", values), _camel)
    return [text.strip("\n") for text in texts]


def _camel(name: str) -> str:
    """Return a name in camel case."""
    first, *others = name.split("_")
    return first + "".join(part.capitalize() for part in others)


def _anomaly() -> str:
    c2, c3 = (_number_lines([float(c) for c in series]) for series in special.stumpff())
    return render("js", "anomaly.mjs", {"c2": c2, "c3": c3, **special.anomaly_values()})


def _number_lines(numbers: Sequence[float]) -> list[str]:
    """Return numbers as lines of text with four numbers each; a comma follows each number."""
    return [" ".join(f"{c!r}," for c in numbers[k : k + 4]) for k in range(0, len(numbers), 4)]


def _phi(function: str) -> dict[str, Any]:
    order = order_of(function)
    values = cast(dict[str, Any], special.values(function, function))
    return {
        **values,
        "near_coefficients": _number_lines(near_coefficients(order)),
        "rest_coefficients": _number_lines(rest_coefficients(order)),
        "closed": [line.replace("phi", "value") for line in values["closed"]],
        "result": f"value{order}",
    }


def _entire(function: str, printer: Callable[[Scope], Printer]) -> dict[str, Any]:
    entire = ENTIRE[function]
    return {
        "function": function,
        "meaning": entire.meaning,
        "radius": repr(entire.radius),
        "coefficients": _number_lines([float(c) for c in entire.terms()]),
        **special.full_range(function, printer, "s > 0 ? {0} : {1}"),
    }
