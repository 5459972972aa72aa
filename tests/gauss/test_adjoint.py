"""Gradients through Gauss steps, compared with finite differences and with tangent maps, in all targets and
profiles.
"""

import ctypes
from functools import cache

import numpy as np
import pytest
from support import SCALED, RawC, first_run, small, solver, spec_of

from phigen import spec
from phigen.compiler import compile_spec
from phigen.runtime import c_solver

TOP = """coordinates: [P1, P2, P3, G1, G2, G3]
parameters: {a: 1.2, b: 0.8, c: 0.7, unused: 3}
poisson: {lie_algebra: {name: se(3), sign: minus}}
hamiltonian: (P1**2*a + P2**2*b + P3**2)/2 + c*G1 + sin(b*G2)
"""
MIXED = """coordinates: [x, y, z, q, p]
parameters: {a: 1.1, s: 1.3}
poisson: {brackets: {x: {y: s*z, z: -s*y}, y: {z: s*x}, q: {p: 1}}}
hamiltonian: x**2/2 + a*y**2/3 + z**2/5 + p**2/2 + q**2/2 + cos(q)*x + sin(a*q)*y*z/4
"""
DRIVEN = """coordinates: [q, p]
time: t
parameters: {g: 1.3, w: 1.7, d: 0.2}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - g*cos(q)*(1 + cos(w*t)/5)
forces: {vector: {p: -d*p*sin(t)}, covector: {p: -d*q*p/9}}
"""
SPECIES = """coordinates: [x, y, z]
parameters: {r: {value: 1.1, positive: true}, k: 0.6}
poisson: {brackets: {x: {y: k*x*y, z: -x*z}, y: {z: y*z}}}
hamiltonian: r*x + y + z + k*log(x)
structure: to truncation
"""
MONITORED = """coordinates: [x, y, u, v]
parameters: {k: 1.1, b: 0.2}
poisson: {canonical: {q: [x, y], p: [u, v]}}
hamiltonian: (u**2 + v**2)/2 - k/sqrt(x**2 + y**2)
monitor: (x**2 + (1 + b)*y**2)**(3/4)
"""
#: Spec, order and start by name: a momentum map, one with parameters in its coefficients, direct products of algebras,
#: time and forces, logarithms; then a step that is a Poisson map only up to its truncation error, and a monitor.
KINDS = {
    "top": (TOP, 16, [0.9, 0.5, 0.8, 0.6, 0.1, 0.8]),
    "mixed": (MIXED, 4, [0.4, -0.8, 0.5, 0.3, 0.7]),
    "scaled": (SCALED, 6, [0.3, -0.2, 0.4]),
    "driven": (DRIVEN, 12, [0.4, 0.3]),
    "logarithms": (SPECIES.replace("structure: to truncation\n", ""), 6, [0.9, 1.2, 0.7]),
    "species": (SPECIES, 10, [0.9, 1.2, 0.7]),
    "monitored": (MONITORED, 8, [1.1, 0.2, 0.1, 0.8]),
}
H, STEPS = 0.4, 5
pytestmark = pytest.mark.few("mixed", "driven", of=KINDS)


@cache
def compilation(kind):
    text, order, _ = KINDS[kind]
    specification = spec.loads(f"phigen: 1\nname: t\n{text}scheme: gauss\ngauge: none\n")
    return compile_spec(specification.overridden(order=order, tangent=True, adjoint=True))


@cache
def method(kind, target):
    compiled = compilation(kind)
    return solver(small(compiled), "c") if target == "small" else solver(compiled, target)


def start(kind):
    return np.array(KINDS[kind][2])


def given(kind):
    """Return values of the parameters that differ from the defaults."""
    return {name: 1.07 * value for name, value in method(kind, "c").interface.parameters.items()}


def weights(shape):
    return np.random.default_rng(7).normal(size=shape)


def difference(f, width=1e-3):
    """Return the derivative of f at 0, by central differences of order 6."""
    return sum(w * (f(k * width) - f(-k * width)) for k, w in ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))) / width


