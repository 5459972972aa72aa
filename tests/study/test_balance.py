"""Energy balance and verification, for Hamiltonians that depend on the time."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import quad
from support import compile_text, solver

from phigen.cli import group
from phigen.geometry.system import system_from_spec
from phigen.spec import loads
from phigen.study.balance import powers, works
from phigen.study.meanings import meaning_of
from phigen.study.summary import summarise
from phigen.study.verification import verify

DUFFING = """time: t
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - q**2/2 + q**4/4 - 0.3*q*cos(1.2*t)
order: 6
tangent: true
"""


def test_the_rule_is_of_order_eight():
    t = np.array([0.3, 0.8, 2.0])
    by_degree = [np.polynomial.Polynomial.basis(degree) for degree in range(9)]
    for degree, p in enumerate(by_degree):
        f = np.array([p.deriv(k)(t) if k else p(t) for k in range(4)])
        parts, off = works(t, f)
        exact = np.diff(p.integ()(t))
        assert (np.max(np.abs(parts - exact)) < 1e-12) == (degree < 8)
        assert (np.max(off) < 1e-12) == (degree < 6)


def test_powers_are_derivatives_along_the_motion():
    system = system_from_spec(loads(f"phigen: 1\nname: t\n{DUFFING}"))
    assert len(powers(system)) == 4
    t = np.arange(0, 4.0, 0.25)
    free = "time: t\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: p**2/2 - q*t"
    x = np.stack([t**3 / 6, t**2 / 2], axis=1)  # the solution of q¨ = t from rest at 0, along which ∂H/∂t is −q
    summary = summarise("exact", system_from_spec(loads(f"phigen: 1\nname: t\n{free}\n")), None, {}, t, x)
    assert summary.energy.error < 1e-14
    assert summary.off < 1e-14


def test_the_balance_is_kept_to_the_order_of_the_method_and_has_no_drift():
    compilation = compile_text(DUFFING)
    errors = []
    for h in (0.1, 0.05):
        rows = solver(compilation, "c").integrate([1.2, 0], h, round(100 / h), t0=0.4)
        summary = summarise("phigen", compilation.system, None, {}, rows.t, rows.x)
        errors.append(summary.energy.error)
        assert summary.energy.growth < 4
    assert np.log2(errors[0] / errors[1]) == pytest.approx(6, abs=0.5)
    work = quad(lambda t: 0.36 * np.interp(t, rows.t, rows.x[:, 0]) * np.sin(1.2 * t), 0.4, 10.4, limit=500)[0]
    assert rows.energy[200] - rows.energy[0] == pytest.approx(work, abs=2e-3)


@pytest.mark.slow
def test_all_checks_hold_from_any_time_on():
    compilation = compile_text(DUFFING)
    solvers = {target: solver(compilation, target) for target in ("c", "numpy")}
    verification = verify(compilation, solvers, "r", [1.2, 0], {}, 0.1, 100, t0=0.7, quick=True)
    assert verification.failures == []
    named = {c.name: c for c in verification.checks}
    assert named["observed order"].value > 5.7
    assert named["Poisson defect, exact tangent"].value < 1e-13
    assert all(meaning_of(c.name) for c in verification.checks)
    assert named["energy balance: largest error"].value < named["energy balance: largest error"].others["rk4"]


def test_a_run_begins_at_its_time(tmp_path):
    runner = CliRunner()
    path = tmp_path / "duffing.yaml"
    run = "{initial: [1.2, 0], step: 0.1, steps: 60, start: 0.7, section: q - cos(t), compare: [rk4]}"
    path.write_text(f"phigen: 1\nname: duffing\n{DUFFING}runs: {{r: {run}}}\n", encoding="utf-8")
    result = runner.invoke(group, ["run", str(path), "--json", "--output", str(tmp_path / "o.npz")])
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    stored = np.load(tmp_path / "o.npz")
    assert document["start"] == 0.7
    assert stored["t"][[0, -1]].tolist() == [0.7, 0.7 + 60 * 0.1]
    mine, other = (m["energy"]["error"] for m in document["methods"])
    assert 0 < mine < other
    shown = runner.invoke(group, ["run", str(path)])
    rows = dict(line.strip().split("  ", 1) for line in shown.output.splitlines() if " of the energy" in line[:30])
    assert [*rows] == ["change of the energy", "error of the energy balance"]
    assert "largest error" not in shown.output
    changes = document["methods"][0]["change"]["error"]
    assert changes == pytest.approx(np.abs(stored["energy"] - stored["energy"][0]).max() / abs(stored["energy"][0]))
    assert "t = 0.7 … 6.7" in shown.output


@pytest.mark.slow
def test_figures_and_reports_show_the_balance(tmp_path):
    path = tmp_path / "duffing.yaml"
    text = DUFFING.replace(
        "tangent: true", "runs: {r: {initial: [1.2, 0], step: 0.1, steps: 40, start: 0.7, compare: [rk4]}}"
    )
    path.write_text(f"phigen: 1\nname: duffing\n{text}", encoding="utf-8")
    result = CliRunner().invoke(group, ["run", str(path), "--plot", str(tmp_path / "d.svg"), "--target", "numpy"])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "d.svg").stat().st_size > 10_000
    result = CliRunner().invoke(group, ["report", str(path), "-o", str(tmp_path / "d.html"), "--quick"])
    assert result.exit_code == 0, result.output
    assert "largest error of the energy balance" in (tmp_path / "d.html").read_text(encoding="utf-8")
