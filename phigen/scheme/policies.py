"""Numerical policies of the runtimes: convergence of a solve, range of a predictor, search for a gauge.

Each number is defined here, once, with its reason, and printed as a named constant into C, JavaScript and NumPy
(`phigen.targets.policies`). Constants of a single runtime, such as blocks of steps in C, are in that runtime.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields


@dataclass(frozen=True)
class PolicyConstant:
    """A named number of a policy; ``about`` is the comment in generated code: its meaning, unit or reason."""

    name: str
    value: int | float
    about: str


@dataclass(frozen=True)
class Policy:
    """Numbers that belong together: the fields of a subclass, each defined by `number` or `count`."""

    def constants(self) -> Iterator[PolicyConstant]:
        """Yield the numbers, with their names in generated code."""
        for each in fields(self):
            yield PolicyConstant(each.name.upper(), getattr(self, each.name), each.metadata["about"])


def number(value: float, about: str) -> float:
    """Return the default of a field of a policy that is a real number."""
    return field(default=float(value), metadata={"about": about})


def count(value: int, about: str) -> int:
    """Return the default of a field of a policy that is a whole number."""
    return field(default=value, metadata={"about": about})


@dataclass(frozen=True)
class StartPolicy(Policy):
    """The first evaluation of coefficients, which checks parameters before a step size is known."""

    probe_step: float = number(1e-100, "so short that coefficients are finite")


@dataclass(frozen=True)
class MeasurePolicy(Policy):
    """The scale of a correction of y; 0 where coordinates keep their sign, and may be of very different size."""

    floor: float = number(1e-6, "components of y are measured no finer than by this part of the largest")


@dataclass(frozen=True)
class NewtonPolicy(Policy):
    """Newton's method for the point of an implicit step; its tolerance is in `InnerSolve`."""

    nearly_solved: float = number(1e-8, "corrections below this have reached the level of rounding, ...")
    shrinking: float = number(0.25, "... if one is more than this part of the one before")


@dataclass(frozen=True)
class PathPolicy(Policy):
    """The solve of a step along paths dm/dt = π(m)p, and the Taylor series of a path.

    ``longest_path`` and ``most_pieces`` were measured on the corpus: steps that take more pieces usually have an
    error as large as the state.
    """

    longest_path: int = count(128, "pieces of a path, a power of 2")
    most_pieces: int = count(512, "of all paths of a solve: steps that need more are wrong by as much as the state")
    patience: int = count(3, "iterations with the approximate Jacobian, before it is asked whether it contracts")
    negligible: float = number(1e-17, "terms that rounding hides in their sum, in sizes of the path")
    least_share: float = number(1e-5, "coordinates are measured no finer than by this part of all together")
    rounded_slope: float = number(2e-15, "rounding of the slope of a path, in sizes of the path and its slope")
    difference: float = number(1e-7, "of arguments in a quotient, in sizes of p: about the root of rounding")
    solved: float = number(4e-16, "a residual, in sizes of p, that is rounding;")
    nearly_solved: float = number(1e-12, "one below this is so too if it is ...")
    shrinking: float = number(0.25, "... more than this part of the one before")
    contracting: float = number(0.05, "part of the residual that an iteration with a useful Jacobian leaves at most")


@dataclass(frozen=True)
class GaussPolicy(Policy):
    """Sweeps over the stages of a Gauss method."""

    most_rising: int = count(3, "sweeps that change more than those before, beyond transients: the step is too large")
    solved: float = number(2e-18, "what a next sweep may change; 2e-17 leaves a linear drift of energy and Casimirs")
    stalled: float = number(0.8, "a sweep that changes more than this part of the one before is the last ...")
    rounding: float = number(4e-16, "... if it changes no more than this: a part of 0.4 let Casimirs drift;")
    nearly_rounding: float = number(2e-14, "so is the second up to this that changes no less than the one before")
    trials: int = count(32, "steps from one comparison of predictors to the next: it takes as long as two sweeps")


@dataclass(frozen=True)
class PredictorPolicy(Policy):
    """Starting values of an inner solve, from those of earlier steps by backward differences."""

    reach: float = number(4.0, "how far from the last value a prediction may be, in sizes of that value")
    differences: int = count(9, "that are stored: those of higher order amplify rounding more than they gain")


