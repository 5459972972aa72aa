"""Gauss collocation in JAX. A system supplies the bracket, and H is any function written in JAX.

The stage equations of a step are solved by fixed-point iteration; one iteration is called a sweep. The unknowns, the
sweeps and the predictor are those of `phigen.gauss`. For derivatives JAX solves the linearised stage equations (for
tangents) or their transpose (for cotangents), by further sweeps. The sweeps of the step itself are not differentiated.
Derivatives are those of the exact solution of the stage equations, to round-off.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import jax
import numpy as np
from jax import numpy as jnp

from phigen.gauss.stage_map import StageMap, at_unknowns, vector_field
from phigen.gauss.tableau import DOUBLE, SINGLE, Tableau, tableau
from phigen.scheme.gauss_kernels import frame_kernel
from phigen.scheme.policies import GaussAdjointPolicy, GaussPolicy
from phigen.scheme.staging import Coefficients
from phigen.symbolic.arrays import Arrays
from phigen.symbolic.expression import Expression, symbol
from phigen.symbolic.symbols import Symbol

#: Kind of the symbols that stand for the components of ∇H.
GRADIENT = "gradient"

#: Largest number of sweeps (fixed-point iterations) for a step or for a linear equation, the same as in generated code.
MAX_SWEEPS = 100

#: Thresholds, in double precision, at which an iteration ends. POLICY: the sweeps of a step. LINEAR_POLICY: the sweeps
#: that solve a linear equation.
POLICY, LINEAR_POLICY = GaussPolicy(), GaussAdjointPolicy()

#: Data of a run between two steps: the state x, the compensation term of x, and a prediction of the increments of the
#: next step. The prediction is computed from the increments of the last step.
Carry = tuple[Any, Any, Any]


class _Traced(Arrays):
    """Evaluator of symbolic expressions with arrays of JAX as the values of their symbols."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        super().__init__(values, jnp)

    def power(self, base: Any, exponent: Fraction) -> Any:
        """Return the power of an array with a rational exponent, computed by products and roots if possible."""
        if exponent.denominator == 1:
            return base ** int(exponent)
        return jnp.sqrt(base) ** exponent.numerator if exponent.denominator == 2 else super().power(base, exponent)


def rounding_of(dtype: Any) -> float:
    """Return the machine epsilon of a floating-point type, divided by that of double precision."""
    return float(jnp.finfo(dtype).eps) / float(np.finfo(np.float64).eps)


def tableau_of(dtype: Any, stages: int) -> Tableau:
    """Return the coefficients of the Gauss method: in double precision for double ``dtype``, else in single
    precision.
    """
    return tableau(stages, DOUBLE if rounding_of(dtype) == 1 else SINGLE)


