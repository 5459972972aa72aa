"""Numerical constants of the runtimes in all languages: when an iteration ends, how far a predictor reaches, how the
search for a gauge works.

Each constant is defined once, with its reason, and is printed into C, JavaScript and NumPy (`phigen.targets.policies`).
Constants that only one runtime has, such as the number of steps in a block in C, are in the files of that runtime.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields


@dataclass(frozen=True)
class PolicyConstant:
    """A named constant of a runtime; ``about`` is its comment in generated code, with its meaning, unit or reason."""

    name: str
    value: int | float
    about: str


@dataclass(frozen=True)
class Policy:
    """Base class for groups of constants that belong together; subclasses define each constant as a field."""

    def constants(self) -> Iterator[PolicyConstant]:
        """Yield the constants of the group, with the names that they have in generated code."""
        for constant in fields(self):
            yield PolicyConstant(constant.name.upper(), getattr(self, constant.name), constant.metadata["about"])


def number(value: float, description: str) -> float:
    """Return the dataclass field of a real constant; ``description`` becomes its comment in generated code."""
    return field(default=float(value), metadata={"about": description})


def count(value: int, description: str) -> int:
    """Return the dataclass field of an integer constant; ``description`` becomes its comment in generated code."""
    return field(default=value, metadata={"about": description})


@dataclass(frozen=True)
class StartPolicy(Policy):
    """The first evaluation of the coefficients, which checks the values of parameters before a step size is known."""

    probe_step: float = number(1e-100, "a step size for which coefficients are finite")


@dataclass(frozen=True)
class MeasurePolicy(Policy):
    """The size of a correction of y, the solution of the implicit equation, relative to the components of y.

    For coordinates that keep their sign and may differ much in size, the floor is 0.
    """

    floor: float = number(1e-6, "least size of a component of y, as a fraction of the largest")


@dataclass(frozen=True)
class NewtonPolicy(Policy):
    """Newton's method for the implicit equation of a step; its tolerance is in `InnerSolve`."""

    nearly_solved: float = number(1e-8, "a correction below this may be rounding")
    shrinking: float = number(0.25, "ratio of successive corrections below NEARLY_SOLVED that shows rounding")


@dataclass(frozen=True)
class PathPolicy(Policy):
    """The solution of the equation for p in a step along paths dm/dt = π(m)p, and the Taylor series of a path.

    ``longest_path`` and ``most_pieces`` were measured on the corpus: steps that need more pieces of Taylor series
    usually have errors as large as the state.
    """

    longest_path: int = count(128, "largest number of pieces of a path, a power of 2")
    most_pieces: int = count(
        512,
        "largest number of pieces of all paths of a solve; steps that need more have errors of the size of the state",
    )
    patience: int = count(3, "iterations with the approximate Jacobian before its contraction is checked")
    negligible: float = number(1e-17, "terms of a series below this, relative to the path, are rounding")
    least_share: float = number(1e-5, "smaller coordinates are measured relative to this fraction of their sum")
    rounded_slope: float = number(2e-15, "rounding of the slope of a path, relative to the path and its slope")
    difference: float = number(
        1e-7, "difference of arguments in a difference quotient, relative to p: the root of rounding"
    )
    solved: float = number(4e-16, "a residual below this, relative to p, is rounding")
    nearly_solved: float = number(1e-12, "a residual below this may be rounding: see SHRINKING")
    shrinking: float = number(0.25, "ratio of successive residuals below NEARLY_SOLVED that shows rounding")
    contracting: float = number(0.05, "largest reduction factor of the residual by an iteration with a useful Jacobian")


@dataclass(frozen=True)
class GaussPolicy(Policy):
    """Fixed-point sweeps over the stages of a Gauss method: when they end, when a step fails, how predictors are
    compared."""

    most_rising: int = count(3, "changes that may grow after transients before the step fails as too large")
    solved: float = number(
        2e-18, "largest expected change by a further sweep; 2e-17 leaves a linear drift of energy and Casimirs"
    )
    stalled: float = number(
        0.8, "ratio of successive changes from which on sweeps do not help; with 0.4 Casimirs drifted"
    )
    rounding: float = number(4e-16, "sweeps end at a change below this with at least the ratio STALLED")
    nearly_rounding: float = number(
        2e-14, "sweeps end at the second change below this that is no smaller than the last"
    )
    trials: int = count(32, "steps between comparisons of the predictors; a comparison costs as much as two sweeps")


@dataclass(frozen=True)
class PredictorPolicy(Policy):
    """Starting values for the iteration of an implicit step, extrapolated from earlier steps by backward
    differences."""

    reach: float = number(4.0, "largest distance from the last value, relative to it")
    differences: int = count(9, "number of stored differences; higher ones would amplify rounding errors")


@dataclass(frozen=True)
class PlausibilityPolicy(Policy):
    """Criteria that reject a spurious solution of an implicit step: one far from the state, with another energy."""

    plausible: float = number(1.5, "accepted length of steps, relative to state and motion")
    max_energy_change: float = number(0.5, "largest relative change of energy in longer steps")


