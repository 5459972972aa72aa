"""``phigen compare``: its table of methods has the steps, errors and Poisson defects of the methods that it names."""

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


@pytest.mark.slow  # it compiles about twenty solvers
@pytest.mark.parametrize("equal", ["step", "work"])
def test_numbers_are_those_of_the_methods(phigen, body, equal):
    result = phigen("compare", body, "--equal", equal, "--budget", "300", "--json", "--plot", "c.svg")
    assert result.exit_code == 0, result.stderr
    assert str(read_origin(Path("c.svg"))).endswith(" by compare")
    document = json.loads(result.stdout)
    entries = {entry["title"]: entry for entry in document["methods"] if not entry["refusal"]}
    assert {"RK4", "DOP853", "exponential, order 4", "cayley, order 2"} <= set(entries)
    of_phigen = next(entry for entry in entries.values() if entry["own"])
    assert (of_phigen["title"], of_phigen["steps"]) == ("exponential, order 4", 100)
    for title, entry in entries.items():
        assert entry["step"] * entry["steps"] == pytest.approx(20)
        if equal == "step":
            assert entry["steps"] == 100
        if entry["poisson"]:
            assert entry["defect"] < 1e-12, title
            assert entry["casimirs"] < 1e-13, title
    # This bound is far above round-off. At equal work the step of RK4 depends on the load of the machine, and its
    # errors are proportional to the fifth power of the step.
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
    result = phigen("compare", body, "--orders", "4", "--budget", "0.01", "-q")
    assert result.exit_code == 0, result.stderr
    assert "exponential, order 4 *" in result.stdout
    assert "Not measured, since there was no time to build it; try a larger --budget: " in result.stdout
    assert result.stderr == ""


@pytest.mark.slow
def test_lattices_are_compared_too(phigen, in_tmp):
    result = phigen("compare", "fput", "--horizon", "2", "--orders", "2", "--budget", "300", "--json")
    assert result.exit_code == 0, result.stderr
    entries = [entry for entry in json.loads(result.stdout)["methods"] if not entry["refusal"]]
    assert len(entries) > 2
    assert all(entry["defect"] is None and entry["error"] < 0.1 for entry in entries)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (
            "noise: {kick: {hamiltonian: a}}",
            "phigen compare needs a system that conserves its energy, and noise changes the energy",
        ),
        ("damping: k", "phigen compare needs a system that conserves its energy, and damping changes the energy"),
        ("time: t", "phigen compare needs a system that conserves its energy, and time changes the energy"),
    ],
)
def test_open_systems_are_refused_at_their_place(phigen, body, line, message):
    Path("open.yaml").write_text(BODY.replace("order: 4", line))
    result = phigen("compare", "open.yaml")
    assert result.exit_code == package.SpecError.exit_code
    assert result.stderr.startswith("open.yaml:8:")
    assert message in result.stderr


@pytest.mark.parametrize("orders", ["2;4", "0", "18", "two", ""])
def test_orders_are_numbers(phigen, body, orders):
    result = phigen("compare", body, "--orders", orders)
    assert result.exit_code == 2
    assert "is not a list of orders from 1 to 16" in result.stderr
