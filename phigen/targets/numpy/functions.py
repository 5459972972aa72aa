"""Functions of phigen's own in NumPy: polynomials where these suffice, else those of NumPy."""

from __future__ import annotations

from collections.abc import Mapping

from phigen.scheme.program import Program
from phigen.symbolic.entire import ENTIRE
from phigen.targets import special
from phigen.targets.numpy.language import LANGUAGE
from phigen.targets.rendering import render


def called(program: Program) -> list[str]:
    """Functions of `SPECIAL` and of `ENTIRE` that kernels call."""
    phis = [render("numpy", "phi.py", special.values(f, f"_{f}")) for f in special.used(program)]
    return phis + [render("numpy", "entire.py", _entire(f)) for f in special.entire_used(program)]


def _entire(function: str) -> Mapping[str, object]:
    found = ENTIRE[function]
    last, *others = [repr(float(c)) for c in reversed(found.terms())]
    return {
        "function": function,
        "meaning": found.meaning,
        "radius": repr(found.radius),
        "last": last,
        "others": others,
        **special.far(function, LANGUAGE.printer, "np.where(s > 0.0, {0}, {1})"),
    }
