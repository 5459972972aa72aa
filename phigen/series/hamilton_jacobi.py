"""The Hamilton–Jacobi series S_t = Σ t^i S_i, without factorials.

S_t solves ∂_t S_t(x) = H(α(x, ∇S_t(x))), S_0 = 0, hence S_1 = H and

    (i+1) S_{i+1}(x) = coefficient of t^i in H(α(x, ∇(S_1 t + … + S_i t^i))).

The S_i of the paper (docs/mathematics.md cites it) have an additional factor i!. In a symmetric bi-realisation,
β(x, p) = α(x, −p) and every S_i of even index is 0. The recursion does not compute these S_i. The result can be proved
by `residual`.

If H depends on a time τ, then τ and its conjugate variable e, with {τ, e} = 1, are added to the coordinates. The
bi-realisation of τ and e is the midpoint rule, and H(τ, x) is replaced by H(τ, x) + e. The generating function is then
t e + S_t(τ, x), where S_t does not contain e and τ is the time in the middle of the step:

    ∂_t S_t = H(τ − t/2, α(x, ∇S_t)) + ½ ∂_τ S_t,    S_0 = 0.

So the time is one more variable of the series, and

    (i+1) S_{i+1} = coefficient of t^i in H(τ − t/2, α(x, ∇(S_1 t + … + S_i t^i))) + ½ ∂_τ S_i t^i.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Sized
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import log
from typing import Any

from phigen import progress
from phigen.spec import limits
from phigen.symbolic.expression import ZERO, Expression, gradient, substitute
from phigen.symbolic.symbols import momentum
from phigen.symbolic.taylor import ExpressionRing, Taylor, closure
from phigen.symbolic.tower import Poly, Tower

#: Largest number of monomials of a gradient ∇S_i. In measurements, generated code for the gradient and the Hessian had
#: 4.3 to 10 operations for each monomial of the gradient.
MOST_SLOPES = limits.OPERATIONS // 4

#: As soon as S_7 is computed, the sizes of the following terms are predicted. The sizes grow like a power of the index;
#: the last two sizes give the exponent.
FORESEEN = 7


@dataclass(frozen=True)
class PolynomialSeries:
    """S_1 … S_k as elements of a tower, a ring of polynomials in coordinates, parameters and values of functions.

    ``terms[i]`` is S_{i+1}.
    """

    tower: Tower
    terms: tuple[Poly, ...]


def composed(hamiltonian: Expression, coordinates: Sequence[str], alpha: Sequence[Expression]) -> Expression:
    """Return H(α(x, p)) as an expression in the coordinates and the momenta."""
    return substitute([hamiltonian], dict(zip(coordinates, alpha, strict=True)))[0]


def series_tower(
    target: Expression, coordinates: Sequence[str], parameters: Sequence[str], times: Sequence[str] = ()
) -> Tower:
    """Return the smallest tower (ring) that contains all S_i, for ``target`` = H(α(x, p)).

    Its generators are the functions in H(α(x, p)) at p = 0. If H depends on the time, ``times`` has the symbol of the
    time, which is also one of the ``parameters``.
    """
    at_zero = substitute(closure([target]), {momentum(c): ZERO for c in coordinates})
    return Tower([*coordinates, *parameters], at_zero, [*coordinates, *times])


def polynomial_series(
    hamiltonian: Expression,
    alpha: Sequence[Expression],
    coordinates: Sequence[str],
    parameters: Sequence[str],
    terms: int,
    *,
    symmetric: bool,
    times: Sequence[str] = (),
) -> PolynomialSeries:
    """Return S_1 … S_terms as polynomials, in exact rational arithmetic with symbolic parameters.

    If H depends on the time, ``times`` has the symbol of the time. Raises `OverflowError` if a term has more than
    `limits.SERIES_TERMS` monomials.
    """
    recursion = _polynomial_recursion(hamiltonian, alpha, coordinates, parameters, symmetric, times)
    return PolynomialSeries(recursion.ring, recursion.first(terms))


def graph_series(
    hamiltonian: Expression,
    alpha: Sequence[Expression],
    coordinates: Sequence[str],
    terms: int,
    *,
    symmetric: bool,
) -> tuple[Expression, ...]:
    """Return S_1 … S_terms as expressions, which share subexpressions; products are not multiplied out."""
    return _graph_recursion(hamiltonian, alpha, coordinates, symmetric).first(terms)


class HamiltonJacobi:
    """S_1, S_2, … of one Hamiltonian in one bi-realisation. Each term is computed when it is first requested.

    ``alpha(n)`` returns the map α(x, p), exactly or up to the degree in p that S_1 … S_n need. It is first called with
    n = ``max_terms``. ``static`` are the parameters and other constants in H and α; ``times`` has the symbol of the
    time, if H depends on it.
    """

    def __init__(
        self,
        hamiltonian: Expression,
        alpha: Callable[[int], Sequence[Expression]],
        coordinates: Sequence[str],
        static: Sequence[str],
        max_terms: int,
        *,
        symmetric: bool,
        times: Sequence[str] = (),
    ) -> None:
        self.hamiltonian, self.coordinates, self.symmetric = hamiltonian, tuple(coordinates), symmetric
        self.static, self.times = tuple(static), tuple(times)
        self._source, self._most = alpha, max_terms

    @cached_property
    def alpha(self) -> tuple[Expression, ...]:
        """Components of the map α(x, p) from which the terms are computed."""
        return tuple(self._source(self._most))

    def polynomial(self, terms: int) -> PolynomialSeries:
        """Return S_1 … S_terms as polynomials. Raises the errors of `polynomial_series`."""
        self.reach(terms)
        return PolynomialSeries(self._polynomials.ring, self._polynomials.first(terms))

    def written(self, terms: int) -> PolynomialSeries:
        """Return S_1, S_2, … as polynomials, up to S_terms or to the last one before a term that is too large."""
        with suppress(OverflowError):
            return self.polynomial(terms)
        with suppress(OverflowError):
            return PolynomialSeries(self._polynomials.ring, self._polynomials.good)
        return PolynomialSeries(series_tower(ZERO, self.coordinates, self.static, self.times), ())

    def graph(self, terms: int) -> tuple[Expression, ...]:
        """Return S_1 … S_terms as expressions, which share subexpressions; products are not multiplied out."""
        self.reach(terms)
        return self._graphs.first(terms)

    def reach(self, terms: int) -> None:
        """Prepare for the computation of S_1 … S_terms: if α is a series in p of too low a degree, extend it.

        Terms that were computed from the shorter series are then dropped, and must be computed again. To avoid this,
        call `reach` with the largest number of terms before any term is computed.
        """
        if terms <= self._most:
            return
        self._most = terms
        if tuple(self._source(terms)) != self.alpha:
            for cached_name in ("alpha", "_polynomials", "_graphs"):
                self.__dict__.pop(cached_name, None)

    @cached_property
    def _polynomials(self) -> _Recursion:
        static = [*self.static, *self.times]
        return _polynomial_recursion(self.hamiltonian, self.alpha, self.coordinates, static, self.symmetric, self.times)

    @cached_property
    def _graphs(self) -> _Recursion:
        return _graph_recursion(self.hamiltonian, self.alpha, self.coordinates, self.symmetric, self.times)


def _polynomial_recursion(
    hamiltonian: Expression,
    alpha: Sequence[Expression],
    coordinates: Sequence[str],
    parameters: Sequence[str],
    symmetric: bool,
    times: Sequence[str],
) -> _Recursion:
    target = composed(hamiltonian, coordinates, alpha)
    tower = series_tower(target, coordinates, parameters, times)
    return _Recursion(target, tower, coordinates, times, symmetric, tower.gradient)


def _graph_recursion(
    hamiltonian: Expression,
    alpha: Sequence[Expression],
    coordinates: Sequence[str],
    symmetric: bool,
    times: Sequence[str] = (),
) -> _Recursion:
    target = composed(hamiltonian, coordinates, alpha)
    return _Recursion(target, ExpressionRing(), coordinates, times, symmetric, gradient)


class _Recursion:
    """The recursion that computes S_1, S_2, … as elements of ``ring``; ``target`` is H(α(x, p)).

    ``slope(S, names)`` returns the derivatives of S with respect to the symbols ``names``.
    """

    def __init__(
        self,
        target: Expression,
        ring: Any,
        coordinates: Sequence[str],
        times: Sequence[str],
        symmetric: bool,
        slope: Callable[[Any, Sequence[str]], list[Any]],
    ) -> None:
        self.ring = ring
        self._target, self._symmetric, self._slope = target, symmetric, slope
        self._coordinates, self._times = coordinates, times
        self._momenta = [momentum(c) for c in coordinates]
        self._taylor = Taylor([target], ring, [*self._momenta, *times])
        self._zero = ring.constant(0)
        self._found: list[Any] = []
        self._overflow: OverflowError | None = None
        self._sizes: dict[int, int] = {}  # number of monomials of ∇S_i, by i

    def first(self, terms: int) -> tuple[Any, ...]:
        """Return S_1 … S_terms.

        Raises `OverflowError` if a term is too large; later calls that need this term raise it again.
        """
        while len(self._found) < terms:
            if self._overflow:
                raise self._overflow
            self._expect_small(terms)
            try:
                with progress.stage(f"S_{len(self._found) + 1}", len(self._taylor.order)) as running:
                    self._found.append(self._next(running))
            except OverflowError as error:
                self._overflow = error
        return tuple(self._found[:terms])

    @property
    def good(self) -> tuple[Any, ...]:
        """Terms S_1, S_2, … that have been computed so far."""
        return tuple(self._found)

    def _expect_small(self, terms: int) -> None:
        """Raise `OverflowError` if ∇S_terms is expected to have more than `MOST_SLOPES` monomials.

        The expected number follows from the sizes of the gradients that have been computed so far.
        """
        *_, previous, latest = [0, 0, *self._sizes]
        if latest < FORESEEN or previous == 0:
            return
        growth = log(self._sizes[latest] / self._sizes[previous]) / log(latest / previous)
        size = self._sizes[latest] * (terms / latest) ** growth
        if size > MOST_SLOPES:
            raise OverflowError(f"a gradient of S_{terms} with about {size:.0f} terms")

    def _next(self, running: progress.Stage) -> Any:
        i, vanishes = len(self._found), self._symmetric and len(self._found) % 2 == 1
        moves = i > 0 and not (self._symmetric and i % 2 == 0)
        slopes = self._slope(self._found[-1], self._coordinates) if moves else [self._zero] * len(self._momenta)
        if moves and self.ring.bytes_per_term:
            self._sizes[i] = max(1, sum(map(len, slopes)))
        inputs = dict(zip(self._momenta, slopes, strict=True)) | beginning(self.ring, self._times, i)
        self._taylor.advance(inputs, running)
        if i and isinstance(self._found[-1], Sized) and len(self._found[-1]) > limits.SERIES_TERMS:
            raise OverflowError(f"{len(self._found[-1])} terms of S_{i}")
        if vanishes:
            return self._zero
        coefficient = self._taylor.coefficients(self._target)[i]
        for rate in self._slope(self._found[-1], self._times) if moves else ():
            coefficient = coefficient + rate * self.ring.constant(Fraction(1, 2))
        return coefficient * self.ring.constant(Fraction(1, i + 1))


def beginning(ring: Any, times: Sequence[str], i: int) -> dict[str, Any]:
    """Return the coefficient of t^i in τ − t/2, as a dictionary with the symbol τ as key.

    A step of size t has its middle at the time τ, and begins at τ − t/2. If ``times`` is empty, H does not depend on
    the time, and the dictionary is empty.
    """
    values = {0: ring.variable, 1: lambda _: ring.constant(Fraction(-1, 2))}
    return {t: values.get(i, lambda _: ring.constant(0))(t) for t in times}


def residual(
    series: PolynomialSeries,
    hamiltonian: Expression,
    alpha: Sequence[Expression],
    coordinates: Sequence[str],
    times: Sequence[str] = (),
) -> list[Poly]:
    """Return the coefficients of t^0 … t^(k−1) in ∂_t S_t − H(α(x, ∇S_t)).

    All coefficients are 0 if S_1 … S_k are correct. If H depends on a time τ, they are the coefficients of
    ∂_t S_t − H(τ − t/2, α(x, ∇S_t)) − ½ ∂_τ S_t.
    """
    target = composed(hamiltonian, coordinates, alpha)
    tower, momenta = series.tower, [momentum(c) for c in coordinates]
    taylor = Taylor([target], tower, [*momenta, *times])
    slopes = [[tower.zero] * len(momenta)]
    slopes += [[tower.derivative(s, c) for c in coordinates] for s in series.terms]
    result = []
    for i, s in enumerate(series.terms):
        taylor.advance(dict(zip(momenta, slopes[i], strict=True)) | beginning(tower, times, i))
        difference = s * tower.constant(i + 1) - taylor.coefficients(target)[i]
        for t in times if i else ():
            difference -= tower.derivative(series.terms[i - 1], t) * tower.constant(Fraction(1, 2))
        result.append(difference)
    return result
