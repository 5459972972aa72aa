"""Failures are reported and leave earlier files unchanged; members and copies are independent."""

import copy
import ctypes
from dataclasses import replace
from functools import cache
from itertools import product

import mpmath
import numpy as np
import pytest
from support import (
    BODY,
    NAMES,
    SPECIES,
    TARGETS,
    PreciseStep,
    RawC,
    compile_text,
    compiled,
    described,
    setting,
    slow_but,
    solver,
)  # fmt: skip

from phigen import spec
from phigen.compiler import compile_spec
from phigen.errors import ParameterError, StepError
from phigen.scheme.policies import PathPolicy
from phigen.scheme.steps import Explicit, Newton, Path, Splitting

pytestmark = [pytest.mark.usefixtures("as_users_compile"), pytest.mark.corpus]

STATUSES = {"OK": 0, "NO_CONVERGENCE": 1, "SINGULAR": 2, "NOT_FINITE": 3, "BAD_ARGUMENT": 4}
PAIR = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\norder: 2\n"

#: For each status of a failing step: Hamiltonian, state and step size.
FAILURES = {
    # The Newton matrix is diag(1 − h/2, 1 + h/2).
    "SINGULAR": ("p*q", [1.0, 1.0], 2.0),
    # q = y − h/2 (y² + 1) has no real solution y.
    "NO_CONVERGENCE": ("p*q**2 + p", [3.0, 1.0], 1.0),
    "NOT_FINITE": ("p**2/2 + sqrt(q)", [-1.0, 0.0], 0.1),
}


def bits(x):
    """Return the bytes of an array, by which −0 differs from 0 and NaN is equal to NaN."""
    return np.ascontiguousarray(x).tobytes()


@pytest.mark.thin(3)
@pytest.mark.parametrize("status", FAILURES)
@pytest.mark.parametrize("target", TARGETS)
def test_a_step_that_cannot_be_made_says_why(status, target):
    hamiltonian, x0, h = FAILURES[status]
    solve = solver(compile_text(f"{PAIR}hamiltonian: {hamiltonian}\n"), target)
    with pytest.raises(StepError) as caught:
        solve.step(x0, h)
    assert caught.value.status == status


@pytest.mark.parametrize("status", FAILURES)
def test_a_failed_step_leaves_the_state(status):
    hamiltonian, x0, h = FAILURES[status]
    raw = RawC(compile_text(f"{PAIR}hamiltonian: {hamiltonian}\n"))
    raw.init(x0)
    before = raw.x.copy(), raw.carry.copy()
    assert raw.step(h) == STATUSES[status]
    assert bits(raw.x) == bits(before[0])
    assert bits(raw.carry) == bits(before[1])
    assert raw.counters[0] == 0


def test_a_sum_that_overflows_leaves_the_state():
    """The sum of the momentum overflows and that of the position does not; neither changes."""
    text = PAIR.replace("order: 2", "order: 1") + "birealisation: canonical-euler\nhamiltonian: p**2/2 + exp(q)\n"
    compilation = compile_text(text)
    assert isinstance(compilation.program.step, Explicit)
    for start in ([800.0, 1.0], [1e308, 1e308]):
        raw = RawC(compilation)
        raw.init(start)
        assert raw.step(0.5) == STATUSES["NOT_FINITE"]
        assert raw.x.tolist() == start
        assert raw.carry.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("factor", [0.3, 0.7, 1.7])
@pytest.mark.parametrize("name", [n for n in NAMES if not described(n)[2].path])
def test_no_step_of_a_long_run_stalls(name, factor):
    """Coordinates pass through zero, where rounding errors are large relative to them; the inner solve must end
    nevertheless.
    """
    compilation = compiled(name)
    run = list(compilation.spec.runs)[-1]
    at, raw = setting(compilation, run), RawC(compilation)
    raw.init(at.x, at.parameters)
    steps = {"lotka_volterra": 10_000, "spin_chain5": 5_000}.get(name, 20_000)
    assert raw.integrate(factor * at.h, steps) == 0


