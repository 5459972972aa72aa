"""Classical methods, expressions evaluated along trajectories, energy drift, and readable formulas."""

import math
from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import DOP853
from support import series_of

from phigen import resources, spec
from phigen.compiler import compile_spec
from phigen.geometry import conservation
from phigen.geometry.system import system_from_spec
from phigen.realisations.catalogue import realise
from phigen.spec.model import BirealisationChoice
from phigen.spec.names import SPEC_FUNCTIONS
from phigen.study import classical, dop853, summary
from phigen.study.summary import WINDOWS, _windows
from phigen.symbolic import arrays, readable
from phigen.symbolic.expression import PI, call, number, power, symbol, text
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.numeric import evaluate

SPECS = resources.bundled_specs()


def pendulum(x):
    return np.array([x[1], -math.sin(x[0])])


@pytest.mark.parametrize("method", classical.METHODS)
def test_measured_order_is_the_stated_one(method):
    order = classical.METHODS[method][1]
    reference = classical.integrate("dop853", pendulum, [1.0, 0.5], 0.01, 200)[-1]
    steps = 8 if order == 8 else 40
    errors = [
        np.max(np.abs(classical.integrate(method, pendulum, [1.0, 0.5], 2.0 / n, n)[-1] - reference))
        for n in (steps, 2 * steps)
    ]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.35)


def test_methods_of_the_spec_format_are_all_there():
    from phigen.spec.names import CLASSICAL_METHODS

    assert set(classical.METHODS) == set(CLASSICAL_METHODS)


def test_dop853_has_the_coefficients_of_hairer():
    for i, row in enumerate(dop853.A):
        assert [row.get(j, 0.0) for j in range(12)] == DOP853.A[i, :12].tolist()
    assert [dop853.B.get(j, 0.0) for j in range(12)] == DOP853.B.tolist()


def test_classical_run_stores_rows_and_marks_failure():
    states = classical.integrate("euler", lambda x: x**3, [1.0], 0.5, 50, 5)
    assert states.shape == (11, 1)
    assert states[0, 0] == 1
    assert np.isnan(states[-1, 0])
    assert classical.integrate("rk4", pendulum, [1.0, 0.0], 0.1, 7, 3).shape == (4, 2)


def test_implicit_midpoint_conserves_quadratic_invariants():
    states = classical.integrate("implicit-midpoint", lambda x: np.array([x[1], -x[0]]), [1.0, 0.0], 0.1, 1000)
    assert np.ptp((states**2).sum(axis=1)) < 1e-13


@pytest.mark.parametrize("name", [f for f in SPEC_FUNCTIONS if f != "sqrt"])
def test_functions_on_arrays_agree_with_those_on_numbers(name):
    x = 1.25 if name == "acosh" else 0.4
    arguments = [symbol("x"), symbol("y")][: FUNCTIONS[name].arity]
    e = call(name, *arguments) * PI - power(symbol("x"), Fraction(-1, 2)) / number(3)
    (expected,) = evaluate([e], {"x": x, "y": 0.7})
    (values,) = arrays.evaluate([e], {"x": np.array([x, x]), "y": 0.7})
    assert values == pytest.approx([expected] * 2, rel=1e-14)


def oscillator():
    system = compile_spec(spec.load(SPECS / "harmonic_oscillator.yaml")).system
    return system, {p.name: 1.0 for p in system.parameters}


def drift_of(energies, t):
    """Return the energy drift for states of the harmonic oscillator that have these energies at the times t."""
    system, parameters = oscillator()
    x = np.sqrt(2 * energies)[:, None] * np.column_stack([np.cos(t), -np.sin(t)])
    return summary.summarise("a", system, None, parameters, t, x).energy


def test_drift_distinguishes_growth_from_oscillation():
    t = np.arange(10001) / 100
    oscillation, growth = drift_of(1 + 1e-3 * np.sin(t), t), drift_of(1 + 1e-3 * t, t)
    assert oscillation.growth == pytest.approx(1, abs=0.1)
    assert growth.growth == pytest.approx(10, abs=0.1)
    assert oscillation.error == pytest.approx(1e-3, rel=1e-2)


