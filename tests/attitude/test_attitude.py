"""Attitudes: statements that are proved, and comparison with Jacobi's elliptic functions and with solutions of the
equations for state, attitude and position together.
"""

from dataclasses import replace
from functools import cache

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj
from support import javascript

import phigen
from phigen import spec as specs
from phigen.api import interface_of, solver_of
from phigen.compiler import compile_spec, examine
from phigen.errors import SpecError
from phigen.proofs import attitude as proofs
from phigen.proofs.statements import ATTITUDE
from phigen.runtime.crossings import CrossingFinder
from phigen.runtime.march import march
from phigen.runtime.solver import Solver
from phigen.series.hamilton_jacobi import HamiltonJacobi
from phigen.symbolic.expression import topological
from phigen.symbolic.verdict import PROVED, REFUTED

INERTIA = np.array([1.0, 2.0, 3.0])
BODY = """
coordinates: [x1, x2, x3]
parameters: {I1: 1, I2: 2, I3: 3}
poisson: {brackets: {x1: {x2: -x3, x3: x2}, x2: {x3: -x1}}}
hamiltonian: (x1**2/I1 + x2**2/I2 + x3**2/I3)/2
casimirs: {C: x1**2 + x2**2 + x3**2}
reconstruct: quaternion
"""
TOP = """
coordinates: [P1, P2, P3, G1, G2, G3]
poisson: {lie_algebra: {name: se(3), sign: minus}}
hamiltonian: (P1**2/1 + P2**2/2 + P3**2/3)/2 + G1/3 + G3
casimirs: {A: G1**2 + G2**2 + G3**2, B: P1*G1 + P2*G2 + P3*G3}
reconstruct: quaternion
"""
SYMMETRIC = TOP.replace("(P1**2/1 + P2**2/2 + P3**2/3)/2 + G1/3 + G3", "(P1**2 + P2**2)/2 + P3**2/3 + G3")
SATELLITE = """
coordinates: [m1, m2, m3, N1, N2, N3, G1, G2, G3]
parameters: {n: 0.3}
poisson:
  brackets:
    m1: {m2: -m3, m3: m2, N2: -N3, N3: N2, G2: -G3, G3: G2}
    m2: {m3: -m1, N1: N3, N3: -N1, G1: G3, G3: -G1}
    m3: {N1: -N2, N2: N1, G1: -G2, G2: G1}
hamiltonian: m1**2/2 + m2**2/3 + m3**2/5 - n*(m1*N1 + m2*N2 + m3*N3) + G1**2/4 + G2**2/5
casimirs: {N: N1**2 + N2**2 + N3**2}
reconstruct: quaternion
scheme: splitting
"""


def algebra(name, sign, n, *more):
    """Return the text of a body with different moments of inertia, on the dual of a Lie algebra."""
    names = [f"x{i}" for i in range(1, n + 1)]
    energy = " + ".join(f"{x}**2/{i + 1}" for i, x in enumerate(names, 1))
    lines = [f"coordinates: [{', '.join(names)}]", f"poisson: {{lie_algebra: {{name: {name}, sign: {sign}}}}}"]
    return "\n".join([*lines, f"hamiltonian: ({energy})/2", *more, ""])


CASES = {
    "body": BODY,
    "body by Cayley": BODY + "birealisation: cayley\n",
    "body along paths": BODY + "birealisation: karasev\n",
    "body with a given gauge": BODY + "gauge: {C: 1/3}\n",
    "body, split": BODY + "scheme: splitting\n",
    "momenta in space": algebra("so(3)", "plus", 3, "reconstruct: quaternion"),
    "momenta in space, split": algebra("so(3)", "plus", 3, "reconstruct: quaternion", "scheme: splitting"),
    "top": TOP,
    "symmetric top, split": SYMMETRIC + "scheme: splitting\n",
    "satellite, split": SATELLITE,
    "symmetric top by matrices, split": SYMMETRIC.replace("quaternion", "matrix") + "scheme: splitting\n",
    "top by Cayley": TOP + "birealisation: cayley\n",
    "top along paths": TOP + "birealisation: karasev\n",
    "motions, momenta in space": algebra("se(3)", "plus", 6, "reconstruct: quaternion", "scheme: series"),
    "so(3) by matrices": algebra("so(3)", "minus", 3, "reconstruct: matrix", "scheme: series"),
    "so(4)": algebra("so(4)", "minus", 6, "reconstruct: matrix", "scheme: series"),
    "so(4), momenta in space, by Cayley": algebra("so(4)", "plus", 6, "reconstruct: matrix", "birealisation: cayley"),
    "so(4), split": algebra("so(4)", "minus", 6, "reconstruct: matrix", "scheme: splitting"),
    "sl(2)": algebra("sl(2)", "minus", 3, "reconstruct: matrix", "scheme: series"),
    "heisenberg(1)": algebra("heisenberg(1)", "plus", 3, "reconstruct: matrix", "scheme: series"),
    "su(2) along paths": algebra("su(2)", "minus", 3, "reconstruct: matrix", "birealisation: karasev"),
    "body by Gauss": BODY + "scheme: gauss\n",
    "momenta in space, by Gauss": algebra("so(3)", "plus", 3, "reconstruct: quaternion", "scheme: gauss"),
    "top by Gauss": TOP + "scheme: gauss\n",
    "motions, momenta in space, by Gauss": algebra("se(3)", "plus", 6, "reconstruct: quaternion", "scheme: gauss"),
}
pytestmark = pytest.mark.few(
    "body",
    "body by Cayley",
    "body along paths",
    "body with a given gauge",
    "body, split",
    "momenta in space",
    "top",
    "so(4)",
    "so(3) by matrices",
    "body by Gauss",
    "motions, momenta in space, by Gauss",
    of=CASES,
)


