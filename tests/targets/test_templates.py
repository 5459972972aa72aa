"""Templates are loops over printed strings with optional parts; all decisions are made in Python."""

import re

import pytest

from phigen import resources
from phigen.targets.rendering import _environment

TEMPLATES = sorted(resources.templates().rglob("*.jinja"))
IDS = [f"{path.parent.name}/{path.name}" for path in TEMPLATES]


def test_every_target_has_templates():
    assert {path.parent.name for path in TEMPLATES} >= {"c", "numpy", "js"}


@pytest.mark.parametrize("path", TEMPLATES, ids=IDS)
def test_template_is_a_chapter_at_most(path):
    """A template is at most one chapter of the output; longer ones must be divided, or become code."""
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 150


@pytest.mark.parametrize("path", TEMPLATES, ids=IDS)
def test_template_contains_no_expressions(path):
    text = path.read_text(encoding="utf-8")
    for statement in re.findall(r"{%-?\s*(.*?)\s*-?%}", text):
        assert re.fullmatch(r"endfor|for \w+(, \w+)* in \w+|if (not )?\w+|else|endif", statement), statement
    for value in re.findall(r"{{-?\s*(.*?)\s*-?}}", text):
        named = re.fullmatch(r'\w+|"[^"]*" if (not )?(\w+|loop\.last)', value)
        assert named, f"{value}: neither filters nor calls nor attributes"
    assert "{#" not in text


@pytest.mark.parametrize("path", TEMPLATES, ids=IDS)
def test_template_parses(path):
    environment = _environment(path.parent.name)
    assert environment.parse(path.read_text(encoding="utf-8"))
    assert environment.undefined.__name__ == "StrictUndefined"
