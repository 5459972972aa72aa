"""``phigen run``: runs that end at a given time or where an expression vanishes, states at given times, and runs that
continue from files.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from interrupting import interrupted

from phigen import compile as compiled
from phigen import spec as specs

SWING = """phigen: 1
name: swing
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: (p**2 + q**2)/2
order: 8
targets: [numpy]
runs:
  steps: {initial: [1, 0], step: 0.1, steps: 60}
  until: {initial: [1, 0], step: 0.1, until: 6.05, stride: 10}
  stopped: {initial: [1, 0], step: 0.1, steps: 100, stop: q - 1/2, every: 0.3}
  listed: {initial: [1, 0], step: 0.1, until: 2.05, at: [1.3, 0.25, 2]}
  past: {initial: [1, 0], step: -0.1, steps: 20, at: [-1.33, -0.5], stop: q}
  back: {initial: [0, 1], step: -0.1, steps: 100, stop: q}
  never: {initial: [1, 0], step: 0.1, steps: 20, stop: q - 2}
  falling: {initial: [1, 0], step: 0.1, steps: 140, section: p, direction: falling}
  both: {initial: [1, 0], step: 0.1, steps: 140, section: q, direction: both}
"""
#: A rigid body with a monitor g: its steps are equal in the time τ with dt = g dτ, so its physical time t has no closed
#: form.
BODY = """phigen: 1
name: slowed
coordinates: [x1, x2, x3]
poisson: {brackets: {x1: {x2: -x3, x3: x2}, x2: {x3: -x1}}}
hamiltonian: (x1**2 + x2**2/2 + x3**2/3)/2
casimirs: {C: x1**2 + x2**2 + x3**2}
monitor: 1/(1 + x1**2)
order: 2
targets: [numpy]
runs:
  tumbling: {initial: [0.5, 1, 0.2], step: 0.05, until: 5, stride: 5}