@pytest.mark.parametrize(
    ("turns", "error", "telling"),
    [(25, 1e-3, True), (11, 1e-3, True), (5, 1e-3, False), (0.4, 1e-3, False), (25, 1e-15, False)],
)
def test_growth_is_measured_if_the_run_has_enough_periods_and_errors_above_rounding(turns, error, telling):
    t = np.linspace(0, 2 * np.pi * turns, 3001)
    assert math.isfinite(drift_of(1 + error * np.sin(t) ** 2, t).growth) == telling


def test_turns_are_counted_across_pieces_of_a_run():
    system, parameters = oscillator()
    t = np.linspace(0, 100, 4001)
    x = (1 + 1e-4 * np.sin(3 * t))[:, None] * np.column_stack([np.cos(t), -np.sin(t)])
    watch = summary.Watch("a", system, None, parameters, len(t))
    for piece in np.array_split(np.arange(len(t)), 77):
        watch.see(t[piece], x[piece])
    assert watch.state["turns"].tolist() == [[3, 3], [31, 32]]
    whole = summary.summarise("a", system, None, parameters, t, x)
    assert watch.summary() == whole


@pytest.mark.parametrize(
    ("value", "terms", "kind", "size"),
    [
        (-2.0, 3.0, "relative", 2.0),
        (1e6, 3.0, "relative", 1e6),
        (0.01, 3.0, "relative", 0.01),
        (1e-16, 3.0, "of its terms", 3.0),
        (0.0, 0.0, "absolute", 1.0),
        (math.nan, math.nan, "no value at the start", 1.0),
        (math.inf, 2.0, "no value at the start", 1.0),
    ],
)
def test_errors_are_relative_to_the_value_at_the_start_or_to_the_terms_that_cancel_there(value, terms, kind, size):
    unit = conservation.unit_of(value, terms)
    assert (unit.kind, unit.size) == (kind, size)


def test_an_energy_without_a_value_at_the_start_is_not_said_to_be_zero_there():
    q = symbol("q")
    (unit,) = conservation.units([q - call("log", q)], ["q"], {}, np.zeros(1))
    assert conservation.stated({"energy": unit}) == "Errors of energy are unknown, since H has no value at the start."


@pytest.mark.parametrize("constant", [0, 5])
def test_error_of_an_energy_that_is_zero_at_the_start_is_relative_to_its_terms(constant):
    """H = p²/2 − cos q + constant at q = π/2, p = 0. Without the constant H is 0 there, and errors are relative to the
    size of its terms. With the constant they are relative to H.
    """
    q, p = symbol("q"), symbol("p")
    h = p**2 / 2 - call("cos", q) + constant
    (unit,) = conservation.units([h], ["q", "p"], {}, np.array([math.pi / 2, 0.0]))
    assert unit.size == pytest.approx(constant or math.pi / 2)
    assert ("since H is nearly 0" in conservation.stated({"energy": unit})) == (constant == 0)


def test_summary_of_a_run_that_failed_is_about_its_finite_rows():
    system = compile_spec(spec.load(SPECS / "harmonic_oscillator.yaml")).system
    x = np.array([[1.0, 0.0], [0.0, 1.0], [np.nan, np.nan]])
    parameters = {p.name: 1.0 for p in system.parameters}
    errors = summary.summarise("a", system, None, parameters, np.arange(3.0), x)
    assert (errors.good, errors.rows) == (2, 3)
    assert math.isfinite(errors.energy.error)


