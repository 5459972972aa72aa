"""Kinds of steps: each has an entry in the tables of the packages that treat kinds differently."""

import re

import pytest

from phigen import resources
from phigen.lanes.in_lanes import LOWERINGS
from phigen.scheme import steps
from phigen.scheme.efficiency import STEP_TIMES
from phigen.scheme.step_kinds import STEP_KINDS
from phigen.targets.c.files import CONDITIONS
from phigen.targets.c.step_text import STEP_TEXTS
from phigen.targets.features import FEATURES
from phigen.targets.js.step_modules import STEP_MODULES
from phigen.targets.numpy.step_functions import STEP_FUNCTIONS

#: The kinds of steps of ordinary systems. Lattices have emitters of their own.
ORDINARY = {name for name, kind in STEP_KINDS.items() if not kind.sites}


@pytest.mark.parametrize("table", [STEP_TEXTS, STEP_MODULES, STEP_FUNCTIONS])
def test_each_target_has_the_text_of_each_kind(table):
    assert set(table) == ORDINARY


def test_lowerings_and_times_are_those_of_kinds():
    assert LOWERINGS.keys() <= STEP_KINDS.keys()
    assert {kind.name for kind in STEP_TIMES} <= STEP_KINDS.keys()


def test_each_kind_has_a_switch_of_the_runtimes():
    assert {name.upper() for name in ORDINARY} <= {feature.name for feature in FEATURES}
    assert all(any(name.upper() in condition for condition in CONDITIONS.values()) for name in ORDINARY)


@pytest.mark.parametrize("kind", sorted(ORDINARY))
@pytest.mark.parametrize("prefix", ["", "tangent_"])
def test_each_kind_has_its_files_in_the_runtimes(kind, prefix):
    templates = resources.templates()
    files = (
        f"c/runtime/{prefix}{kind}.c",
        f"js/runtime/{prefix}{kind}.mjs",
        f"numpy/{prefix}{kind}.py.jinja",
    )
    assert [file for file in files if not (templates / file).is_file()] == []


@pytest.mark.parametrize(("root", "prefix"), [("steps.c", ""), ("tangent.c", "tangent_")])
def test_the_runtime_in_c_includes_the_files_of_each_kind(root, prefix):
    assert {f"{prefix}{kind}.c" for kind in ORDINARY} <= included(root)


def included(file: str) -> set[str]:
    """Return the files of the C runtime that a file includes, directly or through others."""
    names, rest = set(), [file]
    while rest:
        text = (resources.templates() / "c" / "runtime" / rest.pop()).read_text("utf-8")
        new = {n for n in re.findall(r'#include "(\w+\.c)"', text) if n not in names}
        names |= new
        rest += new
    return names


def test_each_class_of_steps_has_a_kind_of_its_own():
    kinds = [step.kind for step in steps.Step.__args__]
    assert kinds == list(STEP_KINDS.values())
