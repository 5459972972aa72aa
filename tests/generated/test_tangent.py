"""The tangent map of generated steps, compared with many digits and differences, and the Poisson identity that it
satisfies.
"""

import ctypes
from functools import cache
from itertools import product

import mpmath
import numpy as np
import pytest
from precise_path import PrecisePathStep
from support import (
    BODY,
    NAMES,
    QUICK,
    TARGETS,
    WARNINGS,
    PreciseStep,
    RawC,
    compiled,
    described,
    files,
    plain,
    run,
    setting,
    slow_but,
    small,
    solver,
    spec_of,
    tool,
    write,
)  # fmt: skip

from phigen import StepError, compile, spec
from phigen.compiler import compile_spec
from phigen.scheme.steps import Path
from phigen.symbolic.arrays import evaluate

#: Systems for each driver, with one stage and with several; small systems first.
KINDS = ("pendulum_euler", "rigid_body", "volterra5", "lagrange_top", "nambu_pendulum", "sir_epidemic")
COMPOSED = f"{BODY}order: 6\ncomposition: kahan-li\ngauge: none\n"


@cache
def with_tangent(name):
    return compile_spec(plain(spec_of(name)), tangent=True, system=described(name)[1])


@cache
def text_with_tangent(text):
    return compile_spec(spec.loads(f"phigen: 1\nname: t\ntangent: true\n{text}"))


def poisson_matrix(compilation, x, parameters):
    at = {**parameters, **dict(zip(compilation.system.coordinates, x, strict=True))}
    flat = evaluate([e for row in compilation.system.poisson for e in row], at)
    return np.array([float(e) for e in flat]).reshape(len(x), len(x))


def defect(compilation, x, image, tangent, parameters):
    before, after = (poisson_matrix(compilation, state, parameters) for state in (x, image))
    return np.max(np.abs(tangent @ before @ tangent.T - after)) / np.max(np.abs(after))


def differences(step, x, width=1e-3):
    """Return the derivative of a step by central differences of order 6."""
    columns = []
    for j in range(len(x)):
        total = 0.0
        for k, weight in ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60)):
            move = width * k * np.eye(len(x))[j]
            total = total + weight * (step(x + move) - step(x - move))
        columns.append(total / width)
    return np.column_stack(columns)


#: Cases of the test below. For the systems in `KINDS` the Poisson identity follows from the next test, since another
#: test proves their map Poisson.
FEW = [("c", name) for name in QUICK if name not in KINDS] + [("numpy", "lotka_volterra")]


@pytest.mark.thin(3)
@pytest.mark.corpus
@pytest.mark.parametrize(("target", "name"), slow_but(FEW, product(TARGETS, NAMES)))
def test_step_is_a_poisson_map(name, target):
    compilation = with_tangent(name) if name in QUICK else small(with_tangent(name))
    integrator = solver(compilation, target)
    at = setting(compilation)
    x = np.array(at.x)
    for h in (at.h, -at.h / 2):
        image, tangent = integrator.step_tangent(x, h, parameters=at.parameters)
        assert np.max(np.abs(image - integrator.step(x, h, parameters=at.parameters))) == 0
        assert defect(compilation, x, image, tangent, at.parameters) <= 1e-12
        x = image


@pytest.mark.thin(3)
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("name", [n for n in KINDS if n != "pendulum_euler"])
def test_tangent_agrees_with_many_digits(name, target):
    compilation = with_tangent(name)
    at = setting(compilation)
    image, tangent = solver(compilation, target).step_tangent(at.x, at.h, parameters=at.parameters)
    x = [mpmath.mpf(v) for v in at.x]
    if isinstance(compilation.program.step, Path):
        expected_image, expected = PrecisePathStep(compilation, at.parameters, at.h).solve(x)
    else:
        expected_image, expected = PreciseStep(compilation, at.parameters, at.h).tangent(x)
    difference = max(abs(float(expected[i, j]) - tangent[i, j]) for i in range(len(at.x)) for j in range(len(at.x)))
    assert difference <= 2e-15 * max(1, np.max(np.abs(tangent))) * len(at.x)
    assert np.max(np.abs(image - np.array(expected_image, dtype=float))) <= 1e-15 * len(at.x) * np.max(np.abs(image))


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("name", ["pendulum_euler", "ablowitz_ladik3", "rigid_body"])
def test_tangent_agrees_with_differences(name, target):
    compilation = with_tangent(name)
    integrator, at = solver(compilation, target), setting(compilation)

    def step(x):
        return integrator.step(x, at.h, parameters=at.parameters)

    tangent = integrator.step_tangent(at.x, at.h, parameters=at.parameters)[1]
    assert np.max(np.abs(tangent - differences(step, np.array(at.x)))) <= 1e-10


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", TARGETS)
def test_stages_of_a_composition_are_multiplied(target):
    compilation = text_with_tangent(COMPOSED)
    assert len(compilation.program.fractions) > 1
    integrator, x = solver(compilation, target), np.array([0.3, 0.9, -0.4])
    image, tangent = integrator.step_tangent(x, 0.2)
    assert np.max(np.abs(tangent - differences(lambda y: integrator.step(y, 0.2), x))) <= 1e-11
    assert defect(compilation, x, image, tangent, {}) <= 1e-14
    back = integrator.step_tangent(image, -0.2)[1]
    assert np.max(np.abs(back @ tangent - np.eye(3))) <= 1e-14
    if target == "numpy":  # the NumPy module has its own loop
        assert np.max(np.abs(integrator.backend.module.step_tangent(x, 0.2)[1] - tangent)) <= 1e-15


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", TARGETS)
def test_gauge_is_held_fixed(target):
    compilation = text_with_tangent(f"{BODY}casimirs: {{C: x1**2 + x2**2 + x3**2}}\norder: 4\ngauge: auto\n")
    assert compilation.program.gauge
    x = np.array([0.3, 0.9, -0.4])
    image, tangent = solver(compilation, target).step_tangent(x, 0.2)
    assert defect(compilation, x, image, tangent, {}) <= 1e-14
    if target == "numpy":
        module = solver(compilation, target).backend.module
        fixed = module.gauge(x)
        by_differences = differences(lambda y: module.step(y, 0.2, gauge=fixed), x)
        assert np.max(np.abs(tangent - by_differences)) <= 1e-11


