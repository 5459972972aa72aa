"""Numerical constants of the runtimes in all languages: tolerances and limits of iterations, and constants of
predictors and of the search for a gauge.

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
        """Yield the constants that the class defines, with their names in generated code."""
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
    """The step size for a first evaluation of the coefficients. This evaluation checks the values of parameters before
    a run has a step size.
    """

    probe_step: float = number(1e-100, "step size for a check of parameters")


@dataclass(frozen=True)
class MeasurePolicy(Policy):
    """The size of a correction of y, the solution of the implicit equation: the largest ratio of |correction of y_i| to
    |y_i| + ``floor`` max |y_j|.

    ``floor`` is 0 if the coordinates keep their signs, since the sizes of these coordinates may differ much.
    """

    floor: float = number(1e-6, "corrections of y_i are relative to |y_i| + this times the largest |y_j|")


@dataclass(frozen=True)
class NewtonPolicy(Policy):
    """Newton's method for the implicit equation of a step; its tolerance is in `InnerSolve`."""

    nearly_solved: float = number(1e-8, "after a correction below this, slow iterations end")
    shrinking: float = number(0.25, "iterations are slow if a correction exceeds this fraction of the one before")


@dataclass(frozen=True)
class PathPolicy(Policy):
    """Constants for steps along paths dm/dt = π(m)p: for the iteration that computes p, and for Taylor series.

    A long path is divided into pieces, each of which has a Taylor series. ``longest_path`` and ``most_pieces`` were
    chosen by measurements with the example systems in ``specs``: steps that need more pieces usually have errors as
    large as the state.
    """

    longest_path: int = count(128, "largest number of pieces of a path, a power of 2")
    most_pieces: int = count(
        512,
        "largest number of pieces of paths in a stage; steps that need more have errors of the size of the state",
    )
    patience: int = count(3, "number of iterations before the approximate Jacobian may be replaced by differences")
    negligible: float = number(
        1e-17, "a Taylor series ends if its terms are below this fraction of the size of the path"
    )
    least_share: float = number(1e-5, "size of a path m in coordinate i: |m_i| + this times the sum of all |m_j|")
    rounded_slope: float = number(2e-15, "tolerated error of dm/dt at the end m of a path, relative to |m| + |dm/dt|")
    difference: float = number(
        1e-7,
        "step of difference quotients, relative to p: about the square root of the rounding error",
    )
    solved: float = number(4e-16, "iterations end if the residual is below this, relative to p")
    nearly_solved: float = number(1e-12, "after a residual below this, slow iterations end")
    shrinking: float = number(0.25, "iterations are slow if a residual exceeds this fraction of the one before")
    contracting: float = number(
        0.05, "the Jacobian is replaced if an iteration multiplies the residual by more than this"
    )


@dataclass(frozen=True)
class GaussPolicy(Policy):
    """Fixed-point sweeps over the stages of a Gauss method: when they end, when a step fails, how predictors are
    compared."""

    most_rising: int = count(3, "a step fails if changes grow in (number of stages + this) successive sweeps")
    solved: float = number(
        2e-18, "sweeps end when a further one would change less than this; with 2e-17, energy and Casimirs drift"
    )
    stalled: float = number(
        0.8, "above this ratio of successive changes, further sweeps do not help; with 0.4, Casimirs drifted"
    )
    rounding: float = number(
        4e-16, "at changes below this, sweeps end when a change exceeds STALLED times the one before"
    )
    nearly_rounding: float = number(
        2e-14, "at changes below this, sweeps end when a change has failed to shrink for the second time"
    )
    trials: int = count(32, "steps between comparisons of the predictors; a comparison costs as much as two sweeps")


@dataclass(frozen=True)
class PredictorPolicy(Policy):
    """Starting values for the iteration of an implicit step, extrapolated from earlier steps by backward
    differences."""

    reach: float = number(4.0, "largest relative distance of a prediction from the last solution")
    differences: int = count(
        9, "number of stored differences of solutions; higher differences would amplify rounding errors"
    )


@dataclass(frozen=True)
class PlausibilityPolicy(Policy):
    """Criteria that reject spurious solutions of an implicit step. A spurious solution is far from the state, and has
    another energy.
    """

    plausible: float = number(1.5, "largest plausible increment, relative to |x| + |h dx/dt|")
    max_energy_change: float = number(0.5, "increments over PLAUSIBLE may change H by at most this fraction")


