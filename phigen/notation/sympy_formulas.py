"""Formulas of the scheme ``series``, as expressions of sympy: H minus multiples of Casimirs, the maps α and β, and the
terms S_1 … S_k.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import prod
from typing import Any

from phigen.compilation import Compilation, CompiledSeries
from phigen.errors import Diagnostic, LimitError, SpecError
from phigen.geometry.sympy_bridge import SympySystem, closed_function, free_symbols, symbols_in_sympy, to_sympy
from phigen.realisations import karasev
from phigen.scheme.discretisation import formal_alpha
from phigen.series.reference import Coefficients, closed_form
from phigen.symbolic.expression import Expression
from phigen.symbolic.symbols import STEP, momentum


@dataclass(frozen=True)
class SympyFormulas:
    """Formulas of a method in sympy.

    ``hamiltonian`` is the Hamiltonian in the equation of the series: H minus λ C for each Casimir C of the gauge;
    ``gauge`` has the symbols of the multipliers λ. ``alpha`` and ``beta`` have an expression for each coordinate, in
    the coordinates of ``system`` and the components of ``covector``. If these expressions are truncated series,
    ``degree`` is the degree in the covector, else None. ``series`` has S_1 … S_k, where S_h = Σ h^i S_i.
    """

    system: SympySystem
    hamiltonian: Any
    gauge: Mapping[str, Any]
    covector: tuple[Any, ...]
    alpha: tuple[Any, ...]
    beta: tuple[Any, ...]
    degree: int | None
    series: tuple[Any, ...]


class Dictionary:
    """Translator of the expressions of one compilation to sympy. It has sympy symbols for coordinates, momenta, λ and
    h.
    """

    def __init__(self, compilation: Compilation) -> None:
        system, gauge = compilation.system, compilation.gauge
        system_symbols = symbols_in_sympy(system)
        self.coordinates = tuple(system_symbols[c] for c in system.coordinates)
        self.times = tuple(system_symbols[t] for t in system.times)
        self.covector = tuple(free_symbols([f"p_{c}" for c in system.coordinates], system_symbols))
        level = ["e"] * (gauge.monitor is not None)
        names = ["h", *(f"lambda_{c}" for c in gauge.free), *level]
        self.step, *covector_symbols = free_symbols(names, [*system_symbols, *self.covector])
        self.gauge = dict(zip((*gauge.free, *level), covector_symbols, strict=True))
        momenta = dict(zip(map(momentum, system.coordinates), self.covector, strict=True))
        self._symbols = {
            **system_symbols,
            **momenta,
            **dict(zip(gauge.symbols, covector_symbols, strict=True)),
            STEP: self.step,
        }

    def expression(self, e: Expression, special: Callable[[int, Any], Any] = closed_function) -> Any:
        """Return an expression in sympy.

        ``special(k, s)`` returns the k-th derivative of the function φ of the exponential bi-realisation at s.
        """
        return to_sympy(e, self._symbols, special)


def sympy_formulas(compilation: Compilation, terms: int | None = None) -> SympyFormulas:
    """Return the formulas of a method by series; ``terms`` is the number of S_i, by default that of the method.

    Raises `SpecError` for another method, such as a splitting, and `LimitError` if the S_i have too many terms.
    """
    if not compilation.has_series:
        raise SpecError(
            [Diagnostic(f"{compilation.label} has no bi-realisation and no S_i", hint="ask for scheme series")]
        )
    series_step = compilation.by_series()
    dictionary, chart = Dictionary(compilation), series_step.realisation
    terms = terms or compilation.stage.terms
    try:
        series = series_step.series.polynomial(terms)
    except OverflowError as error:
        raise LimitError([Diagnostic(f"S_1 … S_{terms} are too large to be written out: {error}")]) from None
    degree = max(terms - 1, karasev.DEGREE) if chart.path else chart.degree
    if chart.path and degree:
        alpha, beta = _ends_of_paths(series_step, dictionary, degree)
    else:
        alpha, beta = (tuple(dictionary.expression(e) for e in maps) for maps in (chart.alpha, chart.beta))
    return SympyFormulas(
        compilation.system.to_sympy(),
        dictionary.expression(compilation.discretised.hamiltonian),
        dictionary.gauge,
        dictionary.covector,
        alpha,
        beta,
        degree,
        tuple(dictionary.expression(series.tower.expression(s)) for s in series.terms),
    )


def _ends_of_paths(
    compilation: CompiledSeries, dictionary: Dictionary, degree: int
) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """Return the Taylor series in p, up to ``degree``, of α and of β(x, p) = α(x, −p).

    The bi-realisation is one that integrates paths numerically, so that α has no closed form.
    """
    formal = formal_alpha(compilation.discretised, compilation.realisation, degree + 1)
    parts = closed_form([dictionary.expression(e) for e in formal], dictionary.covector)(degree)

    def summed(x: Any, part: Coefficients, sign: int) -> Any:
        monomials = {mu: prod(p**e for p, e in zip(dictionary.covector, mu, strict=True)) for mu in part}
        return x + sum(sign ** sum(mu) * a * monomials[mu] for mu, a in part.items())

    alpha, beta = (
        tuple(summed(x, part, sign) for x, part in zip(dictionary.coordinates, parts, strict=True)) for sign in (1, -1)
    )
    return alpha, beta