#: A composition for each order, with which the body is split into rotations. Without it the body has one exact flow.
COMPOSITIONS = {2: "none", 4: "suzuki", 6: "yoshida"}


@cache
def made(case, order=2):
    """Return the compilation of a case of `CASES`."""
    composition = f"composition: {COMPOSITIONS[order]}\n" if case == "body, split" else ""
    return compile_spec(spec_of(CASES[case] + composition), order=order)


def spec_of(text):
    """Return the spec with this text, to which the keys phigen and name are added."""
    return specs.loads(f"phigen: 1\nname: t\n{text}")


def compiled_text(text):
    """Return the compilation of a spec with this text, to which the keys phigen and name are added."""
    return compile_spec(spec_of(text))


@cache
def solver(case, target="numpy", order=2) -> Solver:
    """Return the solver of a case of `CASES`."""
    return solver_of(made(case, order), target)


def rotation(q):
    """Return the rotation matrices (…, 3, 3) of unit quaternions (…, 4)."""
    w, u = q[..., :1], q[..., 1:]
    columns = [v + 2 * (w * np.cross(u, v) + np.cross(u, np.cross(u, v))) for v in np.eye(3)]
    return np.stack(columns, axis=-1)


def statements(compilation):
    """Return the statements about the attitude of a compilation, with their verdicts."""
    return list(proofs.check(compilation))


@pytest.mark.parametrize("case", CASES)
def test_elements_leave_the_other_momentum_as_it_is_and_turn_as_h_says(case):
    verdicts = statements(made(case))
    assert verdicts
    # The statements on splittings relate sines of an angle to those of half the angle, and are only checked at points.
    if "split" in case:
        assert all(s.holds for s in verdicts)
        assert [s.verdict for s in verdicts].count(PROVED) >= 2
    else:
        assert [s.verdict for s in verdicts] == [PROVED] * len(verdicts)


def test_what_has_too_many_terms_to_expand_is_stated_of_the_formula(monkeypatch):
    expanded = statements(made("body"))

    def large(self, terms):
        raise OverflowError

    monkeypatch.setattr(HamiltonJacobi, "polynomial", large)
    assert statements(made("body")) == expanded


def test_a_flow_and_its_element_take_each_function_of_an_angle_once():
    turned = made("symmetric top, split").program.attitude.turns[1]
    functions = sorted(e.op for e in topological(turned.roots) if e.op in {"sin", "versin", "sinroot", "cosroot"})
    assert functions == ["cosroot", "sin", "sinroot", "versin"]


def altered(case, **changes):
    """Return the compilation of a case, with these changes of its attitude."""
    compilation_of_case = made(case)
    attitude = replace(compilation_of_case.program.attitude, **changes)
    return replace(compilation_of_case, program=replace(compilation_of_case.program, attitude=attitude))


@pytest.mark.parametrize("case", ["body by Cayley", "body along paths", "so(4)", "so(3) by matrices"])
def test_the_other_side_of_the_product_is_refuted(case):
    group = made(case).program.attitude.group
    wrong = statements(altered(case, group=replace(group, spatial=not group.spatial)))
    assert REFUTED in [s.verdict for s in wrong]


@pytest.mark.parametrize("case", ["body", "body by Cayley"])
def test_the_wrong_sign_of_p_is_refuted(case, monkeypatch):
    right = proofs.element
    monkeypatch.setattr(proofs, "element", lambda p, t, **how: right([-v for v in p], t, **how))
    assert [s.verdict for s in statements(made(case))] == [REFUTED, PROVED, PROVED]


def test_the_wrong_realisation_is_refuted():
    compilation_of_case = made("body by Cayley")
    exponential = replace(compilation_of_case, realisation=made("body").realisation)
    assert [s.verdict for s in statements(exponential)] == [PROVED, REFUTED, PROVED]


