"""Transposes (reverse mode) of generated steps and runs, compared with tangent maps, with arithmetic in many digits and
with differences.
"""

import ctypes
from functools import cache

import mpmath
import numpy as np
import pytest
from precise_path import PrecisePathStep
from support import RATTLEBACK, TARGETS, PreciseStep, RawC, compile_text, files, precisely, solver

from phigen import SpecError, StepError, compile, spec
from phigen.compiler import compile_spec, emit
from phigen.runtime import c_solver
from phigen.runtime import members as runs
from phigen.runtime.gradients import segments
from phigen.scheme.lowering import cost
from phigen.scheme.steps import Explicit, Newton, Path, Splitting
from phigen.splitting.ring import TIME
from phigen.symbolic.expression import symbols_of, topological

TOP = """coordinates: [x1, x2, x3]
parameters: {I1: 1, I2: 2, I3: 3, c: 1.1}
poisson: {brackets: {x1: {x2: -c*x3, x3: c*x2}, x2: {x3: -c*x1}}}
hamiltonian: (x1**2/I1 + x2**2/I2 + x3**2/I3)/2
"""
SWING = """coordinates: [q, p]
parameters: {g: 1.5, m: 0.7, w: 1.3}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/(2*m) - g*cos(q)
"""
DRIVEN = "time: t\n" + SWING.replace("g*cos(q)", "g*cos(q)*(1 + cos(w*t)/5)")
FALLING = SWING.replace("g: 1.5", "g: {value: 1.5, positive: true}").replace("cos", "exp")
#: A top whose three parts of H all depend on the time, so that flows of two parts share the coefficients of one time.
SHAKEN = "time: t\n" + TOP.replace(
    "(x1**2/I1 + x2**2/I2 + x3**2/I3)/2", "cos(t)*x1**3/I1 + sin(t)*x2**3/I2 + exp(-t)*x3**3/I3"
)
SHORT = "profile: small\n"

#: Specs of every kind of step, with time dependence, forces and monitors. Fast code makes blocks of steps where it can.
KINDS = {
    "newton": (TOP + "order: 4\ngauge: none\n", Newton),
    "newton, composed": (SWING + "order: 6\ncomposition: kahan-li\n", Newton),
    "newton, gauge": (TOP + "casimirs: {C: x1**2 + x2**2 + x3**2}\n", Newton),
    "newton, time": (DRIVEN + "order: 4\n", Newton),
    "newton, force": (TOP + "order: 2\nforces: {covector: {x1: -x2*I1/9}, vector: {x3: -x3*I2/9}}\n" + SHORT, Newton),
    "newton, monitor": (SWING + "monitor: 1/(1 + g*q**2)\norder: 4\n", Newton),
    "explicit, time": (DRIVEN + "birealisation: {kind: canonical-euler, side: q}\norder: 1\n" + SHORT, Explicit),
    "path": (TOP + "birealisation: karasev\ngauge: none\norder: 4\n", Path),
    "path, long": (TOP.replace("/2\n", "*8\n") + "birealisation: karasev\ngauge: none\norder: 2\n" + SHORT, Path),
    "path, time, composed": (DRIVEN + "birealisation: karasev\norder: 4\ncomposition: suzuki\n" + SHORT, Path),
    "splitting, time": (SHAKEN + "scheme: splitting\norder: 4\n" + SHORT, Splitting),
    "splitting, damping": (
        "coordinates: [x1, x2, x3]\nparameters: {I1: 1, I2: 2, I3: 3, c: 1.1}\npoisson: {lie_algebra: {name: so(3)}}\n"
        "hamiltonian: x1 + x3*I2/4 - I3*x2**2/9\ndamping: c/9\nscheme: splitting\norder: 4\n" + SHORT,
        Splitting,
    ),
    "kicks, time": (DRIVEN + "scheme: splitting\norder: 4\n" + SHORT, Splitting),
    "splitting, monitor": (FALLING + "monitor: log\norder: 4\n" + SHORT, Splitting),
}
pytestmark = pytest.mark.few(
    "newton",
    "newton, composed",
    "newton, gauge",
    "newton, force",
    "explicit, time",
    "path",
    "splitting, time",
    "splitting, monitor",
    of=KINDS,
)
H, STEPS = 0.11, 5


