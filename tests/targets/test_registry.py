"""The registry of targets, from which all lists of targets derive."""

import json

import pytest
from click.testing import CliRunner
from support import BODY, COMMAND, compile_text

import phigen
from phigen import registry
from phigen.cli import group
from phigen.compiler import emit


@pytest.fixture(scope="module")
def program():
    return compile_text(BODY + "order: 2\n").program


@pytest.mark.parametrize("target", registry.TARGETS)
def test_the_files_of_a_target_have_its_suffixes_and_tell_it(program, target):
    files = emit(program, target, COMMAND)
    assert {file.removeprefix(program.name) for file in files} == set(registry.TARGETS[target].suffixes)
    assert registry.target_of(files, program.name).name == target


@pytest.mark.parametrize(
    ("target", "hint"),
    [("numpyy", "did you mean 'numpy'"), ("JavaScript", "did you mean 'js'"), ("cobol", "there are c, numpy")],
)
def test_an_unknown_target_is_an_error_with_a_hint(program, target, hint):
    with pytest.raises(ValueError, match=f"unknown target '{target}'; {hint}"):
        emit(program, target, COMMAND)
    with pytest.raises(ValueError, match=f"unknown target '{target}'"):
        phigen.compile("nothing.yaml", target)


def test_the_command_line_and_the_schema_offer_what_is_registered():
    listed = "|".join(registry.TARGETS)
    assert f"[{listed}]" in CliRunner().invoke(group, ["build", "--help"]).output.replace("\n", "").replace(" ", "")
    assert f"[auto|{'|'.join(registry.RUNNABLE)}]" in CliRunner().invoke(group, ["run", "--help"]).output
    schema = json.dumps(json.loads(CliRunner().invoke(group, ["schema"]).output))
    assert json.dumps(list(registry.TARGETS)) in schema