@pytest.mark.parametrize("case", ["body", "body with a given gauge", "body, split"])
def test_leaving_out_what_casimirs_turn_is_refuted(case):
    assert made(case).program.attitude.rate
    assert statements(altered(case, rate=None))[-1].verdict == REFUTED


def test_check_shows_the_statements():
    groups = examine(made("body").spec).groups
    assert [s.verdict for s in groups[ATTITUDE]] == [PROVED] * 3


def elliptic_motion(t, m0):
    """Return the motion of the free rigid body with 2H I2 < |m|² in closed form: momenta m (rows, 3), and rotation
    matrices (rows, 3, 3) from the body to space.

    The spatial momentum points along the third axis. The rotations have Euler angles in the convention zxz. The second
    component of m0 must be 0, so that the motion m = (a₁ cn, a₂ sn, a₃ dn) starts at m0.
    """
    i1, i2, i3 = INERTIA
    total, energy = m0 @ m0, (m0**2 / INERTIA).sum()
    a1, a3 = m0[0], m0[2]
    speed = np.sqrt((i2 - i3) * (i1 - i3) / (i1 * i2)) * abs(a3) / i3
    modulus = (i1 - i2) * a1**2 * i3 / ((i2 - i3) * a3**2 * i1)
    sn, cn, dn, am = ellipj(speed * t, modulus)
    a2 = a1 * speed / (a3 * (1 / i2 - 1 / i3))
    m = np.stack([a1 * cn, a2 * sn, a3 * dn], axis=-1)
    length = np.sqrt(total)
    rest = total - a3**2
    n = -modulus * a3**2 / rest
    pi = np.array([float(mpmath.ellippi(n, mpmath.mpf(float(a)), modulus)) for a in am])
    phi = length * t / i3 + length * (energy - total / i3) / rest * pi / speed
    theta, psi = np.arccos(m[:, 2] / length), np.arctan2(m[:, 0], m[:, 1])
    return m, about(2, phi) @ about(0, theta) @ about(2, psi)


def about(axis, angles):
    """Return the rotation matrices about a coordinate axis by these angles."""
    half = np.zeros((len(angles), 4))
    half[:, 0], half[:, 1 + axis] = np.cos(angles / 2), np.sin(angles / 2)
    return rotation(half)


START = np.array([0.6, 0.0, 1.1])
TIMES = np.array([0.0, 3.0])


def test_the_closed_form_is_a_solution():
    t = np.linspace(0, 3, 7)
    (m, r), d = elliptic_motion(t, START), 1e-5
    later, before = elliptic_motion(t + d, START), elliptic_motion(t - d, START)
    assert np.abs((later[0] - before[0]) / (2 * d) - np.cross(m, m / INERTIA)).max() < 1e-9
    spin = np.swapaxes(r, 1, 2) @ ((later[1] - before[1]) / (2 * d))
    assert np.abs(np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=-1) - m / INERTIA).max() < 1e-9


def errors(case, order, counts, gauge=None):
    """Return the errors of the final attitude, compared with the closed form, for each number of steps in
    ``counts``.
    """
    exact = elliptic_motion(TIMES, START)[1]
    norms = []
    for steps in counts:
        module = solver(case, "numpy", order).backend.module
        _states, attitudes = module.reconstruct(START, TIMES[-1] / steps, steps, steps, gauge=gauge)
        norms.append(np.abs(exact[0] @ rotation(attitudes[-1]) - exact[1]).max())
    return np.array(norms)


COUNTS = {2: (20, 40), 4: (12, 24), 6: (8, 16), 8: (6, 12), 10: (5, 10), 12: (4, 6)}


@pytest.mark.thin(2)
@pytest.mark.parametrize(
    ("order", "gauge"),
    [
        *((k, 0.0) for k in COUNTS if k < 10),
        *(pytest.param(k, 0.0, marks=pytest.mark.slow) for k in (10, 12)),
        (2, None),
        (4, None),
        (6, None),
        (8, None),
    ],
)
def test_the_attitude_has_the_order_of_the_method(order, gauge):
    counts = COUNTS[order]
    few, many = errors("body", order, counts, gauge)
    assert abs(np.log(few / many) / np.log(counts[1] / counts[0]) - order) < 0.25 + 0.06 * order


@pytest.mark.parametrize("case", ["body", "body with a given gauge"])
@pytest.mark.slow
def test_the_attitude_is_that_of_the_closed_form_to_round_off(case):
    assert errors(case, 12, [60])[0] < 1e-13


@pytest.mark.thin(2)
@pytest.mark.parametrize("case", ["body by Cayley", "body along paths", "body, split"])
def test_other_elements_have_the_order_too(case):
    few, many = errors(case, 4, [24, 48], 0.0 if "split" not in case else None)
    assert abs(np.log2(few / many) - 4) < 0.3


