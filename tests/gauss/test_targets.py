"""Gauss steps in all targets and profiles are equal to round-off, also their tangent maps and failures."""

import re
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from support import SCALED, compile_text, compiled, files, first_run, javascript, small, solver, spec_of

from phigen.compiler import compile_spec
from phigen.errors import StepError
from phigen.spec import loads
from phigen.symbolic.expression import number, substitute

FORCED = """coordinates: [q, p]
time: t
parameters: {g: 0.3}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - cos(q) + g*q*sin(2*t)
forces: {vector: {p: -p/5}}
scheme: gauss
"""
STEPS = 40


def methods(compilation):
    """Return the solvers of a compilation by name: NumPy, fast C, and C of profile small."""
    return {
        "numpy": solver(compilation, "numpy"),
        "c": solver(compilation, "c"),
        "small": solver(small(compilation), "c"),
    }


def ends(compilation, x0, h, **more):
    """Return the final states of all solvers after `STEPS` steps, JavaScript included."""
    final_states = {name: m.integrate(x0, h, STEPS, **more).x[-1] for name, m in methods(compilation).items()}
    final_states["js"] = np.array(
        javascript(compilation, f"x0: {list(map(float, x0))}", f"s.integrate({h}, {STEPS});", "[...s.x]")
    )
    return final_states


@pytest.mark.thin(3)
@pytest.mark.parametrize(
    ("name", "order"), [("rigid_body", 6), ("so4_manakov", 16), ("toda3", 2), ("volterra5", 12), ("henon_heiles", 10)]
)
def test_targets_are_equal_to_rounding(name, order):
    compilation = compiled(name, order, "gauss")
    run = first_run(compilation)
    x0 = [float(v) for v in run.initial]
    final_states = ends(compilation, x0, 4 * float(run.step))
    for other in ("c", "small", "js"):
        assert final_states[other] == pytest.approx(
            final_states["numpy"], rel=0, abs=1e-13 * np.abs(final_states["numpy"]).max()
        )


@pytest.mark.parametrize("size", [0.0, 1e-170, 1e-160])
def test_steps_begin_at_the_origin_and_close_to_it(size):
    """Steps start at the origin or so close to it that squares of the state underflow, although changes are measured
    relative to the state. A force drives the pendulum away.
    """
    pendulum = FORCED.replace("time: t\n", "").replace("g*q*sin(2*t)", "g*q/1000")
    spin = (
        "coordinates: [x, y, z]\npoisson: {lie_algebra: {name: so(3)}}\nhamiltonian: x + y**2/2 + z**2\nscheme: gauss\n"
    )
    for text, n in ((pendulum, 2), (spin, 3)):
        compilation = compile_text(text, 6)
        states = ends(compilation, [size, *[0.0] * (n - 1)], 0.1)
        for state in states.values():
            assert state == pytest.approx(states["c"], rel=1e-12, abs=1e-17)
        assert np.abs(states["c"][:2]).max() > 1e-4 or n == 3
        members = np.array([[size, *[0.0] * (n - 1)], [0.3] * n])
        together = solver(compilation, "numpy").ensemble(members, 0.1, STEPS)
        np.testing.assert_allclose(together[0], states["numpy"], rtol=1e-12, atol=1e-17)


def test_time_and_forces_enter_at_the_stages():
    """A driven pendulum with friction: all targets agree, and errors are those expected of the order."""
    compilation = compile_text(FORCED, 8)
    final_states = ends(compilation, [0.3, 0.4], 0.2)
    exact = solver(compile_text(FORCED, 16), "c").integrate([0.3, 0.4], 0.1, 2 * STEPS).x[-1]
    for state in final_states.values():
        assert state == pytest.approx(exact, abs=2e-9)
        assert state == pytest.approx(final_states["numpy"], abs=1e-13)


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", ["so4_manakov", "henon_heiles"])
def test_tangents_are_equal_and_those_of_the_step(name):
    compilation = compile_spec(spec_of(name).overridden(order=8, scheme="gauss", tangent=True))
    run = first_run(compilation)
    x0, h = np.array([float(v) for v in run.initial]), 4 * float(run.step)
    tangents = [m.step_tangent(x0, h)[1] for m in methods(compilation).values()]
    width, method = 1e-5, solver(compilation, "c")
    columns = [(method.step(x0 + width * e, h) - method.step(x0 - width * e, h)) / (2 * width) for e in np.eye(len(x0))]
    shown = javascript(compilation, f"x0: {x0.tolist()}", "", f"[...s.stepTangent({h})]")
    assert tangents[0] == pytest.approx(np.array(columns).T, abs=1e-8)
    for other in (*tangents[1:], np.reshape(shown, tangents[0].shape)):
        assert other == pytest.approx(tangents[0], abs=1e-12)


@pytest.mark.parametrize("target", ["numpy", "c", "small"])
def test_a_step_that_is_too_large_fails_soon(target):
    """If the fixed-point sweeps do not contract, the step fails long before the maximal number of sweeps, and the state
    is the last valid one.
    """
    method = methods(compiled("henon_heiles", 8, "gauss"))[target]
    with pytest.raises(StepError) as failed:
        method.integrate([0.1, 0.3, 0.2, 0.4], 40.0, 5)
    assert failed.value.status in ("NO_CONVERGENCE", "NOT_FINITE")
    assert failed.value.step == 0


