"""Reader of ``spectrum`` and ``correlation``, two keys of runs of lattices on a grid."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from phigen.spec.declarations import Declarations
from phigen.spec.model import CorrelationChoice, SpectrumChoice
from phigen.spec.problems import did_you_mean, one_of, shown
from phigen.spec.yaml_source import Scalar

#: Key of ``correlation`` for the largest distance, in sites.
UP_TO = "up to"


def spectrum_of(name: str, raw: Mapping[str, Any], declared: Declarations) -> SpectrumChoice | None:
    """Return the setting ``spectrum`` of the run ``name``; None if it is absent, or after reported errors."""
    entries = raw.get("spectrum")
    if entries is None or not _is_allowed(name, "spectrum", raw, declared):
        return None
    fields = [_field(node, "spectrum", declared) for node in entries.get("of") or () if node is not None]
    start_time = declared.number(entries.get("after"), declared.numbers())
    return SpectrumChoice(tuple(f for f in fields if f), start_time) if all(fields) and fields else None


def correlation_of(
    name: str, raw: Mapping[str, Any], sizes: tuple[int, ...], declared: Declarations
) -> CorrelationChoice | None:
    """Return the setting ``correlation`` of the run ``name``; None if it is absent, or after reported errors.

    ``sizes`` are the numbers of sites along the axes in this run. The largest distance of the correlation must be
    smaller than the number of sites along its axis.
    """
    entries = raw.get("correlation")
    if entries is None or not _is_allowed(name, "correlation", raw, declared):
        return None
    assert declared.lattice is not None
    first_field, second_field, axis = (entries.get(key) for key in ("of", "with", "axis"))
    first = _field(first_field, "correlation", declared) if first_field is not None else ""
    second = _field(second_field, "correlation", declared) if second_field is not None else first
    axes, up_to = declared.lattice.axes, entries.get(UP_TO)
    if axis is not None and axis.text not in axes:
        hint = did_you_mean(axis.text, axes) or one_of(axes)
        declared.reader.error(axis, f"correlation: {shown(axis.text)} is not an axis", hint)
        return None
    axis_name = axis.text if axis is not None else axes[0]
    start_time = declared.number(entries.get("after"), declared.numbers())
    if not (first and second) or up_to is None:
        return None
    size = dict(zip(axes, sizes, strict=False)).get(axis_name)
    if size is not None and up_to >= size:
        message = f"correlation: {UP_TO}: {up_to} is farther than {size - 1}, the last distance along {axis_name}"
        declared.reader.problems.add(message, declared.reader.locations["runs", name, "correlation", UP_TO])
        return None
    return CorrelationChoice(first, second, axis_name, up_to, start_time)


def _is_allowed(name: str, key: str, raw: Mapping[str, Any], declared: Declarations) -> bool:
    """Return whether a run may have ``key``, which requires a grid and stored states. If not, an error is reported."""
    place, add = declared.reader.locations["runs", name, key], declared.reader.problems.add
    if declared.relation != "grid":
        add(
            f"{key} needs a grid, and this lattice has no axes",
            place,
            "lattice: {axes: [i]} declares a grid of one axis",
        )
        return False
    record = [node.text for node in raw.get("record") or () if node is not None]
    if record and "state" not in record:
        add(f"{key} needs states, and `record` does not contain `state`", place, "record: [state, …], or no record")
        return False
    return True


def _field(node: Scalar, key: str, declared: Declarations) -> str:
    """Return the coordinate that a node names; "" after an error, which is reported."""
    if node.text in declared.coordinates or declared.incomplete:
        return node.text
    message = f"{key}: {shown(node.text)} is not a coordinate"
    declared.reader.error(node, message, declared.coordinate_hint(node.text))
    return ""