@pytest.mark.thin(1)
@pytest.mark.parametrize("kind", KINDS)
def test_pullback_is_the_gradient_of_the_run(kind):
    """Pullbacks agree with central differences; every stored state has a cotangent. NumPy and the C of profile small
    agree with the fast C.
    """
    fast, x, parameters, stride = method(kind, "c"), start(kind), given(kind), 2
    bar = weights((4, len(x)))
    rows, x0_bar, by = fast.pullback(x, H, STEPS, bar, stride, parameters=parameters)

    def weighed(x, **changed):
        return np.sum(bar * fast.integrate(x, H, STEPS, stride, parameters={**parameters, **changed}).x)

    for j, unit in enumerate(np.eye(len(x))):
        assert x0_bar[j] == pytest.approx(difference(lambda e, u=unit: weighed(x + e * u)), abs=1e-9)
    for name, value in parameters.items():
        slope = difference(lambda e, n=name, v=value: weighed(x, **{n: v + e}))
        assert by[name] == pytest.approx(slope, abs=1e-9), name
    for target in ("numpy", "small"):
        again = method(kind, target).pullback(x, H, STEPS, bar, stride, parameters=parameters)
        assert again.x1 == pytest.approx(rows, abs=1e-13)
        assert again.x0_bar == pytest.approx(x0_bar, rel=0, abs=1e-13 * np.abs(x0_bar).max())
        assert list(again.parameters_bar.values()) == pytest.approx(list(by.values()), rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("target", ["c", "numpy", "small"])
# The tangent map of "monitored" holds the energy level fixed, but the pullback includes its dependence on the start.
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "monitored"])
def test_pullback_is_the_transpose_of_the_tangent_map(kind, target):
    integrator, x = method(kind, target), start(kind)
    bar, product = weights(len(x)), np.eye(len(x))
    for _, tangent in integrator.tangents(x, H, STEPS):
        product = tangent @ product
    x0_bar = integrator.pullback(x, H, STEPS, bar).x0_bar
    assert np.abs(x0_bar - bar @ product).max() <= 1e-14 * np.abs(x0_bar).max()


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_gradients_of_members_are_those_of_single_runs(target):
    """Pullbacks of an ensemble whose members have different steps, parameters and start times agree with those of
    single runs.
    """
    integrator, rng, x = method("driven", target), np.random.default_rng(2), start("driven")
    many, h, t0 = x + 0.1 * rng.normal(size=(3, 2)), H * (1 + 0.1 * rng.random(3)), rng.random(3)
    member_values = {name: value * (1 + 0.1 * rng.random(3)) for name, value in given("driven").items()}
    bar = rng.normal(size=(3, 2))
    together = integrator.pullback(many, h, STEPS, bar, t0=t0, parameters=member_values)
    for m in range(3):
        alone = integrator.pullback(
            many[m], h[m], STEPS, bar[m], t0=t0[m], parameters={name: value[m] for name, value in member_values.items()}
        )
        assert together.x0_bar[m] == pytest.approx(alone.x0_bar, rel=1e-13)
        assert [b[m] for b in together.parameters_bar.values()] == pytest.approx(
            [*alone.parameters_bar.values()], rel=1e-13
        )


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_long_runs_are_pulled_back_in_segments(target, monkeypatch):
    """A reverse pass that exceeds the memory of the tape is split into segments. The first step of a segment has no
    predictor, so results may differ by rounding only.
    """
    integrator, x, bar = method("mixed", target), start("mixed"), weights((4, 5))
    whole = integrator.pullback(x, H, 30, bar, 10)
    monkeypatch.setattr(c_solver, "MAX_TAPE_VALUES", 7 * 29)  # room for seven steps
    if target == "numpy":
        monkeypatch.setattr(integrator.backend.module, "MAX_TAPE", 7 * 22)
    part = integrator.pullback(x, H, 30, bar, 10)
    assert part.x1 == pytest.approx(whole.x1, abs=1e-13)
    assert part.x0_bar == pytest.approx(whole.x0_bar, rel=0, abs=1e-12 * np.abs(whole.x0_bar).max())


def test_transpose_of_a_step_that_fails_leaves_the_state():
    raw = RawC(compilation("driven"))
    raw.init(start("driven"))
    bar, before = np.array([1.0, 2.0]), bytes(raw.memory)
    here = ctypes.c_void_p(bar.ctypes.data)
    assert raw.call("step_adjoint", ctypes.c_int, raw.here, ctypes.c_double(5e3), here, here, None) != 0
    assert (bytes(raw.memory), bar.tolist()) == (before, [1, 2])
    assert raw.call("step_adjoint", ctypes.c_int, raw.here, ctypes.c_double(0.1), here, here, None) == 0
    assert bar.tolist() != [1, 2]


@pytest.mark.parametrize("name", ["so4_manakov", "henon_heiles"])
def test_reverse_sweeps_start_from_those_of_the_step_after(name, monkeypatch):
    """The reverse pass solves for the cotangents of the stages by fixed-point sweeps, which start from the cotangents
    of the following step. This saves a fifth of the sweeps and changes only rounding.
    """
    compilation = compile_spec(spec_of(name).overridden(order=16, scheme="gauss", adjoint=True))
    x0, h, steps = np.array([float(v) for v in first_run(compilation).initial]), 2.0 if "so4" in name else 0.5, 10
    module = solver(compilation, "numpy").backend.module
    sweeps, field, stage = [0], module._stage_field_adjoint, module._adjoint_stage

    def counted(*arguments):
        sweeps[-1] += 1
        return field(*arguments)

    monkeypatch.setattr(module, "_stage_field_adjoint", counted)
    predicted = module.pullback(x0, h, steps, np.ones(len(x0)))[1]
    sweeps.append(0)
    monkeypatch.setattr(module, "_adjoint_stage", lambda *arguments: stage(*arguments[:5], None))
    anew = module.pullback(x0, h, steps, np.ones(len(x0)))[1]
    assert sweeps[0] < 0.8 * sweeps[1]
    assert predicted == pytest.approx(anew, rel=1e-14)
    assert solver(compilation, "c").pullback(x0, h, steps, np.ones(len(x0)))[1] == pytest.approx(anew, rel=1e-13)
