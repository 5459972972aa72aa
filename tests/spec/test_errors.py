"""The cases of errors.txt: each spec is refused with the listed messages, with line, column and hint."""

from __future__ import annotations

import pytest
from spec.text_pairs import cases, complete, errors_of

from phigen.errors import SpecError
from phigen.spec import loads


@pytest.mark.parametrize(("title", "spec", "expected"), [pytest.param(*c, id=c[0]) for c in cases()])
def test_errors_are_reported_as_written(title: str, spec: str, expected: str) -> None:
    assert errors_of(spec if title.endswith("(bare)") else complete(spec)) == expected


@pytest.mark.parametrize(("name", "meant"), [("ln", "log"), ("cosine", "cos"), ("tangent", "tan")])
def test_functions_by_other_names_are_recognised(name, meant):
    text = "phigen: 1\nname: a\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
    with pytest.raises(SpecError, match=f"did you mean '{meant}'"):
        loads(f"{text}hamiltonian: {name}(q)\n")


@pytest.mark.parametrize(("value", "hinted"), [("atan2(q, 1)", True), ('"atan2(q, 1"', False)])
def test_commas_inside_of_braces_need_quotes(value, hinted):
    text = "phigen: 1\nname: a\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: q\n"
    with pytest.raises(SpecError, match="never closed") as caught:
        loads(f"{text}observables: {{angle: {value}}}\n")
    assert ("between quotes" in str(caught.value)) is hinted
