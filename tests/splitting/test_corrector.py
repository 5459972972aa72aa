"""Correctors of steps for H = A + εB: their conditions, orders and Poisson maps, runs in all targets, and refusals."""

from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from support import TARGETS, compile_text, javascript, solver

from phigen import SpecError, StepError
from phigen.scheme.near_integrable import METHODS, Corrected
from phigen.spec.names import CORRECTED

PLANE = "coordinates: [x, y, px, py]\npoisson: {canonical: {q: [x, y], p: [px, py]}}\n"
PARAMETERS = "parameters: {eps: {value: 0.001, small: true}}\n"
KEPLER = "hamiltonian: (px**2 + py**2)/2 - 1/sqrt(x**2 + y**2) - eps*x**2*(1 + y)\nscheme: splitting\n"
SMALL = PLANE + PARAMETERS + KEPLER
#: The system `SMALL` with a field for which radial orbits remain radial.
RADIAL = SMALL.replace("*(1 + y)", "")
START = [1, 0, 0, 1.1]
#: A free symmetric top in a weak field, on a linear bracket with a Casimir.
TOP = (
    "coordinates: [m1, m2, m3]\npoisson: {brackets: {m1: {m2: -m3, m3: m2}, m2: {m3: -m1}}}\n"
    "casimirs: {C: m1**2 + m2**2 + m3**2}\nscheme: splitting\n"
    + PARAMETERS
    + "hamiltonian: m3**2/2 + eps*(m1 + m1**2/3)\n"
)
BY_NAME = {m.name: m for m in METHODS if isinstance(m, Corrected)}


@cache
def compilation(name, text=SMALL, **options):
    return compile_text(text + f"composition: {name}\n", BY_NAME[name].order, **options)


def test_all_names_are_offered():
    assert [*BY_NAME] == [*CORRECTED]


@pytest.mark.parametrize("name", CORRECTED[1:])
def test_a_run_of_one_step_is_a_quadrature_of_the_stated_order(name):
    """To first order in ε a run is a quadrature, with B evaluated at the times that the flows of A have reached."""
    end = BY_NAME[name].corrector
    times = [*(-t for t in reversed(end)), Fraction(1), Fraction(1), *end]
    nodes, clock = [], Fraction(0)
    kinds = ["A" if k % 2 == 0 else "B" for k in range(len(end))]
    for kind, t in zip([*kinds, "B", "A", *kinds], times, strict=True):
        clock += t if kind == "A" else 0
        nodes += [(t, clock)] if kind == "B" else []
    defects = [abs(sum(b * c**k for b, c in nodes) - Fraction(1, k + 1)) for k in range(20)]
    power = int(name.rpartition("-")[2]) + 1
    assert clock == 1
    assert max(defects[:power]) == 0
    assert defects[power] > Fraction(1, 10**9)


@pytest.mark.parametrize(("name", "power"), [("wisdom-holman", 2), ("wisdom-holman-3", 4), ("wisdom-holman-7", 8)])
def test_the_error_in_the_first_power_of_epsilon_has_its_order(name, power):
    integrator = solver(compilation(name), "c")
    coarse, fine = (
        np.ptp(integrator.integrate(START, h, round(24 / h), stride=round(2.4 / h), eps=1e-7).energy)
        for h in (0.6, 0.4)
    )
    assert np.log(coarse / fine) / np.log(1.5) == pytest.approx(power, abs=1)


def test_the_error_in_the_second_power_of_epsilon_is_left():
    integrator = solver(compilation("wisdom-holman-17"), "c")
    errors = [np.ptp(integrator.integrate(START, 0.2, 120, stride=12, eps=eps).energy) for eps in (0.01, 0.001)]
    assert errors[0] / errors[1] == pytest.approx(100, rel=0.2)


def test_the_modified_flow_removes_the_error_of_the_second_power_of_the_step():
    """Without a balanced corrector, an error of order ε² h³ would remain."""
    integrator = solver(compilation("wisdom-holman-modified-17"), "c")
    errors = [np.ptp(integrator.integrate(START, h, round(48 / h), stride=1).energy) for h in (0.2, 0.1)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.3)


