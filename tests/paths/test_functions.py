"""Every function that a bracket may contain has a Taylor recurrence along paths: steps agree with steps in many
digits.
"""

import re

import mpmath
import numpy as np
import pytest
from precise_path import PATH_DIGITS, PrecisePathStep, compile_paths, state_of
from support import TARGETS, RawC, relative_defect, slow_but, solver

from phigen import StepError

EPS = np.finfo(float).eps
START, STEP = (1.1, 0.6), 0.1

BRACKETS = [
    "1/(1 + x**2 + y**2)",
    "x**3*y",
    "(x + y)**(3/2)",
    "(x + y)**(-1/3)",
    "x**(-2)",
    "x**y",
    "(1 + x)**a",
    "y**2/(x - 3)",
    "exp(x*y)",
    "log(x + y)",
    "sqrt(1 + x*y)",
    "sin(x)",
    "cos(x - y)",
    "tan(x/2)",
    "asin(x/3)",
    "acos(y/2)",
    "atan(x*y)",
    "atan2(y, x)",
    "sinh(x)",
    "cosh(y)",
    "tanh(x + y)",
    "asinh(x)",
    "acosh(1 + x)",
    "atanh(x/4)",
    "abs(x - 2)*y",
    "sin(x)**3 - cos(y)**2",
    "sqrt(exp(x)/(1 + log(2 + y**2)))",
    "a*x*y + pi + E",
    "x*exp(a*y)/(1 + a**2)",
    "a",
]


def plane(bracket):
    """Return a spec with {x, y} = ``bracket`` and a parameter a. In two dimensions every bracket is Poisson."""
    return planes([bracket]).replace("x0", "x").replace("y0", "y")


def planes(brackets):
    """Return a spec that combines several planar systems with the given brackets, in coordinates x0, y0, x1, y1, …, so
    that they are compiled together.
    """
    pairs = [(f"x{k}", f"y{k}") for k in range(len(brackets))]
    rows = []
    for (x, y), bracket in zip(pairs, brackets, strict=True):
        renamed = re.sub(r"\by\b", y, re.sub(r"\bx\b", x, bracket))
        rows.append(f'    {x}: {{{y}: "{renamed}"}}')
    energy = " + ".join(f"{x} + 7*{y}/10 + {x}*{y}/3 + {y}**2/4" for x, y in pairs)
    names = ", ".join(name for pair in pairs for name in pair)
    listed = "\n".join(rows)
    return f"""coordinates: [{names}]
parameters: {{a: 0.7}}
poisson:
  brackets:
{listed}
hamiltonian: "{energy}"
"""


GROUP = 6


@pytest.mark.parametrize("first", slow_but([24], range(0, len(BRACKETS), GROUP)))
def test_path_of_each_function_is_followed_to_roundoff(first):
    brackets = BRACKETS[first : first + GROUP]
    compilation, parameters = compile_paths(planes(brackets), 2), {"a": 0.45}
    raw = RawC(compilation)
    raw.init(START * len(brackets), parameters)
    assert raw.step(STEP) == 0
    numpy = solver(compilation, "numpy").step(START * len(brackets), h=STEP, parameters=parameters)
    for k, bracket in enumerate(brackets):
        step = PrecisePathStep(compile_paths(plane(bracket), 2), parameters, STEP)
        image, tangent = step.solve(START)
        with mpmath.workdps(PATH_DIGITS):
            assert relative_defect(tangent, step.poisson(START), step.poisson(image)) < 1e-20
        # The covector is rounded as well as the state, so a few rounding errors of the largest value are allowed.
        bound = 6 * EPS * max(1, *(abs(float(v)) for v in image))
        for end in (state_of(raw), numpy):
            error = max(abs(a - b) for a, b in zip(end[2 * k : 2 * k + 2], image, strict=True))
            assert error <= bound, bracket


def test_parameters_of_the_bracket_reach_the_path():
    solve = {t: solver(compile_paths(plane("a*x*y"), 2), t) for t in TARGETS}
    for a in (-1.5, 0.0, 2.0):
        ends = [solve[t].step(START, h=STEP, a=a) for t in TARGETS]
        step = PrecisePathStep(compile_paths(plane("a*x*y"), 2), {"a": a}, STEP)
        image = [float(v) for v in step(START)]
        assert np.max(np.abs(np.array(ends) - image)) < 8 * EPS * max(np.abs(image))


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("power", slow_but([4, 9], [4, 6, 8, 9]))
def test_expansion_with_a_gap_is_not_taken_for_a_finished_one(power, target):
    # For y(0) = 0 the first term of the Taylor series is z(t) = -(4 h t)^(power+1)/(power+1) + …, and all terms of
    # lower order vanish.
    text = f"""coordinates: [x, y, z]
poisson: {{brackets: {{x: {{y: 1, z: y**{power}}}}}}}
hamiltonian: 4*x + y**2/2 + 2*z
"""
    compilation, start = compile_paths(text, 2), (0.3, 0.0, 0.2)
    image = PrecisePathStep(compilation, {}, STEP)(start)
    integrator = solver(compilation, target).step(start, h=STEP)
    assert max(abs(a - b) for a, b in zip(integrator, image, strict=True)) <= 2 * EPS


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", TARGETS)
def test_path_across_a_kink_is_refused(target):
    text = """coordinates: [x, y]
poisson: {brackets: {x: {y: abs(x - 1)}}}
hamiltonian: y
"""
    solve = solver(compile_paths(text, 2), target)
    assert solve.step((1.5, 0.0), h=-1.0)[0] == pytest.approx(1 + 0.5 * np.exp(-1))
    text = text.replace("abs(x - 1)", "1 + abs(x - 1)")
    solve = solver(compile_paths(text, 2), target)
    assert solve.step((1.5, 0.0), h=1.0)[0] == pytest.approx(1.5 * np.exp(1))
    with pytest.raises(StepError):
        solve.step((1.5, 0.0), h=-1.0)
