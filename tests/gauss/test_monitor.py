"""Gauss steps of equal size in a fictitious time τ: they integrate K = g·(H + e), with the monitor g and the energy
level e = −H(x₀), instead of H.
"""

from functools import cache

import numpy as np
import pytest
from support import javascript, small, solver

from phigen import spec
from phigen.compiler import compile_spec, examine

KEPLER = """coordinates: [x, y, u, v]
parameters: {k: 1.1}
poisson: {canonical: {q: [x, y], p: [u, v]}}
hamiltonian: (u**2 + v**2)/2 - k/sqrt(x**2 + y**2)
monitor: (x**2 + y**2)**(3/4)
"""
TOP = """coordinates: [x, y, z]
parameters: {a: 1.3, c: 0.7}
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: a*x**2/2 + y**2/3 + z**2/5 + x*y*z/7 + sin(y)
casimirs: {C: x**2 + y**2 + z**2}
monitor: 1/(1 + c*x**2 + z**2)
"""
DAMPED = f"{TOP}forces: {{covector: {{x: -a*y/9}}}}\n"
#: The brackets of so(3) times 1 + R with R = x² + y² + z², for which no momentum map is known; a force crosses the
#: symplectic leaves.
SPREAD = "{x: {y: z*(1 + R), z: -y*(1 + R)}, y: {z: x*(1 + R)}}".replace("R", "x**2 + y**2 + z**2")
LEAVING = TOP.replace("{lie_algebra: {name: so(3)}}", f"{{brackets: {SPREAD}}}") + (
    "structure: to truncation\nforces: {vector: {x: -x*c/9}}\n"
)
#: Systems by name: spec, start, and step in the fictitious time τ.
CASES = {
    "kepler": (KEPLER, [1, 0.1, 0, 0.5], 0.4),
    "top": (TOP, [0.4, 0.8, -0.5], 0.8),
    "damped": (DAMPED, [0.4, 0.8, -0.5], 0.8),
    "leaving": (LEAVING, [0.4, 0.8, -0.5], 0.3),
}
STEPS = 10
pytestmark = pytest.mark.few("kepler", "damped", of=CASES)


def written(case, *, monitored=True):
    text = "".join(f"{line}\n" for line in CASES[case][0].splitlines() if monitored or "monitor" not in line)
    return spec.loads(f"phigen: 1\nname: t\n{text}scheme: gauss\ngauge: none\n")


@cache
def compilation(case):
    return compile_spec(written(case).overridden(order=6, tangent=True))


@pytest.mark.parametrize("case", CASES)
def test_state_and_time_have_the_order_of_the_method(case):
    """After steps in τ, state and time agree with a run in t by a method of order 16, and errors decrease with the
    order 6.
    """
    _, x0, h = CASES[case]
    plain = solver(compile_spec(written(case, monitored=False).overridden(order=16)), "c")
    errors = []
    for finer in (1, 2):
        run = solver(compilation(case), "c").integrate(x0, h / finer, finer * STEPS)
        exact = plain.integrate(x0, run.t[-1] / 400, 400, 400).x[-1]
        errors.append(np.abs(run.x[-1] - exact).max())
    assert 1e-9 < errors[0] < 1e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(6, abs=1.2)


@pytest.mark.parametrize("case", CASES)
def test_targets_have_the_same_states_and_times(case):
    compiled, (_, x0, h) = compilation(case), CASES[case]
    runs = [
        solver(c, target).integrate(x0, h, STEPS)
        for c, target in ((compiled, "numpy"), (compiled, "c"), (small(compiled), "c"))
    ]
    ends = [[*run.x[-1], run.t[-1]] for run in runs]
    ends.append(javascript(compiled, f"x0: {list(map(float, x0))}", f"s.integrate({h}, {STEPS});", "[...s.x, s.t]"))
    for end in ends[1:]:
        assert end == pytest.approx(ends[0], abs=1e-13)


BRACKETS = {
    "kepler": lambda x: np.kron([[0, 1], [-1, 0]], np.eye(2)),
    "top": lambda x: np.array([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]]),
}


@pytest.mark.parametrize("case", BRACKETS)
def test_step_for_a_fixed_e_is_a_poisson_map(case):
    """The tangent map at fixed energy level e is a Poisson map, here for large steps of order 2, whose errors are far
    above rounding.
    """
    poisson, (_, x0, h) = BRACKETS[case], CASES[case]
    following, tangent = solver(compile_spec(written(case).overridden(order=2, tangent=True)), "numpy").step_tangent(
        x0, h
    )
    assert np.abs(tangent @ poisson(x0) @ tangent.T - poisson(following)).max() <= 2e-14


@pytest.mark.parametrize("case", ["damped", "leaving"])
def test_check_proves_the_field_of_forces_and_monitors(case):
    groups = examine(written(case)).groups
    (statements,) = (listed for name, listed in groups.items() if name.startswith("Gauss"))
    assert next(s for s in statements if s.name.startswith("ẋ")).verdict == "proved"


def test_steps_back_take_the_time_back():
    _, x0, h = CASES["kepler"]
    for compiled in (compilation("kepler"), small(compilation("kepler"))):
        session = solver(compiled, "c").session(x0)
        for sign in (1, -1):
            for _ in range(4):
                session.step(sign * h)
        assert session.x == pytest.approx(x0, abs=1e-13)
        assert session.t == pytest.approx(0, abs=1e-14)
