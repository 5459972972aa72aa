"""monitor: log, K = log(A + e) − log(−B): explicit steps equal in τ, each exactly Poisson."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import javascript

from phigen import SpecError, StepError, resources, spec
from phigen.api import solver_of
from phigen.compiler import compile_spec
from phigen.study import verification

KEPLER = """phigen: 1
name: kepler_log
coordinates: [q1, q2, p1, p2]
poisson: {canonical: {q: [q1, q2], p: [p1, p2]}}
hamiltonian: (p1**2 + p2**2)/2 - 1/sqrt(q1**2 + q2**2)
scheme: splitting
monitor: log
runs: {comet: {initial: [0.01, 0, 0, 14.106735979665885], step: 0.05, steps: 200}}
"""
ECCENTRICITY = 0.99
START = np.array([1 - ECCENTRICITY, 0, 0, np.sqrt((1 + ECCENTRICITY) / (1 - ECCENTRICITY))])


def compiled_text(text, order=4):
    return compile_spec(spec.loads(text), order=order, tangent=True)


@pytest.fixture(scope="module")
def kepler():
    compilation = compiled_text(KEPLER)
    return compilation, {target: solver_of(compilation, target) for target in ("c", "numpy")}


@pytest.mark.thin(2)
@pytest.mark.parametrize("order", [2, 4, 8])
def test_the_orbit_of_a_kepler_motion_is_exact_however_eccentric(order):
    run = solver_of(compiled_text(KEPLER, order), "c").integrate(START, 0.05, 4000)
    r = np.hypot(run.x[:, 0], run.x[:, 1])
    ellipse = r + ECCENTRICITY * run.x[:, 0] - (1 - ECCENTRICITY**2)
    assert np.abs(ellipse).max() < 1e-12
    assert np.abs(run.energy + 0.5).max() < 1e-12
    assert r.max() > 1.9
    assert run.t[-1] > 100


@pytest.mark.slow
def test_verification_finds_the_order_in_tau_and_of_the_time_and_no_poisson_defect(kepler):
    compilation, solvers = kepler
    measured = verification.verify(
        compilation, solvers, "comet", np.array([0.5, 0, 0, 1.7]), {}, 0.1, 60, (), quick=True
    )
    assert not measured.failures


def test_all_targets_make_the_same_steps_and_take_the_same_time(kepler):
    compilation, solvers = kepler
    c, numpy = (solvers[target].integrate(START, 0.05, 100) for target in ("c", "numpy"))
    np.testing.assert_allclose(c.x, numpy.x, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(c.t, numpy.t, rtol=1e-12)
    js = javascript(compilation, f"x0: {START.tolist()}", "s.integrate(0.05, 100)", "[...s.x, s.t]")
    np.testing.assert_allclose(js, [*numpy.x[-1], numpy.t[-1]], rtol=1e-11, atol=1e-12)


def test_until_ends_at_a_time_and_the_bytes_of_a_session_go_on(kepler):
    integrator = kepler[1]["c"]
    ended = integrator.integrate(START, 0.01, until=2 * np.pi, stride=10_000)
    assert ended.t[-1] == pytest.approx(2 * np.pi, rel=1e-15)
    whole, first = integrator.backend.start(START, {}), integrator.backend.start(START, {})
    whole.advance(0.05, 40)
    first.advance(0.05, 20)
    resumed = integrator.backend.restored(first.saved(), {})
    resumed.advance(0.05, 20)
    assert resumed.time() == whole.time()
    assert np.array_equal(resumed.state(), whole.state())


TRAP = """phigen: 1
name: trap
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - cos(q)
scheme: splitting
monitor: log
runs: {near: {initial: [0.1, 0], step: 0.05, steps: 10}}
"""


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_where_minus_b_is_not_positive_nothing_starts_and_a_step_fails(target):
    solver = solver_of(compiled_text(TRAP), target)
    assert np.ptp(solver.integrate([0.1, 0], 0.05, 100).energy) < 1e-6
    with pytest.raises(StepError, match="monitor is not positive"):
        solver.integrate([2, 0], 0.05, 1)
    with pytest.raises(StepError, match="NOT_FINITE"):
        solver.integrate([0.1, 3.0], 0.05, 100)


def test_without_runs_the_form_of_a_part_shows_that_it_is_negative():
    alone = KEPLER[: KEPLER.index("runs:")]
    ends = [solver_of(compiled_text(text), "numpy").integrate(START, 0.05, 9).x for text in (alone, KEPLER)]
    np.testing.assert_array_equal(*ends)
    assert compiled_text(alone.replace("- 1/sqrt(q1**2 + q2**2)", "- q1**4"))
    with pytest.raises(SpecError, match="a part that is negative"):
        compiled_text(alone.replace("- 1/sqrt", "- mu/sqrt").replace("scheme:", "parameters: {mu: 1}\nscheme:"))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("monitor: log", "monitor: q1**2 + 1"), "does not split"),
        (("- 1/sqrt", "+ 1/sqrt"), "a part that is negative"),
        (("(p1**2 + p2**2)/2 - 1/sqrt(q1**2 + q2**2)", "(p1**2 + p2**2)/2"), "of two parts"),
        (("monitor: log", "monitor: log\ncomposition: nystrom"), "composition nystrom"),
    ],
    ids=["expression", "repelling", "one part", "kicks"],
)
def test_what_does_not_apply_is_an_error_of_the_spec(change, said):
    with pytest.raises(SpecError, match=said):
        compiled_text(KEPLER.replace(*change))


def test_the_eccentric_orbit_of_the_corpus_is_that_of_dop853():
    specification = spec.load(resources.bundled()["kepler_eccentric"])
    run = specification.runs["orbits"]
    solver, x0 = solver_of(compile_spec(specification), "c"), np.array([float(v) for v in run.initial])
    times = np.linspace(0, 12.5, 7)
    h = float(run.step)
    here, finer = (solver.integrate(x0, step, until=times[-1], stride=50).at(times) for step in (h, h / 2))
    np.testing.assert_allclose(here, finer, rtol=0, atol=1e-11)
    there = solve_ivp(lambda t, x: solver.vector_field(x), (0, 12.5), x0, "DOP853", times, rtol=3e-14, atol=1e-15)
    np.testing.assert_allclose(here, there.y.T, rtol=0, atol=3e-10)  # the error of DOP853 near the planet
