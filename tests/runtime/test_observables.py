"""Observables of a spec: the same values in every target, in trajectories and files."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from node import asked

import phigen
import phigen.spec
from phigen.api import emit
from phigen.cli import group
from phigen.compiler import compile_spec

DRIVEN = """\
phigen: 1
name: driven
time: t
coordinates: [q, p]
parameters: {A: 0.5, sign: 2}
definitions: {speed: abs(p)}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - cos(q) - A*q*cos(sign*t)
casimirs: {}
observables:
  kinetic: speed**2/2
  angle: atan2(sin(q), cos(q))
  least: min(q, p*A) - max(q, 1/3)
  inside: if(q**2 + p**2 <= 1, t, -1)
  strictly: if(p < A, if(q > 0.2, 1, 2), 3)
  step: heaviside(q)
targets: [c, numpy, js]
runs:
  swing: {initial: [0.9, 0.3], step: 0.1, steps: 300, start: 0.5, stride: 3, average: {after: 12, blocks: 5}}
"""

BODY = """\
phigen: 1
name: body
coordinates: [x, y, z]
poisson: {lie_algebra: {name: so(3), sign: minus}}
hamiltonian: x**2/2 + y**2/4 + z**2/6
casimirs: {C: x**2 + y**2 + z**2}
observables: {tilt: "acos(z/sqrt(x**2 + y**2 + z**2))", side: "if(x >= 0, 1, 0)"}
order: 2
runs: {spin: {initial: [0.1, 1, 0.2], step: 0.1, steps: 50}}
"""


def by_numpy(x, t, A=0.5):
    """Return the observables of `DRIVEN` by name, computed by NumPy formulas that were written independently."""
    q, p = x.T
    return {
        "kinetic": p**2 / 2,
        "angle": np.arctan2(np.sin(q), np.cos(q)),
        "least": np.minimum(q, p * A) - np.maximum(q, 1 / 3),
        "inside": np.where(q**2 + p**2 <= 1, t, -1),
        "strictly": np.where(p < A, np.where(q > 0.2, 1, 2), 3),
        "step": np.where(q >= 0, 1.0, 0.0),
    }


@pytest.mark.thin(2)
@pytest.mark.parametrize("profile", ["fast", "small"])
@pytest.mark.parametrize("target", ["c", "numpy"])
def test_observables_are_those_of_the_formulas(target, profile):
    solver = phigen.compile(phigen.spec.loads(DRIVEN), target=target, profile=profile)
    trajectory = solver.run(A=0.7)
    expected = by_numpy(trajectory.x, trajectory.t, 0.7)
    assert list(trajectory.observables) == list(expected)
    for name, values in expected.items():
        np.testing.assert_allclose(trajectory.observables[name], values, atol=1e-14)
    again = solver.observables(trajectory.x, trajectory.t, A=0.7)
    np.testing.assert_array_equal(again["kinetic"], trajectory.observables["kinetic"])
    session = solver.session([0.9, 0.3], t0=0.5).step(0.1, 4)
    assert session.observables == pytest.approx({n: v[0] for n, v in by_numpy(session.x[None], session.t).items()})


def test_javascript_has_the_same_observables(tmp_path):
    spec = phigen.spec.loads(DRIVEN)
    (text,) = emit(compile_spec(spec).program, "js", "").values()
    module = tmp_path / "driven.mjs"
    module.write_text(text)
    rng = np.random.default_rng(3)
    states, times = rng.uniform(-1.5, 1.5, (20, 2)), rng.uniform(0, 9, 20)
    body = f"""const s = new module.Solver({{ x0: [1, 0], t0: 0, params: {{ A: 0.7 }} }});
    const given = {json.dumps([[*x, t] for x, t in zip(states.tolist(), times.tolist(), strict=True)])};
    return [module.Solver.OBSERVABLES, given.map(([q, p, t]) => [...s.observables([q, p], t)])];"""
    names, rows = asked(module, body)
    expected = by_numpy(states, times, 0.7)
    assert names == list(expected)
    np.testing.assert_allclose(np.array(rows), np.column_stack([*expected.values()]), atol=1e-14)


def test_equality_belongs_to_the_side_that_the_comparison_says():
    text = BODY.replace(
        "if(x >= 0, 1, 0)", "if(x >= 0, 1, 0) + 10*if(x > 0, 1, 0) + 100*if(x <= 0, 1, 0) + 1000*if(x < 0, 1, 0)"
    )
    solver = phigen.compile(phigen.spec.loads(text), target="numpy")
    states = [[-1.0, 1, 1], [0.0, 1, 1], [1.0, 1, 1]]
    assert solver.observables(states)["side"].tolist() == [1100, 101, 11]


def test_observables_are_the_last_columns_of_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "body.yaml").write_text(BODY)
    solver = phigen.compile("body.yaml")
    trajectory = solver.run()
    trajectory.save("body.csv")
    for name in ("run.csv", "run.npz"):
        assert CliRunner().invoke(group, ["run", "body.yaml", "-o", name], prog_name="phigen").exit_code == 0
    lines = (tmp_path / "run.csv").read_text().splitlines()
    assert lines[0] == "t,x,y,z,energy,C,tilt,side"
    assert (tmp_path / "body.csv").read_text().splitlines()[0] == lines[0]
    np.testing.assert_array_equal(np.load("run.npz")["observable_tilt"], trajectory.observables["tilt"])
    assert trajectory.to_pandas()["side"].tolist() == trajectory.observables["side"].tolist()
    assert trajectory.to_xarray()["tilt"].dims == ("t",)


def test_a_run_records_the_columns_that_it_names(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "body.yaml").write_text(BODY.replace("steps: 50}", "steps: 50, record: [tilt, C]}"))
    for name in ("run.csv", "run.npz"):
        assert CliRunner().invoke(group, ["run", "body.yaml", "-o", name], prog_name="phigen").exit_code == 0
    trajectory = phigen.compile("body.yaml").run()
    rows = np.loadtxt("run.csv", delimiter=",", skiprows=1)
    assert (tmp_path / "run.csv").read_text().splitlines()[0] == "t,C,tilt"
    np.testing.assert_array_equal(rows[:, 2], trajectory.observables["tilt"])
    assert {"t", "casimir_C", "observable_tilt"} <= {*np.load("run.npz")}
    assert "x" not in np.load("run.npz")
    for option in (["-o", "run.csv", "--extend", "--steps", "9"], ["--from", "run.csv"]):
        assert CliRunner().invoke(group, ["run", "body.yaml", *option], prog_name="phigen").exit_code == 2


def test_averages_are_over_the_rows_that_the_run_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "driven.yaml").write_text(DRIVEN)
    result = CliRunner().invoke(group, ["run", "driven.yaml", "--json"], prog_name="phigen")
    averages = json.loads(result.stdout)["observables"]
    trajectory = phigen.compile("driven.yaml").run()
    late = trajectory.t >= 12
    for name, values in trajectory.observables.items():
        assert averages[name]["mean"] == pytest.approx(values[late].mean(), rel=1e-12, abs=1e-14)
        assert averages[name]["variance"] == pytest.approx(values[late].var(ddof=1), rel=1e-12, abs=1e-14)
        assert averages[name]["largest"] == pytest.approx(values[late].max())
    plain = CliRunner().invoke(group, ["run", "driven.yaml"], prog_name="phigen").stdout
    assert f"means over {late.sum()} rows from t = " in plain


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("hamiltonian: p**2/2", "hamiltonian: min(p, q) + p**2/2", "min is allowed in observables and stop only"),
        ("kinetic: speed**2/2", "q: p", "observables: 'q' is the name of a coordinate"),
        ("kinetic: speed**2/2", "t: p", "observables: 't' is the name of a column of every output"),
        ("kinetic: speed**2/2", "kinetic: if(p, 1, 2)", "if needs a comparison"),
        ("kinetic: speed**2/2", "kinetic: if(p > 1, 2)", "if takes a condition and 2 values, not 2 arguments"),
        ("kinetic: speed**2/2", "kinetic: p > 1", "unexpected '>'"),
        ("kinetic: speed**2/2", "kinetic: max(p)", "max takes 2 arguments, not 1 argument"),
        ("kinetic: speed**2/2", "kinetic: mass*p", "the name 'mass' is not declared"),
        ("blocks: 5", "blocks: 1", "blocks: 1 is not between 2 and 10000"),
    ],
)
def test_mistakes_are_reported_with_their_place(old, new, message):
    with pytest.raises(phigen.SpecError) as error:
        phigen.spec.loads(DRIVEN.replace(old, new), "driven.yaml")
    assert message in str(error.value)
    assert str(error.value).startswith("driven.yaml:")


def test_an_average_needs_observables():
    text = BODY.replace("steps: 50", "steps: 50, average: {after: 1}")
    phigen.spec.loads(text)
    without = "\n".join(line for line in text.splitlines() if not line.startswith("observables"))
    with pytest.raises(phigen.SpecError, match="average: the spec has no observables"):
        phigen.spec.loads(without)


def test_stop_may_be_piecewise():
    text = BODY.replace("steps: 50}", "steps: 500, stop: 'max(x, z) - 0.5'}")
    trajectory = phigen.compile(phigen.spec.loads(text), target="numpy").run()
    assert max(trajectory.x[-1, 0], trajectory.x[-1, 2]) == pytest.approx(0.5, abs=1e-12)
