"""``phigen run``: files that grow during the run, interruptions, --resume, sections, exponents, figures."""

import json
import os
import re
import signal
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from interrupting import interrupted
from systems import slow_but

from phigen import resources

SPECS = resources.bundled_specs()
#: A run with a section, Lyapunov exponents and a gauge.
EVERYTHING = (SPECS / "rigid_body.yaml", "--run", "tumbling", "--lyapunov")


@pytest.fixture(autouse=True)
def no_comparison(monkeypatch):
    """Omit the comparison with classical methods, which is slow and not tested in this file."""
    from phigen.cli import experiment

    prepared = experiment.prepared

    def alone(*args, **kwargs):
        run = prepared(*args, **kwargs)
        return experiment.replace(run, run=experiment.replace(run.run, compare=()))

    monkeypatch.setattr("phigen.cli.run.prepared", alone)


def files(*names):
    return [Path(name).read_bytes() for name in names]


@pytest.mark.thin(3)
@pytest.mark.parametrize(
    ("name", "target", "suffix"),
    [("rigid_body", "c", "csv"), ("pendulum_euler", "numpy", "csv"),
     ("charged_particle", "c", "npz"), pytest.param("rigid_body", "numpy", "npz", marks=pytest.mark.slow)],
)  # fmt: skip
def test_an_interrupted_run_goes_on_to_the_same_bytes(phigen, in_tmp, name, target, suffix):
    run = ("run", SPECS / f"{name}.yaml", "-t", target, "--steps", 2000, "-o", f"a.{suffix}", "--json")
    whole = phigen(*run)
    assert whole.exit_code == 0, whole.stderr
    expected = files(f"a.{suffix}")
    Path(f"a.{suffix}").unlink()
    for pieces, resume in ((3, []), (2, ["--resume"])):
        with interrupted(pieces, steps=7):
            stopped = phigen(*run, *resume)
        assert stopped.exit_code == 130, stopped.stderr
        assert "interrupted after" in stopped.stderr
        assert Path(f"a.{suffix}.checkpoint").exists()
    assert 0 < json.loads(stopped.stdout)["steps"] < 2000
    result = phigen(*run, "--resume")
    assert result.exit_code == 0, result.stderr
    assert files(f"a.{suffix}") == expected
    assert json.loads(result.stdout) == json.loads(whole.stdout)
    assert sorted(p.name for p in in_tmp.iterdir()) == [f"a.{suffix}"] + ["a.csv-metadata.json"] * (suffix == "csv")


def test_a_run_interrupted_before_its_first_step_stores_its_start_once(phigen, in_tmp):
    """The resumed run stores the initial state once, whether the checkpoint of step 0 was written before this state was
    stored or after.
    """
    run = ("run", SPECS / "rigid_body.yaml", "-t", "numpy", "--steps", 9, "-o", "a.csv")
    with interrupted(0, steps=7):
        assert "interrupted after 0 of 9 steps" in phigen(*run).stderr
    assert len(Path("a.csv").read_text().splitlines()) == 2
    assert phigen(*run, "--resume").exit_code == 0
    times = [row.split(",")[0] for row in Path("a.csv").read_text().splitlines()]
    assert times[:3] == ["t", "0.0", "0.1"]
    assert len(times) == len(set(times)) == 7  # the header, every second state, and the last one


@pytest.mark.slow
def test_sections_and_exponents_go_on_as_well(phigen, in_tmp):
    run = ("run", *EVERYTHING, "--steps", 1500, "--section", "s.csv", "-o", "a.npz", "--plot", "f.svg", "--json")
    whole = phigen(*run)
    assert json.loads(whole.stdout)["section"]["crossings"] > 1
    names = ("a.npz", "s.csv", "f.svg")
    expected = files(*names)
    for name in names:
        Path(name).unlink()
    with interrupted(15, steps=77):
        assert phigen(*run).exit_code == 130
    with np.load("a.npz") as stored:  # the file of an interrupted run can be read
        assert 10 < len(stored["t"]) < 140
    assert len(Path("s.csv").read_text().splitlines()) > 1
    result = phigen(*run, "--resume")
    assert files(*names) == expected
    assert result.stdout == whole.stdout


KILLED = """
import sys
from phigen.cli import main, recording
from phigen.runtime import march
recording.CHECKPOINT_SECONDS = 0.1
march._MOST_STEPS = 200
sys.argv[0] = "phigen"
main()
"""


KILLS = [(signal.SIGKILL, -9), (signal.SIGINT, 130)]


