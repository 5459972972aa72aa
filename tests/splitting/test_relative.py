"""Bodies in Jacobi and democratic heliocentric coordinates: parts, proofs, orders and errors, with Cartesian states."""

from dataclasses import replace
from functools import cache

import mpmath
import numpy as np
import pytest
from many_digits import precisely, values
from scipy.integrate import solve_ivp
from support import TARGETS, compile_text, javascript, solver

from phigen import SpecError, StepError, spec
from phigen.compiler import examine
from phigen.geometry.system import system_from_spec
from phigen.spec.names import RELATIVE
from phigen.splitting.bodies import split_bodies
from phigen.splitting.parts import SplitHamiltonian
from phigen.splitting.ring import TIME
from phigen.splitting.statements import check
from phigen.symbolic.numeric import evaluate
from phigen.symbolic.symbols import coefficient

AXES = {2: "xy", 3: "xyz"}


def text(count, axes=2, more="", masses="", change="jacobi"):
    """Return the spec of a star and planets of a thousandth of its mass; coordinates are ordered body by body."""
    bodies, names = range(count), AXES[axes]
    q = [f"{a}{i}" for i in bodies for a in names]
    masses = masses or "m0: 1.5, " + ", ".join(f"m{i}: {{value: 0.00{i}, positive: true}}" for i in bodies[1:])
    kinetic = [f"({' + '.join(f'p{a}{i}**2' for a in names)})/(2*m{i})" for i in bodies]
    pairs = [
        f"G*m{i}*m{j}/sqrt({' + '.join(f'({a}{i} - {a}{j})**2' for a in names)})" for i in bodies for j in range(i)
    ]
    return (
        f"coordinates: [{', '.join([*q, *(f'p{c}' for c in q)])}]\n"
        f"poisson: {{canonical: {{q: [{', '.join(q)}], p: [{', '.join(f'p{c}' for c in q)}]}}}}\n"
        f"parameters: {{G: 1, {masses}}}\n"
        f"hamiltonian: {' + '.join(kinetic)} - {' - '.join(pairs)}{more}\n"
        f"scheme: splitting\ncoordinates_from: {change}\n"
    )


@cache
def compiled(count, change, composition="auto", order=4, axes=2, **options):
    return compile_text(text(count, axes, change=change) + f"composition: {composition}\n", order, **options)


def start(count, axes=2):
    """Return planets at distances 1, 2.8, … with nearly circular speeds about the centre of mass, which moves."""
    masses = np.array([1.5, *(0.001 * i for i in range(1, count))])
    q, v = np.zeros((2, count, axes))
    for i in range(1, count):
        radius, angle = i**1.5, 2.0 * i
        q[i, :2] = radius * np.array([np.cos(angle), np.sin(angle)])
        v[i, :2] = np.sqrt(1.5 / radius) * np.array([-np.sin(angle), 1.05 * np.cos(angle)])
    if axes == 3:
        q[1:, 2] = 0.1 * np.arange(1, count)
    q, v = (e - masses @ e / masses.sum() for e in (q, v))
    return np.concatenate([(q + 0.4).ravel(), (masses[:, np.newaxis] * (v + 0.01)).ravel()])


def reference(count, axes, until):
    """Return the solution of Newton's equations of all bodies by a Runge–Kutta method."""
    masses = np.array([1.5, *(0.001 * i for i in range(1, count))])

    def rate(_, y):
        q, p = y.reshape(2, count, axes)
        between = q[np.newaxis] - q[:, np.newaxis]
        cubes = (np.square(between).sum(axis=-1) + np.eye(count)) ** 1.5
        force = (masses[:, np.newaxis] * masses / cubes)[..., np.newaxis] * between
        return np.concatenate([(p / masses[:, np.newaxis]).ravel(), force.sum(axis=1).ravel()])

    return solve_ivp(rate, (0, until), start(count, axes), "DOP853", rtol=1e-13, atol=1e-15).y[:, -1]


@pytest.mark.parametrize("change", RELATIVE)
@pytest.mark.parametrize(("count", "axes"), [(3, 2), (3, 3), pytest.param(5, 3, marks=pytest.mark.slow)])
def test_states_are_cartesian_and_follow_newton(change, count, axes):
    integrator = solver(compiled(count, change, "aba-10-6-4", axes=axes), "c")
    end = integrator.integrate(start(count, axes), 0.1, 60).x[-1]
    np.testing.assert_allclose(end, reference(count, axes, 6), rtol=0, atol=2e-11)


@pytest.mark.parametrize("change", RELATIVE)
def test_targets_agree(change):
    compilation = compiled(3, change, "saba-8-2", order=2)
    ends = [solver(compilation, target).integrate(start(3), 0.2, 50).x[-1] for target in TARGETS]
    ends.append(javascript(compilation, f"x0: {start(3).tolist()}", "s.integrate(0.2, 50)", "[...s.x]"))
    np.testing.assert_allclose(ends, ends[:1] * len(ends), rtol=0, atol=1e-13)


