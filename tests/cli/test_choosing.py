"""The page docs/choosing.md: its settings have the errors that it states, and its commands work."""

import re
import shlex
from functools import cache

import numpy as np
import pytest
from support import described

from phigen import resources
from phigen.tuning.building import build
from phigen.tuning.problem import Candidate, SystemProblem
from phigen.tuning.settings import SPLITTING, Setting
from phigen.tuning.trials import energy_measure

DOCS = resources.bundled_specs().parent / "docs"
TEXT = (DOCS / "choosing.md").read_text(encoding="utf-8")


def rows(heading):
    """Return the rows of the table under a heading of the page, as lists of cells."""
    section = TEXT.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("| ")]
    return [[cell.strip(" `") for cell in line.strip("|").split("|")] for line in lines[1:]]


def energy_error(name, kind, order, step, gauge="auto"):
    """Return the largest relative energy error of the first run of a spec, integrated up to t = 10,000."""
    candidate = built(name, Setting(kind, int(order), gauge, "auto" if kind == SPLITTING else "none"))
    spec, system, _ = described(name)
    run = next(iter(spec.runs.values()))
    values = spec.parameters_of(run)
    problem = SystemProblem(np.array([float(v) for v in run.initial]), values, float(step), 1e4, system=system)
    return energy_measure(problem)(Candidate(candidate.solver(), problem), float(step), 1e4).measured


@cache
def built(name, setting):
    spec, system, _ = described(name)
    return build(spec, system, setting)


ROWS = rows("Energy up to t = 100,000")


def name_of(row):
    return "-".join(row[:2])


@pytest.mark.thin(1)
@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS, ids=name_of)
def test_proposed_settings_reach_their_accuracy_and_hardly_more(row):
    name, accuracy, kind, order, step, *_ = row
    assert 0.2 < energy_error(name, kind, order, step) / float(accuracy) <= 1


@pytest.mark.thin(2)
@pytest.mark.parametrize(
    "row",
    [
        pytest.param(r, id="-".join(r[:3]), marks=pytest.mark.slow if r[1] == "12" else ())
        for r in rows("What each choice does")
    ],
)
def test_steps_for_one_accuracy(row):
    kind, order, gauge, step, _ = row
    assert 0.3 < energy_error("rigid_body", kind, order, step, gauge) / 1e-8 < 3


@pytest.mark.slow
def test_commands_work(phigen, in_tmp):
    commands = re.findall(r"(?m)^phigen (tune tumbler.yaml .*)$", TEXT)
    assert len(commands) == 2
    phigen("new", "tumbler")
    for command in commands:
        measured, budget = None, 1
        # A busy machine measures fewer settings in the budget, so the budget is raised until tune proposes a setting.
        while not (measured and "To paste into the spec" in measured.stdout) and budget < 100:
            measured = phigen(*shlex.split(command), "--budget", str(budget))
            budget *= 5
        assert measured.exit_code == 0, measured.stderr
        assert "To paste into the spec" in measured.stdout