@pytest.mark.parametrize("target", TARGETS)
def test_a_step_to_a_coordinate_near_zero_does_not_stall(target):
    """The solution has y_3 = 2.7e-8; corrections relative to it never fall below their rounding error, 1e-11."""
    start = [-1.017117076849337, 0.9827338521080663, 0.0001490710425976643]
    end = solver(compiled("poisson_not_hamiltonian"), target).step(start, 0.035)
    assert np.max(np.abs(end - start)) < 0.1


@pytest.mark.parametrize("factor", [10.0, 1e3, 1e8, -1e5, 1e200])
@pytest.mark.parametrize("name", NAMES)
def test_after_a_step_that_was_too_large_the_run_goes_on(name, factor):
    """The steps after a failed step are those of a run without it, to round-off."""
    compilation = compiled(name)
    at, raw, other = setting(compilation), RawC(compilation), RawC(compilation)
    for solve in (raw, other):
        solve.init(at.x, at.parameters)
        assert solve.integrate(at.h, 10) == 0
    before, steps = raw.x.copy(), int(raw.counters[0])
    status = raw.step(factor * at.h)
    assert status in (0, 1, 2, 3)
    assert np.isfinite(raw.x).all()
    if status:
        assert bits(raw.x) == bits(before)
        assert raw.counters[0] == steps
        assert raw.integrate(at.h, 10) == other.integrate(at.h, 10) == 0
        np.testing.assert_allclose(raw.x, other.x, rtol=0, atol=1e-13 * np.max(np.abs(before)))


def test_a_hopeless_path_ends_early(monkeypatch):
    """The inner solve of a step that is a thousand times too long abandons paths early; C once followed 68 long
    paths.
    """
    compilation = compiled("nambu_pendulum")
    raw, module = RawC(compilation), solver(compilation, "numpy").backend.module
    raw.init([0.6, 0.1, 0.7])
    assert raw.step(709.0) == STATUSES["NO_CONVERGENCE"]
    assert raw.counters[1] <= 20
    follow, pieces = module._piece, []
    monkeypatch.setattr(module, "_piece", lambda *arguments: pieces.append(1) or follow(*arguments))
    with pytest.raises(module.StepError, match="NO_CONVERGENCE"):
        module.step([1.7, 0.6, -0.5], 709.0)
    assert len(pieces) <= PathPolicy().most_pieces + 4 * 2 * PathPolicy().longest_path


def test_a_path_of_numpy_costs_and_is_the_same_whatever_the_others_are(monkeypatch):
    """In NumPy, paths that have ended or failed are followed no further; the other members have the same bits
    as alone.
    """
    module = solver(compiled("nambu_pendulum"), "numpy").backend.module
    x, p = np.tile([0.6, 0.1, 0.7], (4, 1)), np.outer([0.1, 40.0, 1e9, 0.3], [1.0, 0.8, -0.5])
    rows, follow = [], module._piece
    monkeypatch.setattr(module, "_piece", lambda coef, p, x: rows.append(len(x)) or follow(coef, p, x))
    coef = np.zeros((1, 1))
    together = module._path(coef, x, p)
    assert sum(rows) == together[2].sum()
    alone = [module._path(coef, x[m : m + 1], p[m : m + 1]) for m in range(4)]
    for whole, parts in zip(together, zip(*alone, strict=True), strict=True):
        assert bits(whole) == bits(np.concatenate(parts))
    assert together[2].tolist()[0] == 1
    assert together[2][1] > 1
    assert np.isnan(together[0][2]).all()


def test_differences_of_numpy_end_where_no_path_is_left(monkeypatch):
    module, calls = solver(compiled("nambu_pendulum"), "numpy").backend.module, []
    lost = np.full((2, 3), np.nan), np.full((2, 3), np.nan), np.array([8, 8])
    monkeypatch.setattr(module, "_path", lambda *arguments: calls.append(1) or lost)
    jacobian, succeeded = module._differences(np.zeros((99, 1)), np.ones((2, 3)), np.ones((2, 3)), np.ones((2, 3)))
    assert (len(calls), succeeded.tolist()) == (1, [8, 8])
    assert np.isnan(jacobian).any(axis=(1, 2)).all()


