"""The numbers and figures of docs/paper.md agree with those that phigen computes now, and its commands work."""

import json
import math
from functools import cache
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from systems import slow_but
from walkthrough import follow, labels_of

pytest.importorskip("matplotlib")

from phigen.cli import group
from phigen.cli.reproduce import described, lines_of
from phigen.drawing.palette import svg
from phigen.paper import rigid_body
from phigen.paper.plate import Plate
from phigen.paper.plates import PLATES

DOCS = Path(__file__).resolve().parent.parent / "docs"
STORED = {entry["figure"]: entry for entry in json.loads((DOCS / "figures" / "paper.json").read_text())}


@cache
def made(name: str) -> Plate:
    """Compute a figure of the paper; of the long run of the rigid body only the first hundredth."""
    return rigid_body.errors_plate(rigid_body.EARLY) if name == "rigid_body" else PLATES[name]()


@pytest.mark.slow
@pytest.mark.parametrize("name", slow_but(["poisson_not_hamiltonian"], PLATES))
def test_numbers_are_current(name):
    stored = {f["quantity"]: f for f in STORED[name]["findings"]}
    today = described({name: made(name)})[0]["findings"]
    assert [f["quantity"] for f in today if f["quantity"] not in stored] == []
    for finding in today:
        before, now = stored[finding["quantity"]], finding["measured"]
        assert before["paper"] == finding["paper"]
        # Round-off errors differ between compilers.
        roundoff = abs(now) < 1e-9 and abs(before["measured"]) < 1e-9
        assert roundoff or math.isclose(now, before["measured"], rel_tol=0.01), finding


def test_long_run_goes_on_as_it_began():
    measured = {f["quantity"]: f["measured"] for f in STORED["rigid_body"]["findings"]}
    for quantity in ("energy, RK4: error at", "Casimir, RK4: error at"):
        assert measured[f"{quantity} t = 10000"] == pytest.approx(100 * measured[f"{quantity} t = 100"], rel=0.01)
    amplitude = "energy, PHI-2: largest error up to"
    assert measured[f"{amplitude} t = 10000"] == pytest.approx(measured[f"{amplitude} t = 100"], rel=0.01)
    assert measured["Casimir, PHI-2: largest error up to t = 10000"] < 1e-13


@pytest.mark.slow
@pytest.mark.parametrize("name", slow_but(["poisson_not_hamiltonian", "foliation"], PLATES))
def test_figures_are_current_and_small(name):
    path = DOCS / "figures" / f"{name}.svg"
    assert path.stat().st_size < 150_000
    assert labels_of(path.read_text()) == labels_of(svg(made(name).figure))


def test_tables_are_those_of_the_measurement():
    text = (DOCS / "paper.md").read_text(encoding="utf-8")
    for entry in STORED.values():
        assert click.unstyle("\n".join(lines_of([entry]))) in text, entry["figure"]


@pytest.mark.slow
def test_page_can_be_followed(tmp_path):
    assert follow(DOCS / "paper.md", tmp_path) == 5


@pytest.mark.slow
def test_command_makes_one_figure_and_refuses_unknown_ones(tmp_path):
    runner = CliRunner()
    result = runner.invoke(
        group, ["reproduce", "paper", "-o", str(tmp_path), "--figure", "singularity", "--format", "png"]
    )
    assert result.exit_code == 0, result.output
    assert [p.name for p in tmp_path.iterdir()] == ["singularity.png"]
    assert "T_sing" in result.stdout
    wrong = runner.invoke(group, ["reproduce", "paper", "-o", str(tmp_path), "--figure", "tori"])
    assert wrong.exit_code == 2
    assert "no figure 'tori'" in wrong.stderr
