"""The golden files are up to date: whole solvers in generated/ and, in tests/golden, paragraphs of the other solvers.
tests/golden.py describes these files.
"""

import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import golden
import pytest
from click.testing import CliRunner
from golden import GENERATED, ROOT

from phigen import resources
from phigen.cli import group
from phigen.targets.c.emitter import FEW_SCREENS

NAMES = ["duffing", "guiding_centre", "kepler_eccentric", "quaternion_top", "toda"]

BUILD = "from phigen.cli import main; main()"


@pytest.mark.parametrize("name", golden.WHOLE)
def test_golden_files_of_a_whole_solver_are_current(name):
    expected = {path.name: path.read_text(encoding="utf-8") for path in (GENERATED / name).iterdir()}
    assert golden.solver_files(name) == expected, "the file is out of date; `make golden` updates it"


@pytest.mark.parametrize("name", golden.PARTIAL)
def test_golden_file_of_a_partial_solver_is_current(name):
    current = golden.part(name, golden.solver_files(name), golden.of_whole_solvers())
    assert (golden.PARTS / f"{name}.txt").read_text(encoding="utf-8") == current, (
        "the file is out of date; `make golden` updates it"
    )


@pytest.mark.parametrize("name", [*golden.WHOLE, *golden.PARTIAL])
def test_calls_are_those_of_the_solver(name):
    assert golden.calls()[name] == golden.called(name), (
        "tests/golden/calls.txt is out of date; `make golden` updates it"
    )


def test_a_paragraph_is_omitted_where_a_whole_solver_has_it():
    whole = {"a.c": "int a_n;\n\n/* Of a_step\n * alone. */\nint a_step(void);\n\nint a_last;\n"}
    shared = golden.keys("a", whole.values())
    same = "/* Of rather_long_step alone. */\nint rather_long_step(void);"
    texts = {"b.c": f"int other;\n\n{same}\n\nint rather_long_last;\n\nint a_step(void);\n"}
    assert golden.part("rather_long", texts, shared) == "==== b.c ====\nint other;\n\n...\n\nint a_step(void);\n\n"


def test_every_system_has_golden_files_and_nothing_else_does():
    assert {*golden.PARTIAL} <= {*resources.bundled()}
    page = (GENERATED / "README.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| \[(\w+)\]\(\1\) \|", page, re.M) == golden.WHOLE
    assert sorted(path.name for path in GENERATED.iterdir() if path.is_dir()) == golden.WHOLE
    file_names = {path.name for path in golden.PARTS.iterdir()}
    assert file_names == {f"{name}.txt" for name in golden.PARTIAL} | {golden.CALLS.name}


@pytest.mark.parametrize("specs", ["specs/pendulum_euler.yaml", pytest.param("specs", marks=pytest.mark.slow)])
def test_generated_is_what_phigen_build_writes(monkeypatch, specs):
    monkeypatch.chdir(ROOT)
    result = CliRunner().invoke(group, ["build", specs, "--check"], prog_name="phigen")
    assert result.exit_code == 0, result.stderr


@pytest.mark.parametrize("name", [*golden.WHOLE, *golden.PARTIAL])
def test_code_is_fit_to_be_read(name):
    """Lines are short, methods with one stage have no loops over stages, names and conditions of the runtime templates
    do not remain, and the table of contents lists the sections.
    """
    for text in (text for file, text in golden.solver_files(name).items() if file.endswith((".c", ".h"))):
        assert max(map(len, text.splitlines())) <= 110
        assert not re.search(r"\bphi_|PHI_(?!GEN)|% 1\b|\n\n\n", text)
        assert "_STAGES" in text or not re.search(r"\bstage <|\[stage\]|\bint stage\b", text)
        contents = re.findall(r"^ \* Contents: (.*?)\n \* body", text, re.M | re.S)
        chapters = re.findall(r"^/\* ---- (.*) ---- \*/$", text, re.M)
        long = text.split("*/\n", 1)[1].count("\n") > FEW_SCREENS
        assert [re.sub(r"\n \* +", " ", line) for line in contents] == ["; ".join(chapters)] * bool(chapters and long)
        assert not re.search(r"^}\n(?:/\*|#define|enum|static)", text, re.M), "no blank line after a function"


def expected():
    """Return the contents of the files in generated/ that `built` should reproduce, by path."""
    return {str(p.relative_to(GENERATED)): p.read_bytes() for n in NAMES for p in (GENERATED / n).iterdir()}


def built(tmp_path, environment=None, cwd=None, python=(), specs=None):
    """Run `phigen build` in a new process and return the contents of the written files, by path."""
    specs = specs or resources.bundled_specs()
    output = tmp_path / f"out{len(list(tmp_path.iterdir()))}"
    files = [str(next(specs.rglob(f"{name}.yaml"))) for name in NAMES]
    command = [sys.executable, *python, "-c", BUILD, "build", *files, "-o", str(output)]
    env = {k: v for k, v in os.environ.items() if k not in ("PYTHONHASHSEED", "LC_ALL")} | (environment or {})
    subprocess.run(command, check=True, env=env, cwd=cwd or ROOT, capture_output=True)
    return {str(p.relative_to(output)): p.read_bytes() for p in sorted(output.rglob("*")) if p.is_file()}


@pytest.mark.slow
def test_output_depends_neither_on_hash_seed_nor_locale_nor_folder(tmp_path):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    copies = shutil.copytree(resources.bundled_specs(), tmp_path / "copies")
    environment = {"PYTHONHASHSEED": "4711", "LC_ALL": "tr_TR.UTF-8", "PYTHONPATH": str(ROOT), "TZ": "Asia/Tokyo"}
    assert built(tmp_path, environment, elsewhere, specs=copies) == expected()


@pytest.mark.slow
def test_wheel_builds_the_same_bytes_and_carries_its_data(tmp_path):
    pytest.importorskip("build")
    dist = tmp_path / "dist"
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(dist), str(ROOT)]
    process = subprocess.run(command, check=False, capture_output=True, text=True)
    if "No module named" in process.stdout + process.stderr:
        pytest.skip("no hatchling in this environment")
    assert process.returncode == 0, process.stdout + process.stderr
    (wheel,) = dist.iterdir()
    unpacked = tmp_path / "unpacked"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(unpacked)
    work = tmp_path / "work"
    work.mkdir()
    environment = {"PYTHONPATH": str(unpacked)}
    where = subprocess.run(
        [sys.executable, "-P", "-c", BUILD, "list", "--path", "kepler"],
        check=True, capture_output=True, text=True, cwd=work, env={**os.environ, **environment},
    )  # fmt: skip
    assert Path(where.stdout.strip()).is_relative_to(unpacked)
    assert built(tmp_path, environment, work, ("-P",), unpacked / "phigen" / "_data" / "specs") == expected()