@pytest.mark.parametrize("name", ["newton", "path"])
def test_numpy_tries_again_only_where_a_guess_may_have_misled(name, monkeypatch):
    """A member at rest has no predictor, so a repeated solve would start from the same values; the other members must
    not be solved twice because of it.
    """
    module, tried = solver(kind(name), "numpy").backend.module, []

    def fail(stage, x, carry, guess):
        tried.append(x.tolist())
        return x.copy(), carry, guess, np.full(len(x), "NO_CONVERGENCE", dtype=object)

    monkeypatch.setattr(module, "_solved", fail)
    moving, still = [0.1, 0.2, 0.3], [0.0, 0.0, 0.0]
    x, offsets = np.array([moving, still]), np.array([moving, still])
    _, _, memory, status = module._advance((np.zeros((9, 1)), {}, 0.1), x, np.zeros_like(x), (offsets, offsets))
    assert tried == [[moving, still], [moving]]
    assert (status == "NO_CONVERGENCE").all()
    assert memory[1].tolist() == [moving, still]


@pytest.mark.parametrize(
    "changes", [{"h": 10**400}, {"h": [0.1, 0.2]}, {"h": np.nan}, {"m": 10**400}, {"x0": [10**400, 1]}]
)
def test_generated_numpy_refuses_numbers_that_are_none(changes):
    module = solver(kind("explicit"), "numpy").backend.module
    with pytest.raises(ValueError, match=r"finite|too large|broadcast"):
        module.integrate(**{"x0": [0.3, 0.4], "h": 0.1, "steps": 0, **changes})


def test_errors_of_generated_numpy_can_be_copied():
    """Pools of processes copy exceptions by pickle."""
    module = solver(kind("explicit"), "numpy").backend.module
    with pytest.raises(module.StepError) as caught:
        module.integrate([[0.3, 0.4], [1e300, 0.4]], 0.1, 3)
    error, twin = caught.value, copy.copy(caught.value)
    assert (str(twin), twin.step, twin.status, twin.members) == (str(error), 0, "NOT_FINITE", (1,))


# -- parameters for which no step exists

POLE = "parameters: {m: {value: 2, description: a mass}, k: {value: 1, positive: true}}\n"
PAIR_WITH_MASS = PAIR.replace("order: 2", "hamiltonian: p**2/(2*m) + k*q**4/4")
BODY_WITH_MASS = BODY.replace("x1**2/2", "k*x1**2/m")

#: One spec for each kind of step: coefficients are infinite for m = 0, and steps need k > 0.
KINDS = {
    "newton": f"{POLE}{BODY_WITH_MASS}order: 4\n",
    "gauged": f"{POLE}{BODY_WITH_MASS}order: 4\ncasimirs: {{C: x1**2 + x2**2 + x3**2}}\n",
    "explicit": f"{POLE}{PAIR_WITH_MASS}birealisation: canonical-euler\norder: 1\n",
    "path": f"{POLE}{BODY_WITH_MASS}order: 2\nbirealisation: karasev\n",
    "splitting": f"{POLE}{PAIR_WITH_MASS}scheme: splitting\norder: 4\n",
}
STEPS = {"newton": Newton, "gauged": Newton, "explicit": Explicit, "path": Path, "splitting": Splitting}


@cache
def kind(name):
    """Compile a kind of step with its tangent map, and with an automatic gauge if there is one."""
    specification = spec.loads(f"phigen: 1\nname: t\n{KINDS[name]}")
    compilation = compile_spec(
        specification if name == "gauged" else replace(specification, gauge="none"), tangent=True
    )
    assert isinstance(compilation.program.step, STEPS[name])
    assert bool(compilation.program.gauge) == (name == "gauged")
    return compilation


REFUSED = ({"m": 0.0}, {"m": np.nan}, {"k": np.inf}, {"k": 0.0}, {"k": -1.0})