@pytest.mark.parametrize("change", RELATIVE)
def test_the_parts_and_their_flows_are_proved(change):
    examination = examine(spec.loads("phigen: 1\nname: bodies\n" + text(3, 3, change=change)))
    statements = [s for group in examination.groups.values() for s in group]
    assert [s.name for s in statements if s.verdict != "proved"] == ["rank of π"]
    assert [bool(flow.motion) for flow in examination.compilation.splitting.flows] == [True, False]


def test_a_wrong_change_of_coordinates_is_refuted():
    """In the wrong change, one momentum has a slightly larger coefficient than the canonical one."""
    system = system_from_spec(spec.loads("phigen: 1\nname: bodies\n" + text(3)))
    parts = split_bodies(system, "jacobi")
    motion = parts.flows[0].motion
    wrong = replace(motion, spread=motion.spread | {"px2": motion.spread["px2"] * 2})
    flow = replace(parts.flows[0], motion=wrong, increment=tuple(wrong.increments(system.coordinates)))
    statements = [*check(system, SplitHamiltonian((flow, parts.flows[1])))]
    assert [s.verdict for s in statements] == ["proved", "refuted", "proved"]


@pytest.mark.parametrize("change", RELATIVE)
def test_a_step_is_a_poisson_map(change):
    integrator = solver(compiled(3, change, "wisdom-holman-5", order=2, tangent=True), "c")
    n = 6
    canonical = np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])
    _, tangent = integrator.step_tangent(start(3), 0.3)
    assert np.abs(tangent @ canonical @ tangent.T - canonical).max() < 2e-13 * np.abs(tangent).max() ** 2


def test_two_bodies_in_jacobi_coordinates_move_exactly():
    """They move along a conic section, with a uniform centre of mass, in one step of any size."""
    compilation = compiled(2, "jacobi")
    assert len(compilation.splitting.flows) == 1
    once, often = (solver(compilation, "c").integrate(start(2), 50 / n, n).x[-1] for n in (1, 500))
    np.testing.assert_allclose(once, often, rtol=0, atol=1e-12)


def test_total_momentum_and_angular_momentum_are_kept_to_rounding():
    run = solver(compiled(4, "jacobi", "wisdom-holman-17", order=2), "c").integrate(start(4), 0.2, 2000, stride=200)
    q, p = (run.x[:, k * 8 : (k + 1) * 8].reshape(-1, 4, 2) for k in (0, 1))
    assert np.ptp(p.sum(axis=1), axis=0).max() < 1e-16
    turning = (q[..., 0] * p[..., 1] - q[..., 1] * p[..., 0]).sum(axis=1)
    assert np.ptp(turning) < 1e-14 * abs(turning[0])


def test_jacobi_coordinates_have_the_smaller_errors():
    """In democratic heliocentric coordinates B contains the momentum of the star: with a corrector, the error is 10
    times as large.
    """
    errors = {}
    for change in RELATIVE:
        integrator = solver(compiled(3, change, "wisdom-holman-17", order=2), "c")
        energy = integrator.integrate(start(3), 0.2, 4000, stride=100).energy
        errors[change] = np.ptp(energy)
    assert errors["jacobi"] < errors["democratic_heliocentric"] / 5


SPIN = ", L1, L2, L3"


def test_a_body_that_rotates_has_its_rotation_among_the_motions():
    """A symmetric top is coupled to the position of a body: its rotation is in A, the torque in B."""
    lines = text(2, 3, more=" + L3**2/5 + 0.001*L1*x1").replace("pz1]\n", f"pz1{SPIN}]\n", 1)
    q = "x0, y0, z0, x1, y1, z1"
    lines = lines.replace(
        f"{{canonical: {{q: [{q}], p: [{', '.join('p' + c for c in q.split(', '))}]}}}}",
        "{brackets: {"
        + ", ".join(f"{c}: {{p{c}: 1}}" for c in q.split(", "))
        + ", L1: {L2: -L3, L3: L2}, L2: {L3: -L1}}}",
    )
    compilation = compile_text(lines, 4)
    a, b = compilation.splitting.flows
    assert sorted(bool(piece.motion) for piece in a.pieces) == [False, True]
    assert compilation.program.step.composition == "aba-10-6-4"
    verdicts = [s.verdict for s in check(compilation.system, compilation.splitting)]
    assert verdicts == ["proved"] * len(verdicts)
    x = [*start(2, 3), 0.3, -0.2, 0.5]
    run = solver(compilation, "c").integrate(x, 0.1, 400, stride=40)
    assert np.ptp(run.energy) < 1e-9
    assert np.ptp(np.linalg.norm(run.x[:, -3:], axis=1)) < 1e-15
    assert b.moving == 1 + 2


