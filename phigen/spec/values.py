"""Values at the sites or bonds of a lattice: a formula of the indices, a list, a file, or random numbers."""

# `return reader.error(…)` reports and returns None, the value of what has an error.
# mypy: disable-error-code="func-returns-value"

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from phigen.spec.model import Values
from phigen.spec.problems import did_you_mean, one_of, shown
from phigen.spec.yaml_source import Scalar

if TYPE_CHECKING:
    from phigen.spec.declarations import Declarations

DISTRIBUTIONS = ("normal", "uniform", "sphere")
FILES = (".npy", ".csv")
RANDOM_KEYS = ("random", "seed", "scale", "mean")


def values(given: Any, declared: Declarations, *, whole: bool = False) -> Values | None:
    """What stands where an array is wanted, ``None`` after errors; ``whole``: that of all fields together."""
    if given is None:
        return None
    if isinstance(given, Scalar):
        if given.text.endswith(FILES):
            return Values(file=given.text)
        scope = declared.site_numbers()
        if given.text in DISTRIBUTIONS and scope.lookup(given.text) is None:
            return declared.reader.error(given, f"{given.text!r} is no value", f"{{random: {given.text}, seed: 1}}")
        formula = declared.formula(given, scope)
        return None if formula is None else Values(formula=formula)
    if isinstance(given, list):
        numbers = [declared.number(node, declared.numbers()) for node in given]
        return Values(listed=tuple(n or Fraction(0) for n in numbers))
    return _random(given, declared, whole)


def _random(given: Mapping[str, Any], declared: Declarations, whole: bool) -> Values | None:
    reader, read = declared.reader, {key: node for key, (_, node) in given.items()}
    for key, (node, _) in given.items():
        if key not in RANDOM_KEYS:
            hint = did_you_mean(key, RANDOM_KEYS) or f"keys: {', '.join(RANDOM_KEYS)}"
            reader.error(node, f"random values have no key {shown(key)}", hint)
    kind, seed, scale, mean = map(read.get, RANDOM_KEYS)
    if not isinstance(kind, Scalar):
        first = next(iter(given.values()))[0] if given else None
        return first and reader.error(first, "values are a number, a formula, a list, or {random: …, seed: …}")
    if kind.text not in DISTRIBUTIONS:
        return reader.error(kind, f"random: {kind.text!r} is not known", one_of(DISTRIBUTIONS))
    if kind.text == "sphere" and not whole:
        return reader.error(kind, "random: sphere is for all fields of a site together", "initial: {random: sphere}")
    if seed is not None and not (isinstance(seed, Scalar) and seed.text.isdigit() and len(seed.text) < 10):
        return reader.error(seed, "seed: expected a whole number below 10⁹")
    if mean is not None and kind.text == "sphere":
        return reader.error(mean, "mean: a sphere is that around 0")
    factor = declared.number(scale, declared.numbers()) if isinstance(scale, Scalar) else Fraction(1)
    around = declared.formula(mean, declared.site_numbers()) if isinstance(mean, Scalar) else None
    number = int(seed.text) if seed else 0
    return Values(random=kind.text, seed=number, scale=factor or Fraction(1), formula=around)
