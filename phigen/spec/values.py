"""Values at the sites or bonds of a lattice: a formula of the indices, a list, a file, or random numbers."""

# `return reader.error(…)` reports an error and returns None, which stands for a value that could not be read.
# mypy: disable-error-code="func-returns-value"

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from phigen.spec.kinds import ExpressionText, Integer, Kind, OneOf
from phigen.spec.model import Values
from phigen.spec.problems import did_you_mean, shown
from phigen.spec.yaml_source import Scalar

if TYPE_CHECKING:
    from phigen.spec.declarations import Declarations

DISTRIBUTIONS = ("normal", "uniform", "sphere")
FILES = (".npy", ".csv")
_RANDOM: Mapping[str, Kind] = {
    "random": OneOf(DISTRIBUTIONS),
    "seed": Integer(0, 10**9 - 1),
    "scale": ExpressionText(constant=True),
    "mean": ExpressionText(),
}
RANDOM_KEYS = tuple(_RANDOM)
_WHOLE_SPHERE = "initial: {random: sphere}"


def values(raw: Any, declared: Declarations, *, whole: bool = False) -> Values | None:
    """Return the values at sites or bonds that a YAML value describes; None after errors, which are reported.

    If ``whole``, the array has the initial values of all fields of a lattice together.
    """
    if raw is None:
        return None
    if isinstance(raw, Scalar):
        if raw.text.endswith(FILES):
            return Values(file=raw.text)
        scope = declared.site_numbers()
        if raw.text in DISTRIBUTIONS and scope.lookup(raw.text) is None:
            return declared.reader.error(raw, f"{raw.text!r} is not a value", f"{{random: {raw.text}, seed: 1}}")
        formula = declared.formula(raw, scope)
        return None if formula is None else Values(formula=formula)
    if isinstance(raw, list):
        numbers = [declared.number(node, declared.numbers()) for node in raw]
        return Values(listed=tuple(n or Fraction(0) for n in numbers))
    return _random(raw, declared, whole)


def _random(entries: Mapping[str, Any], declared: Declarations, whole: bool) -> Values | None:
    """Return the random values that a mapping {random: …, seed: …} describes; None after errors, which are reported."""
    reader, before = declared.reader, len(declared.reader.problems.found)
    for key, (node, _) in entries.items():
        if key not in RANDOM_KEYS:
            hint = did_you_mean(key, RANDOM_KEYS) or f"keys: {', '.join(RANDOM_KEYS)}"
            reader.error(node, f"random values have no key {shown(key)}", hint)
    if not entries:  # all keys were invalid; the errors were reported when the mapping was read
        return None
    if "random" not in entries:
        first = next(iter(entries.values()))[0]
        return reader.error(first, "values are a number, a formula, a list, or {random: …, seed: …}")
    kind, seed, scale, mean = (_option(entries, key, declared) for key in RANDOM_KEYS)
    if kind == "sphere" and not whole:
        reader.error(
            entries["random"][1], "random: sphere is only for all coordinates of a site together", _WHOLE_SPHERE
        )
    if mean is not None and kind == "sphere":
        reader.error(mean, "mean: not available with `random: sphere`, whose values always have the mean 0")
        mean = None
    factor = Fraction(1) if scale is None else declared.number(scale, declared.numbers())
    around = declared.formula(mean, declared.site_numbers())
    if kind is None or factor is None or len(reader.problems.found) > before:
        return None
    return Values(random=kind, seed=seed or 0, scale=factor, formula=around)


def _option(entries: Mapping[str, tuple[Scalar, Any]], key: str, declared: Declarations) -> Any:
    """Return the value of ``key`` in a mapping {random: …, seed: …}; None if the key is absent, or after a reported
    error.
    """
    node, value = entries.get(key, (None, None))
    if node is None or value is None:
        return None
    if isinstance(value, Scalar):
        return _RANDOM[key].read(value, (key,), declared.reader)
    kind = "a list" if isinstance(value, list) else "a mapping"
    return declared.reader.error(node, f"{key}: expected {_RANDOM[key].expected}, found {kind}")
