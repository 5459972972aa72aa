"""Reader of ``observables:``. On a lattice an observable is a field, or a sum, mean or extreme of a density."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from phigen.spec.declarations import Declarations
from phigen.spec.grammar import AllowedNames
from phigen.spec.model import Reduction
from phigen.spec.names import REDUCTIONS
from phigen.spec.yaml_source import Scalar
from phigen.symbolic.expression import Expression

#: Names of columns that every output may have; observables must have other names.
RECORDED = ("t", "tau", "x", "energy", "state", "attitude", "position")
#: The relation between sites that densities of bonds or of pairs require, and how a spec declares this relation.
_RELATIONS = {"bonds": ("graph", "lattice: {graph: NAME}"), "pairs": ("pairs", "lattice: {pairs: all}")}


def observables(
    raw: Mapping[str, tuple[Scalar, Any]], declared: Declarations, casimirs: Iterable[str]
) -> tuple[dict[str, Expression], dict[str, Reduction]]:
    """Return the expressions of ``observables``, and the reductions of observables of lattices to one number.

    Observables, coordinates and Casimirs are columns of the output. So an observable must not have the name of a
    coordinate or a Casimir.
    """
    used_names = dict.fromkeys(declared.coordinates, "a coordinate") | dict.fromkeys(casimirs, "a Casimir")
    used_names |= {name: "a column of every output" for name in (*RECORDED, declared.time) if name}
    values: dict[str, Expression] = {}
    reductions: dict[str, Reduction] = {}
    for name, (key, entry) in raw.items():
        if name in used_names:
            message = f"observables: {name!r} is the name of {used_names[name]}"
            declared.reader.error(key, message, "choose another name")
        reduction = _reduction(name, entry, declared) if isinstance(entry, dict) else None
        node = entry.get(reduction.kind) if reduction else entry
        value = declared.formula(node, _scope(reduction, declared)) if isinstance(node, Scalar) else None
        if value is not None:
            values[name] = value
            reductions |= {name: reduction} if reduction else {}
    return values, reductions


def _scope(reduction: Reduction | None, declared: Declarations) -> AllowedNames:
    """Return the names that an observable may use. Densities of bonds and pairs may use values at both ends."""
    of_bonds = reduction is not None and reduction.over != "sites"
    scope = declared.bond_scope(dated=True) if of_bonds else declared.dated_scope()
    return replace(scope, piecewise=True)


def _reduction(name: str, entry: Mapping[str, Any], declared: Declarations) -> Reduction | None:
    """Return how the density of an observable is reduced to one number.

    Returns None for an observable without a reduction, and after errors, which are reported.
    """
    kind = next((k for k in REDUCTIONS if entry.get(k) is not None), None)
    if kind is None:
        return None
    domain, add = entry.get("over", "sites"), declared.reader.problems.add
    place = declared.reader.locations["observables", name, kind]
    if declared.lattice is None:
        add(f"observables: the key {kind} is only for specs with lattice:", place, f"write {name}: FORMULA")
        return None
    relation, declaration = _RELATIONS.get(domain, (declared.relation, ""))
    if relation != declared.relation:
        place = declared.reader.locations["observables", name, "over"]
        hint = "on a grid, write x[i+1] for x at the next site" if declared.relation == "grid" else ""
        add(f"observables: over: {domain} needs {declaration}", place, hint)
        return None
    return Reduction(kind, domain)