@cache
def compilation(kind):
    text, step = KINDS[kind]
    compilation = compile_spec(
        spec.loads(f"phigen: 1\nname: t\n{text}"),
        scheme="splitting" if step is Splitting else None,
        tangent=True,
        adjoint=True,
    )
    assert isinstance(compilation.program.step, step)
    return compilation


def start(kind):
    return np.array([0.4, 0.9, 0.3] if compilation(kind).program.dimension == 3 else [0.4, 0.3])


def weights(shape):
    return np.random.default_rng(7).normal(size=shape)


def difference(f, width=1e-3):
    """Return the derivative of f at 0, by central differences of order 6."""
    return sum(w * (f(k * width) - f(-k * width)) for k, w in ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))) / width


def given(integrator):
    """Return parameter values that differ from the defaults."""
    return {name: 1.07 * value for name, value in integrator.interface.parameters.items()}


@pytest.mark.thin(3)
@pytest.mark.parametrize("kind", KINDS)
def test_pullback_is_the_gradient_of_the_run(kind):
    """All rows have a cotangent. The differences hold the gauge fixed, as the gradient does; the level e of a monitor
    follows the start.
    """
    integrator, numpy, x = *(solver(compilation(kind), target) for target in ("c", "numpy")), start(kind)
    if compilation(kind).program.gauge:
        gauge = numpy.backend.module.gauge(x, **given(integrator))
        integrator, numpy = (type(s)(s.backend.with_gauge(gauge), s.interface) for s in (integrator, numpy))
    parameters, stride = given(integrator), 2
    bar = weights((4, len(x)))
    rows, x0_bar, parameters_bar = integrator.pullback(x, H, STEPS, bar, stride, parameters=parameters)
    trajectory = integrator.integrate(x, H, STEPS, stride, parameters=parameters)
    assert rows == pytest.approx(trajectory.x, abs=1e-14)

    def weighed(x, **changed):
        return np.sum(bar * integrator.integrate(x, H, STEPS, stride, parameters={**parameters, **changed}).x)

    for j, unit in enumerate(np.eye(len(x))):
        assert x0_bar[j] == pytest.approx(difference(lambda e, u=unit: weighed(x + e * u)), abs=1e-10)
    for name, value in parameters.items():
        slope = difference(lambda e, n=name, v=value: weighed(x, **{n: v + e}))
        assert parameters_bar[name] == pytest.approx(slope, abs=3e-10), name
    again = numpy.pullback(x, H, STEPS, bar, stride, parameters=parameters)
    assert again.x1 == pytest.approx(rows, abs=1e-14)
    assert again.x0_bar == pytest.approx(x0_bar, rel=1e-13)
    assert [again.parameters_bar[name] for name in parameters_bar] == pytest.approx(
        list(parameters_bar.values()), rel=1e-12
    )


@pytest.mark.parametrize("target", TARGETS)
def test_a_splitting_whose_brackets_are_all_zero_pulls_back_what_it_is_given(target):
    text = (
        "coordinates: [x, y]\nparameters: {a: 2}\npoisson: {brackets: {x: {}}}\nhamiltonian: a*x\nscheme: splitting\n"
    )
    back = solver(compile_text(text + "adjoint: true\n"), target).pullback([1, 2], H, STEPS, [3, 4])
    assert [*back.x0_bar, back.parameters_bar["a"]] == [3, 4, 0]


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("kind", [k for k in KINDS if "monitor" not in k])
def test_pullback_is_the_transpose_of_the_tangent_map(kind, target):
    integrator, x = solver(compilation(kind), target), start(kind)
    bar, product = weights(len(x)), np.eye(len(x))
    for _, tangent in integrator.tangents(x, H, STEPS):
        product = tangent @ product
    x0_bar = integrator.pullback(x, H, STEPS, bar).x0_bar
    assert np.max(np.abs(x0_bar - bar @ product)) <= 3e-15 * np.max(np.abs(x0_bar))