def whole_motion(x0, gradient, t):
    """Return the state (momentum and direction of the force), the quaternion and the position at time t of a body on
    se(3)*, integrated by DOP853.
    """

    def slope(_, u):
        p, g, q = u[:3], u[3:6], u[6:10]
        omega, v = gradient(u[:6])
        turned = [-q[1:] @ omega / 2, *((q[0] * omega + np.cross(q[1:], omega)) / 2)]
        return [*(np.cross(p, omega) + np.cross(g, v)), *np.cross(g, omega), *turned, *(rotation(q) @ v)]

    first = [*x0, 1, 0, 0, 0, 0, 0, 0]
    return solve_ivp(slope, (0, t), first, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]


def top_gradient(x):
    return x[:3] / INERTIA, np.array([1 / 3, 0, 1])


SLOW_C = pytest.param("c", marks=pytest.mark.slow)


@pytest.mark.parametrize("target", [SLOW_C, "numpy"])
def test_a_heavy_top_has_the_attitude_and_position_of_the_whole_motion(target):
    x0 = np.array([0.3, -0.2, 1.0, 0.6, 0.0, 0.8])
    exact = whole_motion(x0, top_gradient, 2.0)
    run = solver("top", target, 8).integrate(x0, 0.02, 100)
    assert run.attitude.shape == (101, 4)
    assert run.position.shape == (101, 3)
    assert np.abs(run.attitude[-1] - exact[6:10]).max() < 1e-11
    assert np.abs(run.position[-1] - exact[10:]).max() < 1e-11


def test_a_split_symmetric_top_has_those_of_the_whole_motion():
    x0 = np.array([0.3, -0.2, 1.0, 0.6, 0.0, 0.8])
    exact = whole_motion(x0, lambda x: (x[:3] * [1, 1, 2 / 3], np.array([0, 0, 1])), 2.0)
    run = solver("symmetric top, split", "numpy", 6).integrate(x0, 0.02, 100)
    whole = np.concatenate([run.x[-1], run.attitude[-1], run.position[-1]])
    assert np.abs(whole - exact).max() < 1e-9
    motion = solver("symmetric top by matrices, split", "numpy", 6).integrate(x0, 0.02, 100).attitude[-1]
    turned = np.column_stack([rotation(exact[6:10]), exact[10:]])
    assert np.abs(motion - [*turned, [0, 0, 0, 1]]).max() < 1e-9


def test_the_element_of_commuting_flows_keeps_the_directions_of_space():
    x0 = np.array([0.4, 0.5, 0.3, 0, 0, 1, 1, 0, 0])
    run = solver("satellite, split").integrate(x0, 0.1, 50)
    for vector in (run.x[:, 3:6], run.x[:, 6:]):
        in_space = (rotation(run.attitude) @ vector[..., None])[..., 0]
        assert np.abs(in_space - in_space[0]).max() < 1e-13
    assert np.abs(run.x[:, 3:6] - run.x[0, 3:6]).max() > 0.5


@pytest.mark.slow
def test_a_split_top_moves_as_by_the_series():
    x0 = np.array([0.3, -0.2, 1.0, 0.6, 0.0, 0.8])
    split = solver_of(compiled_text(TOP + "order: 8\nscheme: splitting\n"), "numpy")
    exact = solver("top", "numpy", 8).integrate(x0, 0.02, 50)
    run = split.integrate(x0, 0.02, 50)
    assert np.abs(run.attitude - exact.attitude).max() < 1e-9
    assert np.abs(run.position - exact.position).max() < 1e-9


def conserved(case, x, g):
    """Return the momenta in the frame in which they are conserved, as matrices (rows, n, n), for states x (rows, DIM)
    and attitudes g (rows, n, n).
    """
    group = made(case).program.attitude.group
    basis = np.array([[[float(e.value) for e in row] for row in m] for m in group.matrices])
    norms = (basis**2).sum(axis=(1, 2))
    momentum = np.einsum("ri,iab->rab", x / norms, basis)
    turned = np.swapaxes(g, 1, 2)
    return turned @ momentum @ g if group.spatial else g @ momentum @ turned


@pytest.mark.thin(3)
@pytest.mark.parametrize("target", ["c", "numpy"])
@pytest.mark.parametrize("case", ["so(4)", "so(4), momenta in space, by Cayley", "so(4), split", "so(3) by matrices"])
def test_matrices_keep_the_other_momentum_and_stay_orthogonal(case, target):
    x0 = np.random.default_rng(4).normal(size=made(case).system.dimension)
    run = solver(case, target).integrate(x0, 0.05, 200, 50)
    momenta = conserved(case, run.x, run.attitude)
    assert np.abs(momenta - momenta[0]).max() < 1e-14 * 5
    assert np.abs(run.attitude @ np.swapaxes(run.attitude, 1, 2) - np.eye(len(run.attitude[0]))).max() < 1e-15 * 5


