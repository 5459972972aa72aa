"""Mutants of specs that phigen accepts are checked and run: no mutant causes an internal error.

PHIGEN_RANDOM_SEEDS sets the number of samples of mutants that --all draws.
"""

from __future__ import annotations

import os
import random
import re
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from mutated_specs import BASES, document, mutants, replaced, tree_of

from phigen.cli import group
from phigen.errors import PhigenError, SpecError
from phigen.spec import loads

SEEDS = int(os.environ.get("PHIGEN_RANDOM_SEEDS", "1"))
SAMPLE, MOST_RUNS = 150, 5
#: Top-level keys that contain only texts and names; mutants of their values are not run.
TEXTS = {"title", "description", "references", "license", "name", "phigen", "targets", "sweeps"}

Path_ = tuple[Any, ...]


def accepted(base: str, seed: int) -> list[tuple[Path_, str, str]]:
    """Return mutants that are valid specs: the path of the replaced value, the new value, and the text of the spec."""
    tree, accepted_changes = tree_of(BASES[base]), []
    for path, value in mutants(base, random.Random(f"{base} {seed}"), SAMPLE):
        if path[0] in TEXTS or path[-1] == "description" or len(accepted_changes) == MOST_RUNS:
            continue
        text = document(replaced(tree, path, value))
        try:
            loads(text)
        except SpecError:
            continue
        accepted_changes.append((path, value, text))
    return accepted_changes


def complaint(path: Path_, text: str) -> str:
    """Run `phigen check` and `phigen run` on a mutant. Return a description of an unexpected result, or "" if there is
    none.
    """
    Path("s.yaml").write_text(text, encoding="utf-8")
    chosen = ["--run", str(path[1])] if path[0] == "runs" and len(path) > 1 else []
    for command in ([] if chosen else [["check", "s.yaml"]]) + [["run", "s.yaml", "-t", "numpy", *chosen]]:
        result = CliRunner().invoke(group, command, prog_name="phigen")
        raised = result.exception if not isinstance(result.exception, SystemExit) else None
        if raised is not None and not isinstance(raised, PhigenError):
            return f"{command[0]}: {raised!r}"
        said = result.output + (str(raised) if raised else "")
        code = raised.exit_code if isinstance(raised, PhigenError) else result.exit_code
        if code == PhigenError.exit_code:
            return f"{command[0]}: {said}"
        if code in (SpecError.exit_code, 3) and not re.search(r"s\.yaml:\d+:\d+: |the spec has no runs", said):
            return f"{command[0]}: an error without a place: {said}"
        if code:
            return ""
    return ""


@pytest.mark.slow
@pytest.mark.parametrize(("base", "seed"), [*product(BASES, range(SEEDS))])
def test_a_mutant_that_is_a_spec_is_run_or_refused(
    base: str, seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    complaints = {(path, value): complaint(path, text) for path, value, text in accepted(base, seed)}
    assert {mutant: said for mutant, said in complaints.items() if said} == {}


def test_a_lattice_without_energy_stands_still(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = document(replaced(tree_of(BASES["eaters"]), ("hamiltonian",), "0"))
    assert complaint(("runs", "a"), text) == ""
