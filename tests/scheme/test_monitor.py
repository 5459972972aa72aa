"""Monitors g with dt = g dτ: a step in τ, made with the Hamiltonian K = g(H + e), is exactly a Poisson map for a fixed
energy level e, and also computes the time t.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import javascript, slow_but

from phigen import SpecError, StepError, spec
from phigen import solve_ivp as solve
from phigen.api import solver_of
from phigen.compiler import compile_proved, compile_spec, emit, examine
from phigen.errors import CheckError
from phigen.proofs import statements
from phigen.proofs.independent import GRADIENT, compare
from phigen.study import measures, verification
from phigen.study.methods import Method

KEPLER = """phigen: 1
name: kepler_monitored
coordinates: [q1, q2, p1, p2]
poisson: {canonical: {q: [q1, q2], p: [p1, p2]}}
hamiltonian: (p1**2 + p2**2)/2 - 1/sqrt(q1**2 + q2**2)
invariants: {L: q1*p2 - q2*p1}
monitor: (q1**2 + q2**2)**(3/4)
order: 4
runs: {eccentric: {initial: [0.1, 0, 0, 4.358898943540674], step: 0.0628, steps: 100}}
"""
BY_HAND = """phigen: 1
name: kepler_by_hand
coordinates: [q1, q2, t, p1, p2, e]
poisson: {canonical: {q: [q1, q2, t], p: [p1, p2, e]}}
hamiltonian: (q1**2 + q2**2)**(3/4)*((p1**2 + p2**2)/2 - 1/sqrt(q1**2 + q2**2) + e)
"""
BODY = """phigen: 1
name: body_monitored
coordinates: [x1, x2, x3]
poisson: {matrix: [[0, x3, -x2], [-x3, 0, x1], [x2, -x1, 0]]}
hamiltonian: (x1**2 + x2**2/2 + x3**2/3)/2
casimirs: {C: x1**2 + x2**2 + x3**2}
monitor: 1/(1 + x1**2)
runs: {tumbling: {initial: [0.3, 1, 0.2], step: 0.2, steps: 400}}
"""
START, E, STEP = np.array([0.1, 0.0, 0.0, np.sqrt(19.0)]), 0.5, 2 * np.pi / 100
BODY_START = np.array([0.3, 1.0, 0.2])


def compiled_text(text, order=None):
    return compile_spec(spec.loads(text), order=order, tangent=True)


@pytest.fixture(scope="module")
def kepler():
    """Return the compilation of the Kepler motion, and its solvers by target."""
    compilation = compiled_text(KEPLER)
    return compilation, {target: solver_of(compilation, target) for target in ("c", "numpy")}


@pytest.mark.parametrize("order", slow_but([2], [2, 4]))
def test_it_is_the_system_with_the_pair_typed_by_hand(order):
    run = solver_of(compiled_text(KEPLER, order), "numpy").integrate(START, STEP, 60)
    by_hand = solver_of(compiled_text(BY_HAND, order), "numpy")
    full = by_hand.integrate([*START[:2], 0.0, *START[2:], E], STEP, 60).x
    np.testing.assert_allclose(run.x, full[:, [0, 1, 3, 4]], rtol=0, atol=1e-13)
    np.testing.assert_allclose(run.t, full[:, 2], rtol=0, atol=1e-13)
    np.testing.assert_allclose(run.tau, STEP * np.arange(61))


@pytest.mark.slow
def test_a_hundred_steps_a_period_keep_the_energy_of_an_eccentric_orbit_without_drift(kepler):
    run = kepler[1]["c"].integrate(START, STEP, 2000)
    errors = np.abs(run.energy + E) / E
    assert errors.max() < 1e-5  # the same number of steps of equal size in t does not even converge
    assert errors[-500:].max() < 1.1 * errors[:500].max()
    assert abs(run.t[-1] / 2000 / STEP - run.t[1000] / 1000 / STEP) < 0.02


def test_all_targets_make_the_same_steps_and_take_the_same_time(kepler):
    compilation, solvers = kepler
    c, numpy = (solvers[target].integrate(START, STEP, 100) for target in ("c", "numpy"))
    np.testing.assert_allclose(c.x, numpy.x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(c.t, numpy.t, rtol=1e-14, atol=1e-14)
    js = javascript(compilation, f"x0: {START.tolist()}", f"s.integrate({STEP}, 100)", "[...s.x, s.t]")
    np.testing.assert_allclose(js, [*numpy.x[-1], numpy.t[-1]], rtol=0, atol=1e-12)


@pytest.mark.thin(1)
@pytest.mark.slow
@pytest.mark.parametrize("extra", slow_but([""], ["", "birealisation: karasev", "composition: suzuki"]))
def test_verification_finds_the_order_in_tau_and_of_the_time_and_no_poisson_defect(extra):
    compilation = compiled_text(f"{BODY}order: 4\n{extra}\n")
    solvers = {target: solver_of(compilation, target) for target in ("c", "numpy")}
    measured = verification.verify(compilation, solvers, "tumbling", BODY_START, {}, 0.2, 400, (), quick=True)
    assert not measured.failures
    assert "observed order, with the time" in [c.name for c in measured.checks]


@pytest.mark.slow
def test_verification_of_the_kepler_motion_passes(kepler):
    compilation, solvers = kepler
    assert not verification.verify(
        compilation, solvers, "eccentric", START, {}, STEP, 60, ("rk4",), quick=True
    ).failures


def test_with_e_varying_the_step_is_not_a_poisson_map(kepler):
    compilation, solvers = kepler
    step = Method("numpy", lambda x, h: solvers["numpy"].step(x, h), lambda *_: np.empty(0))
    assert measures.poisson_defect(compilation.system, {}, step, START, STEP) > 1e-6


def test_a_bracket_times_the_monitor_is_no_poisson_bracket():
    scaled = "(q1**2 + q2**2)**(3/4)"
    matrix = f"[[0, 0, {scaled}, 0], [0, 0, 0, {scaled}], [-{scaled}, 0, 0, 0], [0, -{scaled}, 0, 0]]"
    text = KEPLER.replace("{canonical: {q: [q1, q2], p: [p1, p2]}}", f"{{matrix: {matrix}}}")
    lines = [line for line in text.splitlines() if not line.startswith("monitor")]
    assert "Jacobi identity" in [s.name for s in examine(spec.loads("\n".join(lines))).refuted]


def test_the_time_of_s_1_alone_has_order_2(kepler):
    """The time of a solver includes the term ∂S_3/∂e. In this test the term is left out: the time then has order 2,
    while the orbit has order 4.
    """
    module, errors = kepler[1]["numpy"].backend.module, []
    exact = kepler[1]["c"].integrate(START, STEP / 64, 6400)
    for n in (100, 200):
        h = 2 * np.pi / n
        (stage,) = module._coefficients({}, START[np.newaxis], h, None)
        x, carry, t, memory = START[np.newaxis], np.zeros((1, 4)), 0.0, (np.zeros((1, 4)),) * 2
        for _ in range(n):
            following, carry, memory, _ = module._advance(stage, x, carry, memory)
            t += h * module._monitor({}, x + memory[0])[0, 0]
            x = following
        errors.append(abs(t - exact.t[-1]))
    assert 3 < errors[0] / errors[1] < 5


@pytest.mark.slow
def test_states_at_times_are_on_the_orbit_and_until_ends_there():
    solver = solver_of(compiled_text(BODY, 8), "c")
    run = solver.integrate(BODY_START, 0.02, 300, stride=25)
    times = np.linspace(0, run.t[-1], 17)

    def field(t, x):
        return np.cross([x[0], x[1] / 2, x[2] / 3], x)

    sign = np.sign(solver.vector_field(BODY_START)[0] / field(0, BODY_START)[0])
    there = solve_ivp(
        lambda t, x: sign * field(t, x), (0, times[-1]), BODY_START, "DOP853", times, rtol=1e-13, atol=1e-14
    )
    np.testing.assert_allclose(run.at(times), there.y.T, rtol=0, atol=1e-12)
    ended = solver.integrate(BODY_START, 0.02, until=times[5], stride=10_000)
    assert ended.t.tolist() == [0, times[5]]
    np.testing.assert_allclose(ended.x[-1], there.y.T[5], rtol=0, atol=1e-12)
    assert ended.steps - 1 < ended.tau[-1] / 0.02 < ended.steps
    back = solver.integrate(ended.x[-1], -0.02, until=-times[5])
    np.testing.assert_allclose(back.x[-1], BODY_START, rtol=0, atol=1e-12)


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", ["c", "numpy"])
def test_until_and_at_without_a_monitor(target):
    solver = solver_of(compiled_text(BODY.replace("monitor: 1/(1 + x1**2)\n", ""), 4), target)
    whole = solver.integrate(BODY_START, 0.01, until=0.5)
    assert (whole.steps, len(whole)) == (50, 51)
    part = solver.integrate(BODY_START, 0.01, until=0.503, stride=20)
    assert part.t.tolist() == [0, 0.2, 0.4, 0.503]
    np.testing.assert_array_equal(part.tau, part.t)
    np.testing.assert_allclose(part.at([0.503, 0.2, 0.31])[:2], part.x[[3, 1]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(whole.at([0.31])[0], part.at([0.31])[0], rtol=0, atol=1e-10)
    with pytest.raises(ValueError, match="never reached"):
        solver.integrate(BODY_START, -0.01, until=0.5)
    with pytest.raises(TypeError, match="needs the number of steps, or the time"):
        solver.integrate(BODY_START, 0.01)
    with pytest.raises(TypeError, match="either steps or until, not both"):
        solver.integrate(BODY_START, 0.01, 3, until=0.5)
    with pytest.raises(ValueError, match="between"):
        part.at([0.6])


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_a_session_goes_on_from_its_bytes_with_its_time_and_its_e(kepler, target):
    backend = kepler[1][target].backend
    whole, first = backend.start(START, {}), backend.start(START, {})
    # Steps are made in blocks, which 32 and 64 steps fill. A block that ends early may round differently.
    whole.advance(STEP, 64)
    first.advance(STEP, 32)
    resumed = backend.restored(first.saved(), {})
    resumed.advance(STEP, 32)
    assert resumed.time() == whole.time()
    assert np.array_equal(resumed.state(), whole.state())


LEAVING = """phigen: 1
name: leaving
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: (q**2 + p**2)/2
monitor: q + 1/2
order: 2
"""


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_where_the_monitor_vanishes_the_motion_stops_and_beyond_it_none_begins(target):
    solver = solver_of(compiled_text(LEAVING), target)
    run = solver.integrate([1, 0], 0.1, 400)
    assert -0.5 < run.x[:, 0].min() < -0.49
    assert np.all(np.diff(run.t) > 0)
    with pytest.raises(StepError, match="the monitor is not positive"):
        solver.integrate([-1, 0], 0.1, 1)


@pytest.mark.thin(2)
@pytest.mark.parametrize("order", [2, 4])
def test_in_single_precision_until_and_at_are_right_to_its_rounding(order):
    single = solver_of(compiled_text(BODY + "real: float\n", order), "c")
    double = solver_of(compiled_text(BODY + "gauge: none\n", order), "c")
    run, times = single.integrate(BODY_START, 0.2, until=7.7), [0.3, 1.0, 5.5]
    assert run.t[-1] == pytest.approx(7.7, rel=1e-6)
    exact = double.integrate(BODY_START, 0.2, until=7.7)
    np.testing.assert_allclose(run.x[-1], exact.x[-1], rtol=0, atol=1e-5)
    np.testing.assert_allclose(run.at(times), exact.at(times), rtol=0, atol=1e-5)


def test_a_failure_reports_the_physical_time_of_the_last_good_state(kepler):
    with pytest.raises(StepError) as failure:
        kepler[1]["c"].integrate(START, 3.5, 6)
    reached = failure.value.trajectory.t[-1]
    assert reached != failure.value.step * 3.5
    assert f" at t = {reached:.12g}: " in str(failure.value)


def test_without_parameters_a_start_is_refused_for_its_monitor_alone():
    solver = solver_of(compiled_text(BODY.replace("1/(1 + x1**2)", "x1").split("runs")[0]), "c")
    with pytest.raises(StepError, match="no step can be made: the monitor is not positive at the start"):
        solver.integrate([-0.3, 1, 0.2], 0.1, 10)


def test_a_step_that_fails_is_made_in_parts_only_where_that_is_asked(kepler):
    integrator = kepler[1]["c"]
    with pytest.raises(StepError):
        integrator.integrate(START, 3.5, 6)
    run = integrator.integrate(START, 3.5, 6, retry=6)
    assert run.retried
    assert run.steps == 6
    assert integrator.integrate(START, 3.5, until=run.t[-1], retry=6).retried[: len(run.retried)] == run.retried
    assert np.ptp(run.x[:, 0] * run.x[:, 3] - run.x[:, 1] * run.x[:, 2]) < 1e-13
    assert integrator.integrate(START, STEP, 10, retry=3).retried == ()


@pytest.mark.parametrize(
    ("monitor", "said"),
    [("log", "H = A \\+ B"), ("q1\ntime: t", "not together with time"), ("sqrt(", "expected|unexpected|missing|end")],
    ids=["log", "time", "syntax"],
)
def test_what_is_not_offered_is_an_error_of_the_spec(monitor, said):
    text = KEPLER.replace("(q1**2 + q2**2)**(3/4)", monitor)
    with pytest.raises(SpecError, match=said):
        compile_spec(spec.loads(text))


@pytest.mark.slow
def test_the_hint_for_a_monitor_with_a_time_is_a_spec_that_is_right():
    driven = KEPLER.replace("- 1/sqrt(q1**2 + q2**2)", "- 1/sqrt(q1**2 + q2**2) + q1*sin(t)/9").replace(
        "invariants", "#"
    )
    with pytest.raises(
        SpecError, match="make t and e coordinates too, a canonical pair; then hamiltonian: g\\*\\(H \\+ e\\)"
    ):
        compile_spec(spec.loads(driven + "time: t\n"))
    solver = solver_of(compiled_text(BY_HAND.replace("+ e)", "+ q1*sin(t)/9 + e)")), "c")
    start = np.array([0.6, 0.0, 0.3, 0.0, 1.2, 0.0])
    start[5] = -(1.2**2 / 2 - 1 / 0.6 + 0.6 * np.sin(0.3) / 9)
    errors = []
    for steps in (100, 200):
        end = solver.integrate(start, 6 / steps, steps).x[-1]
        exact = solve_ivp(
            lambda t, x: [x[2], x[3], -x[0] / np.hypot(*x[:2]) ** 3 - np.sin(t) / 9, -x[1] / np.hypot(*x[:2]) ** 3],
            (0.3, end[2]), start[[0, 1, 3, 4]], rtol=1e-12, atol=1e-12, method="DOP853",
        ).y[:, -1]  # fmt: skip
        errors.append(np.linalg.norm(end[[0, 1, 3, 4]] - exact))
    assert errors[1] < errors[0] / 12


def test_positivity_is_proved_by_form_and_refuted_at_a_start():
    proved = examine(spec.loads(KEPLER)).groups[statements.MONITOR][0]
    assert proved.verdict == "proved"
    wrong = spec.loads(KEPLER.replace("monitor: (q1**2 + q2**2)**(3/4)", "monitor: q1 - 1"))
    assert examine(wrong).refuted[0].name == "g > 0"
    inverse = spec.loads(KEPLER.replace("monitor: (q1**2 + q2**2)**(3/4)", "monitor: 1/(q1**2 + q2**2)"))
    assert examine(inverse).groups[statements.MONITOR][0].detail == "by its form"
    with pytest.raises(CheckError, match="7:10: error: g > 0"):
        compile_proved(wrong)


def test_without_a_monitor_the_code_has_no_elapsed_time():
    text = "\n".join(line for line in KEPLER.splitlines() if not line.startswith("monitor"))
    for target in ("c", "numpy", "js"):
        for source in emit(compile_spec(spec.loads(text)).program, target, "phigen build").values():
            assert "elapsed" not in source


@pytest.mark.parametrize("forces", ["", "forces: {covector: {x1: x2}, vector: {x3: x1}}\n"])
def test_sympy_derives_the_same_with_a_monitor(forces):
    """The derivation by sympy treats the energy level e as a symbol of K. With forces, the covector p is g(∇H + ζ),
    which is not a gradient.
    """
    agreements = list(compare(compile_spec(spec.loads(BODY + forces), order=2)))
    assert all(c.statement.holds for c in agreements if c.term is None)
    assert any(c.statement.name == GRADIENT for c in agreements)


def test_events_receive_the_physical_time():
    solver = solver_of(compiled_text(BODY, 6), "c")

    def event(t, x):
        return x[0] - 0.1 * t + 0.05

    solution = solve(solver, (0.0, 9.0), BODY_START, h=0.05, events=event)
    exact = solve_ivp(
        lambda t, x: solver.vector_field(x), (0, 9), BODY_START, events=event, rtol=1e-12, atol=1e-12, method="DOP853"
    )
    assert len(solution.t_events[0]) > 0
    np.testing.assert_allclose(solution.t_events[0], exact.t_events[0], rtol=0, atol=1e-7)
