"""Observables and their statistics, stored by sweeps."""

import re
from pathlib import Path

import numpy as np
import pytest
import xarray

import phigen
import phigen.spec
from phigen.study.averages import Averages

DRIVEN = """\
phigen: 1
name: driven
time: t
coordinates: [q, p]
parameters: {A: 0.5, omega: 2}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - cos(q) - A*q*cos(omega*t)
observables: {kinetic: p**2/2 + A*t/100, inside: "if(abs(q) < 1, 1, 0)"}
order: 2
runs: {swing: {initial: [0.9, 0.3], step: 0.1, steps: 60, start: 0.5}}
sweeps:
  map: {run: swing, over: {A: [0.1, 0.4, 0.8], q: [0.2, 0.9]}, keep: [kinetic, mean(kinetic), "std( inside )"]}
"""


@pytest.mark.slow  # each case starts a cluster of workers
@pytest.mark.parametrize(("after", "frames"), [(None, 0), (2.5, 7)])
def test_statistics_are_those_of_single_runs(frames, after):
    text = DRIVEN if after is None else DRIVEN.replace("start: 0.5", f"start: 0.5, average: {{after: {after}}}")
    spec = phigen.spec.loads(text)
    assert spec.sweeps["map"].keep == ("kinetic", "mean(kinetic)", "std(inside)")
    data = phigen.sweep(spec, frames=frames, workers=1)
    solver = phigen.compile(spec)
    for i, a in enumerate([0.1, 0.4, 0.8]):
        for j, q in enumerate([0.2, 0.9]):
            trajectory = solver.integrate([q, 0.3], 0.1, 60, t0=0.5, A=a)
            rows = np.arange(0, 61, frames or 1)
            rows = rows if after is None else rows[trajectory.t[rows] >= after - 1e-12]
            kinetic, inside = (trajectory.observables[n] for n in ("kinetic", "inside"))
            assert data["kinetic"][i, j] == pytest.approx(kinetic[-1], rel=1e-12)
            assert data["mean(kinetic)"][i, j] == pytest.approx(kinetic[rows].mean(), rel=1e-11)
            assert data["std(inside)"][i, j] == pytest.approx(inside[rows].std(ddof=1), rel=1e-11)
            averages = Averages(1, after=after)
            averages.see(trajectory.t[rows], kinetic[rows][:, None])
            error = averages.results()[0].error
            assert data["error(kinetic)"][i, j] == pytest.approx(error, rel=1e-9, nan_ok=True)


@pytest.mark.slow  # the test starts a cluster of workers
def test_statistics_are_over_the_stored_rows_of_a_run():
    text = DRIVEN.replace("start: 0.5", "start: 0.5, stride: 7, average: {after: 2.5, blocks: 2}")
    data, solver = phigen.sweep(phigen.spec.loads(text), workers=1), phigen.compile(phigen.spec.loads(text))
    average = phigen.averages(solver.run("swing", A=0.4), after=2.5, blocks=2)["kinetic"]
    member = data.sel(A=0.4, q=0.9)
    assert float(member["mean(kinetic)"]) == pytest.approx(average.mean, rel=1e-11)
    assert float(member["error(kinetic)"]) == pytest.approx(average.error, rel=1e-9)


def curves(data, names, logarithmic=frozenset()):
    """Return the error bars (x, low, high) of each curve in each panel of a figure, and the axes of the panels."""
    from phigen.drawing.sweep_map import _figure

    drawn = _figure(data, names, logarithmic, frozenset()).get_axes()
    bars = [[c.lines[2][0].get_segments() for c in axes.containers] for axes in drawn]
    return [[np.array([[*s[0], s[1][1]] for s in curve]) for curve in of] for of in bars], drawn


def test_error_bars_are_the_stored_standard_errors():
    a, r = np.geomspace(0.1, 10, 5), np.array([0.5, 1.0, 2.0])
    means, errors = 5 + np.outer(r, np.log(a)), 0.1 + np.outer(r, a) / 50
    variables = {"mean(M)": (("r", "a"), means), "error(M)": (("r", "a"), errors), "N": (("r", "a"), -means)}
    data = xarray.Dataset(variables, {"r": r, "a": a})
    ((*over_a,), none), (axes, other) = curves(data, ["mean(M)", "N"], {"a"})
    assert (axes.get_xscale(), axes.get_yscale(), axes.get_xlabel()) == ("log", "linear", "a")
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["r = 0.5", "r = 1", "r = 2"]
    for k, curve in enumerate(over_a):
        np.testing.assert_allclose(curve, np.stack([a, means[k] - errors[k], means[k] + errors[k]], 1), rtol=1e-12)
    assert not none
    assert len(other.get_lines()) == 3
    ((line,),), (axes,) = curves(data.isel(a=2), ["mean(M)"])
    np.testing.assert_allclose(line[:, 2] - line[:, 1], 2 * errors[:, 2])
    assert axes.get_title() == "mean(M) ± standard error"