def test_a_large_step_is_as_exact_as_a_small_one():
    """The tangent map is evaluated at the solution y, not at the last iterate."""
    compilation = with_tangent("rigid_body")
    precise = PreciseStep(compilation, setting(compilation).parameters, 0.6)
    x = [0.2, 1.1, 0.4]
    expected = precise.tangent([mpmath.mpf(v) for v in x])[1]
    for target in TARGETS:
        tangent = solver(compilation, target).step_tangent(x, 0.6)[1]
        assert max(abs(float(expected[i, j]) - tangent[i, j]) for i in range(3) for j in range(3)) <= 5e-15


def test_c_advances_its_solver_as_step_does():
    compilation = with_tangent("rigid_body")
    one, other = RawC(compilation), RawC(compilation)
    at, tangent = setting(compilation), np.zeros(9)
    one.init(at.x, at.parameters)
    other.init(at.x, at.parameters)
    address = ctypes.c_void_p(tangent.ctypes.data)
    for _ in range(100):
        assert one.step(at.h) == 0
        assert other.call("step_tangent", ctypes.c_int, other.here, ctypes.c_double(at.h), address) == 0
    assert bytes(one.memory) == bytes(other.memory)
    assert abs(np.linalg.det(tangent.reshape(3, 3)) - 1) < 1e-3


def test_c_failure_leaves_state_and_tangent():
    raw = RawC(with_tangent("rigid_body"))
    raw.init([1e3, 2e3, -1e3])
    tangent, before = np.full(9, 7.0), bytes(raw.memory)
    address = ctypes.c_void_p(tangent.ctypes.data)
    assert raw.call("step_tangent", ctypes.c_int, raw.here, ctypes.c_double(50.0), address) != 0
    assert bytes(raw.memory) == before
    assert (tangent == 7.0).all()
    assert raw.call("step_tangent", ctypes.c_int, None, ctypes.c_double(0.1), address) == 4
    assert raw.call("step_tangent", ctypes.c_int, raw.here, ctypes.c_double(0.1), None) == 4


def test_numpy_takes_many_members():
    compilation = with_tangent("rigid_body")
    module = solver(compilation, "numpy").backend.module
    x = np.random.default_rng(5).normal(size=(2, 4, 3))
    image, tangent = module.step_tangent(x, 0.05)
    assert tangent.shape == (2, 4, 3, 3)
    assert np.allclose(tangent[1, 2], module.step_tangent(x[1, 2], 0.05)[1], rtol=0, atol=1e-15)
    assert np.array_equal(image, module.step(x, 0.05))


@pytest.mark.parametrize("target", TARGETS)
def test_a_step_that_fails_raises(target):
    integrator = solver(with_tangent("rigid_body"), target)
    with pytest.raises(StepError):
        integrator.step_tangent([1e3, 2e3, -1e3], 50.0)


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", TARGETS)
def test_plain_code_has_none_and_says_how_to_get_it(target):
    plain = compiled("rigid_body")
    assert all("tangent" not in text for text in files(plain, target).values())
    with pytest.raises(TypeError, match="tangent=True"):
        solver(plain, target).step_tangent([1, 1, 1], 0.1)
    assert compile(plain, target, tangent=True).step_tangent([1, 1, 1], 0.1)[1].shape == (3, 3)


def test_code_without_extras_is_the_same_whatever_was_compiled_before():
    with_tangent("rigid_body")
    again = compile_spec(plain(spec.loads(f"phigen: 1\nname: t\n{BODY}order: 4\n")))
    asked = text_with_tangent(f"{BODY}order: 4\n")
    assert asked.program.step.linearise == again.program.step.linearise


@pytest.mark.thin(2)
@pytest.mark.parametrize("compiler", slow_but(["clang"], ["gcc", "clang"]))
@pytest.mark.parametrize("name", [*KINDS, "toda3_quadratic", "ablowitz_ladik3"])
def test_generated_c_has_no_warnings(name, compiler, tmp_path):
    write(tmp_path, files(with_tangent(name), "c"))
    run([tool(compiler), "-std=c99", *WARNINGS, "-fsyntax-only", f"{name}.c"], tmp_path)


def test_splittings_that_turn_an_attitude_have_tangents_too():
    """The derivative is that of the same steps without an attitude."""
    text = f"{BODY}profile: small\nscheme: splitting\norder: 4\ncomposition: suzuki\n"
    tangent_maps = [
        solver(text_with_tangent(text + more), "c").step_tangent([0.4, 0.9, 0.3], 0.1)
        for more in ("", "reconstruct: quaternion\n")
    ]
    assert np.array_equal(tangent_maps[0][1], tangent_maps[1][1])
