"""All proofs about one spec, in groups. Messages on refuted statements name the places in the spec."""

from __future__ import annotations

from dataclasses import dataclass, replace

from phigen.compilation import Compilation
from phigen.errors import Diagnostic, SpecError
from phigen.geometry.definedness import start_is_defined
from phigen.proofs.statements import (
    ATTITUDE,
    CASIMIRS,
    DAMPING,
    DEFINEDNESS,
    GAUSS,
    INVARIANTS,
    METHOD,
    MONITOR,
    SPLITTING,
    Groups,
)
from phigen.spec.model import LieAlgebraForm, Spec
from phigen.symbolic.verdict import REFUTED, Statement

#: Names of the groups that are not examined if π is not a Poisson tensor. Their statements presuppose a Poisson tensor.
UNEXAMINED = "Casimirs, invariants, the method"

#: Group of statements → path of the key that the statements are about.
_PLACES = {METHOD: ("birealisation",), MONITOR: ("monitor",), SPLITTING: ("scheme",), ATTITUDE: ("reconstruct",)}
_PLACES |= {DAMPING: ("damping",), GAUSS: ("scheme",)}


@dataclass(frozen=True)
class Examination:
    """The statements about a spec, in groups, with their verdicts.

    ``compilation`` is None if the spec does not compile; ``obstacle`` is then the reason. An obstacle is not a
    refutation: the Poisson tensor may be correct, but of a form for which phigen has no bi-realisation. ``unexamined``
    names the groups that were skipped since they depend on a refuted statement; it is empty if everything was examined.
    """

    spec: Spec
    groups: Groups
    compilation: Compilation | None = None
    obstacle: SpecError | None = None
    unexamined: str = ""

    @property
    def statements(self) -> list[Statement]:
        """All statements, in the order in which they are printed."""
        return [s for group in self.groups.values() for s in group]

    @property
    def refuted(self) -> list[Statement]:
        """The refuted statements."""
        return refuted(self.groups)

    @property
    def mistakes(self) -> list[tuple[str, Statement]]:
        """The refuted statements with their groups, except those that may follow from an earlier refuted statement.

        Casimirs and invariants are independent of each other, so all are listed. In other groups, such as the axioms of
        a bi-realisation, all statements concern the same formulas, and only the first refuted statement is listed.
        """
        mistakes = []
        for group, statements in self.groups.items():
            refuted_pairs = [(group, s) for s in statements if s.verdict == REFUTED]
            mistakes += refuted_pairs if group in (DEFINEDNESS, CASIMIRS, INVARIANTS) else refuted_pairs[:1]
        return mistakes


def refuted(groups: Groups) -> list[Statement]:
    """Return the refuted statements of all groups."""
    return [s for group in groups.values() for s in group if s.verdict == REFUTED]


def refutation(examination: Examination) -> str:
    """Return the text of the error about the refuted statements, each with its place in the spec."""
    unexamined_note = (
        f"not examined, because they depend on a refuted statement: {examination.unexamined}"
        if examination.unexamined
        else ""
    )
    return "\n".join(
        str(
            examination.spec.diagnostic(
                _place(examination.spec, group, s), str(s), hint_of(examination.spec, group) or unexamined_note
            )
        )
        for group, s in examination.mistakes
    )


def hint_of(spec: Spec, group: str) -> str:
    """Return a hint at the usual cause of a refuted statement of the ``group``; "" if phigen has no hint.

    The usual cause of a refuted Casimir is that the coordinates are not in the order of the basis of the named algebra.
    """
    form = spec.poisson
    if group == DAMPING:
        return "a negative λ adds energy, which forces can do: forces: {covector: …}, or {vector: …}"
    if group != CASIMIRS or not isinstance(form, LieAlgebraForm) or not form.family:
        return ""
    return (
        f"coordinates stand for the basis of {form.family}({form.size}) in its order; phigen show prints their brackets"
    )


def doubts(examination: Examination) -> list[Diagnostic]:
    """Return warnings about expressions that seem to be undefined, everywhere or at the start of a run, and about keys
    without effect.

    Each warning has its place in the spec.
    """
    messages = [
        examination.spec.diagnostic(_place(examination.spec, DEFINEDNESS, s), str(s))
        for s in examination.groups.get(DEFINEDNESS, ())
    ]
    return [*(replace(d, severity="warning") for d in messages), *unused_keys(examination)]


def unused_keys(examination: Examination) -> list[Diagnostic]:
    """Return a warning for each key of the spec that has no effect with the scheme of the compilation."""
    compilation, spec = examination.compilation, examination.spec
    if compilation is None:
        return []
    ending = f"has no effect with scheme: {compilation.scheme_name}"
    messages = [(path, f"{': '.join(path)} {ending}") for path in compilation.unused]
    return [replace(spec.diagnostic(path, message), severity="warning") for path, message in messages]


def _place(spec: Spec, group: str, statement: Statement) -> tuple[str, ...]:
    """Return the path of keys in the spec that leads to the subject of a statement, such as ("casimirs", "C")."""
    key_paths: dict[str, tuple[str, ...]] = {f"{name} is a Casimir": ("casimirs", name) for name in spec.casimirs}
    key_paths |= {f"{name} is invariant": ("invariants", name) for name in spec.invariants}
    key_paths |= {"H is defined": ("hamiltonian",), "the density of a pair is symmetric": ("hamiltonian", "pairs")}
    key_paths |= {f"{name} is defined": ("casimirs", name) for name in spec.casimirs}
    key_paths |= {f"{name} is defined": ("invariants", name) for name in spec.invariants}
    key_paths |= {start_is_defined(run): ("runs", run, "initial") for run in spec.runs}
    return key_paths.get(statement.name, _PLACES.get(group.partition(" (")[0], ("poisson",)))


def located(error: SpecError, spec: Spec) -> SpecError:
    """Return the error with the line of the spec added to each diagnostic that lacks it."""
    lines = spec.source.split("\n")

    def shown(d: Diagnostic) -> Diagnostic:
        if d.source_line or not d.location or d.location.line > len(lines):
            return d
        return replace(d, source_line=lines[d.location.line - 1])

    return type(error)([shown(d) for d in error.diagnostics])
