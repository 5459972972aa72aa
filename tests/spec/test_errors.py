"""The text pairs of errors.txt: every message with its line, column and hint."""

from __future__ import annotations

import pytest
from spec.text_pairs import cases, complete, errors_of


@pytest.mark.parametrize(("title", "spec", "expected"), [pytest.param(*c, id=c[0]) for c in cases()])
def test_errors_are_reported_as_written(title: str, spec: str, expected: str) -> None:
    assert errors_of(spec if title.endswith("(bare)") else complete(spec)) == expected
