"""Observables of lattices: sums, means and extremes of densities, and fields, in every target."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from click.testing import CliRunner
from node import asked

import phigen
import phigen.spec
from phigen.api import emit
from phigen.cli import group
from phigen.compiler import compile_spec
from phigen.runtime import lattice_series

FILM = """\
phigen: 1
name: film
time: t
coordinates: [x, y, z]
parameters: {J: 1, B: {value: 0.3 + i*j/100, at: sites}, c: 0.5}
lattice: {axes: [i, j], boundary: [open, periodic]}
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: -J*(x*x[i+1] + y*y[i+1] + z*z[i+1]) - J*(x*x[j+1] + y*y[j+1] + z*z[j+1]) - B*z*cos(t)
casimirs: {C: x**2 + y**2 + z**2}
observables:
  M: {mean: z}
  Q: {sum: "x*y[i+1]*z[j-1] - c*B*x + t"}
  steepest: {max: "abs(z - z[i+2])"}
  flattest: {min: "abs(z - z[i-2])"}
  twist: atan2(y, x) + x[i+1]
  up: {mean: "heaviside(z)"}
  local: "z**2*cos(t)"
order: 2
runs: {relax: {initial: {random: sphere, seed: 1}, sizes: [4, 5], step: 0.05, steps: 6, stride: 2, start: 0.3}}
"""

WEB = """\
phigen: 1
name: web
coordinates: [q, p]
parameters: {k: {value: 1, at: bonds}}
lattice: {graph: bonds}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: {sites: p**2/2, bonds: "k*(1 - cos(q[a] - q[b]))"}
observables:
  flow: {mean: "k*(p[a] - p[b])*sin(q[a] - q[b])", over: bonds}
  oriented: {sum: "q[a]*p[b]**2", over: bonds}
  tightest: {max: "k*abs(q[a] - q[b])", over: bonds}
  steepest: {min: "k*q[a] - p[b]", over: bonds}
  P: {sum: p}
  hot: {max: p**2}
  e: p**2/2
order: 2
runs:
  r:
    initial: {q: [0.1, 0.5, 0.9, -0.3], p: [0.2, -1, 0.4, 0.6]}
    bonds: [[0, 1], [2, 1], [2, 3], [3, 0], [0, 2]]
    parameters: {k: [1, 2, 3, 4, 5]}
    step: 0.05
    steps: 6
    stride: 2
"""

VORTICES = """\
phigen: 1
name: vortices
coordinates: [x, y]
parameters: {g: {value: 1, at: sites}}
lattice: {pairs: all}
poisson: {brackets: {x: {y: 1/g}}}
hamiltonian: {pairs: "-g[a]*g[b]*log((x[a] - x[b])**2 + (y[a] - y[b])**2)/(4*pi)"}
observables:
  apart: {mean: "sqrt((x[a] - x[b])**2 + (y[a] - y[b])**2)", over: pairs}
  both: {sum: "x[a]*g[b]**2", over: pairs}
  closest: {min: "sqrt((x[a] - x[b])**2 + (y[a] - y[b])**2)", over: pairs}
  widest: {max: "g[a]*x[b]", over: pairs}
  X: {mean: g*x}
order: 2
runs:
  r:
    initial: {x: [0, 1, 2, 0.5], y: [1, 0, 0.5, 2]}
    parameters: {g: [1, 2, -1, 0.5]}
    step: 0.01
    steps: 6
    stride: 2