def test_stages_whose_paths_are_long_are_gone_back_through_one_after_the_other():
    """The reverse pass of a path starts at the point to which the next stage was traced back. The shift of this point
    to the mean of the stages must not change the gradient.
    """
    integrator, x, bar, h, steps = solver(compilation("path, long"), "c"), start("path, long"), weights(3), 0.3, 50
    product = np.eye(3)
    for _, tangent in integrator.tangents(x, h, steps):
        product = tangent @ product
    _, x0_bar, parameters_bar = integrator.pullback(x, h, steps, bar)
    assert np.max(np.abs(x0_bar - bar @ product)) <= 1e-8 * np.max(np.abs(x0_bar))
    for name, value in integrator.interface.parameters.items():
        slope = difference(
            lambda e, n=name, v=value: bar @ integrator.integrate(x, h, steps, steps, **{n: v + e}).x[-1], 1e-4
        )
        assert parameters_bar[name] == pytest.approx(slope, rel=1e-5), name


@precisely
def exact_gradient(kind, parameters, x, bar, steps):
    """Return the gradient of bar · (last state), along state and parameters, from the scheme in many digits."""
    step_of = PrecisePathStep if isinstance(compilation(kind).program.step, Path) else PreciseStep

    def end(x, **changed):
        step, state = step_of(compilation(kind), {**parameters, **changed}, H), [mpmath.mpf(v) for v in x]
        for _ in range(steps):
            state = step(state)
        return mpmath.fdot(bar, state)

    def slope(f):
        width = mpmath.mpf(10) ** -10
        return (f(width) - f(-width)) / (2 * width)

    units = np.eye(len(x), dtype=int).tolist()
    moved = [lambda e, u=u: end([mpmath.mpf(v) + e * k for v, k in zip(x, u, strict=True)]) for u in units]
    by = {name: slope(lambda e, n=name: end(x, **{n: mpmath.mpf(parameters[n]) + e})) for name in parameters}
    return [slope(f) for f in moved], by


@pytest.mark.thin(2)
@pytest.mark.parametrize("kind", ["newton", "path"])
def test_gradient_agrees_with_many_digits(kind):
    x, steps = start(kind), 3 if kind == "newton" else 1
    bar = weights(len(x))
    integrator = solver(compilation(kind), "c")
    parameters = given(integrator)
    expected, by = exact_gradient(kind, parameters, x, bar, steps)
    for target in TARGETS:
        _, x0_bar, parameters_bar = solver(compilation(kind), target).pullback(x, H, steps, bar, parameters=parameters)
        size = max(map(abs, expected))
        assert max(abs(a - b) for a, b in zip(x0_bar, expected, strict=True)) <= 1e-14 * size
        assert max(abs(parameters_bar[name] - by[name]) for name in by) <= 1e-14 * max(map(abs, by.values()))


def test_sparse_newton_matrices_are_gone_back_through_in_lanes():
    """A chain of seven species, whose Newton matrix is sparse: its zeros are not stored. The SIMD lanes are steps of
    one run, or members of an ensemble.
    """
    rows = [[(j - i) if abs(i - j) == 1 else 0 for j in range(7)] for i in range(7)]
    names = [f"x{k}" for k in range(7)]
    text = f"coordinates: [{', '.join(names)}]\nparameters: {{r: 1.1}}\npoisson: {{log_canonical: {rows}}}\n"
    text += f"hamiltonian: r*x0 + {' + '.join(names[1:])}\norder: 2\nadjoint: true\n"
    compilation = compile_spec(spec.loads(f"phigen: 1\nname: t\n{text}"))
    assert compilation.program.step.factors
    x, bar = 1 + 0.3 * np.arange(7) % 1.1, weights(7)
    ours, theirs = (solver(compilation, target).pullback(x, 0.1, 21, bar, r=1.2) for target in ("c", "numpy"))
    assert ours.x0_bar == pytest.approx(theirs.x0_bar, rel=1e-13)
    assert ours.parameters_bar["r"] == pytest.approx(theirs.parameters_bar["r"], rel=1e-12)
    members = solver(compilation, "c").pullback(np.tile(x, (3, 1)), 0.1, 21, np.tile(bar, (3, 1)), r=1.2)
    assert members.x0_bar == pytest.approx(np.tile(ours.x0_bar, (3, 1)), rel=1e-13)


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", TARGETS)
def test_long_runs_are_pulled_back_in_segments(target, monkeypatch):
    integrator = solver(compilation("newton"), target)
    x, bar = start("newton"), weights((11, 3))
    whole = integrator.pullback(x, H, 150, bar[:6], 30)
    monkeypatch.setattr(c_solver, "MAX_TAPE_VALUES", 3 * 47)  # 47 steps
    if target == "numpy":
        monkeypatch.setattr(integrator.backend.module, "MAX_TAPE", 3 * 3 * 47)
    for stride in (30, 100):
        rows = bar[:6] if stride == 30 else bar[:3]
        part = integrator.pullback(x, H, 150, rows, stride)
        assert part.x1[-1] == pytest.approx(whole.x1[-1], abs=1e-12)
        if stride == 30:
            assert np.max(np.abs(part.x0_bar - whole.x0_bar)) <= 1e-12 * np.max(np.abs(whole.x0_bar))
            for name, value in whole.parameters_bar.items():
                assert part.parameters_bar[name] == pytest.approx(value, rel=1e-11)
        else:
            monkeypatch.undo()
            again = integrator.pullback(x, H, 150, rows, stride)
            assert np.max(np.abs(part.x0_bar - again.x0_bar)) <= 1e-12 * np.max(np.abs(again.x0_bar))


