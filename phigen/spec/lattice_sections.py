"""The parts of a spec that only lattices have: relations of sites, densities, brackets along bonds, runs."""

# `return reader.error(…)` reports an error and returns None, which stands for a value that could not be read.
# mypy: disable-error-code="func-returns-value"

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from typing import Any

from phigen.spec import limits
from phigen.spec.declarations import Declarations, Raw
from phigen.spec.grammar import AllowedNames
from phigen.spec.indices import Indices
from phigen.spec.model import Lattice, LatticeRunSettings, Values
from phigen.spec.problems import counted, shown
from phigen.spec.spectra import correlation_of, spectrum_of
from phigen.spec.values import values
from phigen.spec.yaml_source import Scalar
from phigen.symbolic.expression import ZERO, Expression, symbol, symbols_of

KINDS = ("sites", "sum", "product")
#: Keys under ``hamiltonian:`` for densities that depend on two sites. Each key requires a relation between the sites.
COUPLINGS = {"bonds": "graph", "pairs": "pairs"}
_WANTED = {"graph": "lattice: {graph: NAME}", "pairs": "lattice: {pairs: all}"}


def densities(raw: Any, declared: Declarations) -> tuple[Expression, Expression]:
    """Return two densities of H: that of a site, and that of a bond or pair. A density that the spec lacks is 0.

    ``raw`` is the value of ``hamiltonian:``, an expression or a mapping. H is the sum of the first density over all
    sites plus the sum of the second one over all bonds or pairs.
    """
    if not isinstance(raw, dict):
        return declared.formula(raw, declared.dated_scope()) or ZERO, ZERO
    sites, coupling = declared.formula(raw.get("sites"), declared.dated_scope()), ZERO
    for key, relation_needed in COUPLINGS.items():
        node = raw.get(key)
        if node is None:
            continue
        if declared.relation != relation_needed:
            declared.reader.error(
                node,
                f"hamiltonian: {key} needs {_WANTED[relation_needed]}",
                "on a grid, write x[i+1] for x at the next site",
            )
        else:
            coupling = declared.formula(node, declared.bond_scope(dated=True)) or ZERO
    if declared.lattice is None:
        place = declared.reader.locations["hamiltonian",]
        declared.reader.problems.add("hamiltonian: sites, bonds and pairs are for specs with lattice:", place)
    return sites or ZERO, coupling


def casimirs(raw: Mapping[str, Any], declared: Declarations) -> tuple[dict[str, Expression], dict[str, str]]:
    """Return the densities of the Casimirs, and the kinds (``sites``, ``sum``, ``product``) that the spec states."""
    formulas, kinds = {}, {}
    for name, (key, entry) in raw.items():
        options = entry if isinstance(entry, dict) else {"value": entry}
        value = declared.formula(options.get("value"), declared.scope())
        if "at" in options:
            kinds[name] = options["at"]
            if declared.lattice is None:
                declared.reader.error(key, f"{name}: at is for specs with lattice:", f"write {name}: EXPRESSION")
        if value is not None:
            formulas[name] = value
    return formulas, kinds


def with_kinds(lattice: Lattice, casimirs: Mapping[str, Expression], kinds: Mapping[str, str], **parts: Any) -> Lattice:
    """Return the lattice with the kinds of its Casimirs, and with ``parts``: attributes of `Lattice` by name.

    If the spec states no kind, a density that depends on one site only is a Casimir at every site. For any other
    density, the sum over the sites is a Casimir.
    """
    local = {name: "sum" if any("[" in s for s in symbols_of(e)) else "sites" for name, e in casimirs.items()}
    return replace(lattice, kinds={**local, **kinds}, **parts)


#: Keys that runs of lattices do not have, with the hint: the reason, or what to use instead.
_ABSENT_IN_RUNS = {
    "box": "phigen show --expand prints an ordinary spec of a few sites, in which this key is allowed",
    "exact": "phigen show --expand prints an ordinary spec of a few sites, in which this key is allowed",
    "compare": "phigen verify and phigen tune compare the solver of a lattice with classical methods",
    "members": "to integrate many members, each with its own noise, add a sweep under sweeps:",
}


def watched_names(
    declared: Declarations, observables: Mapping[str, Expression], numbers: Collection[str]
) -> AllowedNames:
    """Return the names that ``section`` and ``stop`` of a run may use.

    ``numbers`` are the observables that are one number; on a lattice, other observables have a value at every site.
    """
    if declared.lattice is None:
        return _scope_of_states(declared, observables)
    return _scope_of_numbers(declared, numbers, [name for name in observables if name not in numbers])


def _scope_of_states(declared: Declarations, observables: Mapping[str, Expression]) -> AllowedNames:
    """Return the names that ``section`` and ``stop`` may use without a lattice: all declared names, and observables."""
    scope = declared.dated_scope()
    return replace(scope, names={**observables, **scope.names})


def _scope_of_numbers(declared: Declarations, observables: Iterable[str], fields: Iterable[str]) -> AllowedNames:
    """Return the names that ``section`` and ``stop`` of a lattice may use: quantities that are one number.

    These quantities are ``observables``, parameters with one value, and the time. ``fields`` are the observables with a
    value at each site, which are refused.
    """
    scope = declared.dated_constants("a number of the lattice")
    at_sites = [name for name, parameter in declared.parameters.items() if parameter.at != "all"]
    hint = "declare observables: {{M: {{mean: {}}}}}, and write M in this expression"
    local = [n for n, e in declared.definitions.items() if set(at_sites).intersection(symbols_of(e))]
    several = dict.fromkeys([*declared.coordinates, *fields, *sorted(declared.varying), *at_sites, *local])
    refused = {
        n: (f"{n!r} has a value at each site, but this expression must be one number", hint.format(n)) for n in several
    }
    names = {n: e for n, e in scope.names.items() if n not in refused} | {n: symbol(n) for n in observables}
    indices = Indices(declared.neighbours, {}, refused)
    return replace(scope, names=names, refused={**scope.refused, **refused}, indices=indices)


