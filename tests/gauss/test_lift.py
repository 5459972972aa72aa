"""Gauss steps on Lie–Poisson spaces with a frame: a quaternion F, updated in each step, such that the momentum is F* k
F with the quaternion unit k. The step is the same as without frames, but with fewer products. In C the stages are in
SIMD lanes.
"""

import ctypes
from dataclasses import replace

import numpy as np
import pytest
from support import RawC, compile_text, solver, spec_of

from phigen.compiler import compile_spec, emit, examine
from phigen.errors import SpecError
from phigen.gauss import statements
from phigen.gauss.lift import quaternion_copies
from phigen.gauss.quaternionic import quaternionic
from phigen.geometry.families import named
from phigen.scheme.lowering import operation_counts
from phigen.symbolic.symbols import Symbol
from phigen.symbolic.verdict import REFUTED

#: A system with so(3) and constant brackets, with a parameter and the time.
MIXED = """coordinates: [x, y, z, q, p]
parameters: {a: 0.4}
time: t
poisson: {brackets: {x: {y: z, z: -y}, y: {z: x}, q: {p: 1}}}
hamiltonian: x**2/2 + y**2/3 + a*z**2 + p**2/2 + q**2/2 + cos(q)*x + a*sin(q + t)*y*z
"""
#: A system with so(3) of the opposite sign and shifted momenta.
SHIFTED = """coordinates: [x, y, z]
poisson: {brackets: {x: {y: -z - 2, z: y}, y: {z: 1 - x}}}
hamiltonian: exp(x/3) + y**2*z/5 + sin(z)
"""
#: Systems whose steps use quaternion frames, with the step size.
CASES = {
    "rigid_body": (lambda **more: with_order_16(spec_of("rigid_body"), **more), 0.8),
    "so4_manakov": (lambda **more: with_order_16(spec_of("so4_manakov"), **more), 3.0),
    "spin_chain5": (lambda **more: with_order_16(spec_of("spin_chain5"), **more), 0.5),
    "mixed": (lambda **more: compile_text(f"{MIXED}scheme: gauss\n", 16, **more), 0.3),
    "shifted": (lambda **more: compile_text(f"{SHIFTED}scheme: gauss\n", 16, **more), 0.3),
}


def with_order_16(spec, **more):
    return compile_spec(
        replace(spec, profile="fast", reconstruct="", composition="auto").overridden(order=16, scheme="gauss", **more)
    )


def start_of(compilation):
    return 0.7 * np.cos(1.0 + np.arange(compilation.system.dimension))


def has_frames(compilation):
    return any("_lift(" in text for text in emit(compilation.program, "c", "").values())


@pytest.mark.parametrize(
    ("family", "size", "count"), [("so", 3, 1), ("so", 4, 2), ("se", 3, 0), ("sl", 2, 0), ("gl", 2, 0)]
)
def test_copies_of_the_quaternions_are_found(family, size, count):
    assert len(quaternion_copies(quaternionic(named(family, size)))) == count


@pytest.mark.parametrize(("name", "most"), [("rigid_body", 28), ("so4_manakov", 56), ("spin_chain5", 136)])
def test_products_of_a_stage_are_few(name, most):
    """With frames the right-hand side of a stage needs at most 28, 56 and 136 products; without frames it would need
    43, 91 and 211.
    """
    assert operation_counts(CASES[name][0]().program.step.lifted.slope.roots)["multiplications"] <= most


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize("name", CASES)
def test_steps_are_those_of_the_frame_at_1(name):
    """Steps agree with those of solvers with tangent maps. These solvers use no frames, and their tangent maps show
    that steps are Poisson maps.
    """
    make, h = CASES[name]
    compilation, reference = make(), make(tangent=True)
    assert has_frames(compilation)
    assert not has_frames(reference)
    ends = [solver(c, "c").integrate(start_of(c), h, 20).x for c in (compilation, reference)]
    assert np.abs(np.subtract(*ends)).max() <= 2e-13


@pytest.mark.parametrize(
    "start", [[0.0, 0.0, 0.0], [0.0, 0.0, 0.6], [0.0, 0.0, -0.6], [0.8, 0.0, 0.0], [0.0, -0.5, -0.0]]
)
def test_states_on_the_axes_have_frames(start):
    compilation, reference = CASES["rigid_body"][0](), CASES["rigid_body"][0](tangent=True)
    ends = [solver(c, "c").integrate(start, 0.5, 5).x[-1] for c in (compilation, reference)]
    assert ends[0] == pytest.approx(ends[1], abs=2e-15)


def test_other_coordinates_are_right_where_momenta_vanish():
    """A momentum of zero has the frame F = 0. The scale by which changes of other coordinates are measured does not
    depend on |F|².
    """
    make, h = CASES["mixed"]
    ends = [solver(c, "c").integrate([0.0, 0.0, 0.0, 0.3, 0.7], h, 20).x[-1] for c in (make(), make(tangent=True))]
    assert ends[0] == pytest.approx(ends[1], abs=2e-14)