def test_error_bars_over_draws_are_those_of_the_mean_of_the_draws():
    values = np.random.default_rng(1).normal(size=(3, 4, 7))
    data = xarray.Dataset({"mean(M)": (("W", "T", "seed"), values)}, {"W": [1, 2, 3], "T": [0.1, 0.2, 0.3, 0.4]})
    data["error(M)"] = data["mean(M)"] * 0 + 9
    ((*over_t,),), (axes,) = curves(data, ["mean(M)"])
    means, errors = values.mean(axis=2), values.std(axis=2, ddof=1) / np.sqrt(7)
    for k, curve in enumerate(over_t):
        np.testing.assert_allclose(curve[:, 1:], np.stack([means[k] - errors[k], means[k] + errors[k]], 1))
    assert axes.get_title() == "mean(M), mean of 7 draws ± standard error"


def test_unknown_observables_are_refused():
    with pytest.raises(phigen.SpecError, match=r"keep: 'mean\(kinetik\)' is not known"):
        phigen.spec.loads(DRIVEN.replace("mean(kinetic)", "mean(kinetik)"))
    with pytest.raises(phigen.SpecError, match=r"keep: 'median\(kinetic\)' is not known"):
        phigen.spec.loads(DRIVEN.replace("mean(kinetic)", "median(kinetic)"))
    with pytest.raises(
        ValueError, match=r"'mean\(q\)' cannot be kept; there are final, .*, kinetic, inside, mean\(kinetic\)"
    ):
        phigen.sweep(phigen.spec.loads(DRIVEN), keep=["mean(q)"])


CHAIN = """\
phigen: 1
name: chain
coordinates: [q, p]
lattice: {axes: [i]}
parameters: {k: 1}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + k*(q[i+1] - q)**2/2 + q**4/4
observables: {heat: {mean: p**2}, far: {max: abs(q)}, local: q**2}
order: 2
runs:
  r: {initial: {random: normal, seed: 2}, sizes: [6], step: 0.1, steps: 400, stride: 2, average: {after: 3, blocks: 4}}
sweeps:
  s: {over: {k: [0.5, 2], seed: {count: 2}}, keep: [far, mean(heat), std(heat), error(heat), energy_error]}
"""


@pytest.mark.slow  # the test starts a cluster of workers
def test_statistics_of_lattices_are_those_of_single_runs(tmp_path):
    spec = phigen.spec.loads(CHAIN)
    data = phigen.sweep(spec, workers=1)
    solver = phigen.compile(spec)
    trajectory = solver.run(k=2.0)
    heat = trajectory.observables["heat"][trajectory.t >= 3 - 1e-12]
    assert float(data["far"][1, 0]) == pytest.approx(trajectory.observables["far"][-1], rel=1e-12)
    assert float(data["mean(heat)"][1, 0]) == pytest.approx(heat.mean(), rel=1e-12)
    assert float(data["std(heat)"][1, 0]) == pytest.approx(heat.std(ddof=1), rel=1e-12)
    averages = Averages(1, blocks=4)
    averages.see(np.arange(float(len(heat))), heat[:, None])
    assert float(data["error(heat)"][1, 0]) == pytest.approx(averages.results()[0].error, rel=1e-12)
    assert float(data["mean(heat)"][1, 1]) != float(data["mean(heat)"][1, 0])
    energy = np.abs(trajectory.energy[-1] - trajectory.energy[0])
    assert float(data["energy_error"][1, 0]) == pytest.approx(energy, rel=1e-9)


