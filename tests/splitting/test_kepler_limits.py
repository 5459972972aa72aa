"""Kepler motions for which a step is impossible or unusual: the status is the same in every target, and the state is
not changed.
"""

import numpy as np
import pytest
from support import TARGETS, compile_text, javascript, solver

from phigen import StepError
from phigen.errors import ParameterError

MADE = compile_text(
    "coordinates: [x, y, z, px, py, pz]\npoisson: {canonical: {q: [x, y, z], p: [px, py, pz]}}\n"
    "parameters: {m: 2, k: 3}\nhamiltonian: (px**2 + py**2 + pz**2)/(2*m) - k/sqrt(x**2 + y**2 + z**2)\n"
    "scheme: splitting\n",
    4,
)
USUAL = [1, 0, 0.1, 0, 2, 0.3]

#: Starts and steps without a final state, with the reason.
IMPOSSIBLE = {
    "at the centre": ([0, 0, 0, 1, 0, 0], 0.1),
    "falls from rest beyond the centre": ([1, 0, 0, 0, 0, 0], 2.0),
    "so near that its attraction overflows": ([1e-200, 0, 0, 1, 1, 0], 0.1),
    "so far that its distance overflows": ([1e200, 0, 0, 1, 1, 0], 0.1),
    "a step that overflows": (USUAL, 1e300),
}

#: Starts, steps and parameters with a final state: signs of m and k, hyperbolas, many revolutions in one step.
POSSIBLE = {
    "past a pericentre": ([1, 0, 0, 0, 0.2, 0], 2.5, {}),
    "no attraction": (USUAL, 0.1, {"k": 0}),
    "repulsion": (USUAL, 0.1, {"k": -3}),
    "a negative mass": (USUAL, 0.1, {"m": -2}),
    "a hyperbola": ([1, 0, 0, 0, 9, 0], 10.0, {}),
    "far along a hyperbola": ([1, 0, 0, 0, 9, 0], 1e10, {}),
    "many turns": (USUAL, 1e4, {}),
}


def energy(x, m=2, k=3):
    return x[3:] @ x[3:] / (2 * m) - k / np.sqrt(x[:3] @ x[:3])


@pytest.mark.parametrize("case", IMPOSSIBLE)
def test_a_step_without_an_end_is_not_finite_and_changes_nothing(case):
    x, h = IMPOSSIBLE[case]
    for target in TARGETS:
        with pytest.raises(StepError, match="NOT_FINITE") as failed:
            solver(MADE, target).integrate(x, h, 3)
        np.testing.assert_array_equal(failed.value.trajectory.x[-1], x)
        assert failed.value.step == 0
    calls = f"try {{ s.integrate({h!r}, 3) }} catch (error) {{ s.status = error.status }}"
    shown = "[...s.x, s.steps, s.status === 'NOT_FINITE' ? 1 : 0]"
    assert javascript(MADE, f"x0: {x}", calls, shown) == [*x, 0, 1]


@pytest.mark.parametrize("case", POSSIBLE)
def test_other_orbits_are_followed_there_and_back(case):
    x, h, parameters = POSSIBLE[case]
    params = ", ".join(f"{name}: {value}" for name, value in parameters.items())
    ends = [solver(MADE, target).integrate(x, h, 1, **parameters).x[-1] for target in TARGETS]
    ends.append(javascript(MADE, f"x0: {x}, params: {{{params}}}", f"s.step({h!r})", "[...s.x]"))
    size = np.abs(ends[0]).max()
    for end in map(np.array, ends):
        np.testing.assert_allclose(end, ends[0], rtol=0, atol=1e-13 * max(1, abs(h)) * size)
        assert energy(end, **parameters) == pytest.approx(energy(np.array(x), **parameters), rel=1e-12)
    back = solver(MADE, "c").integrate(ends[0], -h, 1, **parameters).x[-1]
    np.testing.assert_allclose(back, x, rtol=0, atol=1e-12 * max(1, abs(h)) * size)


@pytest.mark.parametrize("target", TARGETS)
def test_a_mass_of_zero_is_refused_before_the_first_step(target):
    with pytest.raises(ParameterError, match="m = 0"):
        solver(MADE, target).integrate(USUAL, 0.1, 1, m=0)
