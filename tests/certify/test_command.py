"""``phigen certify`` at the command line, and docs/certify.md."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from walkthrough import follow

from phigen.cli import group

ROOT = Path(__file__).resolve().parents[2]


def phigen(*arguments: Any) -> Result:
    return CliRunner().invoke(group, ["certify", *map(str, arguments)])


def test_the_page_can_be_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert follow(ROOT / "docs" / "certify.md", tmp_path) == 1


def test_json_has_bounds_in_the_order_of_the_coordinates(tmp_path: Path) -> None:
    result = phigen("pendulum", "--json", "-q", "-o", tmp_path, "--samples", 2, "--set", "g=2", "--step", 0.05)
    assert result.exit_code == 0
    summary = json.loads(result.stdout)
    assert (summary["coordinates"], summary["step"], summary["samples"]) == (["q", "p"], 0.05, 2)
    assert all(0 < far <= bound for far, bound in zip(summary["observed"], summary["bound"], strict=True))
    stored = json.loads((tmp_path / "pendulum" / "pendulum.bounds.json").read_text())
    assert stored["parameters"] == {"g": 2.0}
    assert sorted(p.name for p in (tmp_path / "pendulum").iterdir()) == [
        "checker.py", "pendulum.bounds.json", "pendulum.c", "pendulum.h",
    ]  # fmt: skip


def test_the_box_of_a_run_is_that_of_the_certificate_and_options_override_it(tmp_path: Path) -> None:
    text = SPEC.replace("BOX", "{q: [-1, 0.5], p: [-0.5, 1]}")
    (tmp_path / "s.yaml").write_text(text)
    result = phigen(tmp_path / "s.yaml", "--json", "-q", "-o", tmp_path / "out", "--samples", 0, "--box", "p=0:1")
    assert json.loads(result.stdout)["domain"] == [[-1.0, 0.5], [0.0, 1.0]]


@pytest.mark.parametrize(
    ("box", "message"),
    [
        ("{q: [0, 1], r: [0, 1]}", "s.yaml:6:72: error: 'r' is not a coordinate"),
        ("{q: [1, 0]}", "s.yaml:6:65: error: box: [1, 0] is not [LOW, HIGH], two numbers in this order"),
        ("{q: [1]}", "s.yaml:6:65: error: box: [1] is not [LOW, HIGH]"),
        ("{q: [0, a]}", "s.yaml:6:68: error: the name 'a' is not declared"),
    ],
)
def test_mistakes_in_a_box_are_reported_at_their_place(tmp_path: Path, box: str, message: str) -> None:
    (tmp_path / "s.yaml").write_text(SPEC.replace("BOX", box))
    result = phigen(tmp_path / "s.yaml", "-o", tmp_path / "out")
    assert (result.exit_code, message in result.stderr) == (1, True), result.stderr


def test_boxes_and_compared_steps_are_stages(tmp_path: Path) -> None:
    listed = phigen("pendulum", "-v", "-o", tmp_path, "--samples", 2).stderr.splitlines()
    assert "pendulum: boxes of the certificate" in listed
    assert "pendulum: steps compared with the exact map, 0 of 2" in listed


SPEC = """phigen: 1
name: swing
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + q**2/2
runs: {a: {initial: [0.1, 0.2], step: 0.1, steps: 10, box: BOX}}
"""


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["pendulum", "--step", "30", "--boxes", "2"], 5, "hint: take a smaller box"),
        (["double_well"], 1, "certificates do not cover noise"),
        (["heisenberg"], 1, "is a lattice"),
        (["pendulum", "--box", "r=0:1"], 2, "'r' is not a coordinate; there are q, p"),
        (["pendulum", "--box", "q=1:0"], 2, "is not LOW:HIGH"),
        (["pendulum", "--time", "0:1"], 2, "H does not depend on the time"),
    ],
)
def test_refusals(tmp_path: Path, arguments: list[str], code: int, words: str) -> None:
    result = phigen(*arguments, "-o", tmp_path)
    assert result.exit_code == code
    assert words in result.stderr
    assert list(tmp_path.iterdir()) == []
