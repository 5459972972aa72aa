"""Reader of the runs of a spec: initial state, step, length, stored rows, and what is computed from the rows."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from phigen.spec import limits
from phigen.spec.declarations import Declarations
from phigen.spec.grammar import AllowedNames
from phigen.spec.lattice_sections import run_of_lattice
from phigen.spec.model import AverageChoice, Run, Values
from phigen.spec.problems import counted, did_you_mean, one_of, shown
from phigen.spec.values import values as site_values
from phigen.spec.yaml_source import Scalar
from phigen.symbolic.expression import Expression, substitute, symbol, symbols_of
from phigen.symbolic.symbols import ELAPSED, initial

#: Words that users may write as a step because they expect an adaptive step size, which phigen does not have.
_ADAPTING = ("auto", "adaptive", "variable")
#: A ratio of times counts as an integer if it differs from the integer by at most this fraction, because users write
#: rounded decimals.
NEAR_INTEGER = Fraction(1, 10**9)


def run(
    name: str,
    raw: Mapping[str, Any],
    declared: Declarations,
    recordable: Mapping[str, str],
    watched: AllowedNames,
    averaged: Collection[str],
    *,
    monitored: bool,
) -> Run:
    """Return the run with this name. Errors are reported; values with errors are then replaced by harmless ones.

    ``recordable`` maps the names that ``record`` may contain to "", and other names to the reason why they are refused.
    ``section`` and ``stop`` may use the names in ``watched``, ``average`` those in ``averaged``. If ``monitored``,
    steps are unequal in time, so that the number of steps and the time at the end are not known in advance.
    """
    numbers = declared.numbers()
    step_node = raw.get("step")
    if step_node is not None and step_node.text in _ADAPTING and step_node.text not in numbers.names:
        hint = "write a number, since the step size is fixed; the key monitor: of the spec adapts steps to the motion"
        _fail(name, "step", f"step: {step_node.text} is not a number", declared, hint)
        step_node = None
    step = declared.number(step_node, numbers)
    if step == 0:
        _fail(name, "step", "the step is 0", declared)
        step = None
    start = _start(name, raw.get("start"), declared)
    until = declared.number(raw.get("until"), numbers)
    steps = _steps_until(name, raw, until - start, step, declared) if until is not None else None
    duration = declared.number(raw.get("duration"), numbers)
    steps = steps if until is not None else _steps(name, raw, duration, step, declared)
    interval = declared.number(raw.get("every"), numbers)
    if interval is not None and interval <= 0:
        _fail(name, "every", f"every: {raw['every'].text} is not positive", declared)
    elif interval is not None and "stride" in raw:
        _fail(name, "every", "every: and stride: exclude each other", declared, "give only one of them")
    end = until if until is not None else start + step * steps if step and steps and not monitored else None
    row_times = _row_times(name, raw, start, end, step, declared)
    if "direction" in raw and "section" not in raw:
        example = "x1" if declared.lattice is None else "M"
        hint = f"section: {example}, for example, records where {example} passes through 0"
        _fail(name, "direction", "direction: the run has no section", declared, hint)
    stride = raw.get("stride", 1)
    if steps is not None and stride > max(steps, 1) and not (monitored and until is not None):
        _fail(name, "stride", f"the stride {stride} is longer than the run of {steps} steps", declared)
    lattice = run_of_lattice(name, raw, declared)
    numbers_of, arrays = _overrides(raw.get("parameters", {}), declared)
    return Run(
        name=name,
        initial=() if lattice else _initial(name, raw.get("initial"), declared),
        step=step or Fraction(1),
        steps=steps or 1,
        stride=stride,
        parameters=numbers_of,
        seed=raw.get("seed", 0),
        members=raw.get("members", 1),
        start=start,
        exact=_exact(raw.get("exact", {}), declared),
        compare=without_repetition(raw.get("compare", ()), ("runs", name, "compare"), declared),
        section=crossed(name, "section", raw, declared, watched),
        direction=raw.get("direction") or "rising",
        duration=duration,
        until=until,
        every=interval,
        at=row_times,
        stop=crossed(name, "stop", raw, declared, replace(watched, piecewise=True)),
        average=_average(name, raw.get("average"), declared, averaged),
        record=_recorded(name, raw.get("record"), declared, recordable),
        box=_box(raw.get("box", {}), declared),
        description=raw.get("description", ""),
        lattice=replace(lattice, arrays=arrays) if lattice else None,
    )


def _box(
    raw: Mapping[str, tuple[Scalar, Sequence[Scalar | None] | None]], declared: Declarations
) -> dict[str, tuple[Fraction, Fraction]]:
    """Return the ranges (lowest, highest value) of coordinates under ``box``."""
    box = {}
    for name, (key, nodes) in raw.items():
        if not nodes:
            continue  # The error was reported when the list was read.
        bounds = [declared.number(node, declared.numbers()) for node in nodes]
        is_coordinate = declared.coordinate(key) is not None
        if len(bounds) != 2 or None in bounds or bounds[0] > bounds[1]:  # type: ignore[operator]
            if None not in bounds:
                texts = ", ".join(node.text for node in nodes if node is not None)
                message = f"box: [{texts}] is not [LOW, HIGH], two numbers in this order"
                declared.reader.error(nodes[0] or key, message, f"{name}: [-1, 1]")
        elif is_coordinate:
            box[name] = (bounds[0], bounds[1])
    return box  # type: ignore[return-value]


def _row_times(
    name: str,
    raw: Mapping[str, Any],
    start: Fraction,
    end: Fraction | None,
    step: Fraction | None,
    declared: Declarations,
) -> tuple[Fraction, ...]:
    """Return the times in the key ``at`` of a run, in the order of the run, without repetitions.

    If the end of the run is known, times outside the run are reported as errors.
    """
    nodes = raw.get("at") or ()
    if nodes and (conflicting_key := next((key for key in ("every", "stride") if key in raw), None)):
        _fail(name, "at", f"at: and {conflicting_key}: exclude each other", declared, "give only one of them")
    times = []
    for node in nodes:
        time = declared.number(node, declared.numbers())
        if time is None or node is None:
            continue
        if end is not None and not min(start, end) <= time <= max(start, end):
            span = f"between {float(start):.9g} and {float(end):.9g}"
            declared.reader.error(node, f"at: {node.text} is not {span}, the start and the end of the run")
        times.append(time)
    return tuple(sorted(set(times), reverse=step is not None and step < 0))


def _fail(name: str, key: str, message: str, declared: Declarations, hint: str = "") -> None:
    declared.reader.problems.add(message, declared.reader.locations["runs", name, key], hint)


def _recorded(
    name: str, nodes: Sequence[Scalar | None] | None, declared: Declarations, recordable: Mapping[str, str]
) -> tuple[str, ...]:
    """Return the names of columns under ``record`` of the run ``name``; report names that are refused.

    ``recordable`` maps column names to "", and other names to the reason why they are refused.
    """
    columns_asked: list[str | None] = []
    for node in nodes or ():
        word = node.text if node is not None else None
        if node is not None and recordable.get(node.text, "?"):
            recordable_columns = [column for column, reason in recordable.items() if not reason]
            reason = recordable.get(node.text) or "is no column of the output"
            hint = (
                "state records all fields" if node.text in recordable else did_you_mean(node.text, recordable_columns)
            )
            declared.reader.error(node, f"record: {shown(node.text)} {reason}", hint or one_of(recordable_columns))
            word = None
        columns_asked.append(word)
    return without_repetition(columns_asked, ("runs", name, "record"), declared)


def _average(
    name: str, raw: Mapping[str, Any] | None, declared: Declarations, averaged: Collection[str]
) -> AverageChoice:
    """Return the setting ``average`` of the run ``name``. Only the observables in ``averaged`` may be averaged."""
    if raw is None:
        return AverageChoice()
    selected = without_repetition(
        [node and node.text for node in raw.get("of", ())], ("runs", name, "average", "of"), declared
    )
    for node in raw.get("of", ()):
        if node is not None and node.text not in averaged and not declared.incomplete:
            hint = did_you_mean(node.text, averaged) or f"observables that are one number: {', '.join(averaged)}"
            declared.reader.error(node, f"average: of: {shown(node.text)} is no observable that is one number", hint)
    return AverageChoice(declared.number(raw.get("after"), declared.numbers()), raw.get("blocks"), selected)


def expect_rows_to_average(run_: Run, declared: Declarations) -> None:
    """Report an average that begins after the end of a run.

    Call this function only without a monitor. With a monitor, the time of the end is not known in advance.
    """
    start_time, end = run_.average.after, run_.until
    end = run_.start + run_.step * run_.steps if end is None else end
    if start_time is not None and (end - start_time) * run_.step < 0:
        place = declared.reader.locations["runs", run_.name, "average", "after"]
        message = f"average: `after: {float(start_time):.9g}` is not before the end of the run, t = {float(end):.9g}"
        declared.reader.problems.add(message, place, "give an earlier time; the rows from this time on are averaged")


def crossed(
    name: str, key: str, raw: Mapping[str, Any], declared: Declarations, scope: AllowedNames
) -> Expression | None:
    """Return the expression under ``key``, which is ``section`` or ``stop``; report one that is constant.

    During the run, phigen finds zeros of the expression. ``scope`` has the names that the expression may use.
    """
    section = declared.formula(raw.get(key), scope)
    constant = {n for n, p in declared.parameters.items() if p.at == "all"}
    if section is not None and not declared.incomplete and constant.issuperset(symbols_of(section)):
        required = "a coordinate" if declared.lattice is None else "an observable"
        _fail(name, key, f"{key}: {shown(raw[key].text)} depends neither on {required} nor on the time", declared)
    return section


def _start(name: str, node: Scalar | None, declared: Declarations) -> Fraction:
    if node is not None and not declared.time:
        _fail(
            name,
            "start",
            "start: this system does not depend on the time",
            declared,
            "add `time: t` to the spec, where t is the name of the time in your formulas",
        )
    return declared.number(node, declared.numbers()) or Fraction(0)


def _steps(
    name: str, raw: Mapping[str, Any], duration: Fraction | None, step: Fraction | None, declared: Declarations
) -> int | None:
    if "duration" not in raw:
        return raw.get("steps")
    if duration is None or step is None:
        return None
    ratio, span_text = (
        duration / step,
        f"{raw['duration'].text} is {float(duration / step):.9g} steps of {raw['step'].text}",
    )
    steps = round(ratio)
    if whole(ratio) is None:
        _fail(
            name,
            "duration",
            f"the duration {span_text}, not a whole number",
            declared,
            f"write steps: {max(1, steps)} in place of duration, or a multiple of the step",
        )
    elif steps < 1:
        hint = "with a negative step the duration must be negative" if step < 0 else "the duration must be positive"
        _fail(name, "duration", f"the duration {span_text}", declared, hint)
    elif steps > limits.STEPS:
        location = declared.reader.locations["runs", name, "duration"]
        message = f"the duration {span_text}, more than the limit of {limits.STEPS}"
        declared.reader.problems.add(message, location, limit=True)
    else:
        return steps
    return None


def _steps_until(
    name: str, raw: Mapping[str, Any], span: Fraction, step: Fraction | None, declared: Declarations
) -> int | None:
    """Return the number of whole steps in the time ``span`` from the start to ``until``, at least 1.

    Returns None after errors, which are reported. With a monitor the steps are unequal in time, so the number is only
    an estimate.
    """
    if step is None:
        return None
    ratio = span / step
    if ratio <= 0:
        _fail(name, "until", f"until: {raw['until'].text} is never reached by steps of {raw['step'].text}", declared)
    elif ratio > limits.STEPS:
        location = declared.reader.locations["runs", name, "until"]
        message = f"until: {float(ratio):.9g} steps, more than the limit of {limits.STEPS}"
        declared.reader.problems.add(message, location, limit=True)
    else:
        return max(1, whole(ratio) or int(ratio))
    return None


def whole(ratio: Fraction) -> int | None:
    """Return the ratio of two times as an integer, such as a number of steps; None if it is not an integer.

    A relative distance of `NEAR_INTEGER` from the integer is allowed, because decimals are rounded.
    """
    steps = round(ratio)
    return steps if abs(ratio - steps) <= NEAR_INTEGER * abs(ratio) else None


def with_step(run: Run, step: Fraction, *, parts: bool = False) -> Run:
    """Return the run with another step, which may be negative.

    A run that states ``until`` or ``duration`` keeps it. Other runs keep the number of their steps. If the step does
    not divide the duration, the last step is shorter if ``parts`` is true; otherwise `ValueError` is raised.
    """
    if run.until is not None:
        ratio = (run.until - run.start) / step
        return replace(run, step=step, steps=max(1, whole(ratio) or int(ratio)))
    if run.duration is None:
        return replace(run, step=step)
    span = abs(run.duration) * (1 if step > 0 else -1)
    if (steps := whole(span / step)) is not None:
        return replace(run, step=step, steps=steps, stride=min(run.stride, steps))
    if not parts:
        count = f"it is {float(span / step):.9g} steps"
        raise ValueError(
            f"the duration {float(span):.9g} is not a whole number of steps of {float(step):.9g} ({count})"
        )
    return replace(run, step=step, steps=max(1, int(span / step)), until=run.start + span)


def _initial(name: str, raw: Any, declared: Declarations) -> tuple[Fraction, ...]:
    n, scope = len(declared.coordinates), declared.numbers()
    if isinstance(raw, Scalar):
        declared.reader.error(raw, "initial: expected a list or a mapping", "[0.1, 1], or {x1: 0.1, x2: 1}")
        return ()
    if isinstance(raw, dict):
        values = {k: (declared.coordinate(key), _single(node, scope, key, declared)) for k, (key, node) in raw.items()}
        missing_names = [c for c in declared.coordinates if c not in values]
        if missing_names:
            _fail(name, "initial", f"initial: no value for {', '.join(missing_names[:10])}", declared)
        return tuple(values[c][1] or Fraction(0) for c in declared.coordinates if c in values)
    if raw is None:
        return ()
    if len(raw) != n and not declared.incomplete:
        _fail(name, "initial", f"initial: {counted(len(raw), 'value')} for {counted(n, 'coordinate')}", declared)
    return tuple(declared.number(node, scope) or Fraction(0) for node in raw)


def _single(node: Any, scope: AllowedNames, key: Scalar, declared: Declarations) -> Fraction | None:
    """Return the value of a node that must be one number; report a list or a mapping, which only lattices allow."""
    if node is None or isinstance(node, Scalar):
        return declared.number(node, scope)
    form = "a list" if isinstance(node, list) else "a mapping"
    declared.reader.error(key, f"{key.text}: expected a number, found {form}")
    return None


def _overrides(
    raw: Mapping[str, tuple[Scalar, Any]], declared: Declarations
) -> tuple[dict[str, Fraction], dict[str, Values]]:
    """Return the values of parameters under ``parameters`` of a run: numbers, and arrays over sites or bonds."""
    values: dict[str, Fraction] = {}
    arrays: dict[str, Values] = {}
    for name, (key, node) in raw.items():
        parameter = declared.parameters.get(name)
        if parameter is not None and parameter.at != "all":
            array = site_values(node, declared)
            arrays |= {} if array is None else {name: array}
            continue
        value = _single(node, declared.numbers(), key, declared)
        if parameter is None:
            hint = did_you_mean(name, declared.parameters)
            declared.reader.error(key, f"{shown(name)} is not a parameter", hint)
        elif value is not None and node is not None:
            if parameter.refuses(value):
                message = f"the parameter {name!r} is {parameter.bound} by declaration, but its value is {node.text}"
                declared.reader.error(node, message)
            values[name] = value
    return values, arrays


def _exact(raw: Mapping[str, tuple[Scalar, Scalar | None]], declared: Declarations) -> dict[str, Expression]:
    if not raw:
        return {}
    symbols = {declared.time or "t": symbol(ELAPSED)} | {f"x0_{c}": symbol(initial(c)) for c in declared.coordinates}
    for name in (*declared.parameters, *declared.definitions):
        if name in symbols:
            message = f"the name {name!r} is reserved in the exact solution of a run"
            declared.reader.error(declared.nodes[name], message, "choose another name")
    dated = {n: declared.definitions[n] for n in declared.dated - declared.varying}
    time_values = dict(zip(dated, substitute(list(dated.values()), {declared.time: symbol(ELAPSED)}), strict=True))
    scope = declared.constants("an exact solution", symbols | time_values)
    hints = {c: (scope.refused[c][0], f"write x0_{c} for the initial value of {c}") for c in declared.coordinates}
    # In an exact solution, t always means the time, even if a coordinate is called t; so this name is not refused.
    refused = {n: reason for n, reason in {**scope.refused, **hints}.items() if n not in symbols}
    scope = AllowedNames(scope.names, refused, scope.open)
    values = {}
    for name, (key, node) in raw.items():
        expression = declared.formula(node, scope)
        if declared.coordinate(key) is not None and expression is not None:
            values[name] = expression
    return values


def without_repetition(entries: Any, path: tuple[Any, ...], declared: Declarations) -> tuple[str, ...]:
    """Return the words of a list without repetitions and without None. Words that occur twice are reported.

    ``path`` are the keys of the list in the spec.
    """
    distinct: list[str] = []
    for index, word in enumerate(entries):
        if word in distinct:
            location = declared.reader.locations[*path, index]
            declared.reader.problems.add(f"{path[-1]}: {word} is given twice", location)
        elif word is not None:
            distinct.append(word)
    return tuple(distinct)