@pytest.mark.parametrize(("number", "code"), slow_but([], KILLS))
def test_a_killed_run_goes_on_to_the_same_bytes(phigen, in_tmp, number, code):
    run = ["run", SPECS / "pendulum_euler.yaml", "--steps", 60_000, "-t", "numpy", "-o", "a.csv"]
    command = [sys.executable, "-c", KILLED, *map(str, run)]
    paths = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    environment = {**os.environ, **paths}
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment) as process:
        while not (Path("a.csv").exists() and Path("a.csv").stat().st_size > 2000):
            assert process.poll() is None, process.stderr.read()
            time.sleep(0.01)
        process.send_signal(number)
        process.communicate()
    assert process.returncode == code
    some = files("a.csv")[0]
    assert phigen(*run, "--resume").exit_code == 0
    resumed = files("a.csv")[0]
    assert phigen(*run).exit_code == 0
    assert files("a.csv")[0] == resumed
    assert len(some) < len(resumed)
    assert resumed.startswith(some[: some.rindex(b"\n")])


def test_an_integration_that_fails_keeps_its_rows(phigen, in_tmp):
    run = ("run", SPECS / "lotka_volterra.yaml", "--step", "0.01", "--steps", "100", "-o", "a.npz", "--plot", "a.png")
    result = phigen(*run)
    assert result.exit_code == 7
    with np.load("a.npz") as stored:
        assert len(stored["t"]) == 1 + 25 // 10 + 1
        assert stored["steps"] == 25
    assert sorted(p.name for p in in_tmp.iterdir()) == ["a.npz", "a.png"]


@pytest.mark.slow
def test_resuming_another_run_is_refused_and_says_why(phigen, in_tmp):
    run = ("run", SPECS / "rigid_body.yaml", "-o", "a.csv")
    with interrupted(3):
        assert phigen(*run).exit_code == 130
    contents = files("a.csv", "a.csv.checkpoint")
    for change, said in [
        (("--step", "0.01"), "step was 0.05 and is 0.01"),
        (("--set", "I1=5"), "parameters was"),
        (("--set", "x1=0.5"), "initial was"),
        (("--order", "4"), "order was 6 and is 4"),
        (("-t", "numpy"), "target was .c. and is .numpy."),
        (("--run", "tumbling"), "run was 'reference' and is 'tumbling'"),
        (("--lyapunov",), "lyapunov was False and is True"),
    ]:
        result = phigen(*run, *change, "--resume")
        assert result.exit_code == 2, change
        assert re.search(said, result.stderr)
    assert "continue it with --resume, or remove the file" in phigen(*run).stderr
    assert files("a.csv", "a.csv.checkpoint") == contents
    Path("a.csv").write_text("t\n")
    assert "fewer than" in phigen(*run, "--resume").stderr
    Path("a.csv.checkpoint").write_text("nonsense")
    assert "is not a checkpoint" in phigen(*run, "--resume").stderr


def test_a_changed_spec_is_not_resumed(phigen, write):
    path = write("a.yaml")
    with interrupted(3):
        assert phigen("run", path, "-o", "a.csv").exit_code == 130
    path.write_text(path.read_text().replace("(q**2 + p**2)/2", "(q**2 + p**2)/2 + q**4"))
    result = phigen("run", path, "-o", "a.csv", "--resume")
    assert result.exit_code == 2
    assert "the spec has changed" in result.stderr


def test_resume_without_an_interrupted_run(phigen, write):
    path = write("a.yaml")
    assert "by --output or --section" in phigen("run", path, "--resume").stderr
    # Without a checkpoint the run starts at its initial state.
    assert phigen("run", path, "-o", "a.csv", "--resume").exit_code == 0
    assert "its run is complete" in phigen("run", path, "-o", "a.csv", "--resume").stderr


@pytest.mark.slow
def test_memory_does_not_grow_with_the_length_of_a_run(phigen, in_tmp, monkeypatch):
    # Otherwise the size of a block depends on the speed of the machine.
    monkeypatch.setattr("phigen.runtime.march._MOST_ROWS", 32)
    # This is the number of points of the figure, smaller than the number of rows of both runs.
    monkeypatch.setattr("phigen.cli.recording.POINTS", 500)

    def peak(steps):
        tracemalloc.start()
        result = phigen("run", SPECS / "harmonic_oscillator.yaml", "--steps", steps, "-o", "a.npz", "-q")
        peak_memory = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert result.exit_code == 0
        return peak_memory

    peak(1000)  # the first run loads modules that stay in memory
    short, long = peak(4_000), peak(16_000)
    assert long < 1.2 * short


@pytest.mark.slow
def test_section_and_exponents_are_reported(phigen, in_tmp):
    result = phigen("run", *EVERYTHING, "--steps", 3000, "--section", "s.npz", "--json")
    document = json.loads(result.stdout)
    with np.load("s.npz") as stored:
        assert len(stored["t"]) == document["section"]["crossings"]
        assert np.max(np.abs(stored["x"][:, 2])) < 1e-15
    exponents = document["lyapunov"]["exponents"]
    assert exponents == sorted(exponents, reverse=True)
    assert abs(document["lyapunov"]["sum"]) < 1e-10
    assert document["lyapunov"]["history"]["time"][-1] == document["time"] == document["lyapunov"]["time"]
    shown = phigen("run", *EVERYTHING, "--steps", 3000).stdout
    assert "crossings of the section x3 = 0" in shown
    assert "Lyapunov exponents after t = 300" in shown