@pytest.mark.parametrize("name", ["rigid_body", "kepler", "pendulum", "predator_prey"])
def test_printed_series_is_the_series(name):
    compilation = compile_spec(spec.load(SPECS / f"{name}.yaml"), order=4)
    series = series_of(compilation.system, compilation.realisation, 3)
    names = [*compilation.system.coordinates, *compilation.system.parameter_names]
    values = {n: 0.3 + 0.2 * i for i, n in enumerate(names)}
    for s in (series.terms[0], series.terms[2]):
        shown = str(readable.of_polynomial(series.tower, s, None))
        functions = {f: getattr(math, f) for f in ("sin", "cos", "exp", "log", "sqrt")}
        (expected,) = evaluate([series.tower.expression(s)], values)
        assert eval(shown, {**functions, **values}) == pytest.approx(expected, rel=1e-12)


def test_readable_formulas_keep_their_value_and_lose_colons():
    system = system_from_spec(spec.load(SPECS / "rigid_body.yaml"))
    alpha = realise(system, BirealisationChoice("cayley")).alpha
    names = [*system.coordinates, *(f"p_{c}" for c in system.coordinates)]
    values = {n: 0.3 + 0.2 * i for i, n in enumerate(names)}
    for shown, e in zip(readable.readable(alpha, None), alpha, strict=True):
        (expected,) = evaluate([e], {n.replace("p_", "p:"): v for n, v in values.items()})
        assert eval(shown, dict(values)) == pytest.approx(expected)
        assert len(shown) <= len(text(e))


@pytest.mark.parametrize(
    "formula",
    ["x - (y - z) - (x + y)", "x*(y/z)/(x*y)", "-(x + y)**3*2", "x/(y + z)**2", "1/x - 1/(y*z)", "-x**2 - -3*y*(-z)",
     "exp(-x/y) - sqrt(x + 1)*2", "x**(3/2)*(y - 1)", "(x*y)**2/3", "-1/2*(x - y)", "x*(-(y + z))",
     "(x + z)*(1/y**2 - z**2)", "z*(x/y)**2/sqrt(2)", "(x + y)**(-3/2)*z", "1/(x*sqrt(y + z))", "(sqrt(x) + z)**2/x"],
)  # fmt: skip
def test_fewer_parentheses_do_not_change_the_value(formula):
    head = "phigen: 1\nname: t\ncoordinates: [x, y, z]\npoisson: {matrix: [[0, 0, 0], [0, 0, 0], [0, 0, 0]]}\n"
    e = spec.loads(f"{head}hamiltonian: {formula}\n").hamiltonian
    values = {"x": 1.3, "y": 0.7, "z": 2.1}
    functions = {"exp": math.exp, "sqrt": math.sqrt}
    assert eval(readable.infix(e), {**functions, **values}) == pytest.approx(evaluate([e], values)[0], rel=1e-14)
    assert "**(-" not in readable.infix(e)  # negative powers are written as quotients


def test_starter_spec_summary_agrees_with_the_solver():
    import phigen

    system = phigen.load(SPECS / "henon_heiles.yaml")
    run = next(iter(system.spec.runs.values()))
    solver = phigen.compile(system, "numpy", 2)
    trajectory = solver.integrate([float(v) for v in run.initial], float(run.step), 100)
    errors = summary.summarise("phigen", system, run, trajectory.parameters, trajectory.t, trajectory.x)
    expected = np.max(np.abs(trajectory.energy / trajectory.energy[0] - 1))
    assert errors.energy.error == pytest.approx(expected, rel=1e-6)


def test_spec_of_the_demo_still_has_its_run():
    assert "blow_up" in spec.load(SPECS / "lotka_volterra.yaml").runs


def test_windows_part_a_run_evenly_whatever_its_length():
    for count in (1, 2, WINDOWS, WINDOWS + 1, 1000, 1003):
        parts = np.array_split(np.arange(1, count), WINDOWS)
        expected = [WINDOWS, *(k for k, part in enumerate(parts) for _ in part)]
        assert _windows(np.arange(count), count).tolist() == expected
    assert _windows(np.array([0, 1, 10**15 - 1]), 10**15).tolist() == [WINDOWS, 0, WINDOWS - 1]
