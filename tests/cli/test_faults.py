"""Faults of the environment: a full disk, a stdout that accepts no output or not every character, and a working
directory that was deleted.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from full_disk import FULL, largest_file

from phigen.cli import group


def tree(folder):
    return {str(p): p.read_bytes() if p.is_file() else None for p in sorted(Path(folder).rglob("*"))}


@pytest.mark.parametrize("command", [["build", "a.yaml", "-o", "out"], ["vendor", "a.yaml", "out"]])
def test_files_of_a_solver_appear_together_or_not_at_all(phigen, write, command):
    write("a.yaml")
    for before in ({}, None):
        if before is None:
            assert phigen(*command).exit_code == 0
            before = tree("out")
        with largest_file(8000):
            result = phigen(*command, "--order", "4")
        assert result.exit_code == 2
        assert f"a.c: {FULL}" in result.stderr
        assert tree("out") == before
    assert not Path("out/nothing").exists()


@pytest.mark.thin(2)
@pytest.mark.parametrize(
    "command",
    [
        ["run", "a.yaml", "-o", "out/a.csv"],
        ["run", "a.yaml", "-o", "out/a.npz"],
        ["run", "a.yaml", "--plot", "out/a.svg"],
        ["report", "without_runs.yaml", "-o", "out/a.html"],
        ["new", "b", "-o", "out/b.yaml"],
    ],
    ids=lambda c: c[-1],
)
def test_nothing_is_left_of_a_file_that_does_not_fit(phigen, write, command):
    text = write("a.yaml").read_text()
    write("without_runs.yaml", text.split("runs:")[0])
    Path("out").mkdir()
    # This run fills the cache of compiled solvers before the size of files is limited.
    assert phigen("run", "a.yaml").exit_code == 0
    with largest_file(400):
        result = phigen(*command)
    assert result.exit_code == 2
    assert f"{command[-1]}" in result.stderr
    assert f": {FULL}" in result.stderr
    assert tree("out") == {}


@pytest.mark.parametrize("file", ["a.csv", pytest.param("a.npz", marks=pytest.mark.slow)])
def test_a_run_that_fills_the_disk_goes_on_where_there_is_room(phigen, write, file, monkeypatch):
    monkeypatch.setattr("phigen.cli.recording.CHECKPOINT_SECONDS", 0.0)
    write("a.yaml")
    options = ["--steps", "8000", "-o"]
    assert phigen("run", "a.yaml", *options, f"whole-{file}").exit_code == 0
    with largest_file(150_000):
        result = phigen("run", "a.yaml", *options, file)
    assert result.exit_code == 2
    assert FULL in result.stderr
    assert "--resume" in result.stderr
    result = phigen("run", "a.yaml", *options, file, "--resume")
    assert result.exit_code == 0
    assert "resuming after" in result.stderr
    assert Path(file).read_bytes() == Path(f"whole-{file}").read_bytes()
    assert not [
        p
        for p in Path().iterdir()
        if p.suffix not in (".yaml", ".csv", ".npz") and not p.name.endswith(".csv-metadata.json")
    ]


def test_a_folder_that_takes_no_files_is_reported_before_the_work(phigen, write, monkeypatch):
    write("a.yaml")
    Path("folder.csv").mkdir()
    for command in (["run", "a.yaml", "-o", "folder.csv"], ["report", "a.yaml", "-o", "folder.csv"]):
        result = phigen(*command)
        assert (result.exit_code, "'folder.csv' is a folder" in result.stderr) == (2, True)
    monkeypatch.setattr("os.access", lambda path, mode: False)
    result = phigen("run", "a.yaml", "-o", "a.csv")
    assert (result.exit_code, "nothing can be written to the folder '.'" in result.stderr) == (2, True)


@pytest.mark.thin(2)
@pytest.mark.parametrize("redirected", [">/dev/full", ">&-"])
@pytest.mark.parametrize("command", ["list --path kepler", "schema", "new b -o -"])
def test_data_that_cannot_be_printed_is_an_error_of_stdout(command, redirected):
    result = shell(f"{command} {redirected}")
    assert result.returncode == 2
    assert result.stderr.startswith("error: stdout: ")
    assert result.stderr.count("\n") == 1


@pytest.mark.thin(2)
@pytest.mark.parametrize(("command", "code"), [("build --nonsense", 2), ("check none.yaml", 1), ("list", 0)])
def test_messages_that_cannot_be_printed_do_not_change_the_exit_code(command, code):
    assert shell(f"{command} 2>/dev/full").returncode == code


def shell(line):
    """Run phigen in a shell with a line of arguments and redirections, and return the completed process."""
    program = "import sys; from phigen.cli import main; main()"
    words = ["sh", "-c", f'"$0" -c "$1" {line}', sys.executable, program]
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    return subprocess.run(words, capture_output=True, text=True, check=False, env=buffered)


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_a_stdout_that_is_not_utf8_gets_all_it_can_show_and_machines_get_everything(encoding, write):
    text = write("a.yaml").read_text() + "title: Théorie de π, ẋ = π∇H\n"
    write("a.yaml", text.split("runs:")[0] + text[text.index("title:") :])
    results = {c: CliRunner(charset=encoding).invoke(group, [*c.split()]) for c in (
        "show a.yaml", "show a.yaml --json", "schema", "--help", "report a.yaml -o -", "check a.yaml",
    )}  # fmt: skip
    assert {c: r.exit_code for c, r in results.items()} == dict.fromkeys(results, 0)
    assert json.loads(results["show a.yaml --json"].stdout_bytes)["title"] == "Théorie de π, ẋ = π∇H"
    assert "…" in json.dumps(json.loads(results["schema"].stdout_bytes), ensure_ascii=False)
    assert "ẋ = π∇H" in results["report a.yaml -o -"].stdout_bytes.decode("utf-8")


def test_a_working_directory_that_has_gone_is_named(phigen, write, tmp_path, monkeypatch):
    path = write("a.yaml").resolve()
    Path("gone").mkdir()
    monkeypatch.chdir("gone")
    Path.cwd().rmdir()
    result = phigen("vendor", path, "out")
    assert result.exit_code == 2
    assert "error: the working directory: No such file" in result.stderr