@pytest.mark.parametrize("target", ["c", "numpy"])
@pytest.mark.parametrize(
    ("text", "name"), [(SMALL, "wisdom-holman-modified-7"), (TOP, "wisdom-holman-7")], ids=["canonical", "top"]
)
def test_a_corrected_step_is_a_poisson_map_with_an_exact_tangent(text, name, target):
    integrator = solver(compilation(name, text, tangent=True), target)
    x, h, d, eps = np.array([0.9, 0.2, 0.3, 1.1][: 4 if text is SMALL else 3]), 0.4, 1e-5, 0.3
    end, tangent = integrator.step_tangent(x, h, eps=eps)

    def poisson(x):
        if text is SMALL:
            return np.block([[np.zeros((2, 2)), np.eye(2)], [-np.eye(2), np.zeros((2, 2))]])
        return np.array([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])

    assert np.abs(tangent @ poisson(x) @ tangent.T - poisson(end)).max() < 2e-14
    ends = [
        [integrator.integrate(x + s * d * row, h, 1, eps=eps).x[-1] for s in (2, 1, -1, -2)] for row in np.eye(len(x))
    ]
    slopes = np.array([(8 * (b - c) - (a - e)) / (12 * d) for a, b, c, e in ends]).T
    np.testing.assert_allclose(tangent, slopes, atol=1e-9)


@pytest.mark.parametrize("profile", ["fast", "small"])
def test_states_do_not_depend_on_the_outputs(profile):
    text = SMALL + f"profile: {profile}\n"
    for target in TARGETS:
        integrator = solver(compilation("wisdom-holman-11", text), target)
        ends = [integrator.integrate(START, 0.3, 24, stride=stride).x[-1] for stride in (1, 5, 24)]
        np.testing.assert_allclose(ends, ends[:1] * 3, rtol=0, atol=1e-13)


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(("stride", "kernel"), [(1, ""), (4, ""), (9, "modified-"), (None, "")])
def test_gradients_of_runs_are_differences(target, stride, kernel):
    """Gradients along states and parameters; at each row a run ends and another one starts, and the last run is
    shorter.
    """
    integrator = solver(compilation(f"wisdom-holman-{kernel}7", adjoint=True), target)
    x, h, steps, d, eps = np.array(START) + 0.1, 0.3, 9, 1e-4, 0.02
    source = np.random.default_rng(1)
    rows = 1 if stride is None else len(integrator.integrate(x, h, steps, stride).x)
    bars = source.normal(size=(rows, 4))

    def value(x, eps):
        states = integrator.integrate(x, h, steps, steps if stride is None else stride, eps=eps).x
        return float(np.sum(bars * states[-rows:]))

    pulled = integrator.pullback(x, h, steps, bars[0] if stride is None else bars, stride, eps=eps)

    def slope(of):
        a, b, c, e = (of(s * d) for s in (2, 1, -1, -2))
        return (8 * (b - c) - (a - e)) / (12 * d)

    slopes = [slope(lambda s, row=row: value(x + s * row, eps)) for row in np.eye(4)]
    np.testing.assert_allclose(pulled.x0_bar, slopes, rtol=1e-8, atol=1e-9)
    assert pulled.parameters_bar["eps"] == pytest.approx(slope(lambda s: value(x, eps + s)), rel=1e-7)


def test_gradients_of_members_are_those_of_single_runs():
    integrator = solver(compilation("wisdom-holman-5", adjoint=True), "c")
    states = np.array([[1, 0, 0, 1 + k / 10] for k in range(5)])
    bars = np.random.default_rng(2).normal(size=(5, 4))
    together = integrator.pullback(states, 0.3, 7, bars).x0_bar
    alone = [integrator.pullback(x, 0.3, 7, bar).x0_bar for x, bar in zip(states, bars, strict=True)]
    np.testing.assert_allclose(together, alone, rtol=0, atol=1e-12)


def test_targets_agree():
    name = "wisdom-holman-modified-17"
    c, numpy = (solver(compilation(name), target).integrate(START, 0.3, 40).x[-1] for target in TARGETS)
    js = javascript(compilation(name), f"x0: {START}", "s.integrate(0.3, 39).step(0.3)", "[...s.x]")
    np.testing.assert_allclose([numpy, js], [c, c], rtol=0, atol=1e-12)