@pytest.mark.slow  # the test starts a cluster of workers
def test_statistics_of_lattices_are_over_the_frames():
    data = phigen.sweep(phigen.spec.loads(CHAIN), frames=70, workers=1, keep=["mean(heat)", "std(heat)"])
    assert data["frame"].values.tolist() == [0, 70, 140, 210, 280, 350]
    heat = (data["frames"].sel(coordinate="p").values[..., 1:, :] ** 2).mean(axis=-1)  # the start is before t = 3
    np.testing.assert_allclose(data["mean(heat)"], heat.mean(axis=-1), rtol=1e-12)
    np.testing.assert_allclose(data["std(heat)"], heat.std(axis=-1, ddof=1), rtol=1e-12)


def test_sweeps_of_lattices_keep_numbers_only():
    with pytest.raises(phigen.SpecError, match=r"keep: 'mean\(local\)' is not known"):
        phigen.spec.loads(CHAIN.replace("mean(heat)", "mean(local)"))


@pytest.mark.slow  # the test starts a cluster of workers
def test_the_temperature_curve_of_the_page_is_that_of_theory():
    page = (Path(__file__).parents[2] / "docs" / "sweeps.md").read_text(encoding="utf-8")
    (text,) = (block for block in re.findall(r"```yaml\n(.*?)```", page, re.DOTALL) if "name: samples" in block)
    text = text.replace("sizes: [65]", "sizes: [33]").replace("steps: 4000", "steps: 2000")
    text = text.replace("{from: 0.2, to: 2, count: 10}", "[0.5, 1.5]")
    data = phigen.sweep(phigen.spec.loads(text), workers=1)
    assert dict(data.sizes) == {"T": 2, "seed": 32}
    couplings = np.linspace(0.5, 1.5, 1001)
    for temperature in data["T"].values:
        expected = (1 / np.tanh(couplings / temperature) - temperature / couplings).mean()
        bonds = data["mean(bonds)"].sel({"T": temperature}).values / 32
        error = bonds.std(ddof=1) / np.sqrt(32)
        assert error < 0.01
        assert bonds.mean() == pytest.approx(expected, abs=4 * error)
    assert (data["error(bonds)"] > 0).all()


@pytest.mark.slow  # it starts a cluster of workers
def test_a_row_without_a_value_makes_the_mean_nan_as_in_a_run():
    text = DRIVEN.replace("observables: {", "observables: {root: sqrt(q), ").replace("std( inside )", "mean(root)")
    spec = phigen.spec.loads(text)
    data, mean = phigen.sweep(spec, workers=1), phigen.averages(phigen.compile(spec).run("swing"))["root"].mean
    assert np.isnan([mean, *data["mean(root)"].values.ravel()]).all()
    assert np.isfinite(data["mean(kinetic)"]).all()


@pytest.mark.slow  # it starts a cluster of workers
def test_a_start_on_the_section_is_a_crossing_as_in_a_run():
    """A start counts if the section function leaves 0 in the direction of the run."""
    text = DRIVEN.replace("steps: 60", "section: q - 0.9, steps: 60").replace("kinetic, mean(kinetic)", "crossings")
    spec = phigen.spec.loads(text)
    data = phigen.sweep(spec, over={"p": [-0.3, 0.0, 0.3]}, workers=1, keep=["crossings"])
    counts = [
        len(phigen.compile(spec).section([0.9, p], 0.1, 60, lambda x, t: x[:, 0] - 0.9, t0=0.5).t)
        for p in (-0.3, 0, 0.3)
    ]
    assert data.crossings.values.tolist() == counts


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("steps: 60", "steps: 60, every: 0.4", "sweeps average over whole steps, but the rows of the run swing"),
        ("steps: 60", "steps: 60, at: [0.7, 2]", "sweeps average over whole steps, but the rows of the run swing"),
        ("steps: 60", "steps: 60, average: {after: 2}", "`after` of the run is a physical time, .* with a monitor"),
    ],
)
def test_averages_that_a_sweep_makes_of_other_rows_than_a_run_are_refused(old, new, reason):
    text = DRIVEN.replace("order: 2", "order: 2\nmonitor: 1 + q**2") if "monitor" in reason else DRIVEN
    changed = text.replace(old, new)
    with pytest.raises(phigen.SpecError, match=rf"mean\(kinetic\): {reason}"):
        phigen.spec.loads(changed)
    spec = phigen.spec.loads(changed.replace('kinetic, mean(kinetic), "std( inside )"', "kinetic"))
    with pytest.raises(ValueError, match=rf"std\(inside\): {reason}"):
        phigen.sweep(spec, keep=["std(inside)"])