@dataclass(frozen=True)
class GaugeSearch(Policy):
    """The search for the multiples of Casimirs whose subtraction from H minimises the leading error of a step."""

    samples: int = count(32, "number of sample states along a short piece of the trajectory")
    degree: int = count(6, "for H - f C with a Casimir C, degree of |pi grad S_3|^2 in f; S_3 is cubic in H")
    sweeps: int = count(4, "largest number of rounds of the search; a round optimises each factor once")
    grids: int = count(
        3, "number of grids in the search for a factor; the mesh of a grid is MESH times that of the one before"
    )
    first_reach: int = count(24, "points of the first grid on each side of its centre")
    reach_of_grid: int = count(8, "points of later grids on each side of the best point so far")
    mesh: float = number(0.125, "distance of the points of the first grid, in units of the width |grad H|/|grad C|")
    sample_length: float = number(
        0.25, "distance between successive sample states, relative to the size of the first state"
    )
    close_call: float = number(
        1e-12,
        "errors that differ by less than this fraction of the sum of all errors count as equal",
    )


@dataclass(frozen=True)
class TangentPolicy(Policy):
    """The additional Newton iterations that solve the implicit equation to the last bit before a step is
    differentiated."""

    tangent_solved: float = number(1e-15, "a correction below this consists of rounding errors")
    tangent_nearly_solved: float = number(1e-10, "a correction below this that no longer shrinks is accepted, too")
    tangent_shrinking: float = number(0.25, "a correction has shrunk if it is below this fraction of the one before")


@dataclass(frozen=True)
class GaussTangentPolicy(Policy):
    """Sweeps that solve the linear equations for the derivatives of the stages of a Gauss step."""

    tangent_solved: float = number(1e-17, "a relative change below this consists of rounding errors")
    tangent_nearly_solved: float = number(
        1e-13, "a residual below this may consist of rounding errors: see TANGENT_SHRINKING"
    )
    tangent_shrinking: float = number(
        0.4, "a residual below TANGENT_NEARLY_SOLVED is accepted if it exceeds this fraction of the one before"
    )


@dataclass(frozen=True)
class GaussAdjointPolicy(Policy):
    """Sweeps that solve the transposed linear equations of the stages of a Gauss step, for gradients."""

    adjoint_solved: float = number(
        1e-17, "sweeps end when a further one would change less than this, relative to the cotangents"
    )
    adjoint_stalled: float = number(0.8, "above this ratio of successive changes, further sweeps do not help")
    adjoint_rounding: float = number(
        1e-12, "two changes below this, each above ADJOINT_STALLED times the previous one, end the sweeps"
    )


@dataclass(frozen=True)
class PathTangentPolicy(Policy):
    """The Taylor series of a path together with its variation, for the derivatives of a step."""

    tangent_negligible: float = number(
        1e-18, "terms below this fraction of |start| + |sum of the terms| are negligible"
    )
    tangent_rounded_slope: float = number(
        1e-13, "accepted error of the slopes of a path and its variation, relative to path and slope"
    )


@dataclass(frozen=True)
class LatticeSweepPolicy(Policy):
    """Sweeps over a lattice that solve a stage, for steps with a generating function."""

    differences: int = count(4, "number of differences in the predictor of a stage")
    patience: int = count(10, "number of sweeps before Newton's method may replace slow sweeps")
    least_size: float = number(1e-3, "size of a field: its largest |y| + this times the largest |y| of all fields")
    settled: float = number(2.0**-55, "expected relative change of y below which sweeps end")
    rounding: float = number(2.0**-40, "changes below this may consist of rounding errors")
    slow: float = number(0.6, "convergence is slow if a change exceeds this fraction of the change before")
    nearly_settled: float = number(2.0**-30, "Newton's method does not take over at changes below this")


@dataclass(frozen=True)
class LatticeNewtonPolicy(Policy):
    """Newton's method for a stage on a lattice whose sweeps converge slowly; Krylov methods solve its linear
    equations."""

    directions: int = count(24, "dimension of the Krylov space in which a correction is computed")
    solved: float = number(1e-6, "GMRES for a Newton correction ends at this relative residual")
    useful: float = number(0.9, "largest relative residual of an accepted correction")
    plausible: float = number(
        1.5, "largest accepted |y - x| / (|x| + |z - x|) of a solution y; one sweep from x gives z"
    )


@dataclass(frozen=True)
class LatticeTangentPolicy(Policy):
    """Constants for tangent maps of lattices. A linear equation for the new tangent vector is solved by iteration."""

    carried: float = number(
        2.0**-54, "a residual below this fraction of the tangent vector consists of rounding errors"
    )
    nearly_carried: float = number(1e-11, "a residual below this that no longer shrinks is accepted, too")
    carried_shrinking: float = number(0.5, "a residual has shrunk if it is below this fraction of the one before")


#: The groups of constants that the runtimes of all languages share. The key is the name of the group. In each runtime,
#: the file that defines the constants of a group has the name of the group.
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