"""


def of_film(x, t, c):
    """Return the observables of `FILM`, computed site by site."""
    _, rows, columns = x.shape
    sites = [(i, j) for i in range(rows) for j in range(columns)]
    field = {(i, j): 0.3 + i * j / 100 for i, j in sites}

    def at(f, i, j):
        return float(x["xyz".index(f)][i, j % columns]) if 0 <= i < rows else None

    def twist(i, j):
        return math.atan2(at("y", i, j), at("x", i, j)) + (at("x", i + 1, j) or 0.0)

    products = [at("x", i, j) * (at("y", i + 1, j) or 0.0) * at("z", i, j - 1) for i, j in sites]
    return {
        "M": np.mean(x[2]),
        "Q": math.fsum(products) - sum(c * field[i, j] * at("x", i, j) for i, j in sites) + t * len(sites),
        "steepest": max(abs(at("z", i, j) - at("z", i + 2, j)) for i, j in sites if i + 2 < rows),
        "flattest": min(abs(at("z", i, j) - at("z", i - 2, j)) for i, j in sites if i >= 2),
        "twist": np.array([[twist(i, j) for j in range(columns)] for i in range(rows)]),
        "up": np.mean(x[2] >= 0),
        "local": x[2] ** 2 * math.cos(t),
    }


def of_web(x, t, k):
    (q, p), bonds = x, [(0, 1), (2, 1), (2, 3), (3, 0), (0, 2)]
    flows = [k_ab * (p[a] - p[b]) * math.sin(q[a] - q[b]) for k_ab, (a, b) in zip(k, bonds, strict=True)]
    oriented = sum(q[a] * p[b] ** 2 for a, b in bonds)
    tightest = max(k_ab * abs(q[a] - q[b]) for k_ab, (a, b) in zip(k, bonds, strict=True))
    steepest = min(k_ab * q[a] - p[b] for k_ab, (a, b) in zip(k, bonds, strict=True))
    of_bonds = {"flow": np.mean(flows), "oriented": oriented, "tightest": tightest, "steepest": steepest}
    return {**of_bonds, "P": p.sum(), "hot": max(p**2), "e": p**2 / 2}


def of_vortices(x, t, g):
    pairs = [(a, b) for a in range(4) for b in range(a)]
    both = sum(x[0][a] * g[b] ** 2 + x[0][b] * g[a] ** 2 for a, b in pairs) / 2
    return {
        "apart": np.mean([math.dist(x[:, a], x[:, b]) for a, b in pairs]),
        "both": both,
        "closest": min(math.dist(x[:, a], x[:, b]) for a, b in pairs),
        "widest": max(g[a] * x[0][b] for a in range(4) for b in range(4) if a != b),
        "X": np.mean(g * x[0]),
    }


CASES = {
    "film": (FILM, of_film, {"c": 0.7}),
    "web": (WEB, of_web, {"k": np.array([1.0, -2, 3, 4, 5])}),
    "web by the series": (WEB + "scheme: series\n", of_web, {"k": np.array([1.0, -2, 3, 4, 5])}),
    "vortices": (VORTICES, of_vortices, {"g": np.array([1.0, 2, -1, 0.5])}),
}


@pytest.mark.thin(2)
@pytest.mark.parametrize(
    ("case", "target", "profile"),
    [
        ("film", "c", "fast"),
        ("film", "c", "small"),
        ("film", "numpy", "fast"),
        ("web", "c", "fast"),
        ("web", "numpy", "fast"),
        ("web", "c", "small"),
        ("web by the series", "c", "small"),
        ("vortices", "c", "fast"),
        ("vortices", "c", "small"),
        ("vortices", "numpy", "fast"),
    ],
)
def test_observables_are_those_of_the_formulas(case, target, profile):
    text, expected_of, parameters = CASES[case]
    trajectory = phigen.compile(phigen.spec.loads(text), target=target, profile=profile).run(**parameters)
    assert len(trajectory) == 4
    (values,) = parameters.values()
    for row, (x, t) in enumerate(zip(trajectory.x, trajectory.t.tolist(), strict=True)):
        expected = expected_of(x, t, values)
        assert sorted(trajectory.observables) == sorted(expected)
        for name, value in expected.items():
            np.testing.assert_allclose(trajectory.observables[name][row], value, rtol=1e-13, atol=1e-14, err_msg=name)


@pytest.mark.parametrize("case", ["film", "web", "vortices"])
def test_javascript_has_the_same_observables(case, tmp_path):
    text, _, parameters = CASES[case]
    spec = phigen.spec.loads(text)
    trajectory = phigen.compile(spec, target="numpy").run(**parameters)
    program = compile_spec(spec).program
    (module,) = emit(program, "js", "").values()
    path = tmp_path / f"{spec.name}.mjs"
    path.write_text(module)
    listed_parameters = {k: np.ravel(v).tolist() if np.ndim(v) else v for k, v in trajectory.parameters.items()}
    options = {"x0": trajectory.x[-1].ravel().tolist(), "sizes": list(trajectory.x.shape[2:])}
    options |= {"bonds": listed_parameters.pop("bonds")} if "bonds" in listed_parameters else {}
    options |= {"params": listed_parameters} | ({"t0": float(trajectory.t[-1])} if program.time else {})
    body = f"""const s = new module.Solver({json.dumps(options)});
    const {{ OBSERVABLES, OBSERVED_FIELDS: fields = [] }} = module.Solver;
    return [OBSERVABLES, [...s.observables()], fields, fields.length ? [...s.observedFields()] : []];"""
    names, values, fields, at_sites = asked(path, body)
    assert [*names, *fields] == list(trajectory.observables)
    for name, value in zip(names, values, strict=True):
        assert value == pytest.approx(trajectory.observables[name][-1], rel=1e-13, abs=1e-14)
    np.testing.assert_allclose(
        at_sites, np.ravel([trajectory.observables[name][-1] for name in fields]), rtol=1e-13, atol=1e-14
    )


def test_sums_are_compensated_and_the_largest_of_no_number_is_none():
    text = WEB.replace("{max: p**2}", "{max: p**2 - p**4}")
    for target in ("c", "numpy"):
        web = phigen.compile(phigen.spec.loads(text), target=target)
        if target == "c":
            state = np.array([[0.0] * 4, [1e16, 1.0, 1.0, -1e16]])
            assert web.observables(state, bonds=[[0, 1]])["P"] == 2
        state = np.array([[0.1, 0.2, 0.3], [1e200, 0.5, 0.0]])
        assert math.isnan(web.observables(state, bonds=[[0, 1]])["hot"])


@pytest.mark.parametrize("text", [WEB, WEB + "scheme: series\n"])
@pytest.mark.parametrize("target", ["c", "numpy"])
def test_extremes_over_no_bonds_are_infinite_and_those_of_no_number_are_none(text, target):
    web = phigen.compile(phigen.spec.loads(text), target=target)
    state = np.array([[0.0, 1.0, 3.0], [0.0, 0.0, 0.0]])
    assert web.observables(state, bonds=[[0, 1]])["tightest"] == 1
    none = web.observables(state, bonds=[])
    assert (none["tightest"], none["steepest"]) == (-math.inf, math.inf)
    text = text.replace("k*abs(q[a] - q[b])", "sqrt(q[a] - q[b])")
    web = phigen.compile(phigen.spec.loads(text), target=target)
    assert web.observables(state, bonds=[[1, 0], [2, 0]])["tightest"] == math.sqrt(3)
    for bonds in ([[2, 0], [0, 1]], [[0, 1], [2, 0]], [[1, 0], [1, 2]], [[1, 2], [1, 0]]):
        assert math.isnan(web.observables(state, bonds=bonds)["tightest"])


def test_the_command_prints_means(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "web.yaml").write_text(WEB.replace("stride: 2", "average: {after: 0.1}"))
    result = json.loads(CliRunner().invoke(group, ["run", "web.yaml", "--json"], prog_name="phigen").stdout)
    trajectory = phigen.compile("web.yaml").run()
    late = trajectory.observables["flow"][2:]
    assert result["observables"]["flow"]["mean"] == pytest.approx(late.mean(), rel=1e-12)
    assert [*result["observables"]] == ["flow", "oriented", "tightest", "steepest", "P", "hot"]
    plain = CliRunner().invoke(group, ["run", "web.yaml"], prog_name="phigen").stdout
    assert "observables, means over 5 rows from t = 0.1 to 0.3" in plain


def test_observables_go_to_files_sessions_and_xarray(tmp_path):
    solver = phigen.compile(phigen.spec.loads(FILM), target="numpy")
    trajectory = solver.run(output=tmp_path / "film.npz")
    stored = np.load(tmp_path / "film.npz")
    np.testing.assert_array_equal(stored["observable_M"], trajectory.observables["M"])
    assert stored["observable_twist"].shape == (4, 4, 5)
    dataset = trajectory.to_xarray()
    assert (dataset["Q"].dims, dataset["twist"].dims) == (("t",), ("t", "i", "j"))
    session = solver.session(trajectory.x[0], t0=0.3, B=trajectory.parameters["B"]).step(0.05, 6)
    assert session.observables["Q"] == trajectory.observables["Q"][-1]
    np.testing.assert_array_equal(session.observables["local"], trajectory.observables["local"][-1])


@pytest.mark.parametrize(
    ("text", "old", "new", "message"),
    [
        (FILM, "{mean: z}", "{mean: z, sum: z}", "mean"),
        (FILM, "{mean: z}", "{average: z}", "average"),
        (FILM, "{mean: z}", '{mean: "z[k+1]"}', "'k'"),
        (FILM, "{mean: z}", "{mean: z, over: bonds}", "over: bonds needs lattice: {graph: NAME}"),
        (FILM, "M: {mean: z}", "C: {mean: z}", "observables: 'C' is the name of a Casimir"),
        (WEB, "{max: p**2}", "{max: p**2, over: bonds}", "'p' has two values, one at each end of a bond"),
        (WEB, "{sum: p}", "{sum: p, over: pairs}", "over: pairs needs lattice: {pairs: all}"),
        (WEB, "{sum: p}", '{sum: "p[a]"}', "p[…]"),
        (WEB, '{sum: "q[a]*p[b]**2", over: bonds}', "{sum: q*p, over: bonds}", "'q' has two values, one at each end"),
        (FILM, "sizes: [4, 5]", "sizes: [2, 5]", "sizes: 2 along i is too small"),
    ],
)
def test_mistakes_are_told_with_their_place(text, old, new, message):
    assert old in text
    with pytest.raises(phigen.SpecError) as error:
        phigen.compile(phigen.spec.loads(text.replace(old, new), "lattice.yaml"), target="numpy")
    assert message in str(error.value)
    assert str(error.value).startswith("lattice.yaml:")


def test_densities_are_those_of_lattices():
    text = "phigen: 1\nname: o\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: p**2 + q**2\n"
    with pytest.raises(phigen.SpecError, match="observables: the key mean is only for specs with lattice:"):
        phigen.spec.loads(text + "observables: {M: {mean: q}}\n")


def test_a_run_may_record_numbers_alone(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    frames = phigen.compile(phigen.spec.loads(WEB), target="numpy").run()
    text = WEB.replace("stride: 2", "stride: 2\n    record: [P, energy, flow]")
    (tmp_path / "web.yaml").write_text(text)
    series = phigen.compile("web.yaml", target="numpy").run()
    assert [*series.columns] == ["P", "energy", "flow"]
    np.testing.assert_array_equal(series.t, frames.t)
    np.testing.assert_array_equal(series.columns["energy"], frames.energy)
    np.testing.assert_array_equal(series.observables["flow"], frames.observables["flow"])
    np.testing.assert_array_equal(series.last, frames.x[-1])
    np.testing.assert_array_equal(series.ends.energy, frames.energy[[0, -1]])
    for name in ("web.csv", "web.npz"):
        result = CliRunner().invoke(group, ["run", "web.yaml", "-t", "numpy", "-o", name], prog_name="phigen")
        assert result.exit_code == 0, result.output
    lines = (tmp_path / "web.csv").read_text().splitlines()
    assert lines[0] == "t,P,energy,flow"
    assert [float(v) for v in lines[-1].split(",")] == [series.t[-1], *(v[-1] for v in series.columns.values())]
    np.testing.assert_array_equal(np.load("web.npz")["observable_P"], series.columns["P"])
    assert not [*tmp_path.glob("*.checkpoint")]


def test_series_go_on_from_their_checkpoint(tmp_path, monkeypatch):
    monkeypatch.setattr(lattice_series, "CHECKPOINT_SECONDS", 0.0)
    solver = phigen.compile(phigen.spec.loads(WEB), target="numpy")
    x0, bonds, checkpoint = np.array([[0.1, 0.5, 0.9], [1.0, 0.0, -1.0]]), [[0, 1], [1, 2]], tmp_path / "kept"

    def interrupt(step):
        if step == 6:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solver.series(x0, 0.05, 12, 2, of=["P", "hot"], bonds=bonds, checkpoints=checkpoint, progress=interrupt)
    with pytest.raises(ValueError, match="an interrupted run: continue"):
        solver.series(x0, 0.05, 12, 2, of=["P", "hot"], bonds=bonds, checkpoints=checkpoint, resume=False)
    with pytest.raises(
        ValueError, match="'e' cannot be recorded; there are energy, flow, oriented, tightest, steepest, P, hot"
    ):
        solver.series(x0, 0.05, 12, of=["e"], bonds=bonds)
    resumed = solver.series(x0, 0.05, 12, 2, of=["P", "hot"], bonds=bonds, checkpoints=checkpoint)
    whole = solver.series(x0, 0.05, 12, 2, of=["P", "hot"], bonds=bonds)
    np.testing.assert_array_equal(resumed.columns["hot"], whole.columns["hot"])
    np.testing.assert_array_equal(resumed.last, whole.last)
    assert len(whole) == 7
    assert not checkpoint.exists()


@pytest.mark.parametrize(
    ("column", "message"),
    [
        ("e", "record: 'e' has a value at every site"),
        ("hott", "record: 'hott' is no column of the output"),
        ("q", "record: 'q' has a value at every site"),
        ("P, P", "record: P is given twice"),
    ],
)
def test_what_is_no_column_is_told(column, message):
    text = WEB.replace("stride: 2", f"stride: 2\n    record: [{column}]")
    with pytest.raises(phigen.SpecError) as error:
        phigen.spec.loads(text, "web.yaml")
    assert message in str(error.value)


SKYRMION = """\
phigen: 1
name: skyrmion
coordinates: [x, y, z]
lattice: {axes: [i, j]}
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: -(x*x[i+1] + y*y[i+1] + z*z[i+1]) - (x*x[j+1] + y*y[j+1] + z*z[j+1])
definitions:
  across: "1 + x*x[i+1,j+1] + y*y[i+1,j+1] + z*z[i+1,j+1]"
  lower: "across + x*x[i+1] + y*y[i+1] + z*z[i+1] + x[i+1]*x[i+1,j+1] + y[i+1]*y[i+1,j+1] + z[i+1]*z[i+1,j+1]"
  upper: "across + x*x[j+1] + y*y[j+1] + z*z[j+1] + x[j+1]*x[i+1,j+1] + y[j+1]*y[i+1,j+1] + z[j+1]*z[i+1,j+1]"
  normal_x: "y[i+1]*z[i+1,j+1] - z[i+1]*y[i+1,j+1]"
  normal_y: "z[i+1]*x[i+1,j+1] - x[i+1]*z[i+1,j+1]"
  normal_z: "x[i+1]*y[i+1,j+1] - y[i+1]*x[i+1,j+1]"
  left_x: "y[i+1,j+1]*z[j+1] - z[i+1,j+1]*y[j+1]"
  left_y: "z[i+1,j+1]*x[j+1] - x[i+1,j+1]*z[j+1]"
  left_z: "x[i+1,j+1]*y[j+1] - y[i+1,j+1]*x[j+1]"