REFUSED = {
    "no pairs": (text(2).replace("(x1 - x0)**2 + (y1 - y0)**2", "x1**2 + y1**2"), "no attraction of two bodies"),
    "unequal masses along the axes": (text(2).replace("py1**2", "2*py1**2"), "no kinetic energy"),
    "one that nothing attracts": (text(3).replace("G*m1*m0", "0"), "at x1 is not attracted"),
    "further terms that do not commute": (
        text(2, more=" + x1*x0 + px1*py0/9"),
        "does not commute with the attractions",
    ),
    "momenta of the star": (text(3, more=" + x1**2", change="democratic_heliocentric"), "may not commute with p_0"),
    "another scheme": (text(2).replace("scheme: splitting\n", ""), "belongs to scheme: splitting"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_other_systems_are_refused_at_the_key(case):
    lines, said = REFUSED[case]
    with pytest.raises(SpecError, match=said) as refused:
        compile_text(lines, 4)
    (diagnostic,) = refused.value.diagnostics
    assert diagnostic.location is not None
    assert diagnostic.hint


#: Starts and steps of two bodies without a final state: at the same place, on a collision course, and with an overflow.
IMPOSSIBLE = {
    "at one place": ([0.1, 0.2, 0.1, 0.2, 0, 0, 0.001, 0], 0.1),
    "falls from rest": ([0, 0, 1, 0, 0, 0, 0, 0], 3.0),
    "a step that overflows": ([0, 0, 1, 0, 0, 0, 0, 0.001], 1e300),
}


@pytest.mark.parametrize("case", IMPOSSIBLE)
def test_a_step_without_an_end_is_not_finite_and_changes_nothing(case):
    x, h = IMPOSSIBLE[case]
    compilation = compiled(2, "jacobi")
    for target in TARGETS:
        with pytest.raises(StepError, match="NOT_FINITE") as failed:
            solver(compilation, target).integrate(x, h, 2)
        np.testing.assert_array_equal(failed.value.trajectory.x[-1], x)
        assert failed.value.step == 0
    calls = f"try {{ s.integrate({h!r}, 2) }} catch (error) {{ s.status = error.status }}"
    shown = "[...s.x, s.steps, s.status === 'NOT_FINITE' ? 1 : 0]"
    assert javascript(compilation, f"x0: {x}", calls, shown) == [*x, 0, 1]


#: The speed of a parabola at the distance 1 from both masses 1.5 and 0.001.
PARABOLA = 0.001 * np.sqrt(2 * 1.501) / 1.501 * 1.5


@pytest.mark.parametrize(
    "momentum", [PARABOLA, 3 * PARABOLA, 0.05 * PARABOLA], ids=["parabola", "hyperbola", "ellipse"]
)
def test_orbits_of_any_kind_are_followed_past_the_pericentre_and_back(momentum):
    """One step forward and one step back, about the centre of mass."""
    start_of_orbit = [0, 0, 1, 0, 0, -momentum, 0, momentum]
    compilation = compiled(2, "jacobi")
    ends = [solver(compilation, target).integrate(start_of_orbit, 1.5, 1).x[-1] for target in TARGETS]
    ends.append(javascript(compilation, f"x0: {[float(v) for v in start_of_orbit]}", "s.step(1.5)", "[...s.x]"))
    np.testing.assert_allclose(ends, ends[:1] * len(ends), rtol=0, atol=1e-13)
    back = solver(compilation, "c").integrate(ends[0], -1.5, 1).x[-1]
    np.testing.assert_allclose(back, start_of_orbit, rtol=0, atol=1e-12)


@pytest.mark.parametrize("mass", [0, -0.001])
def test_a_mass_that_is_not_positive_is_refused_before_the_first_step(mass):
    for target in TARGETS:
        with pytest.raises(ValueError, match="'m1' must be positive"):
            solver(compiled(2, "jacobi"), target).integrate(start(2), 0.1, 1, m1=mass)


@precisely
def canonical_error(change, h):
    """Return the largest entry of DΦ J DΦᵀ − J for the flow of A, in many digits, with the coefficients of the code."""
    compilation = compiled(3, change, "saba-4-2", 2)
    step, names = compilation.program.step, compilation.program.coordinates
    masses = {"G": 1.0, "m0": 1.1, "m1": 0.0007, "m2": 0.0013}
    coefficients = evaluate(step.prepare.roots, {**masses, TIME: h})
    fixed = {coefficient(k): mpmath.mpf(float(v)) for k, v in enumerate(coefficients)}
    x, small, n = [mpmath.mpf(float(v)) for v in start(3)], mpmath.mpf(10) ** -15, len(names)

    def moved(j, change_of_x):
        y = [v + change_of_x * (k == j) for k, v in enumerate(x)]
        return values(step.flows[0].roots, fixed | dict(zip(names, y, strict=True)))

    columns = [
        [(a - b) / (2 * small) for a, b in zip(moved(j, small), moved(j, -small), strict=True)] for j in range(n)
    ]
    matrix = mpmath.eye(n) + mpmath.matrix(columns).T
    form = mpmath.matrix(n)
    for k in range(n // 2):
        form[k, k + n // 2], form[k + n // 2, k] = 1, -1
    return max(abs(e) for e in matrix * form * matrix.T - form)


@pytest.mark.parametrize("change", RELATIVE)
def test_rounded_quotients_of_masses_leave_the_change_canonical(change):
    assert canonical_error(change, 0.003) < 1e-21  # 3e-19 if a form and its inverse round m_i/M_i differently