"""
TURNING = BODY.replace("monitor: 1/(1 + x1**2)", "reconstruct: quaternion")


def ran(phigen, *args):
    result = phigen("run", *args, "-t", "numpy", "-q")
    assert result.exit_code == 0, result.stderr
    return result


def table(path):
    return np.loadtxt(path, delimiter=",", skiprows=1)


@pytest.fixture
def swing(write):
    return write("swing.yaml", SWING)


def test_a_run_ends_at_its_time_by_a_part_of_a_step(phigen, swing):
    output = ran(phigen, swing, "--run", "until", "-o", "a.csv", "--json").stdout
    rows = table("a.csv")
    assert rows[:, 0] == pytest.approx([0, 1, 2, 3, 4, 5, 6, 6.05], rel=1e-15)
    assert rows[:, 1] == pytest.approx(np.cos(rows[:, 0]), abs=1e-11)
    assert json.loads(output)["steps"] == 60
    ran(phigen, swing, "--run", "steps", "--until", 0.03, "-o", "b.csv")
    assert table("b.csv")[-1, :2] == pytest.approx([0.03, np.cos(0.03)], abs=1e-13)


def test_a_run_ends_where_an_expression_vanishes_first_to_roundoff(phigen, swing):
    ran(phigen, swing, "--run", "stopped", "-o", "a.csv")
    rows = table("a.csv")
    assert rows[:, 0] == pytest.approx([0, 0.3, 0.6, 0.9, np.pi / 3], abs=1e-11)
    assert rows[-1, 1] == pytest.approx(0.5, abs=2e-16)
    ran(phigen, swing, "--run", "back", "-o", "b.csv")  # the run also starts at a zero of stop, which does not end it
    assert table("b.csv")[-1, 0] == pytest.approx(-np.pi, abs=1e-11)
    never = phigen("run", swing, "--run", "never", "-t", "numpy", "-o", "c.csv")
    assert "the expression under stop: has no zero during the run" in never.stderr
    assert len(table("c.csv")) == 21


def test_of_an_end_in_time_and_a_stop_the_first_counts(phigen, swing):
    for until, end in ((1.04, 1.04), (1.049, np.pi / 3), (7, np.pi / 3)):
        ran(phigen, swing, "--run", "stopped", "--until", until, "-o", "a.csv")
        assert table("a.csv")[-1, 0] == pytest.approx(end, abs=1e-11)


@pytest.mark.parametrize(("name", "expected"), [("falling", [2, 4]), ("both", [0.5, 1.5, 2.5, 3.5])])
def test_sections_have_a_direction(phigen, swing, name, expected):
    result = ran(phigen, swing, "--run", name, "--section", "s.csv")
    crossing_times = table("s.csv")[:, 0]
    assert crossing_times[crossing_times > 0] == pytest.approx(
        np.pi * np.array([e for e in expected if e * np.pi < 14]), abs=1e-9
    )
    assert ("crossings" if name == "both" else "falling crossings") in result.stdout


def test_states_at_given_times(phigen, swing):
    Path("times.txt").write_text("2\n0.25, 0\n 6\n")
    for texts, times in (
        (["1.234"], [1.234, 6]),
        (["times.txt"], [0.25, 2, 6]),
        (["5.5", "1.5, 3", "times.txt"], [0.25, 1.5, 2, 3, 5.5, 6]),
    ):  # fmt: skip
        ran(phigen, swing, "--run", "steps", *(word for text in texts for word in ("--at", text)), "-o", "a.csv")
        rows = table("a.csv")
        assert rows[:, 0] == pytest.approx([0, *times], rel=1e-15)
        assert rows[:, 1] == pytest.approx(np.cos(rows[:, 0]), abs=1e-11)


@pytest.mark.thin(2)
@pytest.mark.parametrize(
    ("text", "suffix"), [(SWING, "csv"), (SWING, "npz"), (BODY, "npz"), (TURNING, "csv")],
    ids=["csv", "npz", "monitor", "attitude"],
)  # fmt: skip
def test_a_finished_run_is_extended_as_if_it_had_not_ended(phigen, write, text, suffix):
    """An extended run goes on with the gauge of its start or, with a monitor, with the energy level e = −H(x₀) of its
    start x₀. Its errors are those of the whole run.
    """
    spec = write("spec.yaml", text)
    whole = ran(phigen, spec, "--until", 3, "-o", f"a.{suffix}", "--json")
    ran(phigen, spec, "--until", 2, "-o", f"b.{suffix}")
    result = ran(phigen, spec, "--until", 3, "--extend", "-o", f"b.{suffix}", "--json")
    if suffix == "csv":
        assert np.array_equal(*(np.array(Path(f"{n}.csv").read_text().splitlines()[0]) for n in "ab"))
        a, b = table("a.csv"), table("b.csv")
    else:
        with np.load("a.npz") as one, np.load("b.npz") as other:
            a, b = (np.column_stack([columns["t"], columns["x"]]) for columns in (one, other))
            assert "monitor" not in text or one["tau"].shape == one["t"].shape
    # For each row of a, the distance to the nearest row of b.
    apart = np.abs(b[:, None, :] - a[None]).max(axis=2).min(axis=0)
    # With a monitor, the shorter last step of the first part shifts all later rows.
    assert np.sum(apart < 1e-12) >= 0.4 * len(a)
    assert text == BODY or (apart < 1e-12).all()
    assert b[-1] == pytest.approx(a[-1], abs=1e-4 if text == BODY else 1e-12)
    errors = [json.loads(process.stdout)["methods"][0]["energy"]["error"] for process in (whole, result)]
    assert errors[1] == pytest.approx(errors[0], rel=0.3, abs=1e-14)


def test_an_extension_holds_the_e_of_the_start(phigen, write):
    """An extension uses the energy level e = −H(x₀) of the first state x₀ of the whole run. The energy of the state
    where the extension begins differs by the energy error.
    """
    spec = write("spec.yaml", BODY)
    ran(phigen, spec, "--steps", 80, "-o", "a.csv")
    ran(phigen, spec, "--steps", 40, "-o", "b.csv")
    ran(phigen, spec, "--steps", 40, "--extend", "-o", "b.csv")
    assert table("b.csv") == pytest.approx(table("a.csv"), abs=1e-13)


@pytest.mark.thin(2)
@pytest.mark.parametrize("how", ["--extend", "--from"])
# At the first three levels, rounding puts the stored end just before the zero.
@pytest.mark.parametrize("level", ["0.46", "0.1", "0.02", "0.5"])
def test_a_run_that_goes_on_from_a_stop_ends_at_the_next_one(phigen, write, how, level):
    spec = write("spec.yaml", SWING.replace("stop: q - 1/2, every: 0.3", f"stop: q - {level}"))
    ran(phigen, spec, "--run", "stopped", "-o", "a.csv")
    first = table("a.csv")[-1, 0]
    assert first == pytest.approx(np.arccos(float(level)), abs=1e-11)
    if how == "--from":
        ran(phigen, spec, "--run", "stopped", "--from", "a.csv", "-o", "b.csv")
        assert first + table("b.csv")[-1, 0] == pytest.approx(2 * np.pi - first, abs=1e-9)
    else:
        ran(phigen, spec, "--run", "stopped", "--extend", "-o", "a.csv")
        assert table("a.csv")[-1, 0] == pytest.approx(2 * np.pi - first, abs=1e-9)


def test_a_run_starts_where_another_ended(phigen, write):
    spec = write("spec.yaml", TURNING)
    ran(phigen, spec, "--until", 2, "-o", "a.npz")
    ran(phigen, spec, "--until", 1, "--from", "a.npz", "-o", "b.csv")
    with np.load("a.npz") as first:
        second = table("b.csv")[0]
        assert second[1:4].tolist() == first["x"][-1].tolist()
        assert second[-4:] == pytest.approx(first["attitude"][-1], abs=1e-15)


def test_times_beyond_a_stop_are_left_out_and_a_long_time_between_rows_leaves_both_ends(phigen, swing):
    ran(phigen, swing, "--run", "stopped", "--at", "0.5,7", "-o", "a.csv")
    assert table("a.csv")[:, 0] == pytest.approx([0, 0.5, np.pi / 3], abs=1e-11)
    ran(phigen, swing, "--run", "steps", "--every", 9, "-o", "a.csv", "--force")
    assert table("a.csv")[:, 0] == pytest.approx([0, 6], abs=1e-14)


@pytest.mark.parametrize("rows", [(), ("--every", 0.37), ("--at", "4.72")])
def test_crossings_do_not_depend_on_which_rows_are_stored_and_parts_of_steps_have_them_too(phigen, swing, rows):
    ran(phigen, swing, "--run", "both", "--until", 4.72, *rows, "--section", "s.csv")  # the last whole step ends at 4.7
    assert table("s.csv")[:, 0] == pytest.approx([np.pi / 2, 3 * np.pi / 2], abs=1e-9)


def test_an_extension_looks_for_a_section_that_depends_on_the_time_at_its_own_times(phigen, write):
    clock = SWING.replace("order: 8", "time: t\norder: 2").replace("section: q", "section: t - 5")
    spec = write("spec.yaml", clock)
    ran(phigen, spec, "--run", "both", "--until", 4, "-o", "a.csv")
    document = json.loads(ran(phigen, spec, "--run", "both", "--until", 6, "--extend", "-o", "a.csv", "--json").stdout)
    assert document["section"]["crossings"] == 1


def test_exponents_do_not_depend_on_which_rows_are_stored(phigen, swing):
    every, whole = (
        json.loads(ran(phigen, swing, "--until", 2.05, *rows, "--lyapunov", "--json").stdout)["lyapunov"]
        for rows in (("--every", 0.37), ())
    )
    assert every == whole
    short = json.loads(ran(phigen, swing, "--until", 0.05, "--lyapunov", "--json").stdout)
    assert "lyapunov" not in short  # a run without a whole step has no exponents


@pytest.mark.thin(2)
@pytest.mark.parametrize(
    "rows", [("--until", 2.03), ("--until", 2.03, "--every", 0.5), ("--until", 0.05), ("--steps", 7)]
)
@pytest.mark.parametrize("text", [SWING, BODY], ids=["time", "monitor"])
def test_compared_methods_have_the_same_times(phigen, write, text, rows):
    spec = write("spec.yaml", text.replace("stride: 5}", "stride: 5, compare: [dop853]}").replace(
        "steps: 60}", "steps: 60, stride: 3, compare: [dop853]}"))  # fmt: skip
    record, other = json.loads(ran(phigen, spec, *rows, "--json").stdout)["methods"]
    assert other["rows"] == other["good"] > 1
    assert text == BODY or other["rows"] == record["rows"]
    assert other["energy"]["error"] < 1e-9


NOISY = SWING.replace("order: 8", "order: 2\nnoise: {kick: {hamiltonian: q, amplitude: 0.1}}").split("  until:")[0]


@pytest.mark.thin(2)
@pytest.mark.parametrize("scheme", ["series", "splitting"])
def test_means_are_over_members_with_the_steps_of_the_run(phigen, write, scheme):
    """The first of two members is the run itself. The standard error of two values is their distance from the mean, so
    the final state lies at this distance.
    """
    spec = write("spec.yaml", NOISY.replace("steps: 60}", "steps: 60, seed: 5, members: 2}") + f"scheme: {scheme}\n")

    def told(*args):
        document = json.loads(ran(phigen, spec, *args, "--json").stdout)
        for name, mean in document["means"].items():
            value = document["final"].get(name, mean["mean"] + mean["error"])
            assert abs(value - mean["mean"]) == pytest.approx(mean["error"], abs=1e-13)
        return document["means"]

    told("--until", 2.05)
    whole = told("--until", 3)
    told("--until", 2, "-o", "a.csv")
    extended = told("--until", 3, "--extend", "-o", "a.csv")
    assert all(extended[name]["mean"] == pytest.approx(whole[name]["mean"], abs=1e-13) for name in whole)
    told("--until", 2.05, "-o", "b.csv")
    refused = phigen("run", spec, "--until", 3, "--extend", "-o", "b.csv", "-t", "numpy")
    assert (refused.exit_code, "ends with a shorter step" in refused.stderr) == (2, True)


@pytest.mark.thin(2)
@pytest.mark.parametrize("members", [1, 2])
def test_another_seed_is_that_of_a_spec_with_it(phigen, write, members):
    spec = write("spec.yaml", NOISY.replace("steps: 60}", f"steps: 60, members: {members}}}"))
    other = write("other.yaml", NOISY.replace("steps: 60}", f"steps: 60, members: {members}, seed: 7}}"))

    def told(*args):
        document = json.loads(ran(phigen, *args, "--json").stdout)
        return document["seed"], document["final"], document.get("means")

    assert told(spec, "--seed", 7) == told(other) == told(other, "--seed", 7)
    assert told(other, "--seed", 0) == told(spec) != told(other)


def test_an_extension_with_the_same_seed_goes_on_along_its_path(phigen, write):
    spec = write("spec.yaml", NOISY)
    ran(phigen, spec, "--seed", 7, "-o", "a.csv")
    ran(phigen, spec, "--seed", 7, "--steps", 20, "-o", "b.csv")
    ran(phigen, spec, "--seed", 7, "--steps", 40, "--extend", "-o", "b.csv")
    assert table("b.csv") == pytest.approx(table("a.csv"), abs=1e-13)


def test_noise_after_a_part_of_a_step_is_new(phigen, write):
    """A step that is shortened to end at a given time uses up the random numbers of its step, so the next step draws
    new ones.
    """
    still = NOISY.replace("(p**2 + q**2)/2", "p - p").replace("hamiltonian: p - p", "hamiltonian: 0")
    spec = write("spec.yaml", still)
    ran(phigen, spec, "--until", 0.22, "-o", "a.csv")
    ran(phigen, spec, "--steps", 1, "--extend", "-o", "a.csv")
    t, _, p = table("a.csv")[:, :3].T
    drawn = np.diff(p) / np.sqrt(np.diff(t))
    assert abs(drawn[-1] - drawn[-2]) > 1e-6


@pytest.mark.parametrize(
    ("text", "end"), [(SWING, ("--until", 5.03)), pytest.param(BODY, ("--steps", 80), marks=pytest.mark.slow)]
)
def test_an_interrupted_run_with_given_times_goes_on_to_the_same_bytes(phigen, write, text, end):
    run = ("run", write("spec.yaml", text), "-t", "numpy", "--every", 0.07, *end, "-q")
    assert phigen(*run, "-o", "a.csv").exit_code == 0
    with interrupted(2), pytest.MonkeyPatch.context() as patch:
        patch.setattr("phigen.runtime.march._MOST_ROWS", 9)
        assert phigen(*run, "-o", "b.csv").exit_code == 130
    assert 2 < len(table("b.csv")) < 60
    assert phigen(*run, "-o", "b.csv", "--resume").exit_code == 0
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()


def test_another_step_keeps_the_duration_or_the_number_of_steps(phigen, write):
    """With another step size, a run keeps its ``duration``, by a shorter last step if necessary, or its ``steps``. With
    a monitor the duration is in τ, where a shorter step is refused.
    """
    spec = write("spec.yaml", SWING.replace("steps: 60}", "duration: 6, stride: 30}"))
    cases = ((0.05, 120, 6), (0.07, 85, 6), (-0.1, 60, -6), (3, 2, 6))
    for step, steps, end in cases:
        document = json.loads(ran(phigen, spec, "--step", step, "--json").stdout)
        assert (document["steps"], document["time"]) == (steps, pytest.approx(end, rel=1e-14))
    document = json.loads(ran(phigen, spec, "--step", 0.07, "--steps", 9, "--json").stdout)
    assert (document["steps"], document["time"]) == (9, pytest.approx(0.63))
    plain = write("plain.yaml", SWING)
    assert json.loads(ran(phigen, plain, "--step", 0.07, "--json").stdout)["steps"] == 60
    body = write("body.yaml", BODY.replace("until: 5", "duration: 5"))
    assert json.loads(ran(phigen, body, "--step", 0.1, "--json").stdout)["steps"] == 50
    assert json.loads(ran(phigen, body, "--step", 0.07, "--until", 1, "--json").stdout)["time"] == pytest.approx(1)
    refused = phigen("run", body, "--step", 0.07)
    assert (
        refused.exit_code,
        "the duration 5 is not a whole number of steps of 0.07 (it is 71.4285714 steps)" in refused.stderr,
    ) == (2, True)


@pytest.mark.thin(2)
@pytest.mark.parametrize(("name", "steps"), [("until", 60), ("stopped", 10), ("back", 31), ("never", 20)])
def test_verify_makes_the_whole_steps_of_the_run(phigen, swing, name, steps):
    (record,) = json.loads(phigen("verify", swing, "--run", name, "--quick", "--json", "-q").stdout)
    assert (record["steps"], record["clock"]) == (steps, "t")


def test_verify_makes_one_step_of_a_run_that_is_shorter(phigen, write):
    spec = write("spec.yaml", SWING.replace("until: 6.05, stride: 10", "until: 0.03"))
    (record,) = json.loads(phigen("verify", spec, "--run", "until", "--quick", "--json", "-q").stdout)
    assert record["steps"] == 1


@pytest.fixture
def asked(monkeypatch):
    """Return a function that runs a command up to its call of the function at ``place``, and returns the arguments of
    this call.
    """

    def asked_of(phigen, place, *args):
        call_arguments = []

        def stop(*arguments, **options):
            call_arguments.extend(arguments)
            raise SystemExit(0)

        monkeypatch.setattr(place, stop)
        assert phigen(*args).exit_code == 0
        return call_arguments

    return asked_of


@pytest.mark.slow
def test_verify_makes_steps_in_tau_up_to_a_physical_time(phigen, write, asked):
    """The time t = 5 of this run corresponds to τ = 6.63, so verify makes 132 steps of 0.05, as the run does."""
    spec = write("spec.yaml", BODY)
    assert json.loads(ran(phigen, spec, "--json").stdout)["steps"] == 132
    arguments = asked(phigen, "phigen.study.verification.verify", "verify", spec)
    assert arguments[5:7] == [0.05, 132]


@pytest.mark.slow
def test_verify_says_that_steps_are_in_tau(phigen, write):
    result = phigen("verify", write("spec.yaml", BODY), "--quick", "-q")
    assert result.exit_code == 0
    assert "132 steps of 0.05 in τ" in result.stdout


@pytest.mark.thin(2)
@pytest.mark.parametrize(
    ("text", "name", "horizon", "clock"),
    [(SWING, "until", 6.05, "t"), (SWING, "stopped", np.pi / 3, "t"), (BODY, "tumbling", 6.6319085, "τ")],
)
def test_tune_measures_up_to_the_end_of_the_run(phigen, write, asked, text, name, horizon, clock):
    _, problem, *_ = asked(phigen, "phigen.tuning.study.tune", "tune", write("spec.yaml", text), "--run", name)
    assert (problem.horizon, problem.clock) == (pytest.approx(horizon, abs=1e-7), clock)


@pytest.mark.slow
def test_tune_measures_orbits_in_tau_and_proposes_lines_for_the_run(phigen, write):
    """All methods make their steps in τ, so that their orbits can be compared at equal τ."""
    spec = write("spec.yaml", BODY.replace("stride: 5", "stop: x1 + 10"))
    result = phigen("tune", spec, "--accuracy", 0.001, "--budget", 8, "--measure", "orbit", "--json")
    assert result.exit_code == 0, result.stderr
    assert "over τ = 0 … 6.63191" in result.stderr
    document = json.loads(result.stdout)
    step, steps = (float(line.split(": ")[1]) for line in document["run_lines"][:2])
    assert 6.6319 < step * steps < 6.6319 + 2 * step
    assert {c["method"] for c in document["classical"]} == {"RK4 in C", "DOP853 in C"}
    assert "up to τ = 6.6319" in phigen("tune", spec, "--budget", 2, "-q", "--accuracy", 1e-3).stdout


@pytest.mark.thin(2)
@pytest.mark.parametrize(
    ("text", "name", "said"),
    [
        (SWING, "stopped", "10 steps of 0.1 and a part of one, states stored at times 0.3 apart"),
        (SWING, "until", "60 steps of 0.1 and a part of one, one in 10 stored"),
        pytest.param(
            BODY, "tumbling", "132 steps of 0.05 in τ and a part of one, one in 5 stored", marks=pytest.mark.slow
        ),
    ],
)
def test_report_shows_the_run_up_to_its_end(phigen, write, monkeypatch, text, name, said):
    monkeypatch.setattr("phigen.report.drawable.find_spec", lambda name: None)
    monkeypatch.setattr("phigen.cli.report_material.studied", lambda *arguments: (None, ""))
    result = phigen("report", write("spec.yaml", text), "--run", name, "--quick", "-q", "-o", "a.html")
    assert result.exit_code == 0, result.stderr
    page = Path("a.html").read_text(encoding="utf-8")
    assert said in page


@pytest.mark.slow
def test_states_are_stored_at_equal_times_of_a_run_of_so_many_steps_in_tau(phigen, write):
    """The run has 100 steps in τ, so its final physical time is only known after the last step."""
    spec = write("spec.yaml", BODY.replace("until: 5, stride: 5}", "steps: 100, every: 0.5}"))
    ran(phigen, spec, "-o", "a.csv")
    rows = table("a.csv")
    assert rows[:-1, 0] == pytest.approx(np.arange(0, 3.6, 0.5), abs=1e-12)
    ran(phigen, spec, "--at", "3.5", "-o", "c.csv")
    assert rows[-2] == pytest.approx(table("c.csv")[1], abs=1e-15)
    assert rows[-1, :2].tolist() == pytest.approx([table("c.csv")[-1, 0], 5.0], rel=1e-15)
    ran(phigen, spec, "--until", 3.5, "--every", 0.5, "-o", "b.csv")
    assert rows[:-1] == pytest.approx(table("b.csv"), abs=1e-13)


def test_a_run_in_tau_that_fails_stores_the_times_before(phigen, write):
    """The motion becomes infinite at a finite time t, and also at a finite τ. The states before this time are
    stored.
    """
    falling = SWING.split("runs:")[0].replace("(p**2 + q**2)/2\norder: 8", "p**2/2 - q**4\norder: 2")
    falling += "monitor: 1/(1 + p**2)**(1/8)\nruns: {far: {initial: [1, 0], step: 0.1, steps: 400, every: 0.1}}\n"
    result = phigen("run", write("spec.yaml", falling), "-t", "numpy", "-o", "a.csv")
    assert (result.exit_code, "failed" in result.stderr) == (7, True)
    times = table("a.csv")[:, 0]
    assert len(times) > 5
    assert np.diff(times[:-1]) == pytest.approx(0.1, abs=1e-9)


def test_options_and_files_that_do_not_fit_are_refused(phigen, write):
    swing = write("swing.yaml", SWING)
    ran(phigen, swing, "-o", "a.csv")
    Path("words.csv").write_text("some,words\n1,2\n")
    Path("empty.npz").touch()
    Path("half.npz").write_bytes(b"PK\x03\x04 the rest is missing")
    np.savez("other.npz", x=np.ones((2, 2)))
    for args, said in (
        ((swing, "--until", 3, "--steps", 5), "--until and --steps exclude each other"),
        ((swing, "--extend", "--lyapunov"), "--extend and --lyapunov"),
        ((swing, "--until", -3), "never reached"),
        ((swing, "--at", "7"), "not between 0.0 and 6.0"),
        ((swing, "--at", "soon"), "expected times or a file of times"),
        ((swing, "--every", "-1"), "must be positive"),
        ((swing, "--seed", 3), "swing has no noise"),
        ((swing, "--extend"), "name its file by --output"),
        ((swing, "--extend", "-o", "a.csv", "--set", "q=2"), "of another run"),
        ((swing, "--extend", "-o", "a.csv", "--until", 5), "never reached from 6.0"),
        ((swing, "--from", "words.csv"), "does not hold a run of swing: it has no column 't'"),
        ((swing, "--from", "empty.npz"), "does not hold a run of swing: No data left in file"),
        ((swing, "--from", "half.npz"), "does not hold a run of swing: File is not a zip file"),
        ((swing, "--from", "other.npz"), "does not hold a run of swing: it has no column 't'"),
    ):
        result = phigen("run", *args, "-t", "numpy")
        assert (result.exit_code, said in result.stderr) == (2, True), (args, result.stderr)
    for option in ("--until", "--steps"):
        result = phigen("run", swing, option, 10**16, "-t", "numpy")
        assert (result.exit_code, "more than the limit of 1000000000000" in result.stderr) == (3, True), result.stderr


def test_times_of_a_spec_are_those_of_the_command_line(phigen, swing):
    ran(phigen, swing, "--run", "listed", "-o", "a.csv")
    ran(phigen, swing, "--run", "until", "--until", "2.05", "--at", "1.3,0.25,2", "-o", "b.csv")
    rows = table("a.csv")
    assert rows[:, 0] == pytest.approx([0, 0.25, 1.3, 2, 2.05], rel=1e-14)
    np.testing.assert_array_equal(rows, table("b.csv"))
    ran(phigen, swing, "--run", "past", "-o", "c.csv")  # the stop at -pi/2 comes after the two times of the run
    assert table("c.csv")[:, 0] == pytest.approx([0, -0.5, -1.33, -np.pi / 2], abs=1e-11)
    solver = compiled(specs.load(str(swing)), target="numpy")
    assert solver.run("listed").t == pytest.approx([0, 0.25, 1.3, 2, 2.05], rel=1e-14)
    assert solver.run("past").t == pytest.approx([0, -0.5, -1.33, -np.pi / 2], abs=1e-11)
    np.testing.assert_allclose(solver.run("listed").x, rows[:, 1:3], atol=1e-14)


@pytest.mark.thin(4, of_all=1)
@pytest.mark.parametrize("until", ["6.05", "6.0", "6.3"])
@pytest.mark.parametrize(("text", "run"), [(SWING, "until"), (BODY, "tumbling"), (SWING, "stopped")])
def test_the_command_and_python_have_the_same_rows(text, run, until, phigen, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = text.replace("until: 6.05", f"until: {until}").replace("until: 5,", f"until: {until},")
    text = text.replace("every: 0.3", f"stride: {4 if until == '6.05' else 9}")
    Path("s.yaml").write_text(text)
    ran(phigen, "s.yaml", "--run", run, "--output", "run.npz")
    stored, trajectory = np.load("run.npz"), compiled("s.yaml", target="numpy").run(run)
    assert len(stored["t"]) == len(trajectory.t)
    np.testing.assert_allclose(stored["t"], trajectory.t, rtol=1e-13)
    np.testing.assert_allclose(stored["x"], trajectory.x, rtol=0, atol=1e-12)


CHAIN = """phigen: 1
name: chain
lattice: {axes: [i]}
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + q**2/2
observables: {M: {mean: q}}
runs: {r: {sizes: [4], initial: {q: 1, p: 0}, step: 0.1, steps: 100}}
"""


@pytest.mark.parametrize(("text", "run", "name"), [(SWING, "steps", "q"), (CHAIN, "r", "M")])
def test_a_stop_of_the_command_line_is_that_of_the_spec(phigen, write, text, run, name):
    command = ("run", write("a.yaml", text), "--run", run, "-t", "numpy")
    result = phigen(*command, "--steps", 100, "--stop", f"max({name}, -1) - 1/2", "--json")
    # The chain is integrated with order 4, hence the larger tolerance.
    assert json.loads(result.stdout)["time"] == pytest.approx(np.pi / 3, abs=1e-5)
    assert "the expression under stop: has no zero during the run" in phigen(*command, "--stop", f"{name} - 2").stderr
    for wrong, words in (("1/2", "depends neither"), (f"{name} -", "ends too early"), (f"{name}s", "did you mean")):
        refused = phigen(*command, "--stop", wrong)
        assert refused.exit_code == 2
        assert words in refused.stderr


def test_a_stop_with_noise_is_refused_on_the_command_line(phigen, in_tmp):
    refused = phigen("run", "thermal_chain", "--stop", "x1")
    assert refused.exit_code == 2
    assert "not available with noise" in refused.stderr