@pytest.mark.parametrize("case", ["so(4)", "sl(2)", "heisenberg(1)", "so(3) by matrices"])
@pytest.mark.parametrize("size", [1e-3, 0.3, 20.0])
def test_matrices_are_exponentials_of_covectors_of_any_size(case, size):
    group = made(case).program.attitude.group
    p = size * np.random.default_rng(5).normal(size=(3, len(group.matrices)))
    basis = np.array([[[float(e.value) for e in row] for row in m] for m in group.matrices])
    generators = np.einsum("ri,iab->rab", p, basis)
    squares = (generators**2).sum(axis=(1, 2))[:, np.newaxis]
    integrator = solver(case).backend.module._of_covector(np.concatenate([p, squares], axis=1))
    exact = [np.array(mpmath.expm(mpmath.matrix(m.tolist())).tolist(), float) - np.eye(len(m)) for m in generators]
    assert np.abs(integrator.reshape(generators.shape) - exact).max() < 1e-15 * (1 + size * np.abs(exact).max())


@pytest.mark.parametrize("case", ["so(4)", "so(3) by matrices"])
def test_long_steps_of_matrices_are_the_same_in_blocks_and_one_by_one(case):
    x0 = np.linspace(0.5, 1.5, made(case).system.dimension)
    numpy, c = (solver(case, target).integrate(x0, 0.45, 48) for target in ("numpy", "c"))
    assert np.abs(numpy.attitude - c.attitude).max() < 1e-13
    assert np.abs(c.attitude[-1] - solver(case, "c").integrate(x0, 0.45, 48, 48).attitude[-1]).max() < 1e-13


@pytest.mark.slow
def test_so4_has_the_attitude_of_the_whole_motion():
    x0, case = np.random.default_rng(4).normal(size=6), "so(4)"
    group = made(case).program.attitude.group
    basis = np.array([[[float(e.value) for e in row] for row in m] for m in group.matrices])
    field = solver(case, "numpy", 8).vector_field

    def slope(_, u):
        omega = np.tensordot(u[:6] / np.arange(2.0, 8.0), basis, 1)
        return [*field(u[:6]), *(u[6:].reshape(4, 4) @ omega).ravel()]

    first = [*x0, *np.eye(4).ravel()]
    exact = solve_ivp(slope, (0, 2.0), first, method="DOP853", rtol=1e-13, atol=1e-14).y[6:, -1]
    run = solver(case, "numpy", 8).integrate(x0, 0.02, 100)
    assert np.abs(run.attitude[-1].ravel() - exact).max() < 1e-11


def test_rotations_by_casimirs_keep_matrices_orthogonal():
    """The rotation by the Casimirs over a long time is computed by repeated doubling of a short one. The doubling must
    not also double the deviation of the matrix from orthogonality that rounding causes.
    """

    def excess(g):
        return np.abs(g.reshape(-1, 4, 4) @ np.swapaxes(g.reshape(-1, 4, 4), 1, 2) - np.eye(4)).max()

    x0 = np.random.default_rng(4).normal(size=(1, 6))
    rate = np.append(x0, np.sum(x0**2))[None]
    assert excess(solver("so(4)").backend.module._uniform(rate, 1e5)) < 5e-15
    assert excess(solver("so(4)", "c").integrate(x0[0], 0.1, 50_000, 10_000).attitude) < 5e-15


def momenta_in_space(run):
    return np.einsum("rij,rj->ri", rotation(run.attitude), run.x)


@pytest.mark.thin(2)
@pytest.mark.parametrize("case", ["body", "body, split"])
def test_spatial_momentum_is_constant_to_round_off_for_many_steps(case):
    start = np.array([0.3, 1.0, 0.2])
    run = solver(case, "c", 6).integrate(start, 0.1, 100_000, 20_000)
    assert np.abs(momenta_in_space(run) - start).max() < 3e-14
    assert np.abs((run.attitude**2).sum(axis=1) - 1).max() < 1e-15


@pytest.mark.parametrize("target", ["c", "numpy"])
@pytest.mark.parametrize("h", [0.3, 7.0, 12 * np.pi, 12 * np.pi + 1e-6, -50.0])
def test_flows_may_turn_by_any_angle(target, h):
    """With h = 12π the first flow is a rotation by π. Formulas with the tangent of half the angle, or with a division
    by 1 + cos of the angle, would fail there.
    """
    start = np.array([0.3, 0.2, 1.0])
    run = solver("body, split", target, 2).integrate(start, h, 20)
    assert np.abs(momenta_in_space(run) - start).max() < 3e-14
    assert np.abs((run.attitude**2).sum(axis=1) - 1).max() < 2e-15