@pytest.mark.parametrize(("steps", "stride", "most"), [(10, 3, 7), (10, 10, 4), (10, 3, 100), (7, 5, 2), (0, 1, 5)])
def test_segments_cover_a_run_and_its_rows(steps, stride, most):
    parts = segments(steps, stride, most)
    assert [k for s in parts for k in range(s.first, s.first + s.count)] == list(range(steps))
    assert [r for s in parts for r in s.rows] == list(range(1, 1 + -(-steps // stride)))
    assert all(s.count <= most and len(s.rows) in (0, -(-s.count // s.stride)) for s in parts)
    for s in parts:
        ends = [min((r) * stride, steps) for r in s.rows]
        assert ends == [min(s.first + (k + 1) * s.stride, s.first + s.count) for k in range(len(s.rows))]


@pytest.mark.parametrize("target", TARGETS)
def test_members_and_their_parameters_have_cotangents(target):
    integrator, x = solver(compilation("newton"), target), start("newton")
    many, bar = x + 0.1 * weights((3, 3)), weights((3, 3))
    masses = np.array([1.5, 2.0, 2.5])
    x1, x0_bar, parameters_bar = integrator.pullback(many, H, STEPS, bar, I2=masses, I3=2.0)
    each = [integrator.pullback(many[m], H, STEPS, bar[m], I2=masses[m], I3=2.0) for m in range(3)]
    assert x1 == pytest.approx(np.array([e.x1 for e in each]), abs=1e-15)
    assert x0_bar == pytest.approx(np.array([e.x0_bar for e in each]), abs=1e-14)
    assert parameters_bar["I2"] == pytest.approx(np.array([e.parameters_bar["I2"] for e in each]), abs=1e-14)
    assert parameters_bar["I3"] == pytest.approx(sum(e.parameters_bar["I3"] for e in each), abs=1e-14)
    together = integrator.pullback(many, H, STEPS, bar, I2=2.0)
    apart = [integrator.pullback(many[m], H, STEPS, bar[m], I2=2.0) for m in range(3)]
    assert together.x0_bar == pytest.approx(np.array([e.x0_bar for e in apart]), abs=1e-14)
    assert together.parameters_bar["I2"] == pytest.approx(sum(e.parameters_bar["I2"] for e in apart), abs=1e-14)


@pytest.mark.parametrize("target", TARGETS)
def test_one_start_is_that_of_all_members_and_there_may_be_none(target):
    integrator, x = solver(compilation("newton"), target), start("newton")
    bar, masses = weights((3, 3)), np.array([1.5, 2.0, 2.5])
    one, each = (integrator.pullback(begin, H, STEPS, bar, I2=masses) for begin in (x, np.tile(x, (3, 1))))
    assert all(np.array_equal(a, b) for a, b in zip(one[:2], each[:2], strict=True))
    assert np.array_equal(one.parameters_bar["I2"], each.parameters_bar["I2"])
    none = np.empty((0, 3))
    x1, x0_bar, parameters_bar = integrator.pullback(none, H, STEPS, none, I2=np.empty(0))
    assert (x1.shape, x0_bar.shape, parameters_bar["I2"].shape, parameters_bar["I3"]) == ((0, 3), (0, 3), (0,), 0)
    rows = integrator.pullback(none, H, 4, np.empty((3, 0, 3)), stride=2).x1
    assert rows.shape == (3, 0, 3)


@pytest.mark.parametrize("kind", ["newton, time", "splitting, monitor", "path, time, composed", "kicks, time"])
def test_members_are_what_each_is_alone_in_any_number_of_threads(kind, monkeypatch):
    """Members outside of SIMD lanes, with their own steps, parameters and times. Long runs are pulled back in
    segments.
    """
    integrator, rng = solver(compilation(kind), "c"), np.random.default_rng(2)
    monkeypatch.setattr(runs, "PART_GRANULARITY", 2)
    monkeypatch.setattr(runs, "_STEPS_PER_THREAD", 1)
    many, h = start(kind) + 0.1 * rng.random((5, len(start(kind)))), H * (1 + 0.1 * rng.random(5))
    member_values = {name: value * (1 + 0.1 * rng.random(5)) for name, value in integrator.interface.parameters.items()}
    t0 = rng.random(5) if integrator.interface.time else None
    bar = rng.normal(size=(4, *many.shape))
    together = integrator.pullback(many, h, STEPS, bar, 2, t0=t0, threads=1, parameters=member_values)
    shared = integrator.pullback(many, h, STEPS, bar, 2, t0=t0, threads=3, parameters=member_values)
    for m in range(5):
        mine, begin = {name: value[m] for name, value in member_values.items()}, None if t0 is None else t0[m]
        alone = integrator.pullback(many[m], h[m], STEPS, bar[:, m], 2, t0=begin, parameters=mine)
        for pulled_back in (together, shared):
            assert np.array_equal(pulled_back.x1[:, m], alone.x1)
            assert np.array_equal(pulled_back.x0_bar[m], alone.x0_bar)
            assert all(pulled_back.parameters_bar[name][m] == alone.parameters_bar[name] for name in member_values)
    monkeypatch.setattr(c_solver, "MAX_TAPE_VALUES", 1)
    cut = integrator.pullback(many, h, STEPS, bar, 2, t0=t0, threads=3, parameters=member_values)
    assert np.max(np.abs(cut.x0_bar - together.x0_bar)) <= 1e-12 * np.max(np.abs(cut.x0_bar))
    for name, bars in cut.parameters_bar.items():
        assert bars == pytest.approx(together.parameters_bar[name], rel=1e-10, abs=1e-13)


#: Cases of members in SIMD lanes: the kind of step, the factor by which the state of one member is larger, and that of
#: its step. In splittings, all lanes then use full-range functions. In other kinds of steps the lanes of this member
#: fail (functions have no values, or Newton's method or expansions fail), except in compositions.
FAR = {
    "splitting": (40, 1, True),
    "kicks": (1, 1, True),  # all members, after some steps
    "splitting, saddle": (1, 12, False),  # the inverse flows lead to another state
    "splitting, damped": (1, 1, True),  # the reverse pass uses stored states, not inverse flows
    "explicit": (1e9, 1, False),
    "newton, gauge": (1, 35, False),
    "path": (1, 15, False),
    "newton, composed": (1, 9, True),
    "newton, monitor": (1, 1, True),
}

#: Specs of the cases that are not in `KINDS`.
FURTHER = {
    "splitting": f"{TOP}order: 4\n",
    "kicks": f"{SWING}order: 6\n",
    "splitting, saddle": SWING.replace("g*cos(q)", "g*q**2/50") + "order: 4\n",
    "splitting, damped": f"{TOP}order: 2\nforces: {{vector: {{x1: -c*x1/9, x3: -I1*x3/7}}}}\n",
    "explicit": f"{SWING}birealisation: {{kind: canonical-euler, side: q}}\norder: 1\n",
}


@pytest.mark.thin(3)
@pytest.mark.parametrize("kind", FAR)
def test_members_are_pulled_back_in_lanes(kind, monkeypatch):
    """The gradient of each member is that of a run of this member alone: with cotangents of rows, parameters and steps
    of each member, and splittings in segments. A member that lanes cannot compute is computed alone, with the same
    bits. The last group is not full, and long runs are pulled back in segments.
    """
    text, scheme = FURTHER.get(kind), "splitting" if kind.startswith(("splitting", "kicks")) else None
    head = "phigen: 1\nname: t\nadjoint: true\n"
    compiled = compile_spec(spec.loads(head + text), scheme=scheme) if text else compilation(kind)
    code = files(compiled, "c")["t.c"]
    assert "t_pull_group(" in code
    assert ("t_pull_arrive(" in code) == (bool(scheme) and "damped" not in kind)
    monkeypatch.setattr(runs, "_STEPS_PER_THREAD", 1)
    integrator, rng, count, far = solver(compiled, "c"), np.random.default_rng(3), 43, 5
    first = np.array([0.4, 0.9, 0.3][: compiled.program.dimension])
    many, h = first + 0.1 * rng.random((count, len(first))), H * (1 + 0.1 * rng.random(count))
    wider, longer, in_reach = FAR[kind]
    many[far], h[far] = wider * many[far], longer * h[far]
    member_values = {
        name: value * (1 + 0.1 * rng.random(count)) for name, value in integrator.interface.parameters.items()
    }
    bar = rng.normal(size=(4, *many.shape))
    one, two = (integrator.pullback(many, h, 23, bar, 9, threads=n, parameters=member_values) for n in (1, 2))
    assert np.array_equal(one.x0_bar, two.x0_bar)
    for m in range(count):
        alone = integrator.pullback(
            many[m], h[m], 23, bar[:, m], 9, parameters={k: v[m] for k, v in member_values.items()}
        )
        near = 1e-13 * np.max(np.abs([*alone.x0_bar, *alone.parameters_bar.values()])) * (m != far or in_reach)
        assert np.max(np.abs(one.x1[:, m] - alone.x1)) <= near
        assert np.max(np.abs(one.x0_bar[m] - alone.x0_bar)) <= near
        assert max(abs(one.parameters_bar[k][m] - alone.parameters_bar[k]) for k in member_values) <= near
    monkeypatch.setattr(c_solver, "MAX_TAPE_VALUES", 7 * int(integrator.backend._c.trail_size_each()))
    cut, others = integrator.pullback(many, h, 23, bar, 9, threads=2, parameters=member_values), np.arange(count) != far
    for whole, cotangents in (
        (one.x0_bar, cut.x0_bar),
        *((one.parameters_bar[k], cut.parameters_bar[k]) for k in member_values),
    ):
        assert np.max(np.abs(whole - cotangents)[others]) <= 1e-12 * np.max(np.abs(whole[others]))
    assert cut.x1[:, others] == pytest.approx(one.x1[:, others], abs=1e-13)


def test_jacobian_has_columns_for_state_and_parameters():
    integrator, x = solver(compilation("newton"), "c"), start("newton")
    x1, by_x0, by = integrator.jacobian(x, H, I2=1.9)
    after, tangent = integrator.step_tangent(x, H, I2=1.9)
    assert np.array_equal(x1, after)
    assert np.max(np.abs(by_x0 - tangent)) <= 1e-15
    assert by["I2"] == pytest.approx(difference(lambda e: integrator.step(x, H, I2=1.9 + e)), abs=1e-11)


@pytest.mark.parametrize("target", TARGETS)
def test_a_run_of_no_steps_gives_its_cotangent_back(target):
    integrator, x = solver(compilation("newton"), target), start("newton")
    x1, x0_bar, parameters_bar = integrator.pullback(x, H, 0, [1, 2, 3])
    assert (x1.tolist(), x0_bar.tolist(), set(parameters_bar.values())) == (x.tolist(), [1, 2, 3], {0.0})


@pytest.mark.parametrize("kind", ["newton", "path", "splitting, time"])
def test_transposed_kernels_are_of_the_size_of_the_kernel(kind):
    step = compilation(kind).program.step
    kernels = step.flows if "splitting" in kind else [step.linearise] if kind == "newton" else [step.generate]
    pairs = zip(kernels, step.adjoint.steps or [step.adjoint.path.slope], strict=True)
    assert all(cost(back.roots) <= 4 * cost(kernel.roots) for kernel, back in pairs)
    assert cost(step.adjoint.prepare.roots) <= 4 * cost(step.prepare.roots)


@pytest.mark.parametrize("target", TARGETS)
def test_what_cannot_be_pulled_back_is_told(target):
    integrator, x = solver(compilation("newton"), target), start("newton")
    with pytest.raises(StepError) as failed:
        integrator.pullback(1e3 * x, 50.0, 10, x)
    assert failed.value.step == 0
    assert failed.value.members == ()  # a single state is not an ensemble
    with pytest.raises(StepError) as failed:
        integrator.pullback(np.array([x, 1e3 * x, x, x]), 0.5, 10, np.array([x, x, x, x]))
    assert failed.value.members == (1,)
    for shape in ((2,), (3, 3)):
        with pytest.raises(ValueError, match=r"cotangent must have shape \(3,\)"):
            integrator.pullback(x, H, 2, np.ones(shape))
    with pytest.raises(ValueError, match="finite"):
        integrator.pullback(x, H, 2, [1, np.nan, 1])
    for bar, why in ((x + 1j, "real"), (["1", "2", "3"], "array of numbers"), ([[1, 2], 3, 4], "array of numbers")):
        with pytest.raises(TypeError, match=f"cotangent must be.*{why}"):
            integrator.pullback(x, H, 2, bar)
    with pytest.raises(TypeError, match="'I2' must be one number"):
        integrator.jacobian(x, H, 2, I2=[1.0])
    with pytest.raises(ValueError, match=r"'I2' must have shape \(1,\)"):
        integrator.pullback([x], H, 2, [x], I2=[1, 2])
    with pytest.raises(TypeError, match="unknown parameter"):
        integrator.pullback(x, H, 2, x, I4=1)
    with pytest.raises(TypeError, match="adjoint=True"):
        compile("rigid_body", target=target).pullback(x, H, 2, x)


def test_c_failure_leaves_state_and_cotangents():
    raw = RawC(compilation("newton"))
    raw.init(start("newton"))
    bar, more, before = np.array([1.0, 2.0, 3.0]), np.full(4, 7.0), bytes(raw.memory)
    here, into = ctypes.c_void_p(bar.ctypes.data), ctypes.c_void_p(more.ctypes.data)
    assert raw.call("step_adjoint", ctypes.c_int, raw.here, ctypes.c_double(5e3), here, here, into) != 0
    assert (bytes(raw.memory), bar.tolist(), more.tolist()) == (before, [1, 2, 3], [7] * 4)
    assert raw.call("step_adjoint", ctypes.c_int, raw.here, ctypes.c_double(0.1), here, None, into) == 4
    assert raw.call("step_adjoint", ctypes.c_int, raw.here, ctypes.c_double(0.1), here, here, into) == 0
    unchanged = bar.copy()
    raw.init(start("newton"))
    bar[:] = [1, 2, 3]
    assert raw.call("step_adjoint", ctypes.c_int, raw.here, ctypes.c_double(0.1), here, here, None) == 0
    assert np.array_equal(bar, unchanged)
    assert (more != 7.0).all()


def test_adjoint_is_refused_where_it_is_not_offered():
    with pytest.raises(SpecError, match="not offered in JavaScript"):
        emit(compilation("newton").program, "js", "phigen build")
    plain = compile_spec(compilation("newton").spec.written)
    assert all("adjoint" not in text for target in TARGETS for text in files(plain, target).values())


def test_transposes_of_flows_compute_nothing_that_is_known_or_unused():
    """The cosine of a rotation is computed from 1 − cos. A time that does not depend on parameters gets no
    cotangent.
    """
    head = "phigen: 1\nname: t\nscheme: splitting\nadjoint: true\n"
    turned = compile_spec(spec.loads(head + TOP)).program.step.adjoint.steps
    used = [{e.op for e in topological(kernel.roots)} for kernel in turned]
    assert all({"sin", "versin"} <= ops and "cos" not in ops for ops in used)
    step = compile_spec(spec.loads(head + SWING.replace("(2*m)", "2"))).program.step
    alone = [set(symbols_of(e)) == {TIME} for e in step.prepare.outputs[0].values]
    assert any(alone)
    zero_outputs = [[kernel.outputs[1].values[c].is_zero for kernel in step.adjoint.steps] for c in range(len(alone))]
    assert [all(unused) for unused in zero_outputs] == alone


def test_c_defines_functions_of_flows_only_where_flows_call_them():
    damped = f"phigen: 1\nname: t\nscheme: splitting\nadjoint: true\n{SWING}{SHORT}forces: {{vector: {{p: -w*p}}}}\n"
    text = files(compile_spec(spec.loads(damped)), "c")["t.c"]
    assert "] = expm1(" in text  # a coefficient
    assert "t_expm1" not in text


def test_steps_that_forget_what_was_before_are_pulled_back_too():
    """A step whose predictor fails is repeated without it. The history of the predictor is then shorter than the number
    of steps.
    """
    both = {"tangent": True, "adjoint": True}
    integrator = solver(compile_spec(spec.loads(f"phigen: 1\nname: t\n{RATTLEBACK}"), **both), "c")
    x, steps, bar, product = np.array([0.01, 0.5, -1]), 20, weights(3), np.eye(3)
    for _, tangent in integrator.tangents(x, 0.4, steps):
        product = tangent @ product
    x0_bar = integrator.pullback(x, 0.4, steps, bar).x0_bar
    assert np.max(np.abs(x0_bar - bar @ product)) <= 1e-12 * np.max(np.abs(x0_bar))


@pytest.mark.parametrize("composition", ["blanes-moan", "blanes-moan-rkn"])
@pytest.mark.parametrize("kick", ["sin(q)", "-cos(q)"])
def test_batches_define_functions_that_only_transposes_call(kick, composition):
    """A kick by H = sin(q) calls cos, and its transpose calls sin."""
    text = f"hamiltonian: p**2/2 + a*{kick}\nparameters: {{a: {{value: 1.3}}}}\nscheme: splitting\norder: 4\n"
    pair = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nadjoint: true\n"
    solve = solver(compile_text(f"{pair}{text}composition: {composition}\n"), "c")
    random = np.random.default_rng(3)
    start, bars, along = (random.normal(size=(20, 2)) for _ in range(3))
    slopes = solve.pullback(start, 0.1, 6, bars).x0_bar
    ahead, behind = (solve.ensemble(start + sign * 1e-5 * along, 0.1, 6) for sign in (1, -1))
    by_differences = np.sum(bars * (ahead - behind), axis=1) / 2e-5
    np.testing.assert_allclose(np.sum(slopes * along, axis=1), by_differences, rtol=1e-8, atol=1e-8)


def test_gradients_of_casimirs_along_paths_are_those_at_the_start_in_single_precision():
    """In these gradients, the cotangents of p and of the coefficient ``a`` vanish, because their terms cancel."""
    bracket = '{x: {y: "a*z**2", z: "-a*y"}, y: {z: "a*x*(1 + x)"}}'
    text = f"coordinates: [x, y, z]\nparameters: {{a: 1}}\npoisson: {{brackets: {bracket}}}\norder: 2\nadjoint: true\n"
    text += "hamiltonian: x**2/2 + y**2 + 3*z**2/2 + x*y\nbirealisation: karasev\nreal: float\n" + SHORT
    single = compile(spec.loads(f"phigen: 1\nname: cubic\n{text}"))
    start = np.array([0.3, 0.1, 0.15])
    end = single.integrate(start, 0.01, 10, 10).x[-1]
    pulled = single.pullback(start, 0.01, 10, [end[0] + end[0] ** 2, end[1], end[2] ** 2])
    np.testing.assert_allclose(pulled.x0_bar, [0.3 + 0.3**2, 0.1, 0.15**2], rtol=0, atol=1e-6)
    assert abs(float(pulled.parameters_bar["a"])) < 1e-6
