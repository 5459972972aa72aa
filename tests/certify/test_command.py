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
    done = phigen("pendulum", "--json", "-q", "-o", tmp_path, "--samples", 2, "--set", "g=2", "--step", 0.05)
    assert done.exit_code == 0
    summary = json.loads(done.stdout)
    assert (summary["coordinates"], summary["step"], summary["samples"]) == (["q", "p"], 0.05, 2)
    assert all(0 < far <= bound for far, bound in zip(summary["observed"], summary["bound"], strict=True))
    stored = json.loads((tmp_path / "pendulum" / "pendulum.bounds.json").read_text())
    assert stored["parameters"] == {"g": 2.0}
    assert sorted(p.name for p in (tmp_path / "pendulum").iterdir()) == [
        "checker", "pendulum.bounds.json", "pendulum.c", "pendulum.h",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["pendulum", "--step", "30", "--boxes", "2"], 5, "hint: a smaller box"),
        (["guiding_centre"], 1, "certificates do not cover steps along paths"),
        (["heisenberg"], 1, "is a lattice"),
        (["pendulum", "--box", "r=0:1"], 2, "'r' is no coordinate; there are q, p"),
        (["pendulum", "--box", "q=1:0"], 2, "is not LOW:HIGH"),
        (["pendulum", "--time", "0:1"], 2, "H does not depend on the time"),
    ],
)
def test_refusals(tmp_path: Path, arguments: list[str], code: int, words: str) -> None:
    done = phigen(*arguments, "-o", tmp_path)
    assert done.exit_code == code
    assert words in done.stderr
    assert list(tmp_path.iterdir()) == []