observables:
  Q: {sum: "(atan2(x*normal_x + y*normal_y + z*normal_z, lower) + atan2(x*left_x + y*left_y + z*left_z, upper))/(2*pi)"}
runs: {r: {initial: {x: 0, y: 0, z: 1}, sizes: [16, 16], step: 0.1, steps: 1}}
"""


def test_the_skyrmion_number_counts_skyrmions():
    solver = phigen.compile(phigen.spec.loads(SKYRMION), target="numpy")
    i, j = np.indices((16, 16)) - 7.5
    radius, angle = np.hypot(i, j), np.arctan2(j, i)
    polar = np.pi * np.clip(1 - radius / 7, 0, 1)  # spins point up at the edge of the core and down in its centre
    for turns in (1, -1, 2):
        spins = [np.sin(polar) * np.cos(turns * angle), np.sin(polar) * np.sin(turns * angle), np.cos(polar)]
        assert solver.observables(np.array(spins))["Q"] == pytest.approx(-turns, abs=1e-12)


@pytest.mark.parametrize(
    ("mistake", "hint"), [("heavyside(z)", "did you mean 'heaviside'?"), ("step(z)", "min, max, if")]
)
def test_functions_of_observables_are_named_after_a_mistake(mistake, hint):
    with pytest.raises(phigen.SpecError) as error:
        phigen.spec.loads(FILM.replace("heaviside(z)", mistake), "film.yaml")
    assert hint in str(error.value)
