"""The examples of the README, compiled and run; the output is compared with that in the README."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from walkthrough import labels_of, typed

from phigen import resources
from phigen.drawing.palette import DARK, PALETTE, svg

ROOT = resources.bundled_specs().parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks():
    """Return pairs in the order of the README: the paragraph before a fenced block, and the text of the block."""
    return re.findall(r"([^\n]*)\n\n```\w+\n(.*?)```", README, flags=re.DOTALL)


def block(start):
    """Return the text of the block whose preceding paragraph starts with ``start``."""
    texts = [text for introduction, text in blocks() if introduction.startswith(start)]
    assert len(texts) == 1, f"the README has {len(texts)} blocks introduced by {start!r}"
    return texts[0]


@pytest.fixture
def workshop(tmp_path):
    """Return a folder with the files of the README, and an environment in whose path `phigen` is the tested version."""
    for name in ("tumbler.yaml", "main.c", "example.py"):
        (tmp_path / name).write_text(block(f"`{name}`"), encoding="utf-8")
    tools = tmp_path / "tools"
    tools.mkdir()
    (tools / "phigen").write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "from phigen.cli import main; main()" "$@"\n')
    (tools / "phigen").chmod(0o755)
    environment = {**os.environ, "PATH": f"{tools}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}

    def run(*command):
        process = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert process.returncode == 0, process.stdout + process.stderr
        return process.stdout

    return run


@pytest.mark.slow
def test_c_example_prints_what_the_readme_says(workshop):
    commands = block("The commands").strip().splitlines()
    assert commands[-1] == "./main"
    for command in commands[:-1]:
        workshop("sh", "-c", command)
    assert workshop("./main") == block("What `./main` prints")


@pytest.mark.slow
def test_python_example_prints_what_the_readme_says(workshop):
    assert workshop(sys.executable, "example.py") == block("What it prints")


@pytest.mark.slow
def test_commands_of_the_text_work(tmp_path):
    (tmp_path / "tumbler.yaml").write_text(block("`tumbler.yaml`"), encoding="utf-8")
    commands = re.findall(r"`(phigen (?:run|show) [^`]*)`", README.replace("\n", " "))
    assert len(commands) > 2
    for command in commands:
        status, said = typed(command, tmp_path, {})
        assert status == 0, said
        assert said


def test_links_lead_somewhere():
    for target in re.findall(r"\]\(([^)]+)\)", README):
        if not target.startswith("https://"):
            path, _, anchor = target.partition("#")
            assert (ROOT / path).exists(), target
            titles = re.findall(r"^#+ (.*)$", (ROOT / path).read_text(encoding="utf-8"), re.MULTILINE) if anchor else []
            assert not anchor or anchor in [title.lower().replace(" ", "-") for title in titles], target


def test_map_names_every_room():
    rooms = {p.name for p in Path(ROOT / "phigen").iterdir() if p.is_dir() and (p / "__init__.py").exists()}
    map_of_all = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert {room for room in rooms if f"phigen/{room}/" not in map_of_all} == set()


def test_reference_of_the_format_names_every_key_and_choice():
    from phigen import spec
    from phigen.spec import names

    text = (ROOT / "docs" / "spec.md").read_text(encoding="utf-8")
    words = set(re.findall(r"[\w-]+", text))
    expected = {*spec.schema()["properties"], *names.BIREALISATIONS, *names.POISSON_FORMS, *names.COMPOSITIONS}
    expected |= {*names.CLASSICAL_METHODS, *names.SPEC_FUNCTIONS}
    assert expected - words == set()


def test_example_of_the_format_is_a_good_spec():
    from phigen import spec

    text = (ROOT / "docs" / "spec.md").read_text(encoding="utf-8")
    assert spec.loads(re.search(r"```yaml\n(.*?)```", text, flags=re.DOTALL)[1]).order == 6


def test_commands_and_exit_codes_are_documented():
    from phigen import errors
    from phigen.cli import COMMANDS

    text = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    assert all(f"`phigen {command}" in text for command in COMMANDS)
    codes = {e.exit_code for e in vars(errors).values() if isinstance(e, type) and issubclass(e, errors.PhigenError)}
    assert all(f"| {code} |" in text for code in codes)


OVERVIEW = ROOT / "docs" / "figures" / "overview.svg"


@pytest.mark.slow
def test_first_figure_is_that_of_the_readme_and_shows_what_it_says():
    pytest.importorskip("matplotlib")
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        import make_overview as overview
    finally:
        sys.path.pop(0)
    compilation = overview.compilation_of_readme()
    runs = overview.courses(compilation, 1e6)
    errors = {
        label: [np.abs(values / values[0] - 1).max() for values in (whole.energy, whole.casimirs["C"])]
        for label, (whole, _) in runs.items()
    }
    assert errors[overview.PHIGEN][0] < 1e-7
    assert errors[overview.PHIGEN][1] < 1e-13
    assert min(errors[overview.RK4]) > 1e-3
    drawn, committed = svg(overview.figure(runs, compilation)), OVERVIEW.read_text(encoding="utf-8")
    assert [label for label in labels_of(drawn) if "10" not in label] == [
        label for label in labels_of(committed) if "10" not in label
    ]


def test_figures_of_pages_are_dark_on_dark_pages():
    for path in (ROOT / "docs" / "figures").rglob("*.svg"):
        text = path.read_text(encoding="utf-8")
        assert "@media (prefers-color-scheme: dark)" in text, path
        body = text.split("</style>", 1)[1]
        assert [colour for role, colour in PALETTE.items() if role in DARK and colour in body] == [], path
