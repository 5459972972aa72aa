"""Monitors that `phigen tune` proposes where H is singular. Settings with and without monitors are compared at the same
energy error.
"""

import re
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from phigen import spec as specs
from phigen.cli.tune_summary import print_monitors
from phigen.compiler import compile_spec
from phigen.geometry.system import system_from_spec
from phigen.tuning import monitors, settings
from phigen.tuning.problem import SystemProblem
from phigen.tuning.settings import Setting, own_setting

KEPLER = """phigen: 1
name: eccentric
coordinates: [q1, q2, p1, p2]
poisson: {canonical: {q: [q1, q2], p: [p1, p2]}}
hamiltonian: (p1**2 + p2**2)/2 - 1/sqrt(q1**2 + q2**2)
order: 2
runs: {r: {initial: [0.1, 0, 0, 4.358898943540674], step: 0.01, duration: 13}}
"""
VORTICES = """phigen: 1
name: pairs
coordinates: [x1, y1, x2, y2, x3, y3]
poisson: {canonical: {q: [x1, x2, x3], p: [y1, y2, y3]}}
hamiltonian: -log((x1 - x2)**2 + (y1 - y2)**2) - log((x1 - x3)**2 + (y1 - y3)**2)
order: 2
"""
START = np.array([0.1, 0.0, 0.0, np.sqrt(19.0)])


def along_the_orbit(t, y):
    r = np.hypot(*y[:2])
    return [*y[2:], *(-y[:2] / r**3)]


@pytest.fixture(scope="module")
def states():
    times = np.linspace(0, 13, 400)
    return solve_ivp(along_the_orbit, (0, 13), START, method="DOP853", rtol=1e-9, t_eval=times).y.T


def test_distances_are_found_where_h_has_them(states):
    system = compile_spec(specs.loads(KEPLER)).system
    assert {"(q1**2 + q2**2)**(3/4)", "sqrt(q1**2 + q2**2)"} <= {_sorted(g) for g in candidates(system, states)}
    six = np.random.default_rng(1).normal(size=(20, 6))
    texts = [str(g) for g in candidates(compile_spec(specs.loads(VORTICES)).system, six)]
    assert any(g.count("x1") == 2 and g.startswith("(1 + ") and g.endswith("**(-1/2)") for g in texts)


def test_monitors_of_many_bodies_are_short_and_about_the_closest_encounter():
    """For many bodies the proposed monitors are short, concern the closest pair, and can be pasted into the spec."""
    bodies, axes = range(6), "xyz"
    names = [f"{a}_{k}" for a in axes for k in bodies]
    pairs = [(i, j) for i in bodies for j in range(i)]
    text = f"phigen: 1\nname: n\ncoordinates: [{', '.join([*names, *(f'p{n}' for n in names)])}]\norder: 2\n"
    text += f"poisson: {{canonical: {{q: [{', '.join(names)}], p: [{', '.join(f'p{n}' for n in names)}]}}}}\n"
    distances = (" + ".join(f"({a}_{i} - {a}_{j})**2" for a in axes) for i, j in pairs)
    h = " + ".join([*(f"p{n}**2" for n in names), *(f"-1/sqrt({d})" for d in distances)])
    spec = specs.loads(f"{text}hamiltonian: {h.replace('+ -', '- ')}\n")
    rows = np.random.default_rng(2).normal(size=(30, 36))
    rows[3, [k * 6 + 4 for k in range(3)]] = rows[3, [k * 6 + 2 for k in range(3)]] + 1e-3
    texts = [str(g) for g in candidates(system_from_spec(spec), rows)]
    assert texts
    assert max(map(len, texts)) <= monitors.MOST_LETTERS
    assert all(settings.monitor_of(g, spec) is not None for g in texts)
    first = next(g for g in texts if g.startswith("(1 + "))
    assert all(re.search(f"{a}_[24] - {a}_[24]", first) for a in axes)


def candidates(system, states):
    return list(monitors.candidates(system, {}, states))


def _sorted(g):
    return str(g).replace("q2**2 + q1**2", "q1**2 + q2**2")


def test_only_a_motion_that_is_fast_at_times_asks_for_one(states):
    assert monitors.is_uneven(lambda x: np.array([along_the_orbit(0, row) for row in x]), states)
    assert not monitors.is_uneven(lambda x: x, np.ones((10, 2)))


@pytest.mark.slow
def test_monitors_take_fewer_steps_for_the_same_error_and_say_how_they_are_written(states):
    spec = specs.loads(KEPLER)
    compilation = compile_spec(spec)
    problem = SystemProblem(START, {}, 0.01, 13.0, system=compilation.system)
    settings = monitors.settings(own_setting(compilation), 2, [])
    settings.append(Setting(settings[0].kind, 2, "none", settings[0].composition, monitor="(q1**2 + q2**2)**(3/4)"))
    comparison = monitors.compare(
        spec, compilation.system, settings, problem, states, 13.0, 1e-3, time.perf_counter() + 60
    )
    gains = {trial.setting.monitor: comparison.gain(trial) for trial in comparison.found}
    assert gains["(q1**2 + q2**2)**(3/4)"] > 10
    assert gains["log"] > gains["(q1**2 + q2**2)**(3/4)"]
    assert all(trial.error <= 1e-3 for trial in comparison.found)
    best = comparison.found[0]
    assert "monitor: log" in best.setting.lines()
    again = best.setting.applied(spec)
    assert (again.monitor, again.scheme) == ("log", "splitting")


def test_the_lines_of_the_best_monitor_are_printed(capsys):
    plain = monitors.Trial(Setting("constant", 4, "none", "auto"), "constant", 4, 0.001, 36000.0, 1e-6, 0.04)
    best = replace(plain, setting=replace(plain.setting, monitor="1/(1 + q1**2)"), step=0.0505, steps=1000.0)
    run = specs.loads(KEPLER).runs["r"]
    tuning = SimpleNamespace(winner=None, horizon=13.0)
    print_monitors(monitors.Monitors(13.0, plain, (best,), {"q1**2": "late"}), tuning, run)
    text = capsys.readouterr().out
    assert "36 times" in text
    assert "Not measured: q1**2: late." in text
    assert "monitor: 1/(1 + q1**2)\n" in text
    assert "    step: 0.0505\n    until: 13.0" in text


def test_each_monitor_is_tried_by_the_series_and_by_gauss():
    spec = specs.loads(KEPLER)
    compilation = compile_spec(spec)
    requested = monitors.settings(own_setting(compilation), 4, [spec.hamiltonian])
    assert [s.scheme for s in requested if s.monitor == str(spec.hamiltonian)] == ["series", "gauss"]
