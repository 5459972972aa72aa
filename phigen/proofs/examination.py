"""Everything phigen proves about one spec, in groups; what is refuted, and where the spec says it."""

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

#: What rests on π: if that is no Poisson tensor, all of it may fail, and says nothing more.
UNEXAMINED = "Casimirs, invariants, the method"

#: Where a spec says what a group of statements is about.
_PLACES = {METHOD: ("birealisation",), MONITOR: ("monitor",), SPLITTING: ("scheme",), ATTITUDE: ("reconstruct",)}
_PLACES |= {DAMPING: ("damping",), GAUSS: ("scheme",)}


@dataclass(frozen=True)
class Examination:
    """What was proved about a spec.

    ``compilation`` is None if there is none: ``obstacle`` then says why. An obstacle is no refutation: no
    bi-realisation of the catalogue may apply to a perfectly good Poisson tensor. ``unexamined`` names what rests on
    something refuted, and would only repeat that; it is empty if everything was examined.
    """

    spec: Spec
    groups: Groups
    compilation: Compilation | None = None
    obstacle: SpecError | None = None
    unexamined: str = ""

    @property
    def statements(self) -> list[Statement]:
        """All statements, in order."""
        return [s for group in self.groups.values() for s in group]

    @property
    def refuted(self) -> list[Statement]:
        """The statements that are false."""
        return refuted(self.groups)

    @property
    def mistakes(self) -> list[tuple[str, Statement]]:
        """The statements that are false with their groups, without those that may follow from one before.

        Casimirs and invariants stand for themselves. The axioms of a bi-realisation, and the flows of a splitting, are
        about the same few formulas: the first that fails says what is wrong.
        """
        found = []
        for group, listed in self.groups.items():
            refuted = [(group, s) for s in listed if s.verdict == REFUTED]
            found += refuted if group in (DEFINEDNESS, CASIMIRS, INVARIANTS) else refuted[:1]
        return found


def refuted(groups: Groups) -> list[Statement]:
    """The statements that are false."""
    return [s for group in groups.values() for s in group if s.verdict == REFUTED]


def refutation(found: Examination) -> str:
    """What is refuted, for a message, each with its place in the spec."""
    rest = f"not examined, since they rest on it: {found.unexamined}" if found.unexamined else ""
    return "\n".join(
        str(found.spec.diagnostic(_place(found.spec, group, s), str(s), hint_of(found.spec, group) or rest))
        for group, s in found.mistakes
    )


def hint_of(spec: Spec, group: str) -> str:
    """What is often the cause where a statement of a group is false, or nothing.

    Of Casimirs it is that coordinates are in another order than the basis of the algebra that is named.
    """
    form = spec.poisson
    if group == DAMPING:
        return "what adds energy is a force: forces: {covector: …}, or {vector: …}"
    if group != CASIMIRS or not isinstance(form, LieAlgebraForm) or not form.family:
        return ""
    return (
        f"coordinates stand for the basis of {form.family}({form.size}) in its order; phigen show prints their brackets"
    )


def doubts(found: Examination) -> list[Diagnostic]:
    """Warnings of what seems to have no value anywhere, or where a run starts, each with its place in the spec."""
    listed = [
        found.spec.diagnostic(_place(found.spec, DEFINEDNESS, s), str(s)) for s in found.groups.get(DEFINEDNESS, ())
    ]
    return [replace(d, severity="warning") for d in listed]


def _place(spec: Spec, group: str, statement: Statement) -> tuple[str, ...]:
    """The path of keys to what a statement is about."""
    places: dict[str, tuple[str, ...]] = {f"{name} is a Casimir": ("casimirs", name) for name in spec.casimirs}
    places |= {f"{name} is invariant": ("invariants", name) for name in spec.invariants}
    places |= {"H is defined": ("hamiltonian",), "the density of a pair is symmetric": ("hamiltonian", "pairs")}
    places |= {f"{name} is defined": ("casimirs", name) for name in spec.casimirs}
    places |= {f"{name} is defined": ("invariants", name) for name in spec.invariants}
    places |= {start_is_defined(run): ("runs", run, "initial") for run in spec.runs}
    return places.get(statement.name, _PLACES.get(group.partition(" (")[0], ("poisson",)))


def located(error: SpecError, spec: Spec) -> SpecError:
    """The error with the line of the spec that each diagnostic is about."""
    lines = spec.source.split("\n")

    def shown(d: Diagnostic) -> Diagnostic:
        if d.source_line or not d.location or d.location.line > len(lines):
            return d
        return replace(d, source_line=lines[d.location.line - 1])

    return type(error)([shown(d) for d in error.diagnostics])