@pytest.mark.parametrize("scale", [1e-7, 1e7])
def test_sweeps_do_not_depend_on_the_size_of_the_state(scale):
    """For a quadratic H, a run with the state multiplied and the step divided by the same factor takes as many
    fixed-point sweeps.
    """
    counts = []
    for factor in (1.0, scale):
        raw = RawC(CASES["rigid_body"][0]())
        raw.init(factor * np.array([0.4, -0.8, 0.5]))
        for _ in range(200):
            raw.step(0.8 / factor)
        counts.append(int(raw.counters[1]))
    assert counts[1] == pytest.approx(counts[0], rel=0.03)


def test_states_between_steps_and_after_kicks_are_right():
    make, h = CASES["so4_manakov"]
    states = []
    for compilation in (make(), make(tangent=True)):
        method = solver(compilation, "c")
        session = method.backend.start(start_of(compilation), method.backend.interface.parameters)
        session.advance(h, 10)
        before = session.state()
        session.advance(h, 1)
        first, middle = session.interpolated([0.0, 0.4])
        assert first == pytest.approx(before, abs=4e-15)
        for _ in range(20):
            session.kick(1e-3 * np.sin(np.arange(6.0)))
            session.advance(h, 1)
        states.append([middle, session.state()])
    assert np.abs(np.subtract(*states)).max() <= 5e-14


def test_kicks_do_not_cost_sweeps():
    """A kick gives a new frame, which is aligned with the old one, so that the stage values of the last step still
    predict the next step.
    """
    make, h = CASES["so4_manakov"]
    counts = []
    for kicked in (False, True):
        raw = RawC(make())
        raw.init(start_of(make()))
        change = np.full(6, 1e-12)
        for _ in range(100):
            if kicked:
                raw.call("kick", ctypes.c_int, raw.here, ctypes.c_void_p(change.ctypes.data))
            raw.step(h)
        counts.append(int(raw.counters[1]))
    assert counts[1] == pytest.approx(counts[0], rel=0.05)


@pytest.mark.parametrize("name", ["so4_manakov", "spin_chain5"])
def test_casimirs_do_not_drift(name):
    """Over many steps the errors of Casimirs grow like the square root of the number of steps, as rounding errors do,
    although the quaternion frame and the state are updated separately.
    """
    make, h = CASES[name]
    steps = 40_000
    run = solver(make(), "c").integrate(start_of(make()), h, steps, stride=100)
    for values in run.casimirs.values():
        assert np.ptp(values) <= 2e-15 * np.sqrt(steps) * max(np.abs(values).max(), 0.5)


def test_check_proves_that_frames_make_the_step(monkeypatch):
    name = "U = FG gives the same step as G, where x̃(q) = k̃(FqF*)"
    for checked in ("rigid_body", "so4_manakov"):
        spec = replace(spec_of(checked), scheme="gauss", composition="auto", reconstruct="")
        assert next(s for s in examine(spec).statements if s.name == name).verdict == "proved"
    monkeypatch.setattr(statements, "frame_symbol", lambda k: Symbol("frame", k ^ 1))
    assert next(s for s in examine(spec).statements if s.name == name).verdict == REFUTED


def test_certificates_refuse_moving_frames():
    from phigen.certify.problem import _expect_covered

    compilation = CASES["rigid_body"][0]()
    with pytest.raises(SpecError, match="certificates do not cover Gauss steps of order"):
        _expect_covered(compilation.program, compilation.spec)


def test_parameters_that_move_the_leaf_bring_new_frames():
    text = "coordinates: [x, y, z]\nparameters: {a: 2}\npoisson: {brackets: {x: {y: -z - a, z: y}, y: {z: -x}}}\n"
    compilation = compile_text(f"{text}hamiltonian: x**2/2 + sin(y)*z/3 + z**2/5\nscheme: gauss\n", 16)
    assert has_frames(compilation)
    states = []
    for target in ("c", "numpy"):
        session = solver(compilation, target).session(start_of(compilation)).step(0.3, 5)
        states.append(session.set_parameters(a=1.9).step(0.3, 5).x)
    assert np.abs(np.subtract(*states)).max() <= 2e-14


def test_compensated_frames_keep_casimirs_in_long_runs():
    """Quaternion frames with compensation terms keep Casimirs to 1.5e-14 in this run. Without compensation the error is
    seven times as large, and twenty times in a run of ten times the length.
    """
    compilation = CASES["so4_manakov"][0]()
    run = solver(compilation, "c").integrate(start_of(compilation), 0.5, 100_000, 1000)
    assert max(np.abs(values - values[0]).max() for values in run.casimirs.values()) < 1.5e-14