def test_the_tangent_in_javascript_is_that_of_c():
    compiled = compilation("wisdom-holman-5", tangent=True)
    _, tangent = solver(compiled, "c").step_tangent(START, 0.3)
    js = javascript(compiled, f"x0: {START}", "s.d = s.stepTangent(0.3)", "[...s.d]")
    np.testing.assert_allclose(js, tangent.ravel(), rtol=0, atol=1e-13)


@pytest.mark.parametrize("target", TARGETS)
def test_a_failed_step_leaves_the_last_good_state(target):
    """The step fails since a radial orbit falls into the centre."""
    integrator = solver(compilation("wisdom-holman-5", RADIAL), target)
    fall = [1, 0, 0, 0]
    for h, steps in (
        (3.0, 1),
        (0.3, 3),
    ):  # a corrector fails: the one before the first step, or the one after the last step
        with pytest.raises(StepError, match="NOT_FINITE") as failed:
            integrator.integrate(fall, h, steps, stride=steps)
        np.testing.assert_array_equal(failed.value.trajectory.x[-1], fall)
        assert failed.value.step == 0
    first = solver(compilation("wisdom-holman", RADIAL), target)
    with pytest.raises(StepError, match="NOT_FINITE") as failed:
        first.integrate(fall, 1.2, 1)  # the first step fails, after half a flow of A
    np.testing.assert_array_equal(failed.value.trajectory.x[-1], fall)
    with pytest.raises(StepError, match="NOT_FINITE") as failed:
        integrator.integrate(fall, 0.25, 20, stride=20)
    good = failed.value.step
    assert 0 < good < 5
    expected = integrator.integrate(fall, 0.25, good).x[-1]
    np.testing.assert_allclose(failed.value.trajectory.x[-1], expected, rtol=0, atol=1e-12)


def test_a_failed_run_in_javascript_leaves_the_state():
    shown = "[...s.x, s.steps, s.status === 'NOT_FINITE' ? 1 : 0]"
    for name, h, steps in (("wisdom-holman-5", 3.0, 2), ("wisdom-holman-5", 0.3, 3), ("wisdom-holman", 1.2, 2)):
        calls = f"try {{ s.integrate({h}, {steps}) }} catch (error) {{ s.status = error.status }}"
        x = javascript(compilation(name, RADIAL), "x0: [1, 0, 0, 0]", calls, shown)
        assert x == [1, 0, 0, 0, 0, 1]


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_members_are_single_runs(target):
    integrator = solver(compilation("wisdom-holman-7", RADIAL), target)
    states = np.array([[1, 0, 0, 1 + k / 10] for k in range(9)])
    together = integrator.ensemble(states, 0.3, 20)
    alone = [integrator.integrate(x, 0.3, 20).x[-1] for x in states]
    np.testing.assert_allclose(together, alone, rtol=0, atol=1e-12)
    states[4] = [1, 0, 0, 0]
    with pytest.raises(StepError, match="NOT_FINITE") as failed:
        integrator.ensemble(states, 0.3, 20)
    assert failed.value.members == (4,)


REFUSED = {
    "time": ("time: t\n" + SMALL.replace("(1 + y)", "(1 + y*cos(t))"), "time"),
    "monitor": (SMALL + "monitor: log\n", "monitor"),
    "attitudes": (TOP + "reconstruct: quaternion\n", "reconstruct"),
    "noise": (SMALL + "noise: {w: {hamiltonian: x, amplitude: 0.1}}\n", "noise"),
    "nothing small": (SMALL.replace("0.001, small: true", "0.5"), "none is known to be small"),
}


def test_a_modified_flow_that_is_no_shift_is_refused():
    with pytest.raises(SpecError, match="coordinates that commute") as refused:
        compilation("wisdom-holman-modified-7", TOP)
    assert refused.value.diagnostics[0].location is not None


@pytest.mark.parametrize("case", REFUSED)
def test_what_does_not_go_with_a_corrector_is_an_error_at_its_place(case):
    text, said = REFUSED[case]
    with pytest.raises(SpecError, match=said) as refused:
        compile_text(text + "composition: wisdom-holman-17\n", 2)
    (diagnostic,) = refused.value.diagnostics
    assert diagnostic.location is not None
    assert diagnostic.hint
