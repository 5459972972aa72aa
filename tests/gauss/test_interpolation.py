"""The collocation polynomial of the last step: its values at the ends of the step, its order, and crossings of sections
that are found with it.
"""

import numpy as np
import pytest
from support import compile_text, compiled, first_run, javascript, slow_but, small, solver

from phigen.errors import StepError

PENDULUM = """coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - cos(q)
scheme: gauss
"""
DRIVEN = """coordinates: [q, p]
time: t
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - cos(q) + q*sin(2*t)/4
scheme: gauss
"""
#: A bracket for which phigen knows no Gauss step that is a Poisson map.
DIRECT = """coordinates: [x, y, z]
poisson: {brackets: {x: {y: z**2}, y: {z: x}, z: {x: y}}}
hamiltonian: (x**2 + 2*y**2 + z**4)/2
casimirs: {C: x**2/2 + y**2/2 + z**3/3}
scheme: gauss
structure: to truncation
"""
#: Systems, each with its step size: with group elements, with logarithms of coordinates, with time, and one whose step
#: is a Poisson map only up to its truncation error.
CASES = {
    "so4": (lambda: compiled("so4_manakov", 8, "gauss"), 0.5),
    "logarithms": (lambda: compiled("volterra5", 8, "gauss"), 0.2),
    "time": (lambda: compile_text(DRIVEN, 8), 0.3),
    "truncation": (lambda: compile_text(DIRECT, 8), 0.2),
}
STARTS = {"time": [1.0, 0.4], "truncation": [0.7, 0.3, 0.8]}


def start_of(case, compilation):
    return np.array(STARTS[case] if case in STARTS else [float(v) for v in first_run(compilation).initial])


def sessions(compilation, x0):
    """Return sessions that start at x0: in NumPy, in fast C and in short C."""
    methods = solver(compilation, "numpy"), solver(compilation, "c"), solver(small(compilation), "c")
    return [m.backend.start(x0, m.backend.interface.parameters) for m in methods]


@pytest.mark.parametrize("case", slow_but(["so4"], CASES))
def test_polynomial_leads_from_the_start_of_the_step_to_its_end(case):
    compilation, h = CASES[case][0](), CASES[case][1]
    x0 = start_of(case, compilation)
    inside = []
    for session in sessions(compilation, x0):
        assert session.interpolated([0.5]) is None  # no polynomial before the first step
        session.advance(h, 3)
        before = session.state()
        session.advance(h, 1)
        first, middle, last = session.interpolated([0.0, 0.3, 1.0])
        assert first == pytest.approx(before, abs=2e-15)
        assert last == pytest.approx(session.state(), abs=2e-15)
        inside.append(middle)
        session.kick(np.zeros(len(x0)))
        assert session.interpolated([0.5]) is None  # a kick invalidates the polynomial
    script = f"s.integrate({h}, 4);"
    inside.append(javascript(compilation, f"x0: {x0.tolist()}", script, "[...s.interpolate([0.3])[0]]"))
    for other in inside[1:]:
        assert other == pytest.approx(inside[0], abs=1e-14)


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize("stages", slow_but([3], [2, 3]))
def test_polynomial_has_the_order_of_its_degree_and_steps_back_that_of_the_method(stages):
    method, fine = (solver(compile_text(PENDULUM, order), "c") for order in (2 * stages, 16))
    errors = []
    for h in (0.2, 0.1):
        largest = np.zeros(2)
        for fraction in (0.2, 0.4, 0.6, 0.8):
            session = method.backend.start(np.array([1.0, 0.5]), {})
            session.advance(h, 1)
            exact = fine.integrate([1.0, 0.5], fraction * h / 8, 8).x[-1]
            (inside,) = session.interpolated([fraction])
            session.advance((fraction - 1) * h, 1)
            largest = np.maximum(largest, [np.abs(inside - exact).max(), np.abs(session.state() - exact).max()])
        errors.append(largest)
    polynomial, step = np.log2(np.divide(*errors))
    assert polynomial == pytest.approx(stages + 1, abs=0.2)
    assert step == pytest.approx(2 * stages + 1, abs=0.2)


@pytest.mark.parametrize("ratio", slow_but([-0.7], [-0.7, 0.3, -1.0]))
def test_steps_of_another_size_start_from_the_polynomial(ratio):
    compilation = compiled("so4_manakov", 16, "gauss")
    x0, h = start_of("so4", compilation), 2.5
    by_scale = f"const warm = s.copy(); const n = s.evaluations; warm.step({ratio * h});"
    anew = f"const cold = new s.constructor({{ x0: s.x }}); cold.step({ratio * h});"
    values = "[warm.evaluations - n, cold.evaluations, ...warm.x, ...cold.x]"
    warm, cold, *ends = javascript(compilation, f"x0: {x0.tolist()}", f"s.integrate({h}, 4); {by_scale} {anew}", values)
    assert warm <= (0.8 * cold if ratio > 0 else 0.6 * cold)
    assert ends[:6] == pytest.approx(ends[6:], abs=1e-15)
    for session in sessions(compilation, x0):
        session.advance(h, 4)
        session.advance(ratio * h, 1)
        assert session.state() == pytest.approx(ends[6:], abs=1e-13)


@pytest.mark.parametrize("target", slow_but(["c"], ["numpy", "c"]))
def test_no_crossing_inside_a_long_step_is_missed(target):
    """All crossings q = 1.27 are found with steps of three eighths of a period, in some of which q rises above 1.27 and
    falls again.

    A parabola through the values of three steps would miss some of these crossings.
    """
    method = solver(compile_text(PENDULUM, 16), target)
    long, short = (
        method.section([0.2, 1.2], h, round(162.5 / h), lambda x: x[:, 0] - 1.27, direction="both")
        for h in ((2.5, 0.1) if target == "c" else (2.5, 0.5))
    )
    assert len(short) == len(long) == 46
    assert long.t == pytest.approx(short.t, abs=1e-5)
    assert np.abs(long.x[:, 0] - 1.27).max() <= 5e-16
    energies = long.x[:, 1] ** 2 / 2 - np.cos(long.x[:, 0])
    assert energies == pytest.approx(np.full(46, 0.72 - np.cos(0.2)), abs=1e-6)


@pytest.mark.slow
def test_crossings_between_steps_are_on_the_leaf():
    compilation = compiled("so4_manakov", 16, "gauss")
    method, x0 = solver(compilation, "c"), start_of("so4", compilation)
    middle = method.integrate(x0, 2.5, 200).x[:, 0].mean()
    section = method.section(x0, 2.5, 200, lambda x: x[:, 0] - middle)
    casimirs = method.casimirs(np.vstack([x0, section.x]))
    assert len(section) == 18
    assert all(np.abs(values - values[0]).max() <= 2e-14 for values in casimirs.values())


def test_members_that_fail_leave_the_others_as_they_are():
    """If a member fails in NumPy, the remaining members keep their predictors and results."""
    method = solver(compiled("henon_heiles", 8, "gauss"), "numpy")
    starts = np.array([[0.1, 0.1, 0.1, 0.1], [0.1, 0.12, 0.1, 0.2], [3.0, 4.0, 5.0, 6.0]])
    with pytest.raises(StepError) as failed:
        method.ensemble(starts, 0.3, 60)
    assert failed.value.members == (2,)
