"""Reader of whole spec files: a text becomes a `Spec`, or all of its errors are raised."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

from phigen.registry import DEFAULT
from phigen.spec import limits
from phigen.spec.declarations import Declarations, declare
from phigen.spec.fields import SPEC
from phigen.spec.grammar import AllowedNames
from phigen.spec.kinds import Reader
from phigen.spec.lattice_sections import casimirs as read_casimirs
from phigen.spec.lattice_sections import densities, watched_names, with_kinds
from phigen.spec.model import (
    DEFAULT_ORDER,
    NOISY_ORDER,
    BirealisationChoice,
    Extras,
    MatrixForm,
    SolverOptions,
    Spec,
    SpecForces,
    SpecNoise,
)
from phigen.spec.names import COMPOSITIONS, LICENSE_REFERENCE, LICENSES, LOGARITHMIC
from phigen.spec.observables import observables
from phigen.spec.poisson import brackets_of_sites, poisson_form
from phigen.spec.problems import Problems, counted, did_you_mean, shown
from phigen.spec.runs import expect_rows_to_average, run, without_repetition
from phigen.spec.sweeps import sweep
from phigen.spec.taken import objection
from phigen.spec.yaml_source import Scalar, decode, read
from phigen.symbolic.expression import ONE, ZERO, Expression, symbol, symbols_of
from phigen.symbolic.symbols import MATRIX, momentum

#: Options under ``birealisation:``, each with the kinds of bi-realisations that accept it.
OPTIONS = {
    "alpha": ("custom",),
    "beta": ("custom",),
    "side": ("canonical-euler",),
    "spray": ("spray",),
    "degree": ("spray",),
    "tau": ("group-map",),
    "of": ("product", "pullback"),
}


def validate(data: bytes, file: str) -> Spec:
    """Return the spec in the bytes of a file.

    ``file`` is its name in messages. Raises `SpecError` with all errors, in the order of the file. If each of these
    errors is that the file exceeds a limit, the exception is a `LimitError`.
    """
    source = decode(data, file)
    problems = Problems(file, source)
    reader = Reader(problems)
    raw = SPEC.read(read(source, problems), (), reader) or {}
    parts = _parts(raw, declare(raw, reader))
    _expect_consistent(raw, problems, reader)
    problems.finish()
    digest = hashlib.sha256(source.encode()).hexdigest()
    return Spec(**parts, source_sha256=digest, file=file, source=source, locations=reader.locations)


def _parts(raw: Mapping[str, Any], declared: Declarations) -> dict[str, Any]:
    """Return the arguments of `Spec` by name. Values with errors are reported, and replaced by harmless ones.

    ``raw`` is the content of the file by key, and ``declared`` has the names that the file declares.
    """
    references = raw.get("references", ())
    poisson = raw.get("poisson", {})
    hamiltonian, coupling = densities(raw.get("hamiltonian"), declared)
    casimirs, kinds = read_casimirs(raw.get("casimirs", {}), declared)
    brackets = brackets_of_sites(poisson, declared)
    observed, reductions = observables(raw.get("observables", {}), declared, casimirs)
    lattice = declared.lattice and with_kinds(
        declared.lattice, casimirs, kinds, bonds=coupling, brackets=brackets, reductions=reductions
    )
    numbers = [name for name in observed if lattice is None or name in reductions]
    columns = dict.fromkeys([*casimirs, *observed, *declared.coordinates], "has a value at every site")
    if lattice is None:
        columns |= dict.fromkeys(declared.coordinates, "is recorded with the state")
    summed = [name for name in casimirs if lattice is None or lattice.kinds[name] != "sites"]
    # An error in the formula of an observable is reported for the formula only. It is not reported again for runs that
    # record the observable.
    broken = [name for name in raw.get("observables", {}) if name not in observed]
    columns |= dict.fromkeys(["state", "energy", *summed, *numbers, *broken], "")
    watched = watched_names(declared, observed, numbers)
    averaged = [*numbers, *broken]
    listed_runs = {n: r for n, (_, r) in raw.get("runs", {}).items() if r is not None}
    monitored = "monitor" in raw
    runs = {n: run(n, r, declared, columns, watched, averaged, monitored=monitored) for n, r in listed_runs.items()}
    if not monitored:
        for run_ in runs.values():
            expect_rows_to_average(run_, declared)
    inputs = _inputs(raw.get("inputs", ()), declared)
    return {
        "name": _name(raw.get("name"), declared),
        "coordinates": declared.coordinates,
        "poisson": poisson_form(poisson, declared) or _no_brackets(declared),
        "hamiltonian": hamiltonian,
        "time": declared.time,
        "forces": _forces(raw, declared),
        "noise": _noise(raw.get("noise") or {}, declared),
        "parameters": tuple(declared.parameters.values()),
        "inputs": inputs,
        "casimirs": casimirs,
        "invariants": _formulas(raw.get("invariants", {}), declared, declared.dated_scope()),
        "observables": observed,
        "birealisation": _birealisation(raw.get("birealisation", "auto"), declared),
        "order": raw.get("order", None if "terms" in raw else NOISY_ORDER if "noise" in raw else DEFAULT_ORDER),
        "terms": raw.get("terms"),
        "composition": raw.get("composition", "auto"),
        "gauge": _gauge(raw.get("gauge", "auto"), declared),
        "monitor": _monitor(raw.get("monitor"), declared),
        "scheme": raw.get("scheme", "series" if lattice is None else "auto"),
        "structure": raw.get("structure", "exact"),
        "coordinates_from": raw.get("coordinates_from", ""),
        "profile": raw.get("profile", "small" if raw.get("real") == "float" else "fast"),
        "solver": _solver(raw.get("solver", {}), declared),
        "targets": without_repetition(raw.get("targets", DEFAULT), ("targets",), declared),
        "extras": Extras(
            raw.get("tangent", False),
            raw.get("modified_hamiltonian", 0),
            frozenset(without_repetition(raw.get("without", ()), ("without",), declared)),
            raw.get("adjoint", False),
            raw.get("real", "double"),
            frozenset(["parameters"] if inputs else []),
        ),
        "reconstruct": raw.get("reconstruct", ""),
        "runs": runs,
        "sweeps": {
            n: sweep(n, s, runs, declared, numbers, monitored=monitored)
            for n, (_, s) in raw.get("sweeps", {}).items()
            if s is not None
        },
        "lattice": lattice,
        "title": raw.get("title", ""),
        "description": raw.get("description", ""),
        "references": (references,) if isinstance(references, str) else tuple(r for r in references if r),
        "license": _license(raw.get("license", "0BSD"), declared),
    }


#: Keys of the Hamilton–Jacobi series, each with the values that request nothing. Schemes without a series refuse all
#: other values of these keys.
SERIES_KEYS: Mapping[str, tuple[object, ...]] = {"terms": (), "birealisation": ("auto",), "modified_hamiltonian": (0,)}
#: Schemes that do not use the Hamilton–Jacobi series. For messages, each has a sentence on what the scheme uses
#: instead.
WITHOUT_SERIES = {
    "splitting": "scheme: splitting follows exact flows of parts of H",
    "gauss": "scheme: gauss solves for the stages of a collocation method",
}


#: Keys that are refused for lattices. Each key has the values that are allowed nevertheless, and a hint.
NOT_OF_LATTICES: Mapping[str, tuple[tuple[object, ...], str]] = {
    "reconstruct": ((), "phigen show --expand prints an ordinary spec of a few sites, where it is allowed"),
    "terms": ((), "remove terms; on lattices, order: determines the method"),
    "gauge": (("auto", "none"), "remove gauge: lattices have none"),
    "modified_hamiltonian": ((0,), "phigen show --expand prints an ordinary spec of a few sites, where it is allowed"),
}


#: Keys that are refused with noise. Each key has the values that are allowed nevertheless, the reason, and a hint.
NOT_WITH_NOISE: Mapping[str, tuple[tuple[object, ...], str, str]] = {
    "monitor": (
        (),
        "noise changes H, so the energy level e = -H(x0) would not be constant",
        "remove monitor; then all steps have the same size in time",
    ),
    "composition": (
        ("auto", "none"),
        "stages with negative steps would have to undo random increments",
        "composition: none; with scheme: splitting, all noise comes before and after the composition of the flows of H",
    ),
    "modified_hamiltonian": ((0,), "each step has a Hamiltonian of its own", ""),
    "terms": ((), "with noise, order: determines the method", "order: 2"),
    "adjoint": ((False,), "gradients of steps with noise are not available", ""),
}
#: Keys that a run with noise must not have, and keys that only a run with noise may have.
NOT_IN_NOISY_RUNS, IN_NOISY_RUNS = ("exact", "compare", "section", "stop", "every", "at"), ("seed", "members")


def _expect_consistent(raw: Mapping[str, Any], problems: Problems, reader: Reader) -> None:
    _expect_consistent_with_noise(raw, problems, reader)
    for name, (_, run_) in raw.get("runs", {}).items() if not raw.get("observables") else ():
        if run_ and "average" in run_:
            hint = "declare what is averaged as observables: {NAME: formula}"
            problems.add("average: the spec has no observables", reader.locations["runs", name, "average"], hint)
    for key, (harmless, hint) in NOT_OF_LATTICES.items() if raw.get("lattice") is not None else ():
        if raw.get(key) is not None and raw[key] not in harmless:
            problems.add(f"{key}: not available for lattices", reader.locations[key,], hint)
    if raw.get("real") == "float" and raw.get("profile") == "fast":
        problems.add(
            "profile: `fast` is not available with `real: float`", reader.locations["profile",], "remove profile"
        )
    if raw.get("structure") is not None and raw.get("scheme") != "gauss":
        message = "structure belongs to scheme: gauss; other schemes are exact Poisson maps"
        problems.add(message, reader.locations["structure",], "remove structure, or set scheme: gauss")
    if raw.get("coordinates_from") is not None and raw.get("scheme") != "splitting":
        message = "coordinates_from belongs to scheme: splitting, whose parts are motions in these coordinates"
        problems.add(
            message, reader.locations["coordinates_from",], "set scheme: splitting, or remove coordinates_from"
        )
    how = WITHOUT_SERIES.get(raw.get("scheme", ""))
    if how is None:
        return
    for key, harmless in SERIES_KEYS.items():
        if key in raw and raw[key] is not None and raw[key] not in harmless:
            message = f"{key} belongs to scheme: series; {how}"
            problems.add(message, reader.locations[key,], f"remove {key}, or remove scheme:")
    solver = raw.get("solver") or {}
    for key in ("tolerance", "max_iterations") if raw["scheme"] == "splitting" and not raw.get("lattice") else ():
        if getattr(solver.get(key), "text", solver.get(key)) not in (None, "auto"):
            message = f"solver: {key} belongs to steps that solve equations; {how}"
            problems.add(message, reader.locations["solver", key], f"remove {key}, or remove scheme:")


def _expect_consistent_with_noise(raw: Mapping[str, Any], problems: Problems, reader: Reader) -> None:
    noisy = "noise" in raw
    if noisy:
        for key, (harmless, reason, hint) in NOT_WITH_NOISE.items():
            harmless = COMPOSITIONS if key == "composition" and raw.get("scheme") == "splitting" else harmless
            if raw.get(key) is not None and raw[key] not in harmless:
                problems.add(f"{key}: not with noise: {reason}", reader.locations[key,], hint)
    for name, (_, run_) in raw.get("runs", {}).items():
        for key in NOT_IN_NOISY_RUNS if noisy else IN_NOISY_RUNS:
            if run_ and key in run_:
                message = f"{key}: not available with noise" if noisy else f"{key}: this system has no noise"
                hint = "" if noisy else "noise: {NAME: {hamiltonian: g, amplitude: sigma}} declares it"
                problems.add(message, reader.locations["runs", name, key], hint)


def _no_brackets(declared: Declarations) -> MatrixForm:
    """Return the zero matrix.

    The zero matrix is π of a site if all brackets of a lattice are along bonds. It also replaces a π with errors.
    """
    n = len(declared.coordinates)
    return MatrixForm(((ZERO,) * n,) * n)


def _name(node: Scalar | None, declared: Declarations) -> str:
    if node is None:
        return ""
    refused = objection(node.text)
    if refused:
        declared.reader.error(node, *refused)
    return node.text


def _formulas(
    raw: Mapping[str, tuple[Scalar, Scalar | None]], declared: Declarations, scope: AllowedNames | None = None
) -> dict[str, Expression]:
    scope = scope or declared.scope()
    values = {name: declared.formula(node, scope) for name, (_, node) in raw.items()}
    return {name: value for name, value in values.items() if value is not None}


def _inputs(nodes: Sequence[Scalar | None], declared: Declarations) -> tuple[str, ...]:
    """Return the names under ``inputs``; report names that are repeated or are not parameters with one value."""
    names: list[str] = []
    for node in filter(None, nodes):
        parameter = declared.parameters.get(node.text)
        if parameter is None:
            hint = did_you_mean(node.text, declared.parameters) or "write names of parameters"
            declared.reader.error(node, f"inputs: {node.text!r} is not a parameter", hint)
        elif parameter.at != "all":
            declared.reader.error(node, f"inputs: {node.text!r} has a value at each of the {parameter.at}, not one")
        elif node.text in names:
            declared.reader.error(node, f"inputs: {node.text!r} is given twice")
        else:
            names.append(node.text)
    return tuple(names)


def _forces(raw: Mapping[str, Any], declared: Declarations) -> SpecForces:
    """Return the forces under ``forces``, by coordinate, and the coefficient under ``damping``."""
    entries_of_kinds, damping = raw.get("forces") or {}, raw.get("damping")
    forces: dict[str, dict[str, Expression]] = {}
    for kind in ("covector", "vector"):
        entries = entries_of_kinds.get(kind) or {}
        for name, (key, _) in entries.items():
            if name not in declared.coordinates and not declared.incomplete:
                message = f"forces: {name!r} is not a coordinate"
                declared.reader.error(key, message, declared.coordinate_hint(name))
        forces[kind] = _formulas(entries, declared, declared.dated_scope())
    return SpecForces(forces["covector"], forces["vector"], declared.formula(damping, declared.dated_scope()))


def _noise(raw: Mapping[str, tuple[Scalar, Any]], declared: Declarations) -> dict[str, SpecNoise]:
    """Return the sources of noise by name, each with a Hamiltonian g and an amplitude σ.

    The amplitude must not depend on coordinates, so that σ∇g is the gradient of a function.
    """
    scope, sources = declared.dated_constants("an amplitude"), {}
    if len(raw) > limits.SOURCES:
        message = f"noise: {len(raw)} sources, the limit is {limits.SOURCES}"
        declared.reader.problems.add(message, declared.reader.locations["noise",], limit=True)
    for name, (_, source) in raw.items():
        node = (source or {}).get("amplitude")
        hamiltonian = declared.formula((source or {}).get("hamiltonian"), declared.dated_scope())
        amplitude = ONE if node is None else declared.formula(node, scope)
        if hamiltonian is not None and amplitude is not None:
            sources[name] = SpecNoise(hamiltonian, amplitude)
    return sources


def _gauge(
    raw: str | Mapping[str, tuple[Scalar, Scalar | None]], declared: Declarations
) -> str | dict[str, Expression]:
    """Return the value of ``gauge``: auto, none, or a multiple for each named Casimir. The multiples are subtracted
    from H.

    The multiples must be constant along trajectories, so those that depend on coordinates are reported.
    """
    if isinstance(raw, str):
        return raw
    values = _formulas(raw, declared)
    for name, value in values.items():
        moving = [s for s in symbols_of(value) if s in declared.coordinates]
        if moving:
            place = declared.reader.locations["gauge", name]
            message = f"gauge: the multiple of {name} must not depend on coordinates, and {moving[0]} is one"
            declared.reader.problems.add(message, place, "use only numbers and parameters")
    return values


def _monitor(node: Scalar | None, declared: Declarations) -> str | Expression | None:
    """Return the monitor: the word log, the factor g(x) of dt = g dτ for steps in the time τ, or None."""
    if node is None:
        return None
    if node.text == LOGARITHMIC:
        return LOGARITHMIC
    return declared.formula(node, declared.scope())


def _license(expression: str, declared: Declarations) -> str:
    for part in expression.replace(" AND ", " OR ").split(" OR "):
        if part not in LICENSES and not LICENSE_REFERENCE.fullmatch(part):
            hint = did_you_mean(part, LICENSES) or "write any other licence as LicenseRef-NAME"
            message = f"license: {shown(part)} is not an SPDX identifier that phigen knows"
            declared.reader.problems.add(message, declared.reader.locations["license",], hint)
    return expression


def _birealisation(raw: str | Mapping[str, Any], declared: Declarations) -> BirealisationChoice:
    options = {"kind": raw} if isinstance(raw, str) else raw
    kind = options.get("kind", "")
    for key, owners in OPTIONS.items():
        location = declared.reader.locations.get(("birealisation", key))
        if key in options and kind and kind not in owners and location is not None:
            owner = f"kind{'s' if len(owners) > 1 else ''} {' and '.join(owners)}"
            declared.reader.problems.add(f"birealisation: {key} belongs to the {owner}, not {kind}", location)
    if kind == "custom":
        return _custom(options, declared)
    if kind == "spray":
        return _spray(options, declared)
    if kind == "group-map":
        return _group_map(options, declared)
    return BirealisationChoice(kind=kind, side=options.get("side", "q"), of=options.get("of", "auto"))


def _group_map(options: Mapping[str, Any], declared: Declarations) -> BirealisationChoice:
    tau = options.get("tau")
    if tau is None:
        place, hint = declared.reader.locations["birealisation",], "{kind: group-map, tau: (1 + P/2)/(1 - P/2)}"
        declared.reader.problems.add("birealisation: the kind group-map needs tau", place, hint)
        return BirealisationChoice(kind="group-map")
    if isinstance(tau, Scalar):
        scope = declared.constants("tau, a function of the matrix P,", {"P": symbol(MATRIX)})
        if "P" in declared.nodes:
            message = "the name 'P' means the matrix Σ p_i E_i in tau"
            declared.reader.error(
                declared.nodes["P"], message, "choose another name, or write tau as a matrix of entries"
            )
        return BirealisationChoice(kind="group-map", tau=declared.formula(tau, scope) or ZERO)
    momenta = _momenta(declared, "tau")
    scope = declared.constants("tau, a function of the momenta p_NAME,", momenta)
    rows = tuple(tuple(declared.formula(cell, scope) or ZERO for cell in row or ()) for row in tau)
    return BirealisationChoice(kind="group-map", tau=rows)


def _custom(options: Mapping[str, Any], declared: Declarations) -> BirealisationChoice:
    for key in ("alpha", "beta"):
        if key not in options:
            place, hint = declared.reader.locations["birealisation",], "{kind: custom, alpha: […], beta: […]}"
            declared.reader.problems.add(f"birealisation: the kind custom needs {key}", place, hint)
    halves = _on_covectors(
        {key: options.get(key, ()) for key in ("alpha", "beta")}, "a custom bi-realisation", declared
    )
    return BirealisationChoice(kind="custom", alpha=halves["alpha"], beta=halves["beta"])


def _spray(options: Mapping[str, Any], declared: Declarations) -> BirealisationChoice:
    spray = options.get("spray", "auto")
    if not isinstance(spray, str):
        spray = _on_covectors({"spray": spray}, "a spray", declared)["spray"]
    return BirealisationChoice(kind="spray", spray=spray, degree=options.get("degree"))


def _on_covectors(
    lists: Mapping[str, Sequence[Scalar | None]], where: str, declared: Declarations
) -> dict[str, tuple[Expression, ...]]:
    """Return the expressions in the ``lists`` of a bi-realisation, such as the list under ``alpha``, by key.

    Each list has one expression for each coordinate. The expressions may use the coordinates and the momenta
    ``p_NAME``. ``where`` is the name of the bi-realisation in messages.
    """
    n, scope, expressions = len(declared.coordinates), declared.scope(_momenta(declared, where)), {}
    for key, nodes in lists.items():
        place = declared.reader.locations.get(("birealisation", key))
        if len(nodes) != n and place is not None and not declared.incomplete:
            message = f"birealisation: {key} has {counted(len(nodes), 'expression')} for {counted(n, 'coordinate')}"
            declared.reader.problems.add(message, place)
        expressions[key] = tuple(declared.formula(node, scope) or ZERO for node in nodes)
    return expressions


def _momenta(declared: Declarations, where: str) -> dict[str, Expression]:
    """Return the names ``p_NAME`` of momenta with their symbols. If the spec already uses one of these names, an error
    is reported.
    """
    momenta = {f"p_{c}": symbol(momentum(c)) for c in declared.coordinates}
    for name in [c for c in momenta if c in declared.nodes]:
        message = f"the name {name!r} means the momentum of {name[2:]!r} in {where}"
        declared.reader.error(declared.nodes[name], message, "choose another name")
    return momenta


def _solver(raw: Mapping[str, Any], declared: Declarations) -> SolverOptions:
    node = raw.get("tolerance")
    tolerance: Fraction | None = None
    if node is not None and node.text != "auto":
        tolerance = declared.number(node, declared.numbers())
        if tolerance is not None and not 0 < tolerance < 1:
            declared.reader.error(node, f"tolerance: {node.text} is not between 0 and 1")
    return SolverOptions(
        raw.get("method", "auto"),
        tolerance,
        raw.get("max_iterations", 20),
        raw.get("lanes", True),
        raw.get("compensated", False),
    )
