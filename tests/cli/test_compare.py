"""``phigen compare``: methods side by side, with numbers that agree with what they name."""

import json
from pathlib import Path

import numpy as np
import pytest

import phigen as package
from phigen.runtime.origin import read_origin

BODY = """\
phigen: 1
name: gyro
coordinates: [a, b, c]
parameters: {k: 1.7}
poisson: {lie_algebra: {name: so(3), sign: minus}}
hamiltonian: a**2/2 + k*b**2/5 + c**2/9 + a*b/7 + c/3
casimirs: {C: a**2 + b**2 + c**2}
order: 4
runs: {spin: {initial: [0.3, 0.8, -0.4], step: 0.2, steps: 100}}
"""


@pytest.fixture
def body(in_tmp):
    Path("gyro.yaml").write_text(BODY)
    return "gyro.yaml"


@pytest.mark.slow  # it builds some twenty candidates
@pytest.mark.parametrize("equal", ["step", "work"])
def test_numbers_are_those_of_the_methods(phigen, body, equal):
    done = phigen("compare", body, "--equal", equal, "--budget", "300", "--json", "--plot", "c.svg")
    assert done.exit_code == 0, done.stderr
    assert str(read_origin(Path("c.svg"))).endswith(" by compare")
    found = json.loads(done.stdout)
    entries = {entry["title"]: entry for entry in found["methods"] if not entry["refusal"]}
    assert {"RK4", "DOP853", "exponential, order 4", "cayley, order 2"} <= set(entries)
    own = next(entry for entry in entries.values() if entry["own"])
    assert (own["title"], own["steps"]) == ("exponential, order 4", 100)
    for title, entry in entries.items():
        assert entry["step"] * entry["steps"] == pytest.approx(20)
        if equal == "step":
            assert entry["steps"] == 100
        if entry["poisson"]:
            assert entry["defect"] < 1e-12, title
            assert entry["casimirs"] < 1e-13, title
    # Far above rounding; at equal work the step depends on the load of the machine, and errors are of its fifth power.
    least = 1e-10 * min(1.0, (entries["RK4"]["step"] / 0.2) ** 5)
    assert entries["RK4"]["defect"] > least
    assert entries["RK4"]["casimirs"] > least
    solver = package.compile(body, order=2, scheme="splitting") if "splitting, order 2" in entries else None
    if solver and equal == "step":
        run = solver.run()
        error = np.max(np.abs(run.energy - run.energy[0])) / abs(run.energy[0])
        assert entries["splitting, order 2"]["error"] == pytest.approx(error, rel=1e-6)
    assert "orbit error" in Path("c.svg").read_text()


def test_table_marks_the_setting_of_the_spec(phigen, body):
    done = phigen("compare", body, "--orders", "4", "--budget", "0.01", "-q")
    assert done.exit_code == 0, done.stderr
    assert "exponential, order 4 *" in done.stdout
    assert "Not measured, since there was no time to build it; a larger --budget builds them: " in done.stdout
    assert done.stderr == ""


@pytest.mark.slow
def test_lattices_are_compared_too(phigen, in_tmp):
    done = phigen("compare", "fput", "--horizon", "2", "--orders", "2", "--budget", "300", "--json")
    assert done.exit_code == 0, done.stderr
    entries = [entry for entry in json.loads(done.stdout)["methods"] if not entry["refusal"]]
    assert len(entries) > 2
    assert all(entry["defect"] is None and entry["error"] < 0.1 for entry in entries)


@pytest.mark.parametrize(
    ("line", "told"),
    [
        (
            "noise: {kick: {hamiltonian: a}}",
            "phigen compare is for systems whose energy is conserved, and noise changes it",
        ),
        ("damping: k", "phigen compare is for systems whose energy is conserved, and damping changes it"),
        ("time: t", "phigen compare is for systems whose energy is conserved, and time changes it"),
    ],
)
def test_open_systems_are_refused_at_their_place(phigen, body, line, told):
    Path("open.yaml").write_text(BODY.replace("order: 4", line))
    done = phigen("compare", "open.yaml")
    assert done.exit_code == package.SpecError.exit_code
    assert done.stderr.startswith("open.yaml:8:")
    assert told in done.stderr


@pytest.mark.parametrize("given", ["2;4", "0", "18", "two", ""])
def test_orders_are_numbers(phigen, body, given):
    done = phigen("compare", body, "--orders", given)
    assert done.exit_code == 2
    assert "is not a list of orders from 1 to 16" in done.stderr
