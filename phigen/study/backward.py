"""Measurement of the modified Hamiltonian (backward error analysis) along trajectories of a solver.

A step agrees to all orders in h with the exact flow of the modified Hamiltonian H̃ = H + h^p H_p + … . If H̃ is
truncated after m corrections, it is constant along the numerical solution up to O(h^q), where q is the power of the
first omitted term. Each correction raises q by one, or by two for a symmetric method.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from phigen.compilation import Compilation
from phigen.errors import LimitError, StepError
from phigen.geometry.conservation import Unit, units
from phigen.scheme.modified import corrections, powers
from phigen.study.methods import Method
from phigen.symbolic.arrays import Floats, evaluate
from phigen.symbolic.expression import Expression

#: CORRECTIONS: number of corrections of the modified Hamiltonian. MOST_ORDER: corrections are computed only for methods
#: of at most this order.
CORRECTIONS, MOST_ORDER = 2, 6
#: STEPS: number of steps at the largest step size. DOUBLINGS: largest number of times that the step of the run is
#: doubled to find the largest step size. HALVINGS: number of times that this size is then halved for the measurement.
STEPS, DOUBLINGS, HALVINGS = 16, 8, 6
#: ROUNDING: changes of H̃ below this fraction of the largest term of H are rounding errors. ASYMPTOTIC: if H changes by
#: more than this, relative to the `ModifiedHamiltonian.unit`, the steps are too large to determine an order.
ROUNDING, ASYMPTOTIC = 1e-13, 1e-3


class NotOfferedError(ValueError):
    """No modified Hamiltonian is available for the method; the message says why."""


@dataclass(frozen=True)
class ModifiedHamiltonian:
    """Modified Hamiltonian H̃ = Σ h^j terms[j]. With m corrections, the sum is over j < powers[m].

    ``values`` has the values of all symbols except the coordinates. ``hamiltonian`` is H, which determines the unit of
    the errors.
    """

    terms: tuple[Expression, ...]
    powers: tuple[int, ...]
    hamiltonian: Expression
    coordinates: tuple[str, ...]
    values: Mapping[str, float]

    def errors(self, rows: Floats, h: float) -> Floats:
        """Return |H̃(x_n) − H̃(x_0)| for H̃ with 0, 1, … corrections, as an array (corrections + 1, rows).

        ``rows`` are the states x_n after steps of size h. The errors are relative to the `unit` of the energy at x_0.
        """
        values = {**self.values, **{c: rows[:, i] for i, c in enumerate(self.coordinates)}}
        terms = [np.broadcast_to(t, len(rows)) for t in evaluate(list(self.terms), values)]
        sums: Floats = np.array([sum(h**j * t for j, t in enumerate(terms[:power])) for power in self.powers])
        errors: Floats = np.abs(sums - sums[:, :1]) / self.unit(rows[0]).size
        return errors

    def unit(self, x: Floats) -> Unit:
        """Return the unit in which energy errors of trajectories from the state ``x`` (DIM,) are measured."""
        (unit,) = units([self.hamiltonian], self.coordinates, self.values, x)
        return unit

    def changes(self, method: Method, x: Floats, h: float, steps: int) -> Floats:
        """Return the largest changes of H̃ with 0, 1, … corrections in a run from x, as an array (corrections +
        1,).

        The run has ``steps`` steps of size h. Changes are relative to the `unit` of the energy at x. Raises `StepError`
        if a step fails.
        """
        changes: Floats = self.errors(method.rows(x, h, steps, 1), h).max(axis=1)
        if not np.isfinite(changes).all():
            raise StepError(
                "the modified Hamiltonian H̃ became infinite or NaN along the trajectory", step=0, status="NOT_FINITE"
            )
        return changes


def modified(compilation: Compilation, parameters: Mapping[str, float], gauge: Floats | None) -> ModifiedHamiltonian:
    """Return the modified Hamiltonian of a method: H plus `CORRECTIONS` corrections. Raises `NotOfferedError`."""
    system, order = compilation.system, compilation.order
    if compilation.is_composed:
        raise NotOfferedError("a step is composed of several maps")
    if not compilation.has_series:
        raise NotOfferedError("it is not computed for Gauss methods")
    if system.time:
        raise NotOfferedError("it depends on the time, and is not constant")
    if not compilation.exact:
        raise NotOfferedError("the bi-realisation is approximate")
    if system.noise:
        raise NotOfferedError("with noise a step is not the flow of a Hamiltonian")
    if system.forces:
        raise NotOfferedError("with forces a step is not the flow of a Hamiltonian")
    if order.order > MOST_ORDER:
        raise NotOfferedError(f"it is computed for orders up to {MOST_ORDER}")
    # Formulas are shorter if numbers take the place of the parameters. If the series cannot represent a root of these
    # numbers, the parameters remain symbols.
    chart = compilation.by_series().realisation
    exact = {name: Fraction(repr(value)) for name, value in parameters.items()}
    for exact_values in (exact, {}):
        try:
            series = corrections(system, chart, order, CORRECTIONS, compilation.gauge, exact_values)
            break
        except (LimitError, ArithmeticError):
            continue
    else:
        raise NotOfferedError("its formula is too large")
    values = dict(parameters)
    if gauge is not None and compilation.gauge is not None:
        values |= dict(zip(compilation.gauge.symbols, np.ravel(gauge).tolist(), strict=True))
    return ModifiedHamiltonian(
        tuple(map(series.tower.expression, series.terms)),
        tuple(powers(order, CORRECTIONS + 1, symmetric=compilation.symmetric)),
        system.hamiltonian,
        system.coordinates,
        values,
    )


def observed_powers(hamiltonian: ModifiedHamiltonian, method: Method, x: Floats, h: float) -> list[float]:
    """Return the observed powers of the step size for H̃ with 0, 1, … corrections.

    A power q says that the change of H̃ along a run is proportional to h^q. The step ``h`` of the run is doubled until
    the changes exceed rounding errors. If the changes are rounding errors at all step sizes, the power is infinite.
    """
    observed, rounding = [math.inf] * len(hamiltonian.powers), ROUNDING * hamiltonian.unit(x).terms
    for doubling in range(1, DOUBLINGS + 1):
        step = h * 2**doubling
        try:
            coarse = hamiltonian.changes(method, x, step, STEPS)
            fine = hamiltonian.changes(method, x, step / 2, 2 * STEPS)
        except StepError:
            break
        if doubling > 1 and coarse[0] > ASYMPTOTIC:
            break
        if fine[0] <= rounding:
            continue  # H changes by rounding errors only, from which no order follows: double the step again
        for m, (coarse_change, fine_change) in enumerate(zip(coarse.tolist(), fine.tolist(), strict=True)):
            if math.isinf(observed[m]) and fine_change > rounding:
                observed[m] = math.log2(coarse_change / fine_change)
    return observed


@dataclass(frozen=True, eq=False)
class Constancy:
    """Measured changes of the modified Hamiltonian H̃ with m = 0, 1, … corrections.

    With m corrections, the changes should decrease with the power ``powers[m]`` of the step size; ``observed[m]`` is
    the measured power. ``errors`` (corrections + 1, rows) are the changes at ``times`` (rows,), up to ``end``, with
    steps of size ``step``. ``sizes`` are step sizes in descending order; ``changes`` (sizes, corrections + 1) has the
    largest change for each step size.
    """

    powers: tuple[int, ...]
    observed: tuple[float, ...]
    step: float
    times: Floats
    errors: Floats
    end: float
    sizes: Floats
    changes: Floats


def constancy(hamiltonian: ModifiedHamiltonian, method: Method, x: Floats, h: float) -> Constancy:
    """Measure the changes of H̃ at the largest step sizes that still show an order.

    These sizes may be larger than the step ``h`` of the run. Raises `StepError` if a step fails, and `NotOfferedError`
    if H itself changes by rounding errors only.
    """
    largest, most, rounding = h, 0.0, ROUNDING * hamiltonian.unit(x).terms
    for doubling in range(1, DOUBLINGS + 1):
        try:
            change = float(hamiltonian.changes(method, x, h * 2**doubling, STEPS)[0])
        except StepError:
            break
        if change > ASYMPTOTIC:
            break
        largest, most = h * 2**doubling, max(most, change)
    if most <= rounding:
        raise NotOfferedError("H itself changes by no more than rounding")
    sizes: Floats = largest / 2.0 ** np.arange(HALVINGS + 1, dtype=np.float64)
    changes = np.array([hamiltonian.changes(method, x, size, STEPS * 2**k) for k, size in enumerate(sizes.tolist())])
    # Indices of the step sizes for which the change of H̃ with all corrections exceeds rounding errors.
    telling = np.flatnonzero(changes[:, -1] > rounding)
    shown_step = float(sizes[telling[-1] if len(telling) else 0])
    rows = method.rows(x, shown_step, round(STEPS * largest / shown_step), 1)
    times: Floats = shown_step * np.arange(len(rows), dtype=np.float64)
    observed = tuple(observed_powers(hamiltonian, method, x, h))
    return Constancy(
        hamiltonian.powers,
        observed,
        shown_step,
        times,
        hamiltonian.errors(rows, shown_step),
        STEPS * largest,
        sizes,
        changes,
    )


def truncation(m: int) -> str:
    """Return the name of H̃ with m corrections: "H itself" for m = 0, else "H̃ with 1 correction" and so on."""
    return "H itself" if m == 0 else f"H̃ with {m} correction{'s' * (m > 1)}"
