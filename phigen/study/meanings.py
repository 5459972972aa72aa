"""Explanations of the rows of a verification table: the measured quantity, and the cause of a failure."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Meaning:
    """Explanation of the checks whose names begin with ``row``, for the table of results.

    ``measures`` is the measured quantity. ``failure`` is the cause if a check fails, "" for checks without a limit.
    """

    row: str
    measures: str
    failure: str = ""


#: Cause of a failure for all checks that judge the drift of the energy.
_DRIFT = "the solver does not follow the flow of a Hamiltonian near H, or the step is too large"

MEANINGS = (
    Meaning(
        "observed order",
        "the power of the step size h with which the error at a fixed time shrinks. The reference is DOP853 with "
        "small steps. ∞ means that all errors are rounding errors",
        "the terms S_1 … S_k, or the composition, do not have the stated order",
    ),
    Meaning(
        "strong order",
        "the power of h with which the error along one path of the noise shrinks, as a mean over many paths. The "
        "increments of a coarse step are sums of those of finer steps. The reference is the solution along the "
        "path with straight lines between its points",
        "the noise is not that of the spec, or not in the sense of Stratonovich, or a source is counted twice",
    ),
    Meaning(
        "steps that fail",
        "the number of failed steps from states of the run, with the largest increments of the noise",
        "a rare increment can make a step of the run fail: use a smaller step",
    ),
    Meaning(
        "energy: largest change",
        "the largest distance of H from its value at the start, for systems with noise. This is not an error",
    ),
    Meaning(
        "Casimir: largest error",
        "the largest error of a Casimir over all steps, relative to its value at the start",
        "the step leaves the symplectic leaf, or rounding errors add up. The bound is a random walk of rounding "
        "errors, 10⁻¹⁵ (20 + √steps) times the largest term of the Casimir",
    ),
    Meaning(
        "Casimir: last/first window",
        "the largest error in the last tenth of the run, divided by that in the first tenth. The ratio is left "
        "out if errors are rounding errors, or if some coordinate does not go back and forth within the first tenth",
    ),
    Meaning(
        "Casimir: spread over the sites",
        "the standard deviation, over the sites, of the change of a Casimir between the first and the last stored "
        "state",
    ),
    Meaning(
        "Casimir: largest change",
        "the largest change of a Casimir, for lattices on which a vector force acts. This is not an error",
    ),
    Meaning(
        "invariant: largest error",
        "the largest error of a sum over the sites, relative to the magnitudes of its terms",
    ),
    Meaning(
        "energy: largest error",
        "the largest error of H, relative to the value of H at the start. The error depends on the step size",
    ),
    Meaning(
        "energy balance: largest error",
        "the largest error of H minus the work done, if H depends on the time or forces act",
    ),
    Meaning(
        "energy: last/first window",
        "the largest energy error in the last tenth of the run, divided by that in the first tenth: about 1 if the "
        "error oscillates, 10 if it drifts. The ratio is judged if the coordinates keep the ranges of the first "
        "half of the run",
        _DRIFT,
    ),
    Meaning(
        "energy: last quarter/before",
        "the largest energy error in the last quarter of a lattice run, divided by the largest before this "
        "quarter: about 1 without drift. The ratio is left out if errors are rounding errors",
        _DRIFT,
    ),
    Meaning(
        "energy balance: last quarter/before",
        "for H minus the work done, if H of a lattice depends on the time or forces act: the largest error in the "
        "last quarter of the run, divided by the largest before this quarter",
    ),
    Meaning(
        "Poisson identity",
        "the largest entry of DΦ π DΦᵀ − π∘Φ, relative to its terms, on a lattice of a few sites with states of "
        "the run. DΦ is the derivative of a step Φ as the code computes it",
        "the step is not a Poisson map",
    ),
    Meaning(
        "energy balance: last/first window",
        "for H minus the work done, if H depends on the time or forces act: the largest error in the last tenth of "
        "the run, divided by that in the first tenth",
        _DRIFT,
    ),
    Meaning(
        "Poisson defect",
        "the largest entry of DΦ π DΦᵀ − π∘Φ, relative to its terms. DΦ is the derivative of a step Φ as the code "
        "computes it. Steps start from four states, with sizes h, h/2 and −h",
        "the step is not a Poisson map. For an approximate bi-realisation the defect must shrink with the stated "
        "power of h",
    ),
    Meaning(
        "tangent map",
        "the difference between the derivative of a step as the code computes it and finite differences of order "
        "six, which are accurate to 10⁻¹²",
        "the computed derivative is wrong, and so are the Poisson defect and Lyapunov exponents, which use it",
    ),
    Meaning(
        "gradient against tangent maps",
        "for code with gradients: the difference between ⟨w, DΦ v⟩ by tangent maps and ⟨DΦᵀ w, v⟩ by gradients, "
        "relative to the terms. Φ is a run of eleven steps, v a tangent vector at the start, and w consists of "
        "covectors after every fourth step and at the end",
        "the reverse pass is not the transpose of the steps",
    ),
    Meaning(
        "gradient against differences",
        "the difference between gradients and finite differences of order six, for a run of eleven steps. "
        "Gradients are those with respect to the initial state and each parameter",
        "the gradients are wrong, and so are fits and optimisations that use them",
    ),
    Meaning(
        "gradients of members",
        "the difference between the gradients of an ensemble and the gradients of each member alone",
        "gradients of ensembles are wrong",
    ),
    Meaning(
        "reversibility",
        "the distance from the start after a step of h and a step of −h. The distance is judged for symmetric "
        "methods only",
        "the method is not symmetric, or the equation of a step was not solved to rounding",
    ),
    Meaning(
        "agreement",
        "the difference between single steps of the targets, such as C and NumPy, from the same states",
        "one of the targets is wrong: an error of phigen, or of the compiler's flags",
    ),
    Meaning(
        "single precision",
        "with `real: float`: the difference of single steps in C from steps in double precision, and the largest "
        "errors of Casimirs over a run in single precision. All other rows are about double precision",
        "the C in single precision is wrong, or an intermediate value exceeds the range of single precision",
    ),
    Meaning(
        "largest step",
        "the largest step for which the equation of a step has a solution, as a multiple of the step of the run. "
        "Steps larger than 256 times the step of the run are not tried",
        "the step of the run itself fails: use a smaller one",
    ),
    Meaning(
        "modified H",
        "the power of h with which changes of the modified Hamiltonian shrink, with one and two corrections. The "
        "step of the run is doubled until the changes exceed rounding; ∞ means that they never do. The row exists "
        "for series up to order 6 without composition",
        "the step is not the flow of the stated Hamiltonian: a sign, or a term from S_{k+1} on, is wrong",
    ),
)


def meaning_of(check: str) -> Meaning:
    """Return the explanation of the check with this name, such as ``Casimir C: largest error``."""
    kind, colon, suffix = check.partition(": ")
    noun = kind.partition(" ")[0]
    name = f"{noun}: {suffix}" if colon and noun in ("Casimir", "invariant") else check
    return next(m for m in MEANINGS if name.startswith(m.row))
