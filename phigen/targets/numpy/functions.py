"""Definitions of elementary functions that NumPy lacks: polynomials for small arguments, and formulas for all
others.
"""

from __future__ import annotations

from collections.abc import Mapping

from phigen.scheme.program import Program
from phigen.symbolic.entire import ENTIRE
from phigen.targets import special
from phigen.targets.numpy.language import LANGUAGE
from phigen.targets.rendering import render


def called(program: Program) -> list[str]:
    """Return the definitions of those functions of `SPECIAL` and `ENTIRE` that the kernels of a program call."""
    phis = [render("numpy", "phi.py", special.values(f, f"_{f}")) for f in special.used(program)]
    entire = [render("numpy", "entire.py", _entire(f)) for f in special.entire_used(program)]
    anomaly = [_anomaly()] if special.calls_anomaly(program) else []
    elliptic = special.elliptic_texts(
        special.elliptic_used(program), lambda template, values: render("numpy", f"{template}.py", values)
    )
    remainders = special.remainders_used(program)
    elliptic += [render("numpy", "remainders.py", special.remainder_values(remainders))] if remainders else []
    return [*phis, *entire, *anomaly, *elliptic, *_exponentials(program)]


def _exponentials(program: Program) -> list[str]:
    """Return the definition of the matrix exponential; [] if the kernel ``prepare`` does not call it."""
    if not special.largest_exponential(program):
        return []
    values = {"adjoint": special.transposes_exponentials(program), **special.exponential_constants()}
    return [render("numpy", "matrix_exponential.py", values)]


def _anomaly() -> str:
    """Return the definition of the function that computes the universal anomaly of Kepler motions."""
    c2, c3 = ([repr(float(c)) for c in reversed(series)] for series in special.stumpff())
    others = list(zip(c2[1:], c3[1:], strict=True))
    values = {"c2_last": c2[0], "c3_last": c3[0], "others": others, **special.anomaly_values()}
    return render("numpy", "anomaly.py", values)


def _entire(function: str) -> Mapping[str, object]:
    entire = ENTIRE[function]
    last, *others = [repr(float(c)) for c in reversed(entire.terms())]
    return {
        "function": function,
        "meaning": entire.meaning,
        "radius": repr(entire.radius),
        "last": last,
        "others": others,
        **special.full_range(function, LANGUAGE.printer, "np.where(s > 0.0, {0}, {1})"),
    }