@dataclass(frozen=True)
class PlausibilityPolicy(Policy):
    """Criteria for solutions of an implicit step far from the motion: distant ones at another energy."""

    plausible: float = number(1.5, "length of steps always accepted, in sizes of state and motion")
    max_energy_change: float = number(0.5, "relative change of energy in longer steps")


@dataclass(frozen=True)
class GaugeSearch(Policy):
    """The search for the multiples of Casimirs whose subtraction from H makes the leading error least."""

    samples: int = count(32, "states along a short piece of the trajectory")
    degree: int = count(6, "S_3 is cubic in H, so the square of the error is of degree six in each multiple")
    sweeps: int = count(4, "most rounds over the multiples")
    grids: int = count(3, "on a line, each finer than the one before by the factor mesh")
    first_reach: int = count(24, "points of the first grid to either side")
    reach_of_grid: int = count(8, "points of the others to either side")
    mesh: float = number(0.125, "of the first grid, in widths of the error")
    sample_length: float = number(0.25, "from one state to the next, in sizes of the first")
    close_call: float = number(1e-12, "errors, in sizes of all on a line, that are as good: rounding does not decide")


@dataclass(frozen=True)
class TangentPolicy(Policy):
    """The second solve of a step, for its derivative: the point to the last bit."""

    tangent_solved: float = number(1e-15, "a correction of this size is rounding;")
    tangent_nearly_solved: float = number(1e-10, "one below this is so too if it is ...")
    tangent_shrinking: float = number(0.25, "... more than this part of the one before")


@dataclass(frozen=True)
class GaussTangentPolicy(Policy):
    """Sweeps for the linear equations of the derivatives of Gauss stages."""

    tangent_solved: float = number(1e-17, "a relative change of this size is rounding;")
    tangent_nearly_solved: float = number(1e-13, "one below this is so too if it is ...")
    tangent_shrinking: float = number(0.4, "... more than this part of the one before")


@dataclass(frozen=True)
class GaussAdjointPolicy(Policy):
    """Sweeps of the transposed equations of Gauss stages."""

    adjoint_solved: float = number(1e-17, "what a next sweep may change, in sizes of the cotangents;")
    adjoint_stalled: float = number(0.8, "a sweep that changes more than this part of the one before ...")
    adjoint_rounding: float = number(1e-12, "... and no more than this is rounding: the second such one is the last")


@dataclass(frozen=True)
class PathTangentPolicy(Policy):
    """The Taylor series of a path with its variation."""

    tangent_negligible: float = number(1e-18, "terms that rounding hides in their sum, in sizes of start and sum")
    tangent_rounded_slope: float = number(
        1e-13, "rounding of slopes, in sizes of the path and its slope: variations add some"
    )


@dataclass(frozen=True)
class LatticeSweepPolicy(Policy):
    """Sweeps over a lattice that solve the equation of a stage of the series."""

    differences: int = count(4, "that predictions of a stage are extrapolated from")
    patience: int = count(10, "sweeps after which slow ones are left to Newton's method")
    least_size: float = number(1e-3, "fields are measured no finer than by this part of the largest")
    settled: float = number(2.0**-55, "what further sweeps may still change, in sizes of y")
    rounding: float = number(2.0**-40, "changes below this may be rounding")
    slow: float = number(0.6, "slower changes are left to Newton's method, ...")
    nearly_settled: float = number(2.0**-30, "... unless they are below this")


@dataclass(frozen=True)
class LatticeNewtonPolicy(Policy):
    """Newton's method for a stage where sweeps do not converge, with linear equations in Krylov spaces."""

    directions: int = count(24, "of the Krylov space that a correction is taken from")
    solved: float = number(1e-6, "how well a correction solves the equation for it, if the space allows, ...")
    useful: float = number(0.9, "... and how well it has to")
    plausible: float = number(1.5, "the motion reaches no further, in sizes of x and of its motion")


@dataclass(frozen=True)
class LatticeTangentPolicy(Policy):
    """The equation of a tangent vector of a lattice, solved by corrections."""

    carried: float = number(2.0**-54, "part of the equation of a tangent vector that is rounding;")
    nearly_carried: float = number(1e-11, "below this it is so too if it is ...")
    carried_shrinking: float = number(0.5, "... more than this part of the one before")


#: The policies of all runtimes by the names of the files that hold their constants.
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
