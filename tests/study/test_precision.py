"""Comparison of errors and times with classical methods: methods in C and in Python agree, have their stated orders,
and are limited by rounding.
"""

import math

import numpy as np
import pytest
from support import compiled, solver

from phigen.drawing import figures
from phigen.study import classical, precision, race
from phigen.study.precision import PrecisionCurve, PrecisionPoint, Study

START, PARAMETERS = np.array([1.0, 0.5, 0.8]), {"I1": 2.0, "I2": 1.0, "I3": 0.7}


@pytest.fixture(scope="module")
def body():
    return compiled("rigid_body", 4)


@pytest.fixture(scope="module")
def in_c(body):
    return race.compiled(body, list(race.TABLEAUX), START, PARAMETERS)


def test_times_of_the_solver_do_not_contain_its_set_up(body):
    start = START.copy()
    methods = race.compiled(body, ["rk4"], start, PARAMETERS)
    of_phigen, rk4 = (methods.runners[name](0.05, 10, 1) for name in (race.OWN, "rk4"))
    start *= 2  # the solver was set up with the old start, but RK4 reads the new one
    assert (methods.runners[race.OWN](0.05, 10, 1) == of_phigen).all()
    assert not np.allclose(methods.runners["rk4"](0.05, 10, 1), rk4)


@pytest.mark.parametrize("method", race.TABLEAUX)
def test_classical_method_in_c_is_the_one_in_python(body, in_c, method):
    field = solver(body, "numpy").vector_field
    expected = classical.integrate(method, lambda x: field(x, **PARAMETERS), START, 0.05, 40)[-1]
    assert in_c.runners[method](0.05, 40, 3) == pytest.approx(expected, rel=1e-12)


def test_solver_in_the_race_is_the_solver(body, in_c):
    expected = solver(body, "c").integrate(START, 0.05, 40, parameters=PARAMETERS).x[-1]
    assert in_c.runners[race.OWN](0.05, 40, 2) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("make", ["c", "python"])
def test_with_a_monitor_all_methods_make_their_steps_in_tau(make):
    """RK4 also makes steps of equal size in τ, so that it ends at the same state as the solver."""
    compilation = compiled("kepler_eccentric", 8)
    start, at = np.array([0.3, 0.0, 0.0, 2.3]), {"oblateness": 1e-3}
    methods = race.compiled(compilation, ["rk4"], start, at) if make == "c" else race.interpreted(
        solver(compilation, "numpy"), ["rk4"], start, at)  # fmt: skip
    assert methods.clock == "τ"
    assert methods.runners["rk4"](0.005, 400, 1) == pytest.approx(methods.runners[race.OWN](0.01, 200, 1), abs=1e-8)


def test_a_step_that_cannot_be_made_has_no_result(in_c):
    assert in_c.runners[race.OWN](1e6, 3, 1) is None
    assert in_c.runners["rk4"](1e200, 3, 1) is None


@pytest.mark.slow
@pytest.mark.parametrize("make", ["c", "python"])
def test_orders_of_a_study_are_the_stated_ones(body, in_c, make, monkeypatch):
    # A busy machine would reach this time limit before it measures small steps.
    monkeypatch.setattr(precision, "MOST_SECONDS", math.inf)
    methods = ["rk4", "dop853"]
    other = race.interpreted(solver(body, "numpy"), methods, START, PARAMETERS)
    measured = precision.study(in_c if make == "c" else other, 4, 0.4, 3, rounds=1)
    slopes = {c.label: c.slope for c in measured.curves}
    assert slopes["phigen"] == pytest.approx(4, abs=0.2)
    assert slopes["rk4"] == pytest.approx(4, abs=0.2)
    assert measured.floor < 1e-13
    assert all(p.seconds > 0 for c in measured.curves for p in c.points)
    assert not measured.has_casimirs


def test_closed_form_is_the_reference_where_there_is_one():
    oscillator = compiled("harmonic_oscillator", 2)
    at = {p.name: 1.0 for p in oscillator.system.parameters}
    one = race.compiled(oscillator, ["dop853"], np.array([1.0, 0.0]), at)

    def exact(t):
        return np.array([math.cos(t), -math.sin(t)])

    with_form = precision.study(one, 2, 0.1, 16, exact, casimirs=lambda x: 1e-16, rounds=1)
    without = precision.study(one, 2, 0.1, 16, rounds=1)
    pairs = zip(with_form.curves[0].points, without.curves[0].points, strict=True)
    assert all(a.error == pytest.approx(b.error, rel=1e-6, abs=1e-13) for a, b in pairs)
    assert "closed form" in with_form.reference
    assert with_form.has_casimirs


def test_motions_that_dop853_cannot_follow_are_reported():
    def lost(h, steps, repeats):
        return None

    with pytest.raises(ArithmeticError, match="DOP853"):
        precision.study(race.Race({race.OWN: lost, "dop853": lost}, lambda repeats: None, "C"), 2, 0.1, 100, rounds=1)


def test_slope_is_that_above_rounding():
    errors = {2**k: 0.3 * 2.0 ** (-4 * k) + 1e-13 * (k % 3) for k in range(1, 16)}
    assert precision.slope(errors, 1e-15) == pytest.approx(4, abs=0.1)
    assert math.isnan(precision.slope({4: 1e-15, 8: 1e-15}, 1e-15))
    assert math.isnan(precision.slope({4: 0.5, 8: 0.4}, 1e-15))


def test_time_is_that_of_the_fastest_repetition(monkeypatch):
    now = iter(range(10**6))
    monkeypatch.setattr(precision.time, "perf_counter", lambda: 0.01 * next(now) ** 1.1)
    runner = {race.OWN: lambda h, n, repeats: START}
    times = precision._times(race.Race(runner, lambda repeats: None, "C"), {race.OWN: [1]}, 1.0, 3)
    assert times[race.OWN, 1] == pytest.approx(0.01 * (3**1.1 - 2**1.1))


def study(casimirs=1e-16):
    curves = [
        PrecisionCurve(
            label,
            order,
            tuple(PrecisionPoint(h, round(1 / h), h**order, casimirs, 1e-6 / h) for h in (0.1, 0.05, 0.025)),
            order,
        )
        for label, order in (("phigen", 4), ("rk4", 4), ("dop853", 8))
    ]
    return Study(1.0, 10, 1e-15, "the closed form", 0.0, "C", 5, tuple(curves))


def test_figures_name_methods_and_slopes():
    text = figures.svg(figures.convergence_figure(study()))
    assert "phigen (order 4): slope 4.00" in text
    assert "rk4 (order 4)" in text


@pytest.mark.parametrize("casimirs", [1e-16, math.nan])
def test_work_has_a_panel_for_casimirs_if_there_are_any(casimirs):
    assert len(figures.work_precision_figure(study(casimirs)).axes) == 1 + math.isfinite(casimirs)
