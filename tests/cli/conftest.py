from pathlib import Path

import pytest
from cli_specs import GOOD
from click.testing import CliRunner

from phigen.cli import group


@pytest.fixture
def phigen():
    """Return a function that runs a phigen command line in this process."""
    runner = CliRunner()

    def run(*args):
        return runner.invoke(group, [str(a) for a in args], prog_name="phigen")

    return run


@pytest.fixture
def in_tmp(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def write(in_tmp):
    """Return a function that writes a spec into the working directory, as in ``write("a.yaml", name="a")``."""

    def make(file, text=GOOD, *, name=None, order=2):
        path = Path(file)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text.format(name=name or path.stem, order=order) if text is GOOD else text, encoding="utf-8")
        return path

    return make
