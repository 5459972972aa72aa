"""Specs in which one value is replaced by another: the new spec must mean something else, or be refused with a
place.

PHIGEN_RANDOM_SEEDS is the number of samples of such specs (mutants) that are drawn with --all.
"""

from __future__ import annotations

import os
import random
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any

import pytest
from mutated_specs import BASES, document, mutants, places, replaced, tree_of
from support import slow_but

from phigen.errors import SpecError
from phigen.spec import loads
from phigen.spec.fields import SPEC
from phigen.spec.kinds import Either, Kind, ListOf, MapOf, Record
from phigen.spec.model import Spec

SEEDS = int(os.environ.get("PHIGEN_RANDOM_SEEDS", "2"))
FEW, MANY = 6, 50
SAMPLES = slow_but(product(BASES, [0]), product(BASES, range(SEEDS)))
#: Values that may equal the default of a key. Any other value must change what a spec means.
DEFAULTS = ("[]", "{}", '""', "0", "auto", "true", "q")


def meaning(text: str) -> Spec:
    """Return a spec for comparison, without its text, its file name and the places of its values."""
    return replace(loads(text), source="", source_sha256="", locations={}, file="")


def complaint(base: str, path: tuple[Any, ...], value: str) -> str:
    """Return what is wrong when a mutant is read: the spec ``base`` with the value at ``path`` replaced by ``value``.
    The result is "" if the mutant is read correctly or refused with a place.
    """
    tree = tree_of(BASES[base])
    text = document(replaced(tree, path, value))
    try:
        message = meaning(text)
    except SpecError as error:
        placed = [d.location is not None and d.source_line in text.split("\n") for d in error.diagnostics]
        return "" if placed and all(placed) else f"an error without a place: {error}"
    if value in DEFAULTS:
        return ""
    try:
        without = meaning(document(replaced(tree, path, None)))
    except SpecError:
        return ""
    return "accepted, and ignored" if message == without else ""


@pytest.mark.parametrize("base", BASES)
def test_a_base_is_written_as_it_is_read(base: str) -> None:
    assert meaning(document(tree_of(BASES[base]))) == meaning(BASES[base])


@pytest.mark.thin(2)
@pytest.mark.parametrize(("base", "seed"), SAMPLES)
def test_a_mutant_is_read_as_what_it_says_or_refused_at_its_place(base: str, seed: int) -> None:
    sample = mutants(base, random.Random(f"{base} {seed}"), MANY if seed else FEW)
    complaints = {(".".join(map(str, path)), value): complaint(base, path, value) for path, value in sample}
    assert {mutant: said for mutant, said in complaints.items() if said} == {}


#: Mutants, specs with one replaced value, that must be refused. They are regression tests: each was once misread, or
#: ended in an internal error.
DEFECTS = [
    ("plane", ("runs", "a", "initial", "scale"), "[q]"),
    ("plane", ("runs", "a", "initial", "scale"), "{random: normal}"),
    ("plane", ("runs", "a", "initial", "seed"), "[1, [2]]"),
    ("graph", ("runs", "b", "parameters", "k", "seed"), "²"),
    ("graph", ("runs", "b", "initial", "q"), "{0: 0}"),
]


@pytest.mark.parametrize(("base", "path", "value"), DEFECTS)
def test_mutants_that_were_misread_are_refused(base: str, path: tuple[Any, ...], value: str) -> None:
    assert complaint(base, path, value) == ""
    with pytest.raises(SpecError):
        loads(document(replaced(tree_of(BASES[base]), path, value)))


def records(kind: Kind) -> Iterator[Record]:
    """Yield all records of the spec format at and below a kind."""
    if isinstance(kind, Record):
        yield kind
        for field in kind.fields:
            yield from records(field.kind)
    inner = [*kind.kinds.values()] if isinstance(kind, Either) else []
    inner += [kind.item] if isinstance(kind, ListOf) else []
    inner += [kind.value] if isinstance(kind, MapOf) else []
    for each in inner:
        yield from records(each)


def test_the_bases_use_every_key() -> None:
    used = {part for text in BASES.values() for path in places(tree_of(text)) for part in path if isinstance(part, str)}
    assert {field.key for record in records(SPEC) for field in record.fields} - used == set()