def test_a_section_needs_one_in_the_spec(phigen, write):
    result = phigen("run", write("a.yaml"), "--section", "s.csv")
    assert result.exit_code == 2
    assert "has no section" in result.stderr


@pytest.mark.parametrize("option", [("-o", "a.xls"), ("--section", "a.txt"), ("--plot", "a.jpg")])
def test_files_of_other_kinds_are_refused_before_the_work(phigen, in_tmp, option):
    result = phigen("run", "nowhere.yaml", *option)
    assert result.exit_code == 2
    assert "must end in" in result.stderr


@pytest.mark.parametrize("command", [("run", "-o", "a.csv"), ("run", "--plot", "a.svg"), ("tune", "--plot", "a.svg")])
def test_missing_folders_are_reported_before_the_work(phigen, in_tmp, command):
    name, option, file = command
    result = phigen(name, "nowhere.yaml", option, f"lost/{file}")
    assert result.exit_code == 2
    assert "there is no folder 'lost'" in result.stderr


@pytest.mark.slow
@pytest.mark.parametrize("suffix", slow_but(["svg"], ["png", "svg", "pdf"]))
def test_the_same_run_is_drawn_with_the_same_bytes(phigen, write, suffix):
    path = write("a.yaml")
    for name in ("one", "two"):
        assert phigen("run", path, "--plot", f"{name}.{suffix}").exit_code == 0
    assert files(f"one.{suffix}") == files(f"two.{suffix}")


def test_figures_without_matplotlib_are_refused_before_the_work(phigen, write, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    result = phigen("run", write("a.yaml"), "--plot", "a.png", "-o", "a.csv")
    assert result.exit_code == 2
    assert "pip install matplotlib" in result.stderr
    assert not Path("a.csv").exists()


def test_with_noise_states_are_stored_after_whole_steps_only(phigen, tmp_path):
    """A shorter step would draw other random numbers than the whole step, so its end would not lie on the path."""

    def made(name, *options):
        path = tmp_path / name
        result = phigen("run", "double_well", "-t", "numpy", "--steps", "8", *options, "-o", path)
        return result, path.read_text().splitlines() if result.exit_code == 0 else []

    (_, every), (_, some) = made("a.csv", "--every", "0.1"), made("b.csv", "--at", "0.1,0.3")
    assert some[2:4] == [every[2], every[4]]
    part, _ = made("c.csv", "--at", "0.12")
    assert part.exit_code == 2
    assert "0.12 is inside a step" in part.stderr


@pytest.mark.slow
def test_states_too_far_apart_for_the_energy_balance_are_reported(phigen, in_tmp):
    duffing = ("run", str(resources.bundled()["duffing"]), "--target", "numpy")
    assert "too far apart" not in phigen(*duffing).stdout
    assert "too far apart for an accurate integral" in phigen(*duffing, "--every", 2).stdout


#: Files that ``phigen run`` cannot have written, given by their text or their arrays, and the error for each.
STRANGE = {
    "twice.csv": ("t,q,p,q\n0,1,2,3\n", "two columns have the same name"),
    "short.csv": ("t,q,p,energy\n0,1,2\n", "rows of another length"),
    "nan.csv": ("t,q,p\n0,1,nan\n", "its last state is not finite"),
    "names.csv": ("t,q,p\n", "has no rows"),
    "empty.csv": ("", "has no rows"),
    "complex.npz": ({"t": [0.0], "x": [[1j, 0]]}, "x is not an array of 2 real numbers"),
    "texts.npz": ({"t": [0.0], "x": [["a", "b"]]}, "x is not an array of 2 real numbers"),
    "wide.npz": ({"t": [0.0], "x": [[1.0, 2.0, 3.0]]}, "x is not an array of 2 real numbers"),
    "flat.npz": ({"t": 0.0, "x": [[1.0, 2.0]]}, "t is not an array of 1 real numbers"),
}


@pytest.mark.parametrize("file", STRANGE)
def test_a_run_does_not_start_from_what_no_run_has_written(phigen, write, file):
    content, why = STRANGE[file]
    path = write("a.yaml")
    if isinstance(content, dict):
        np.savez(file, **content)
    else:
        Path(file).write_text(content)
    result = phigen("run", path, "-t", "numpy", "--from", file)
    assert result.exit_code == 2
    assert why in " ".join(result.stderr.split())


def test_more_members_than_there_is_memory_for_are_refused_at_their_place(phigen, write):
    noisy = (
        "phigen: 1\nname: thermal\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
        "hamiltonian: p**2/2 + q**2/2\nnoise: {w: {hamiltonian: q}}\n"
        "runs: {a: {initial: [1, 0], step: 0.1, steps: 10, members: 4294967296}}\n"
    )
    result = phigen("run", write("a.yaml", noisy), "-t", "numpy")
    assert result.exit_code == 3
    assert "a.yaml:7:60: error: 4294967296 members take 192 GiB of memory" in result.stderr
