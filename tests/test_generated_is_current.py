"""The shipped examples are the golden files: generated/ is what `phigen build specs` writes, on every machine."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import solvers
import systems
from click.testing import CliRunner

from phigen import resources
from phigen.cli import group

ROOT = resources.bundled_specs().parent
GENERATED = ROOT / "generated"
SUFFIXES = {"c": ("c", "h"), "numpy": ("py",), "js": ("mjs",)}
NAMES = ["lotka_volterra", "kepler", "so4_manakov", "pendulum_euler", "vortices3"]
#: Systems of the corpus that tests of their own are about.
BESIDE = (*systems.TIMED, *systems.FORCED, *systems.NOISY, *systems.MONITORED, *systems.COLLOCATED)

BUILD = "from phigen.cli import main; main()"


@pytest.mark.parametrize("name", [*systems.NAMES, *BESIDE, *systems.LATTICES])
def test_generated_is_what_is_made_of_the_spec(name):
    compilation = systems.as_given(name)
    for target in compilation.spec.targets:
        for file, text in solvers.files(compilation, target).items():
            assert (GENERATED / name / file).read_text(encoding="utf-8") == text, "make golden makes it anew"


def test_generated_is_what_phigen_build_writes(monkeypatch):
    """All of it, in processes of their own: see below; `make golden` does it for the others."""
    monkeypatch.chdir(ROOT)
    done = CliRunner().invoke(group, ["build", "specs/pendulum_euler.yaml", "--check"], prog_name="phigen")
    assert done.exit_code == 0, done.stderr


def test_nothing_else_is_generated():
    found = {str(p.relative_to(GENERATED)) for p in GENERATED.rglob("*") if p.is_file()}
    names = (*systems.NAMES, *BESIDE, *systems.LATTICES)
    targets = [(name, target) for name in names for target in systems.spec_of(name).targets]
    assert found == {f"{name}/{name}.{suffix}" for name, target in targets for suffix in SUFFIXES[target]}


def golden():
    """The files that `built` should make."""
    return {str(p.relative_to(GENERATED)): p.read_bytes() for n in NAMES for p in (GENERATED / n).iterdir()}


def built(tmp_path, environment=None, cwd=None, python=(), specs=None):
    """The files that a process of its own writes: name → bytes."""
    specs = specs or resources.bundled_specs()
    output = tmp_path / f"out{len(list(tmp_path.iterdir()))}"
    files = [str(specs / f"{name}.yaml") for name in NAMES]
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
    assert built(tmp_path, environment, elsewhere, specs=copies) == golden()


@pytest.mark.slow
def test_wheel_builds_the_same_bytes_and_carries_its_data(tmp_path):
    pytest.importorskip("build")
    dist = tmp_path / "dist"
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(dist), str(ROOT)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if "No module named" in done.stdout + done.stderr:
        pytest.skip("no hatchling in this environment")
    assert done.returncode == 0, done.stdout + done.stderr
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
    assert built(tmp_path, environment, work, ("-P",), unpacked / "phigen" / "_data" / "specs") == golden()