@pytest.mark.thin(3)
@pytest.mark.parametrize("name", KINDS)
def test_parameters_that_give_no_steps_are_refused_from_the_start(name):
    """A refused start leaves the solver unchanged, and the next start succeeds as usual."""
    compilation = kind(name)
    x0, raw = [0.3, 0.4, 0.5][: compilation.program.dimension], RawC(compilation)
    assert raw.init(x0) == STATUSES["OK"]
    before = bits(raw.memory)
    for changes in REFUSED:
        assert raw.init(x0, {"m": 2.0, "k": 1.0, **changes}) == STATUSES["BAD_ARGUMENT"]
        assert bits(raw.memory) == before
    assert raw.integrate(0.01, 20) == STATUSES["OK"]


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("target", TARGETS)
def test_parameters_that_give_no_steps_are_told_in_python(name, target):
    solve = solver(kind(name), target)
    x0 = [0.3, 0.4, 0.5][: len(solve.coordinates)]
    calls = [
        lambda **p: solve.integrate(x0, 0.1, 0, **p),
        lambda **p: solve.step(x0, 0.1, **p),
        lambda **p: solve.step_tangent(x0, 0.1, **p),
        lambda **p: solve.ensemble([x0] * 9, 0.1, 3, **p),
        lambda **p: solve.ensemble(np.empty((0, len(x0))), 0.1, 3, **p),
    ]
    for call in calls:
        with pytest.raises(
            ParameterError, match=r"m = 0\.0, .* a coefficient computed from parameters alone is not finite"
        ):
            call(m=0)
        call(m=1)
    assert not np.isfinite(solve.hamiltonian(x0, m=0.0))
    assert not np.isfinite(solve.vector_field(x0, m=0.0)).all()
    if target == "numpy":
        for changes in REFUSED:
            with pytest.raises(ValueError, match="no step can be made with the parameters"):
                solve.backend.module.integrate(x0, 0.1, 0, **changes)


def test_a_gauge_and_its_solver_may_be_arguments_of_their_own_start():
    raw, size = RawC(kind("gauged")), ctypes.sizeof(ctypes.c_double)
    x0, after = [0.3, 0.4, 0.5], 2 * 3 * size + raw.counters.nbytes + 2 * size  # behind x, carry, the counters, t, h
    assert raw.init(x0) == STATUSES["OK"]
    gauge = raw.memory[after + 2 * size :][:size].view(np.float64)
    gauge[0] = 0.25
    params, x, multiples = (raw.memory.ctypes.data + offset for offset in (after, 0, after + 2 * size))
    arguments = [ctypes.c_void_p(p) for p in (params, x, multiples)]
    assert raw.call("init_gauge", ctypes.c_int, raw.here, *arguments) == STATUSES["OK"]
    assert gauge[0] == 0.25
    assert raw.x.tolist() == x0
    assert raw.memory[after:][: 2 * size].view(np.float64).tolist() == [2.0, 1.0]


# -- changing the step size, copying the solver


@pytest.mark.parametrize("name", ["rigid_body", "lotka_volterra", "kepler", "pendulum_euler"])
def test_the_step_size_may_change_at_every_step(name):
    compilation = compiled(name)
    at, raw = setting(compilation), RawC(compilation)
    raw.init(at.x, at.parameters)
    for factor in (1.0, 1.0, 0.5, -0.25, 1.0, 2.0):
        h, before = factor * at.h, raw.exact_state()
        assert raw.step(h) == 0
        exact = PreciseStep(compilation, at.parameters, h)(before)
        with mpmath.workdps(40):
            error = max(abs(u - v) for u, v in zip(raw.exact_state(), exact, strict=True))
        assert error <= 1e-16 * np.max(np.abs(raw.x))


@pytest.mark.parametrize("name", NAMES)
def test_a_copy_of_the_solver_is_a_branch(name):
    compilation = compiled(name)
    at, raw = setting(compilation), RawC(compilation)
    raw.init(at.x, at.parameters)
    assert raw.integrate(at.h, 7) == 0
    memory = raw.memory.copy()
    assert raw.integrate(at.h, 5) == 0
    end = bits(raw.x)
    raw.memory[:] = memory
    assert raw.integrate(at.h, 5) == 0
    assert bits(raw.x) == end
    raw.memory[:] = memory
    assert raw.integrate(-at.h, 5) == 0
    assert bits(raw.x) != end