def run_of_lattice(name: str, raw: Raw, declared: Declarations) -> LatticeRunSettings | None:
    """Return the settings that only runs of lattices have; None for a spec without lattice.

    Without a lattice, these settings are reported as errors. The arrays of parameters are read elsewhere, by
    `phigen.spec.runs`.
    """
    if declared.lattice is None:
        for key in ("sizes", "bonds", "names", "spectrum", "correlation"):
            if key in raw:
                _fail(name, key, f"{key} is for specs with lattice:", declared)
        return None
    for key, hint in _ABSENT_IN_RUNS.items():
        if key in raw:
            _fail(name, key, f"{key} is not available for lattices", declared, hint)
    sizes = _sizes(name, raw, declared)
    return LatticeRunSettings(
        sizes,
        _state(name, raw.get("initial"), declared),
        _bonds(name, raw, declared),
        spectrum=spectrum_of(name, raw, declared),
        correlation=correlation_of(name, raw, sizes, declared),
        names=_names(name, raw, declared),
    )


def _fail(name: str, key: str, message: str, declared: Declarations, hint: str = "") -> None:
    declared.reader.problems.add(message, declared.reader.locations["runs", name, key], hint)


def _sizes(name: str, raw: Raw, declared: Declarations) -> tuple[int, ...]:
    sizes, axes = raw.get("sizes"), declared.lattice.axes if declared.lattice else ()
    number = len(axes) or 1
    if sizes is None:
        if axes and ("runs", name, "sizes") not in declared.reader.locations:
            example = ", ".join(["32"] * number)
            declared.reader.problems.add(
                f"the run {name!r} has no sizes", declared.reader.locations["runs", name], f"sizes: [{example}]"
            )
        return ()
    if len(sizes) != number:
        expected = f"{counted(number, 'axis', 'axes')} {', '.join(axes)}" if axes else "the number of sites"
        _fail(name, "sizes", f"sizes: {counted(len(sizes), 'size')} for {expected}", declared)
    sites = 1
    for size in sizes:
        sites *= size or 1
    if sites > limits.SITES:
        place = declared.reader.locations["runs", name, "sizes"]
        declared.reader.problems.add(f"sizes: {sites} sites, the limit is {limits.SITES}", place, limit=True)
    return tuple(size or 1 for size in sizes)


def _bonds(name: str, raw: Raw, declared: Declarations) -> tuple[tuple[int, int], ...] | str:
    bonds = raw.get("bonds")
    if declared.relation != "graph":
        if bonds is not None:
            _fail(name, "bonds", "bonds are for lattice: {graph: NAME}", declared)
        return ()
    if bonds is None:
        place, hint = declared.reader.locations["runs", name], "bonds: edges.csv, or bonds: [[0, 1], [1, 2]]"
        declared.reader.problems.add(f"the run {name!r} has no bonds", place, hint)
        return ()
    if isinstance(bonds, str):
        if not bonds.endswith(".csv"):
            _fail(name, "bonds", f"bonds: the file {shown(bonds)} must end in .csv", declared)
        return bonds
    pairs = []
    for index, pair in enumerate(bonds):
        if pair is None or None in pair:
            continue
        if len(pair) != 2 or pair[0] == pair[1]:
            message = f"bonds: {pair} is not a bond of two different sites"
            declared.reader.problems.add(message, declared.reader.locations["runs", name, "bonds", index])
        else:
            pairs.append((pair[0], pair[1]))
    return tuple(pairs)


def _names(name: str, raw: Raw, declared: Declarations) -> tuple[str, ...]:
    names = tuple(text for text in raw.get("names") or () if text is not None)
    if names and declared.relation == "grid":
        _fail(
            name,
            "names",
            "names: sites have names only with `lattice: {pairs: all}` or `lattice: {graph: NAME}`",
            declared,
        )
        return ()
    repeated = next((text for k, text in enumerate(names) if text in names[:k]), None)
    if repeated is not None:
        _fail(name, "names", f"names: {shown(repeated)} is given twice", declared)
    return names


def _state(name: str, initial: Any, declared: Declarations) -> dict[str, Values]:
    """Return the initial values by field; one array of all fields together has the name ``""``."""
    fields = declared.coordinates
    if initial is None:
        return {}
    if isinstance(initial, Scalar):
        if not initial.text.endswith(".npy"):
            hint = "initial: {…} by field, or {random: sphere, seed: 1}"
            declared.reader.error(initial, f"initial: the file {shown(initial.text)} must end in .npy", hint)
        return {"": Values(file=initial.text)}
    if isinstance(initial, list):
        if len(initial) != len(fields) and not declared.incomplete:
            _fail(
                name,
                "initial",
                f"initial: {counted(len(initial), 'value')} for {counted(len(fields), 'field')}",
                declared,
            )
        state = {c: values(node, declared) for c, node in zip(fields, initial, strict=False)}
    elif "random" in initial and "random" not in fields:
        return {"": values(initial, declared, whole=True) or Values()}
    else:
        for c, (key, _) in initial.items():
            if c not in fields and not declared.incomplete:
                declared.reader.error(key, f"{shown(c)} is not a coordinate", declared.coordinate_hint(c))
        if missing_fields := [c for c in fields if c not in initial]:
            _fail(name, "initial", f"initial: no value for {', '.join(missing_fields[:10])}", declared)
        state = {c: values(node, declared) for c, (_, node) in initial.items()}
    return {c: v for c, v in state.items() if v is not None}