@pytest.mark.parametrize("target", ["c", "small"])
def test_kicks_and_new_step_sizes_discard_predictions(target):
    """After a kick and a change of h, a solver continues as a new solver would from the same state."""
    compilation = compiled("so4_manakov", 8, "gauss")
    method = methods(compilation)[target]
    x0 = np.array([float(v) for v in first_run(compilation).initial])
    session = method.session(x0)
    for _ in range(5):
        session.step(2.0)
    session.kick(0.2 * x0[::-1])
    here = np.array(session.x)
    for _ in range(3):
        session.step(1.0)
    assert session.x == pytest.approx(method.integrate(here, 1.0, 3).x[-1], abs=1e-14)


def test_members_are_integrated_each_as_by_itself():
    compilation = compiled("so4_manakov", 8, "gauss")
    x0 = np.array([float(v) for v in first_run(compilation).initial])
    starts = x0 + 0.1 * np.random.default_rng(1).normal(size=(5, 6))
    for method in methods(compilation).values():
        together = method.ensemble(starts, 2.0, 5)
        for start, end in zip(starts, together, strict=True):
            assert end == pytest.approx(method.integrate(start, 2.0, 5).x[-1], abs=1e-14)


def test_steps_back_undo_steps():
    compilation = compiled("so4_manakov", 8, "gauss")
    x0 = np.array([float(v) for v in first_run(compilation).initial])
    for method in methods(compilation).values():
        there = method.integrate(x0, 4.0, 4).x[-1]
        assert method.integrate(there, -4.0, 4).x[-1] == pytest.approx(x0, abs=1e-14)


def test_gauge_shifts_the_hamiltonian_that_is_discretised():
    """H and H − λC have the same flow. With the gauge λ the states agree up to the error of the method, but the stages
    differ.
    """
    spec = spec_of("rigid_body")
    shifted = replace(spec, gauge={"C": number(1) / number(3)})
    methods_ = [
        solver(compile_spec(specification.overridden(order=8, scheme="gauss")), "c")
        for specification in (spec, shifted)
    ]
    plain, other = (method.integrate([0.4, -0.8, 0.5], 0.4, 20).x[-1] for method in methods_)
    assert plain == pytest.approx(other, abs=1e-7)
    assert np.abs(plain - other).max() > 1e-15


def test_structure_constants_may_be_parameters():
    """Momentum maps may depend on parameters: all targets agree, for parameters that differ from the defaults."""
    compilation = compile_text(f"{SCALED}scheme: gauss\n", 6)
    x0, more = [0.3, -0.2, 0.4], {"r": 1.5, "s": 2.5}
    states = [m.integrate(x0, 0.3, 20, **more).x[-1] for m in methods(compilation).values()]
    options = f"x0: {x0}, params: {{ r: 1.5, s: 2.5 }}"
    states.append(javascript(compilation, options, "s.integrate(0.3, 20);", "[...s.x]"))
    for state in states[1:]:
        assert state == pytest.approx(states[0], abs=1e-14)


STIFF = """coordinates: [x, y, z]
parameters: {a: 103, b: 101, c: 4}
poisson: {brackets: {x: {y: -z, z: y}, y: {z: -x}}}
hamiltonian: (a*x**2 + b*y**2 + c*z**2)/2
casimirs: {C: x**2 + y**2 + z**2}
scheme: gauss
"""


def gauged(text, order):
    """Compile a spec without changes, with its automatic gauge."""
    return compile_spec(loads(f"phigen: 1\nname: t\n{text}").overridden(order=order))


def test_long_steps_take_few_sweeps():
    """Long steps of a stiff body take few fixed-point sweeps, since `gauge: auto` subtracts a multiple of C from H,
    stages are predicted, and sweeps end at rounding.
    """
    compilation = gauged(STIFF, 16)
    (sweeps,) = javascript(compilation, "x0: [1, 1, 1]", "s.integrate(0.01, 200);", "[s.evaluations/200]")
    assert sweeps < 14


def test_gauge_makes_velocities_small():
    stiff, tops = gauged(STIFF, 4), compile_spec(spec_of("kowalevski_gauss"))
    (multiple,) = stiff.gauge.fixed.values()
    (value,) = substitute([multiple], {"a": number(103), "b": number(101), "c": number(4)})
    assert value == number(Fraction(208, 6))  # the Hessian of C is 2·identity
    assert not tops.gauge.fixed  # the Hessians of its Casimirs are orthogonal to that of H
    assert not gauged(f"{STIFF}gauge: none\n", 4).gauge.fixed


def in_single_precision(name, order):
    """Return a compilation whose C computes with numbers of 32 bits."""
    double = small(compiled(name, order, "gauss"))
    return replace(double, program=replace(double.program, extras=replace(double.program.extras, real="float")))


@pytest.mark.slow
def test_energy_does_not_drift_in_single_precision():
    """In 20,000 steps in single precision the energy changes by a few rounding errors only."""
    compilation = in_single_precision("henon_heiles", 12)
    run = solver(compilation, "c").integrate([float(v) for v in first_run(compilation).initial], 0.4, 20_000, 500)
    assert np.abs(run.energy - run.energy[0]).max() <= 1e-6


def test_coefficients_are_symplectic_in_single_precision():
    """The coefficients in the C, as a compiler reads them in single precision, satisfy μ_ij + μ_ji = 1 exactly."""
    text = files(in_single_precision("henon_heiles", 12), "c")["henon_heiles.c"]
    rows = re.search(r"henon_heiles_mixing\[.*?\] = \{(.*?)\};", text, re.S)[1].strip().split("\n")
    mixing = [[Fraction(float(np.float32(v))) for v in re.findall(r"(-?[\d.e-]+)f", row)] for row in rows]
    columns = list(zip(*mixing, strict=True))
    assert len(columns) == len(mixing) == 6
    assert all(
        a + b == 1 for row, column in zip(mixing, columns, strict=True) for a, b in zip(row, column, strict=True)
    )