@dataclass(frozen=True)
class GaugeSearch(Policy):
    """The search for the multiples of Casimirs whose subtraction from H minimises the leading error of a step."""

    samples: int = count(32, "number of states along a short piece of the trajectory")
    degree: int = count(6, "S_3 is cubic in H, so the square of the error is of degree six in each multiple")
    sweeps: int = count(4, "most rounds over all multiples")
    grids: int = count(3, "number of grids on a line, each finer than the one before by the factor mesh")
    first_reach: int = count(24, "points of the first grid on either side")
    reach_of_grid: int = count(8, "points of the other grids on either side")
    mesh: float = number(0.125, "mesh of the first grid, in units of the width of the search")
    sample_length: float = number(0.25, "distance between successive states, relative to the first")
    close_call: float = number(
        1e-12, "errors that differ less than this, relative to all on a line, are equal: rounding must not decide"
    )


@dataclass(frozen=True)
class TangentPolicy(Policy):
    """The additional Newton iterations that solve the implicit equation to the last bit before a step is
    differentiated."""

    tangent_solved: float = number(1e-15, "a correction below this is rounding")
    tangent_nearly_solved: float = number(1e-10, "a correction below this that no longer shrinks is rounding too")
    tangent_shrinking: float = number(0.25, "a correction shrinks if below this fraction of the one before")


@dataclass(frozen=True)
class GaussTangentPolicy(Policy):
    """Sweeps that solve the linear equations for the derivatives of the stages of a Gauss step."""

    tangent_solved: float = number(1e-17, "a relative change below this is rounding")
    tangent_nearly_solved: float = number(1e-13, "a residual below this may be rounding: see TANGENT_SHRINKING")
    tangent_shrinking: float = number(
        0.4, "ratio of successive residuals below TANGENT_NEARLY_SOLVED that shows rounding"
    )


@dataclass(frozen=True)
class GaussAdjointPolicy(Policy):
    """Sweeps that solve the transposed linear equations of the stages of a Gauss step, for gradients."""

    adjoint_solved: float = number(1e-17, "largest expected change by a further sweep, relative to the cotangents")
    adjoint_stalled: float = number(0.8, "ratio of successive changes from which on sweeps do not help")
    adjoint_rounding: float = number(
        1e-12, "sweeps end at the second change below this with at least the ratio ADJOINT_STALLED"
    )


@dataclass(frozen=True)
class PathTangentPolicy(Policy):
    """The Taylor series of a path together with its variation, for the derivatives of a step."""

    tangent_negligible: float = number(1e-18, "terms below this fraction of start and sum are rounding")
    tangent_rounded_slope: float = number(1e-13, "rounding of slopes with variations, relative to path and slope")


@dataclass(frozen=True)
class LatticeSweepPolicy(Policy):
    """Sweeps over a lattice that solve the implicit equation of a stage, for steps with a generating function."""

    differences: int = count(4, "number of differences in the predictor of a stage")
    patience: int = count(10, "sweeps after which slow convergence is left to Newton's method")
    least_size: float = number(1e-3, "smaller fields are measured relative to this fraction of the largest")
    settled: float = number(2.0**-55, "largest expected change by further sweeps, relative to y")
    rounding: float = number(2.0**-40, "changes below this may be rounding")
    slow: float = number(0.6, "a change above this fraction of the one before is left to Newton's method")
    nearly_settled: float = number(2.0**-30, "changes below this are not left to Newton's method")


@dataclass(frozen=True)
class LatticeNewtonPolicy(Policy):
    """Newton's method for a stage on a lattice whose sweeps converge slowly; Krylov methods solve its linear
    equations."""

    directions: int = count(24, "dimension of the Krylov space of a correction")
    solved: float = number(1e-6, "relative residual at which the iteration for a correction ends")
    useful: float = number(0.9, "largest relative residual of an accepted correction")
    plausible: float = number(1.5, "solutions farther from x than this, relative to x and its motion, are rejected")


@dataclass(frozen=True)
class LatticeTangentPolicy(Policy):
    """The linear equation for a tangent vector of a step of a lattice, solved by iterative corrections."""

    carried: float = number(2.0**-54, "a relative residual of a tangent vector below this is rounding")
    nearly_carried: float = number(1e-11, "a residual below this that no longer shrinks is rounding too")
    carried_shrinking: float = number(0.5, "a residual shrinks if below this fraction of the one before")


#: The groups of constants of all runtimes, by the name of the file with their definitions in generated code.
POLICIES: dict[str, Policy] = {
    "start_policy": StartPolicy(),
    "measure_policy": MeasurePolicy(),
    "newton_policy": NewtonPolicy(),
    "path_policy": PathPolicy(),
    "gauss_policy": GaussPolicy(),
    "predictor_policy": PredictorPolicy(),
    "plausibility_policy": PlausibilityPolicy(),
    "gauge_search": GaugeSearch(),
    "tangent_policy": TangentPolicy(),
    "gauss_tangent_policy": GaussTangentPolicy(),
    "gauss_adjoint_policy": GaussAdjointPolicy(),
    "path_tangent_policy": PathTangentPolicy(),
    "lattice_sweep_policy": LatticeSweepPolicy(),
    "lattice_newton_policy": LatticeNewtonPolicy(),
    "lattice_tangent_policy": LatticeTangentPolicy(),
}