@pytest.mark.parametrize("name", NAMES)
def test_missing_parameters_are_the_defaults(name):
    compilation = compiled(name)
    at, defaults = setting(compilation), {p.name: float(p.value) for p in compilation.spec.parameters}
    ends = []
    for parameters in (None, defaults):
        raw = RawC(compilation)
        assert raw.init(at.x, parameters) == 0
        assert raw.integrate(at.h, 3) == 0
        ends.append(bits(raw.x))
    assert ends[0] == ends[1]


# -- ensembles


def members_of(name, count):
    """Return states near the start of the first run."""
    at = setting(compiled(name))
    return np.array([[v * (1 + 0.003 * k) + 0.001 * k for v in at.x] for k in range(count)]), at


#: Cases of the quick tests; in NumPy one system for each driver, which advances all members at once.
QUICK_MEMBERS = [*product(["c"], NAMES), *product(["numpy"], ["rigid_body", "pendulum_euler", "nambu_pendulum"])]


@pytest.mark.thin(1)
@pytest.mark.parametrize(("target", "name"), slow_but(QUICK_MEMBERS, product(TARGETS, NAMES)))
def test_members_of_an_ensemble_are_trajectories(name, target):
    start, at = members_of(name, 5)
    compilation, steps = compiled(name), 5 if isinstance(compiled(name).program.step, Path) else 20
    solve = solver(compilation, target)
    together = solve.ensemble(start, at.h, steps, parameters=at.parameters)
    for x0, end in zip(start, together, strict=True):
        alone = solve.integrate(x0, at.h, steps, stride=steps, parameters=at.parameters).x[-1]
        np.testing.assert_allclose(end, alone, rtol=0, atol=2e-15 * np.max(np.abs(alone)))


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", TARGETS)
def test_failing_members_keep_their_last_good_state(target):
    """One member reaches the singularity of its solution, the others do not."""
    compilation = compile_text(SPECIES + "order: 2\n")
    start = np.array([[0.3, 0.9, 0.6], [-3.0, 5.0, 0.001], [0.5, 0.2, 0.1]])
    with pytest.raises(StepError) as single:
        solver(compilation, target).integrate(start[1], 1e-3, 400, stride=400)
    assert single.value.status in ("NO_CONVERGENCE", "SINGULAR", "NOT_FINITE")
    last = single.value.trajectory.x[-1]
    assert 100 < single.value.step < 260
    with pytest.raises(StepError) as many:
        solver(compilation, target).ensemble(start, 1e-3, 400)
    assert many.value.members == (1,)
    assert many.value.status == single.value.status
    states = many.value.trajectory
    np.testing.assert_allclose(states[1], last, rtol=1e-9)  # near the singularity round-off grows
    for k in (0, 2):
        alone = solver(compilation, target).integrate(start[k], 1e-3, 400, stride=400).x[-1]
        np.testing.assert_allclose(states[k], alone, rtol=1e-13)


def test_status_of_each_member_is_reported():
    compilation = compile_text(SPECIES + "order: 2\n")
    raw, members = RawC(compilation), 4
    x = np.array([[0.3, -3.0, 0.5, np.nan], [0.9, 5.0, 0.2, 1.0], [0.6, 0.001, 0.1, 1.0]])
    status = np.full(members, 99, dtype=np.uint8)
    pointers = [ctypes.c_void_p(a.ctypes.data) for a in (x, status)]
    numbers = ctypes.c_size_t(members), ctypes.c_double(1e-3), ctypes.c_size_t(400)
    overall = raw.call("ensemble", ctypes.c_int, None, pointers[0], *numbers, pointers[1])
    assert status[0] == status[2] == STATUSES["OK"]
    assert status[1] in (1, 2, 3)
    assert status[3] == STATUSES["BAD_ARGUMENT"]
    assert overall == status[1]
    assert np.isfinite(x[:, :3]).all()