@pytest.mark.parametrize("target", ["c", "numpy"])
@pytest.mark.parametrize("case", ["body", "body, split"])
def test_a_body_after_a_kick_rotates_as_in_a_new_session(case, target):
    """The Casimirs that the gauge subtracts from H rotate the body at a rate that depends on the momentum. A kick along
    the momentum changes this rate, too.
    """
    session = solver(case, target, 6).session([0.3, 1.0, 0.2]).step(0.02, 10)
    session.kick(0.5 * session.x)
    fresh = session.solver.session(session.x, attitude0=session.attitude)
    assert session.step(0.02, 40).attitude == pytest.approx(fresh.step(0.02, 40).attitude, abs=1e-10)


ALL = ["body", "body by Cayley", "body along paths", "body, split", "momenta in space", "top", "so(4)", "sl(2)"]


@pytest.mark.thin(3)
@pytest.mark.parametrize("case", [*ALL, "heisenberg(1)", "su(2) along paths", "motions, momenta in space"])
def test_targets_agree_to_round_off_for_strides_and_starts_and_backward(case):
    rng, n = np.random.default_rng(7), made(case).system.dimension
    x0, expected = rng.normal(size=n), interface_of(made(case).program)
    first = {"attitude0": rng.normal(size=expected.attitude)}
    if expected.position:
        first["position0"] = rng.normal(size=3)
    c, numpy = (solver(case, target).integrate(x0, -0.03, 40, 7, **first) for target in ("c", "numpy"))
    assert np.abs(c.attitude - numpy.attitude).max() < 2e-14
    if expected.attitude == (4,):
        unit_attitude = first["attitude0"] / np.linalg.norm(first["attitude0"])
        assert np.abs(c.attitude[0] - unit_attitude).max() < 1e-15
    else:
        assert np.array_equal(c.attitude[0], first["attitude0"])
    if expected.position:
        assert np.abs(c.position - numpy.position).max() < 2e-14
        assert np.array_equal(c.position[0], first["position0"])
    every = solver(case, "c").integrate(x0, -0.03, 40, **first)
    assert np.abs(every.attitude[::7] - c.attitude[:-1]).max() < 5e-15


@pytest.mark.parametrize("target", ["c", "numpy"])
@pytest.mark.parametrize("case", ["body", "top", "so(4)"])
def test_a_step_back_undoes_the_attitude_and_saved_sessions_go_on(case, target):
    backend, x0 = solver(case, target).backend, np.linspace(0.5, 1.0, made(case).system.dimension)
    session = backend.start(x0, solver(case, target).interface.parameters)
    first = session.element()
    session.advance(0.02, 30)
    middle = session.element()
    again = backend.restored(session.saved(), solver(case, target).interface.parameters)
    twin = session.branch()
    for other in (session, again, twin):
        other.advance(0.02, 5)
        other.advance(-0.02, 35)
    assert np.array_equal(session.element(), again.element())
    assert np.array_equal(session.element(), twin.element())
    assert np.abs(session.element() - first).max() < 5e-15
    assert np.abs(middle - first).max() > 0.1


def test_members_are_turned_each_by_itself():
    module = solver("top").backend.module
    x0 = np.random.default_rng(2).normal(size=(5, 6))
    states, attitudes, positions = module.reconstruct(x0, 0.05, 10, 4)
    assert states.shape == (4, 5, 6)
    assert attitudes.shape == (4, 5, 4)
    assert positions.shape == (4, 5, 3)
    alone = solver("top").integrate(x0[3], 0.05, 10, 4)
    assert np.abs(attitudes[:, 3] - alone.attitude).max() < 1e-15 * 5
    assert np.abs(positions[:, 3] - alone.position).max() < 1e-15 * 5


