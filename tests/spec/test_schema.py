"""The JSON Schema and the validator accept the same specs, among them the starter spec."""

from __future__ import annotations

from typing import Any

import pytest
from jsonschema import Draft202012Validator
from ruamel.yaml import YAML
from spec.text_pairs import cases, complete

from phigen.errors import SpecError
from phigen.spec import loads, schema, starter
from phigen.spec.fields import SPEC
from phigen.spec.kinds import Either, Kind, ListOf, MapOf, Record, RecordKey
from phigen.spec.names import MEANT


def conforms(text: str) -> bool:
    return bool(Draft202012Validator(schema()).is_valid(YAML(typ="safe", pure=True).load(text)))


def test_schema_is_a_schema() -> None:
    Draft202012Validator.check_schema(schema())


ACCEPTED = [pytest.param(complete(s), id=t) for t, s, e in cases() if not e]


@pytest.mark.parametrize("text", ACCEPTED)
def test_what_is_accepted_conforms_to_the_schema(text: str) -> None:
    loads(text)
    assert conforms(text)


@pytest.mark.parametrize(
    "fragment",
    [
        "nmae: a",
        "phigen: 2",
        "name: A",
        "coordinates: [x-y]",
        "coordinates: []",
        "parameters: {I1: {positive: true}}",
        "parameters: {I1: {value: 1, positive: yes}}",
        "poisson: {}",
        "poisson: {nambu: [x1], canonical: {q: [x2], p: [x3]}}",
        "birealisation: caley",
        "birealisation: {kind: product, of: caley}",
        "birealisation: {kind: spray, spray: round}",
        "birealisation: {kind: spray, degree: 17}",
        "{order: 1, terms: 1}",
        "order: 17",
        "solver: {max_iterations: 0}",
        "targets: []",
        "targets: [fortran]",
        "runs: {a: {initial: [1, 1, 1], step: 1}}",
        "runs: {a: {initial: [1, 1, 1], step: 1, steps: 1, duration: 1}}",
        "runs: {a: {initial: [1, 1, 1], step: 1, steps: 1, compare: rk4}}",
        "gauge: [C]",
    ],
)
def test_what_the_schema_refuses_the_validator_refuses(fragment: str) -> None:
    text = complete(
        fragment.strip("{}").replace(", terms", "\nterms") + "\n" if fragment[0] == "{" else fragment + "\n"
    )
    assert not conforms(text)
    with pytest.raises(SpecError):
        loads(text)


def fields_below(kind: Kind) -> list[RecordKey]:
    """Return all keys of the spec format below a kind."""
    match kind:
        case Record():
            return [g for f in kind.fields for g in (f, *fields_below(f.kind))]
        case ListOf():
            return fields_below(kind.item)
        case MapOf():
            return fields_below(kind.value)
        case Either():
            return [f for k in kind.kinds.values() for f in fields_below(k)]
    return []


def test_every_key_is_described_for_editors() -> None:
    described_fields: list[Any] = fields_below(SPEC)
    assert len(described_fields) > 40
    assert all(f.description for f in described_fields)


def test_words_of_other_programs_are_explained_by_existing_keys() -> None:
    keys = {f.key for f in fields_below(SPEC)}
    assert {word: key for word, key in MEANT.items() if key not in keys} == {}
    assert {word for word, key in MEANT.items() if word == key} == set()


@pytest.mark.parametrize("name", ["a", "rigid_body", "x" * 31, "a1_", "body__2"])
def test_starter_loads_and_conforms_for_every_valid_name(name: str) -> None:
    text = starter(name)
    assert loads(text).name == name
    assert conforms(text)


@pytest.mark.parametrize(
    "name", ["", "A", "1a", "x" * 32, "a-b", "a b", "a\nb", "a: b", "{name}", "ünit", "lambda", "re", "a_default"]
)
def test_starter_refuses_other_names(name: str) -> None:
    with pytest.raises(SpecError):
        starter(name)
