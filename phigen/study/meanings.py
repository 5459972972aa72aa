"""What each row of a verification measures, and what it means if the row fails: for people who read a table."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Meaning:
    """``row`` begins the names of the checks that are meant; ``failure`` is empty for rows that are not judged."""

    row: str
    measures: str
    failure: str = ""


MEANINGS = (
    Meaning(
        "observed order",
        "how the error at one time shrinks with the step: like h^order. The solution is that of DOP853 at small steps. "
        "∞ means that all errors are those of rounding",
        "S_1 … S_k or the composition are not those of the stated order",
    ),
    Meaning(
        "strong order",
        "how the error along one path of the noise shrinks with the step, as a mean over 48 paths. The increments of "
        "a coarse step are sums of those of finer ones; the solution is that of the fields along the path joined by "
        "lines",
        "the noise is not that of the spec, or not in the sense of Stratonovich, or sources are taken twice",
    ),
    Meaning(
        "steps that fail",
        "steps from four states with increments of the noise that are all as large as they can be",
        "the run may fail some day, where a rare increment makes a step impossible: make the step smaller",
    ),
    Meaning(
        "energy: largest change",
        "how far H went from its value at the start where there is noise; it is no error",
    ),
    Meaning(
        "Casimir: largest error",
        "how far a Casimir went from its value at the start, relative to that, over all steps",
        "the step leaves the symplectic leaf, or rounding adds up to a drift; the bound is a random walk of rounding "
        "errors, 10⁻¹⁵ (20 + √steps) of the largest terms of the Casimir",
    ),
    Meaning(
        "Casimir: last/first window",
        "the largest error in the last tenth of the run over that in the first; nothing where errors are of rounding, "
        "or where the first tenth has not seen every coordinate turn back and forth",
    ),
    Meaning(
        "Casimir: spread over the sites",
        "of the changes of a Casimir that every site has, from the first frame to the last: their standard deviation",
    ),
    Meaning(
        "Casimir: largest change", "how far a Casimir of a lattice went that a vector force changes; it is no error"
    ),
    Meaning("invariant: largest error", "how far a sum over the sites went, relative to the magnitudes of its terms"),
    Meaning(
        "energy: largest error",
        "how far H went from its value at the start, relative to that; it depends on the step",
    ),
    Meaning(
        "energy balance: largest error",
        "the same of H less the work that was done, where H depends on the time or forces act",
    ),
    Meaning(
        "energy: last/first window",
        "the same quotient for the energy: about 1 if it oscillates, 10 if it drifts. It is judged if the orbit stays "
        "where it was in the first half",
        "the solver does not follow the flow of any Hamiltonian near H, or the step is so large that H̃ says nothing",
    ),
    Meaning(
        "energy: last quarter/before",
        "the largest error of the energy in the last quarter of a run of a lattice over that before: about 1 without "
        "drift; nothing where errors are of rounding",
        "the solver does not follow the flow of any Hamiltonian near H, or the step is so large that H̃ says nothing",
    ),
    Meaning(
        "energy balance: last quarter/before",
        "the same of H less the work that was done on a lattice that is driven",
    ),
    Meaning(
        "Poisson identity",
        "the largest entry of DΦ π DΦᵀ − π∘Φ over that of π, on a lattice of a few sites that are as some of the "
        "run; DΦ by differences of order six",
        "the step is not a Poisson map",
    ),
    Meaning(
        "energy balance: last/first window",
        "the same quotient for the balance of energy",
        "the solver does not follow the flow of any Hamiltonian near H, or the step is so large that H̃ says nothing",
    ),
    Meaning(
        "Poisson defect",
        "the largest entry of DΦ π DΦᵀ − π∘Φ, relative to its terms; DΦ is the derivative of a step Φ that the code "
        "states itself. Steps are taken at four states, of sizes h, h/2 and −h",
        "the step is not a Poisson map. Of an approximate bi-realisation the defect must shrink with the stated power "
        "of h",
    ),
    Meaning(
        "tangent map",
        "the stated derivative of a step against differences of order six of the step itself, good to 10⁻¹²",
        "the derivative is that of another map, so the rows and exponents that rest on it mean nothing",
    ),
    Meaning(
        "gradient against tangent maps",
        "⟨bar, DΦ v⟩ against ⟨DΦᵀ bar, v⟩ over eleven steps with cotangents at every fourth, relative to its terms, "
        "where the code has gradients",
        "the reverse pass is not the transpose of the steps that are made",
    ),
    Meaning(
        "gradient against differences",
        "derivatives of such a run along the start and each parameter, against differences of order six",
        "gradients are those of another run, so fits and optimisations that rest on them go astray",
    ),
    Meaning(
        "gradients of members",
        "gradients of runs that are made side by side against those of the same runs one by one",
        "ensembles have other gradients than their members",
    ),
    Meaning(
        "reversibility",
        "how far a step of h and one of −h lead from the start. Judged for symmetric methods",
        "the method is not symmetric, or the equation of a step was not solved to the last bit",
    ),
    Meaning(
        "agreement",
        "single steps of C and NumPy from the same states",
        "one of the targets computes something else: an error of its emitter or of the compiler's flags",
    ),
    Meaning(
        "largest step",
        "how many times larger than the run's a step may be before the equation of a step has no solution, at most 256",
        "the step of the run itself fails: make it smaller",
    ),
    Meaning(
        "modified H",
        "the power of h that changes of the modified Hamiltonian with one and two corrections shrink like. Steps are "
        "doubled from the run's until the changes stand out from rounding; ∞ means that they never do. For series up "
        "to order 6 without composition",
        "the step is the flow of another Hamiltonian than the one stated: S_{k+1}, … or a sign is wrong",
    ),
)


def meaning_of(check: str) -> Meaning:
    """The meaning of the check of that name."""
    kind, colon, rest = check.partition(": ")
    noun = kind.partition(" ")[0]
    name = f"{noun}: {rest}" if colon and noun in ("Casimir", "invariant") else check
    return next(m for m in MEANINGS if name.startswith(m.row))
