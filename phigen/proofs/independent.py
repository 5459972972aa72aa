"""Comparison of two derivations of the S_i, α and β: by the compiler, and by sympy in `phigen.series.reference`."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from types import FrameType
from typing import Any

import mpmath
import sympy

from phigen import progress
from phigen.compilation import CompiledSeries
from phigen.errors import Diagnostic, LimitError
from phigen.geometry.shapes import LogCanonical
from phigen.geometry.sympy_bridge import expanded_function
from phigen.notation.sympy_formulas import Dictionary
from phigen.realisations import exponential, spray
from phigen.scheme.discretisation import hamilton_jacobi
from phigen.series.reference import Source, closed_form, generating_function
from phigen.series.reference_axioms import defects
from phigen.series.reference_functions import Functions, Sign, derivative
from phigen.series.reference_paths import source_of_paths
from phigen.symbolic.expression import Expression, symbol
from phigen.symbolic.verdict import CHECKED, POINTS, PROVED, REFUTED, UNDECIDED, Statement, refutation, sample_point

#: Default time limit, in seconds, for the derivation of one spec by sympy.
SECONDS = 60.0

#: Number of digits with which expressions are evaluated at a point, and number of digits in which they must agree.
DIGITS, AGREEING = 120, 60
_ATTEMPTS = 64
_LONGEST = 160

#: Names of the comparisons of ∇S_h, and of α and β, which follow the comparisons of the S_i.
GRADIENT, MAPS = "∇S_h", "α and β"

#: What is compared: a label, and two sympy expressions that should be equal.
Pair = tuple[str, Any, Any]


@dataclass(frozen=True)
class Agreement:
    """Result of comparing two derivations of the same formulas.

    The formulas are S_``term`` or, if ``term`` is None, either ∇S_h or the two maps α and β. ``sympy`` and ``compiler``
    are the seconds that the two derivations took for S_1 … S_``term``. ``compiler`` is None if the time is not known.
    """

    statement: Statement
    term: int | None
    sympy: float
    compiler: float | None = None

    @property
    def timed(self) -> Statement:
        """The statement. Its ``detail`` also says how many seconds sympy and phigen took."""
        seconds = f"in {self.sympy:.2f} s"
        if self.compiler is not None:
            terms = "" if self.term == 1 else f"S_1 … S_{self.term} "
            seconds = f"{terms}in {self.sympy:.2f} s, by phigen in {self.compiler:.3f} s"
        return replace(self.statement, detail="; ".join(filter(None, [self.statement.detail, seconds])))


class OutOfTimeError(BaseException):
    """The time limit was reached. The class is a `BaseException`, so that no handler for exceptions catches it."""


def compare(compilation: CompiledSeries, terms: int | None = None, seconds: float = SECONDS) -> Iterator[Agreement]:
    """Yield comparisons of phigen's formulas with those that sympy derives: S_1 … S_``terms``, then ∇S_h, α and β.

    By default, all terms of the method are compared. ∇S_h is compared only if it needs no further S_i. If steps follow
    paths, α and β have no closed form, and are compared only through the S_i. Raises `LimitError` after ``seconds``, or
    if a polynomial has too many terms.
    """
    terms = terms or compilation.stage.terms
    derivation: _Derivation | None = None
    for step in _steps(compilation, terms):
        try:
            with progress.stage(f"{step} by sympy") as stage, time_limit(seconds):
                derivation = derivation or _Derivation(compilation, terms)
                comparison = derivation.compared(step)
        except (OutOfTimeError, OverflowError) as error:
            raise _limit(compilation, step, derivation.reached if derivation else 0, str(error)) from None
        seconds -= stage.seconds
        yield comparison


def _steps(compilation: CompiledSeries, terms: int) -> list[str]:
    """Return the names of the comparisons in order, such as ``S_1``."""
    steps = [f"S_{i}" for i in range(1, terms + 1)]
    if compilation.scheme.terms <= terms:
        steps.append(GRADIENT)
    return steps if compilation.realisation.path else [*steps, MAPS]


def _limit(compilation: CompiledSeries, step: str, reached: int, reason: str) -> LimitError:
    reason = reason or "the time limit was reached"
    progress = ["nothing was compared", "S_1 was compared", f"S_1 … S_{reached} were compared"][min(reached, 2)]
    message = f"{compilation.spec.file}: {step} was not derived a second time: {reason}; {progress}"
    hint = "--seconds sets a longer limit, --terms fewer S_i"
    return LimitError([Diagnostic(message, hint=hint)])


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Return a context that raises `OutOfTimeError` after a number of seconds.

    The context has no effect outside the main thread, which alone receives signals. Python drops an exception that is
    raised in a destructor or in the callback of a weak reference, so the exception is raised again every second.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    lasting = True

    def over(number: int, frame: FrameType | None) -> None:
        if lasting:
            raise OutOfTimeError

    previous_handler = signal.signal(signal.SIGALRM, over)
    signal.setitimer(signal.ITIMER_REAL, max(seconds, 1e-6), 1.0)
    try:
        yield
    finally:
        lasting = False
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, previous_handler)


class _Derivation:
    """The derivations of one method by the compiler and by sympy, as far as they have been computed."""

    def __init__(self, compilation: CompiledSeries, terms: int) -> None:
        self._compilation, self._terms = compilation, terms
        self._dictionary = Dictionary(compilation)
        self._positive = compilation.system.positive
        system, chart = compilation.discretised, compilation.realisation
        self._poisson = sympy.Matrix([[self._dictionary.expression(e) for e in row] for row in system.poisson])
        self._alpha, self._beta = self._given(chart.alpha), self._given(chart.beta)
        source = self._path(0) if chart.path or chart.kind == exponential.KIND else self._alpha
        hamiltonian = self._dictionary.expression(system.hamiltonian)
        self._mine = generating_function(hamiltonian, source, self._dictionary.coordinates, self._dictionary.times)
        self._found: list[Any] = []
        self._taken = 0.0

    def _path(self, time: int) -> Source:
        return source_of_paths(self._poisson, self._dictionary.coordinates, self._dictionary.covector, time)

    def _given(self, maps: Sequence[Expression]) -> Source:
        return closed_form(self._maps(maps), self._dictionary.covector)

    def _maps(self, maps: Sequence[Expression]) -> list[Any]:
        """Return the compiler's α or β as sympy expressions. The function φ of exponential bi-realisations is replaced
        by its Taylor polynomial.
        """

        def expanded(order: int, s: Any) -> Any:
            least = min(sum(mu) for mu in closed_form([s], self._dictionary.covector)(self._degree)[0])
            return expanded_function(order, s, self._degree // least)

        return [self._dictionary.expression(e, expanded) for e in maps]

    @property
    def _degree(self) -> int:
        """The degree in p up to which α and β are compared: the degree that S_1 … S_terms need, and at least 2.

        A truncated bi-realisation is compared up to its own degree.
        """
        degree, chart = max(self._terms - 1, 2), self._compilation.realisation
        return degree if chart.exact or chart.degree is None else min(degree, chart.degree)

    @property
    def reached(self) -> int:
        """The number of S_i that have been derived."""
        return len(self._found)

    def compared(self, step: str) -> Agreement:
        """Return the comparison named ``step``: of the next S_i, of ∇S_h, or of α and β.

        phigen's formulas are compared with those of the independent derivation.
        """
        if step == GRADIENT:
            return self._gradient()
        if step == MAPS:
            return self._ends() if self._are_ends() else self._axioms()
        return self._term(self.reached + 1)

    def _term(self, i: int) -> Agreement:
        compilation = self._compilation
        start = time.perf_counter()
        mine = next(self._mine)
        middle = time.perf_counter()
        hamilton_jacobi(compilation.discretised, compilation.realisation, i, compilation.gauge.symbols).polynomial(i)
        end = time.perf_counter()
        self._taken += middle - start
        polynomial = compilation.series.polynomial(i)
        theirs, size = polynomial.tower.expression(polynomial.terms[i - 1]), len(polynomial.terms[i - 1])
        pair = ("", self._dictionary.expression(theirs), mine)
        statement = decide(f"S_{i}", [pair], self._positive, f"{size} term{'s' * (size != 1)}")
        self._found.append(mine)
        return Agreement(statement, i, self._taken, end - middle)

    def _gradient(self) -> Agreement:
        """Compare ∇S_h in the program of phigen with ∇S_h derived by sympy.

        The program computes ∇S_h in one stage of a step. Named coefficients in the program are replaced by their
        expressions.
        """
        scheme, h = self._compilation.scheme, self._dictionary.step
        start = time.perf_counter()
        slope = scheme.generating.coefficients.written_out(scheme.generating.slope)
        pairs: list[Pair] = []
        pushes, monitor = self._pushes(), self._compilation.monitor
        # With forces, S_h is the series of H, and the monitor g multiplies all terms; otherwise S_h contains g.
        factor = self._dictionary.expression(monitor) if monitor and self._compilation.system.forces else 1
        for c, theirs in zip(self._dictionary.coordinates, slope, strict=True):
            terms = (h**i * derivative(s, c) for i, s in enumerate(self._found[: scheme.terms], 1))
            pairs.append((f"along {c}", self._dictionary.expression(theirs), factor * (sum(terms) + pushes[c])))
        statement = decide(GRADIENT, pairs, self._positive, f"as the program has it: {scheme.generating.form}")
        return Agreement(statement, None, time.perf_counter() - start)

    def _pushes(self) -> dict[Any, Any]:
        """Return the terms that forces and noise add to ∇S_h, by coordinate.

        A force with the covector ζ adds hζ. A source of noise with the Hamiltonian g adds ΔW σ∇g.
        """
        system, dictionary = self._compilation.system, self._dictionary
        pushes = dict.fromkeys(dictionary.coordinates, sympy.Integer(0))
        for c, zeta in zip(dictionary.coordinates, system.forces.covector if system.forces else (), strict=False):
            pushes[c] += dictionary.step * dictionary.expression(zeta)
        for source, name in zip(system.noise, system.increments, strict=True):
            g, dw = dictionary.expression(source.hamiltonian), dictionary.expression(symbol(name) * source.amplitude)
            pushes = {c: push + dw * derivative(g, c) for c, push in pushes.items()}
        return pushes

    def _are_ends(self) -> bool:
        chart, choice = self._compilation.realisation, self._compilation.spec.birealisation
        natural = choice.spray == "auto" and isinstance(self._compilation.system.shape, LogCanonical)
        flat = chart.kind == spray.KIND and not chart.exact and choice.spray in ("flat", "auto") and not natural
        return chart.kind == exponential.KIND or flat

    def _at_origin(self) -> list[Pair]:
        """Return the pairs to compare for α(x, 0) = x and β(x, 0) = x.

        These equations are compared separately, since otherwise only Taylor coefficients of positive degree in p are
        compared.
        """
        chart, origin = self._compilation.realisation, dict.fromkeys(self._dictionary.covector, 0)
        return [
            (f"{name}_{x} at p = 0", e.subs(origin), x)
            for name, maps in (("α", self._maps(chart.alpha)), ("β", self._maps(chart.beta)))
            for x, e in zip(self._dictionary.coordinates, maps, strict=True)
        ]

    def _ends(self) -> Agreement:
        coordinates, d = self._compilation.system.coordinates, self._degree
        start = time.perf_counter()
        pairs = self._at_origin()
        for name, compiled_map, end in (("α", self._alpha, 0), ("β", self._beta, 1)):
            for c, theirs, mine in zip(coordinates, compiled_map(d), self._path(end)(d), strict=True):
                all_keys = dict.fromkeys([*theirs, *mine])
                pairs += [(f"{name}_{c}", theirs.get(mu, sympy.S.Zero), mine.get(mu, sympy.S.Zero)) for mu in all_keys]
        name = f"α and β up to degree {d} in p"
        statement = decide(name, pairs, self._positive, "from the path ṁ = π(m)p about its mean")
        return Agreement(statement, None, time.perf_counter() - start)

    def _axioms(self) -> Agreement:
        d, x, p = self._degree, self._dictionary.coordinates, self._dictionary.covector
        start = time.perf_counter()
        residuals = defects(self._poisson, self._alpha(d), self._beta(d), x, p, d)
        labelled_residuals = [*self._at_origin(), *((label, r, sympy.S.Zero) for label, r in residuals)]
        statement = decide(f"axioms of α and β up to degree {d - 1} in p", labelled_residuals, self._positive, "")
        return Agreement(statement, None, time.perf_counter() - start)


def decide(name: str, pairs: Iterable[Pair], positive: Collection[str], detail: str) -> Statement:
    """Return the statement that the two expressions of each pair are equal, as functions of their symbols.

    Equality is proved if the difference is 0 in the ring `Functions`. Otherwise the expressions are evaluated at points
    with `DIGITS` digits. Equality is refuted if the values differ at a point, and checked if they agree.
    """
    fewest, open_pairs = POINTS, 0
    for label, theirs, mine in pairs:
        functions = Functions([theirs, mine])
        difference = functions.element(theirs) - functions.element(mine)
        if difference == 0 or functions.vanishes(difference):
            continue
        open_pairs += 1
        point_or_count = _differing_point([theirs, mine], positive)
        if isinstance(point_or_count, str):
            prefix = f"{label}, " if label else ""
            return Statement(
                name, REFUTED, f"{prefix}{point_or_count}", _cut(sympy.sstr(functions.expression(difference)))
            )
        fewest = min(fewest, point_or_count)
    if not open_pairs:
        return Statement(name, PROVED, detail)
    if not fewest:
        return Statement(name, UNDECIDED, f"no proof, and no point of the domain among {_ATTEMPTS} tried")
    return Statement(name, CHECKED, f"{fewest} points, {AGREEING} digits")


def _differing_point(pair: Sequence[Any], positive: Collection[str]) -> str | int:
    """Return a text with a point where the two expressions of a pair differ, and their values at this point.

    If no point is found, return the number of points at which the expressions agree.
    """
    symbols = sorted(set().union(*(e.free_symbols for e in pair)), key=str)
    values = sympy.lambdify(symbols, list(pair), modules=[{Sign.__name__: mpmath.sign}, "mpmath"], cse=True)
    agreeing = 0
    for k in range(_ATTEMPTS):
        point = sample_point([str(s) for s in symbols], positive, k)
        with mpmath.workdps(DIGITS):
            coordinates_at_point = [mpmath.mpf(v.numerator) / v.denominator for v in point.values()]
            try:
                theirs, mine = (mpmath.mpf(v) for v in values(*coordinates_at_point))
            except (ArithmeticError, TypeError, ValueError):  # a pole, a complex value, or a point outside the domain
                continue
            if not (mpmath.isfinite(theirs) and mpmath.isfinite(mine)):
                continue
            if abs(theirs - mine) > mpmath.mpf(10) ** -AGREEING * (1 + abs(mine)):
                difference = f"{mpmath.nstr(theirs, 12)}, not {mpmath.nstr(mine, 12)}"
                return refutation({n: str(v) for n, v in point.items()}, k, difference)
        agreeing += 1
        if agreeing == POINTS or not symbols:
            break
    return agreeing


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"