@dataclass(frozen=True, eq=False)
class Collocation:
    """Step of size ``h`` by the Gauss method with ``stages`` stages.

    ``points`` are the stage equations of a system. In these equations ∇H of the system is replaced by ``slope``, a
    function of x and further arguments.
    """

    points: StageMap
    slope: Callable[..., Any]
    h: float
    stages: int

    @cached_property
    def _places(self) -> list[Expression]:
        positions = at_unknowns(self.points)
        return [positions[c] for c in self.points.system.coordinates]

    @cached_property
    def _derivatives(self) -> list[Expression]:
        slopes = [symbol(s) for s in self._slope_symbols]
        return vector_field(self.points, at_unknowns(self.points), slopes=slopes)

    @property
    def _slope_symbols(self) -> tuple[str, ...]:
        return tuple(Symbol(GRADIENT, k) for k in range(self.points.system.dimension))

    @cached_property
    def _traced_value(self) -> tuple[Sequence[str], Sequence[Expression]] | None:
        kernel = frame_kernel(self.points, Coefficients(()))
        return None if kernel is None else (kernel.inputs["k"], kernel.outputs[0].values)

    def _values(self, x: Any, z: Any, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values of the symbols in the stage equations, by name.

        The symbols are the parameters, the coordinates (values ``x`` at the start of the step), and the unknowns
        (values ``z``, each an array over the stages).
        """
        return {
            **parameters,
            **dict(zip(self.points.system.coordinates, x, strict=True)),
            **dict(zip(self.points.unknowns, z, strict=True)),
        }

    def start(self, x: Any) -> Carry:
        """Return the data of a run at its start x, where the compensation term and the increments are 0."""
        return x, jnp.zeros_like(x), jnp.zeros((len(self.points.unknowns), self.stages), x.dtype)

    def moves(self, table: Tableau, x: Any, moves: Any, arguments: Any, parameters: Mapping[str, Any]) -> Any:
        """Return the increments L_j = h b_j f_j of the stages j as an array (unknowns, stages).

        f_j is the time derivative of the unknowns at stage j, and b_j is the weight of the stage. ``moves`` are
        approximate increments of the same shape; the unknowns at the stages are computed from ``moves``.
        """
        z = moves @ jnp.asarray(table.mixing, x.dtype).T
        values = self._values(x, z, parameters)
        stacked = _stacked(_Traced(values).values(self._places), self.stages, x.dtype)
        slopes = jax.vmap(lambda at: self.slope(at, *arguments))(stacked.T).T
        values |= dict(zip(self._slope_symbols, slopes, strict=True))
        weights = self.h * jnp.asarray(table.weights, x.dtype)
        return weights * _stacked(_Traced(values).values(self._derivatives), self.stages, x.dtype)

    def advance(self, carry: Carry, arguments: Any, parameters: Mapping[str, Any]) -> Carry:
        """Return the data of a run after a step; x is NaN if the step failed."""
        x, compensation, difference = carry
        table, unit = tableau_of(x.dtype, self.stages), rounding_of(x.dtype)

        def rest(moves: Any) -> Any:
            return self.moves(table, x, moves, arguments, parameters) - moves

        guess = difference @ jnp.asarray(table.prediction, x.dtype).T @ _inverse_mixing(table, x.dtype)
        moves = jax.lax.custom_root(
            rest,
            jax.lax.stop_gradient(guess),
            lambda equation, start: _solved(equation, start, self._scale(x), unit),
            lambda linear, side: _solved_linear(linear, side, unit),
        )
        end = jnp.sum(moves, axis=1)
        change = _stacked(_Traced(self._values(x, end, parameters)).values(self.points.change), None, x.dtype)
        change = change + jax.lax.stop_gradient(compensation)
        following = x + change
        rounding_error = jax.lax.stop_gradient(change - (following - x))
        return following, rounding_error, jax.lax.stop_gradient(self._from_the_end(x, end, moves, parameters))

    def _scale(self, x: Any) -> Any:
        """Return the sizes of the unknowns (unknowns, 1), to which errors of the unknowns are relative.

        Some unknowns are of the size of the state x: for these unknowns the size is |x|, or 1 if x = 0. For all other
        unknowns, such as logarithms, the size is 1.
        """
        size = jnp.sqrt(jnp.sum(x**2))
        size = jnp.where(size > 0, size, 1)
        ones = jnp.ones(len(self.points.unknowns) - self.points.plain, x.dtype)
        return jnp.concatenate([jnp.broadcast_to(size, (self.points.plain,)), ones])[:, None]

    def _from_the_end(self, x: Any, end: Any, moves: Any, parameters: Mapping[str, Any]) -> Any:
        """Return the increments of the step from ``x``, converted so that they predict the next step.

        ``moves`` are the increments, and ``end`` has the values of the unknowns at the end of the step.
        """
        if self._traced_value is None:
            return moves
        symbols, roots = self._traced_value
        values = self._values(x, end, parameters) | dict(zip(symbols, moves, strict=True))
        return _stacked(_Traced(values).values(roots), self.stages, moves.dtype)


def _stacked(values: Sequence[Any], stages: int | None, dtype: Any) -> Any:
    """Return an array with a row for each of the ``values``, which are arrays over the stages or single numbers."""
    shape = () if stages is None else (stages,)
    return jnp.stack([jnp.broadcast_to(jnp.asarray(v, dtype), shape) for v in values])


def _inverse_mixing(table: Tableau, dtype: Any) -> Any:
    """Return (μ⁻¹)ᵀ, the matrix that converts predicted unknowns to increments.

    The matrix μ converts the increments of a step to the unknowns at the stages.
    """
    return jnp.asarray(np.linalg.inv(np.array(table.mixing)).T, dtype)


def _largest(change: Any, scale: Any) -> Any:
    """Return the norm of a change of the unknowns, relative to ``scale``: the largest of the norms at the stages."""
    return jnp.sqrt(jnp.max(jnp.sum((change / scale) ** 2, axis=0)))


def _solved(equation: Callable[[Any], Any], start: Any, scale: Any, unit: float) -> Any:
    """Return the solution L of F(L) = L, found by the iteration L ← F(L). Return NaN if the iteration does not
    converge.

    ``equation`` is the function F(L) − L. The iteration begins at L = ``start``. If it diverges, it begins again once,
    at L = 0.
    """
    solved_limit, rounding, near_rounding = (unit * v for v in (POLICY.solved, POLICY.rounding, POLICY.nearly_rounding))
    stages, infinity = start.shape[1], jnp.asarray(jnp.inf, start.dtype)

    def goes_on(state: tuple[Any, ...]) -> Any:
        return (state[1] < MAX_SWEEPS) & ~state[-1]

    def swept(state: tuple[Any, ...]) -> tuple[Any, ...]:
        moves, sweep, previous_size, rate, rising, rises, repeated, _ = state
        change = equation(moves)
        size = _largest(change, scale)
        contraction = size / jnp.maximum(previous_size, jnp.finfo(size.dtype).tiny)
        counts = (contraction > 0) & (contraction < 1) & (size > near_rounding)
        rate = jnp.where(counts, 0.7 * rate + 0.3 * contraction, rate)
        slow = (contraction >= 1) | (contraction > jnp.maximum(1.5 * rate, POLICY.stalled))
        rises = rises + ((contraction >= 1) & (size <= near_rounding))
        is_solved = (rate * size <= solved_limit) | (slow & (size <= rounding)) | (rises > 1)
        rising = jnp.where(contraction >= 1, rising + 1, 0)
        has_failed = ~is_solved & (~jnp.isfinite(size) | (rising >= POLICY.most_rising + stages))
        anew = has_failed & repeated
        moves = jnp.where(anew, 0, jnp.where(has_failed, jnp.nan, moves + change))
        previous_size = jnp.where(anew, infinity, size)
        rate = jnp.where(anew, 0.5, rate)
        rising, rises, sweep = (jnp.where(anew, 0, v) for v in (rising, rises, sweep + 1))
        return moves, sweep, previous_size, rate, rising, rises, repeated & ~anew, is_solved | (has_failed & ~anew)

    none, half = jnp.asarray(0), jnp.asarray(0.5, start.dtype)
    state = (start, none, infinity, half, none, none, jnp.any(start != 0), jnp.asarray(False))
    moves, *_, ended = jax.lax.while_loop(goes_on, swept, state)
    return jnp.where(ended, moves, jnp.nan)


def _solved_linear(linear: Callable[[Any], Any], side: Any, unit: float) -> Any:
    """Return the solution L of A L = side, found by `_swept_linear`; ``linear`` is the linear map A.

    JAX can transpose this function. Then `_swept_linear` solves the transposed equation.
    """
    return jax.lax.custom_linear_solve(
        linear, side, lambda f, b: _swept_linear(f, b, unit), lambda f, b: _swept_linear(f, b, unit)
    )


def _swept_linear(linear: Callable[[Any], Any], side: Any, unit: float) -> Any:
    """Return the solution L of A L = side, found by the iteration L ← L + A L − side; ``linear`` is the linear
    map A.

    The result is NaN if the iteration does not converge.
    """
    solved_limit, rounding = unit * LINEAR_POLICY.adjoint_solved, unit * LINEAR_POLICY.adjoint_rounding
    floor = jnp.finfo(side.dtype).tiny

    def goes_on(state: tuple[Any, ...]) -> Any:
        return (state[1] < MAX_SWEEPS) & ~state[-1]

    def swept(state: tuple[Any, ...]) -> tuple[Any, ...]:
        moves, sweep, previous_size, stalls, _ = state
        change = linear(moves) - side
        following = moves + change
        size, largest = jnp.max(jnp.abs(change)), jnp.max(jnp.abs(following)) + floor
        rate = size / jnp.maximum(previous_size, floor)
        stalls = stalls + ((rate > LINEAR_POLICY.adjoint_stalled) & (size <= rounding * largest))
        is_solved = (stalls > 1) | ((sweep > 0) & (size * rate <= solved_limit * largest)) | ~jnp.isfinite(size)
        return following, sweep + 1, size, stalls, is_solved

    none = jnp.asarray(0)
    state = (-side, none, jnp.asarray(jnp.inf, side.dtype), none, jnp.asarray(False))
    moves, *_, ended = jax.lax.while_loop(goes_on, swept, state)
    return jnp.where(ended, moves, jnp.nan)