@cache
def small_top() -> Solver:
    """Return the solver of the heavy top in C with the profile small."""
    return solver_of(compile_spec(spec_of(TOP), order=2, profile="small"), "c")


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", ["c", "numpy", "small"])
def test_members_of_ensembles_have_attitudes_and_positions(target):
    """Members have their own initial attitudes and positions. Their stored rows have the bits of single runs, with any
    number of threads. Final attitudes without stored rows agree to round-off.
    """
    top, rng = small_top() if target == "small" else solver("top", target), np.random.default_rng(2)
    x0, attitude0, position0 = rng.normal(size=(40, 6)), rng.normal(size=(40, 4)), rng.normal(size=(40, 3))
    frames = top.attitudes(x0, 0.05, 10, 4, attitude0=attitude0, position0=position0)
    again = top.attitudes(x0, 0.05, steps := 10 if target == "numpy" else 2000, steps // 2, threads=2)
    assert (frames.x.shape, frames.attitude.shape, frames.position.shape) == ((4, 40, 6), (4, 40, 4), (4, 40, 3))
    ends = top.attitudes(x0, 0.05, 10, attitude0=attitude0, position0=position0[0])
    for m in (0, 1, 39):
        alone = top.integrate(x0[m], 0.05, 10, 4, attitude0=attitude0[m], position0=position0[m])
        assert np.array_equal(frames.x[:, m], alone.x)
        assert np.array_equal(frames.attitude[:, m], alone.attitude)
        assert np.array_equal(frames.position[:, m], alone.position)
        assert np.array_equal(again.attitude[:, m], top.integrate(x0[m], 0.05, steps, steps // 2).attitude)
        assert np.abs(ends.attitude[m] - alone.attitude[-1]).max() < 5e-15
    assert np.abs(ends.position[0] - frames.position[-1, 0]).max() < 5e-15
    still = top.attitudes(x0, 0.05, 0)
    assert np.array_equal(still.attitude, [[1, 0, 0, 0]] * 40)
    assert np.array_equal(still.position, np.zeros((40, 3)))


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_a_member_that_fails_keeps_its_last_good_attitude_and_the_others_theirs(target):
    body, x0 = solver("body", target), np.array([[0.3, 1.0, 0.2], [0.5, 1.0, 0.2], [0.3, 1.2, 0.1]])
    h, I2 = [0.1, 1e3, 0.2], [2.0, 1.5, 1.2]
    with pytest.raises(phigen.StepError) as failed:
        body.attitudes(x0, h, 7, 3, I2=I2)
    assert failed.value.members == (1,)
    frames = failed.value.trajectory
    assert np.isnan(frames.attitude[1:, 1]).all()
    for m in (0, 2):
        alone = body.integrate(x0[m], h[m], 7, 3, I2=I2[m])
        assert np.array_equal(frames.attitude[:, m], alone.attitude)
    with pytest.raises(phigen.StepError) as failed:
        body.attitudes(x0, h, 7, I2=I2)
    assert np.array_equal(failed.value.trajectory.attitude[1], [1, 0, 0, 0])


def test_other_solvers_have_none():
    plain = phigen.compile(compiled_text(BODY.replace("reconstruct: quaternion", "")), target="numpy")
    assert plain.integrate([1, 0, 0.1], 0.1, 2).attitude is None
    with pytest.raises(TypeError, match="no attitude"):
        plain.integrate([1, 0, 0.1], 0.1, 2, attitude0=[1, 0, 0, 0])
    with pytest.raises(TypeError, match="no attitude"):
        plain.attitudes([[1, 0, 0.1]], 0.1, 2)
    with pytest.raises(ValueError, match="attitude0 must"):
        solver("body").attitudes([[1, 0, 0.1]], 0.1, 2, attitude0=np.eye(3))
    with pytest.raises(TypeError, match="no position"):
        solver("body").integrate([1, 0, 0.1], 0.1, 2, position0=[1, 0, 0])
    with pytest.raises(ValueError, match="must not be 0"):
        solver("body").integrate([1, 0, 0.1], 0.1, 2, attitude0=[0, 0, 0, 0])
    with pytest.raises(ValueError, match="shape"):
        solver("body").integrate([1, 0, 0.1], 0.1, 2, attitude0=np.eye(3))


ASKED = "reconstruct: quaternion"
SHEARED = BODY.replace("(x1**2/I1 + x2**2/I2 + x3**2/I3)/2", "x3*(x1**2 + x2**2) + x1") + "scheme: splitting\n"
REFUSED = {
    "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: p**2\n" + ASKED: "needs a linear π",
    algebra("sl(2)", "plus", 3, ASKED): "three coordinates with the brackets of so(3)",
    algebra(
        "so(3)", "plus", 3, ASKED, "birealisation: {kind: group-map, tau: (1 + P/2)/(1 - P/2)}"
    ): "no group element",
    SHEARED: "the part H_2 = x3*(x2**2 + x1**2)",
    BODY + "damping: 1/10\ngauge: {C: 1}\n": "with forces no Casimir is subtracted",
    BODY + "monitor: 1 + x1**2\ngauge: {C: 1}\n": "with a monitor no Casimir is subtracted",
}


def test_a_refusal_without_an_algebra_names_the_alternative():
    with pytest.raises(SpecError, match="make a quaternion part of the coordinates, as the spec quaternion_top does"):
        compiled_text(next(iter(REFUSED)))


@pytest.mark.parametrize(
    ("text", "message"), REFUSED.items(), ids=["no algebra", "no rotations", "no element", "part", "forces", "monitor"]
)
def test_what_has_no_attitude_is_refused_at_the_key(text, message):
    with pytest.raises(SpecError) as caught:
        compiled_text(text)
    (diagnostic,) = caught.value.diagnostics
    assert message in diagnostic.message
    assert diagnostic.location is not None


def test_files_have_the_attitude_and_position(tmp_path):
    run = solver("top").integrate(np.linspace(0.5, 1.0, 6), 0.05, 7, 3)
    for name in ("a.csv", "a.npz"):
        run.save(tmp_path / name)
    head, *lines = (tmp_path / "a.csv").read_text().splitlines()
    assert head.endswith("attitude_w,attitude_x,attitude_y,attitude_z,position_x,position_y,position_z")
    assert np.array([line.split(",")[-7:] for line in lines], dtype=float)[:, :4].tolist() == run.attitude.tolist()
    with np.load(tmp_path / "a.npz") as stored:
        assert np.array_equal(stored["attitude"], run.attitude)
        assert np.array_equal(stored["position"], run.position)


@pytest.mark.parametrize("section", [False, True])
def test_long_runs_give_the_attitude_of_each_row(section):
    backend, parameters = solver("body").backend, solver("body").interface.parameters
    start = np.array([0.3, 1.0, 0.2])
    finder = CrossingFinder(lambda x: x[:, 0], 0.1) if section else None
    pieces = list(march(backend.start(start, parameters), 0.1, 25, 4, finder))
    run = solver("body").integrate(start, 0.1, 25, 4)
    assert np.array_equal(np.concatenate([p.numbers for p in pieces]), np.array([0, 4, 8, 12, 16, 20, 24, 25]))
    assert np.array_equal(np.concatenate([p.turned for p in pieces]), run.attitude)


JAVASCRIPT = """(() => {
  s.integrate(-0.03, 30);
  const found = [[...s.attitude], [...(s.position ?? [])]];
  s.kick(s.x.map((x) => 0.1 * x)).step(0.05);
  const params = Object.entries(s.params).map(([name, value]) => [name, 1.1 * value]);
  s.setParameters(Object.fromEntries(params)).step(0.05);
  return [...found, [...s.attitude], [...(s.position ?? [])]];
})()"""


@pytest.mark.thin(2)
@pytest.mark.parametrize("case", CASES)
def test_javascript_has_the_attitude_of_numpy_after_kicks_too(case):
    x0, expected = np.linspace(0.4, 1.0, made(case).system.dimension), interface_of(made(case).program)
    first = {"attitude0": np.random.default_rng(3).normal(size=expected.attitude)}
    if expected.position:
        first["position0"] = np.array([0.1, 0.2, 0.3])
    options = ", ".join(f"{name}: {initial_array.ravel().tolist()}" for name, initial_array in first.items())
    *results, turned, moved = javascript(made(case), f"x0: {x0.tolist()}, {options}", "s", JAVASCRIPT)
    session = solver(case).session(x0, **first).step(-0.03, 30)
    assert results[0] == pytest.approx(session.attitude.ravel(), abs=3e-15)
    assert not expected.position or results[1] == pytest.approx(session.position, abs=3e-15)
    session.kick(0.1 * session.x).step(0.05)
    session.set_parameters({name: 1.1 * value for name, value in session.parameters.items()}).step(0.05)
    assert turned == pytest.approx(session.attitude.ravel(), abs=3e-15)
    assert not expected.position or moved == pytest.approx(session.position, abs=3e-15)


@pytest.mark.parametrize("case", ["body, split", "so(4), split"])
def test_javascript_has_the_derivative_of_a_step_with_an_attitude(case):
    compilation = compile_spec(spec_of(CASES[case]), order=2, tangent=True)
    x0 = np.linspace(0.4, 1.0, compilation.system.dimension)
    derivative = javascript(compilation, f"x0: {x0.tolist()}", "", "Array.from(s.stepTangent(0.3))")
    _, tangent = solver_of(compilation, "numpy").step_tangent(x0, 0.3)
    assert np.reshape(derivative, tangent.shape) == pytest.approx(tangent, abs=1e-14)


@pytest.mark.parametrize("target", ["c", "numpy"])
@pytest.mark.parametrize("term", ["b*x2", "b*x2*cos(t)"])
def test_gradients_leave_out_coefficients_of_attitudes(term, target):
    """The angle of the rotation by b*x2 does not depend on the state, so its quaternion consists of coefficients."""
    text = (
        BODY.replace("/2\n", f"/2 + {term}\n")
        .replace("parameters:", "time: t\nparameters:" if "t" in term else "parameters:")
        .replace("I3: 3", "I3: 3, b: 0.7")
        + "scheme: splitting\n"
    )
    turning = solver_of(compile_spec(spec_of(text), order=4, adjoint=True), target)
    plain = solver_of(
        compile_spec(spec_of(text.replace("reconstruct: quaternion\n", "")), order=4, adjoint=True), target
    )
    at, bar = np.array([0.4, -0.3, 0.8]), np.array([1.0, -0.5, 0.2])
    pulled, expected = (s.pullback(at, 0.3, 4, bar) for s in (turning, plain))
    assert pulled.x0_bar == pytest.approx(expected.x0_bar, rel=1e-13)
    assert pulled.parameters_bar == pytest.approx(expected.parameters_bar, rel=1e-12)
