"""The scheme is a Poisson map, and the generated code of both targets computes the scheme."""

import json
from pathlib import Path

import mpmath
import numpy as np
import pytest
from support import (
    BODY,
    NAMES,
    QUICK,
    RUNS,
    PreciseStep,
    RawC,
    compile_text,
    compiled,
    described,
    setting,
    slow_but,
    solver,
    tangent_by_differences,
    values,
)

from phigen.symbolic.symbols import ELAPSED

pytestmark = [pytest.mark.usefixtures("as_users_compile"), pytest.mark.corpus]

REFERENCES = json.loads(Path(__file__).parents[1].joinpath("references.json").read_text(encoding="utf-8"))["references"]
EPSILON = 2.0**-52

#: Systems whose α and β are formulas; tests/paths has those that are computed by following a path.
IN_CLOSED_FORM = [name for name in NAMES if not described(name)[2].path]


def state_after(compilation, at, steps):
    """Return the state of the C solver after some steps."""
    raw = RawC(compilation)
    raw.init(at.x, at.parameters)
    assert raw.integrate(at.h, steps) == 0
    return [mpmath.mpf(v) for v in raw.x.tolist()]


# -- the scheme


@pytest.mark.parametrize("name", IN_CLOSED_FORM)
def test_scheme_is_a_poisson_map(name):
    """Check DΦ π DΦᵀ = π∘Φ to 1e-12 with an exact tangent map, at the start of a run and later."""
    compilation = compiled(name)
    at = setting(compilation)
    step = PreciseStep(compilation, at.parameters, at.h)
    assert step.defect(at.x) <= 1e-12
    assert step.defect(state_after(compilation, at, 100)) <= 1e-12


@pytest.mark.parametrize("name", IN_CLOSED_FORM)
def test_scheme_is_a_poisson_map_for_steps_that_are_not_small(name):
    """The defect is due to rounding for all step sizes: the map is exactly Poisson, not to some order."""
    compilation = compiled(name)
    at = setting(compilation)
    assert PreciseStep(compilation, at.parameters, 4 * at.h).defect(at.x) <= 1e-12


def test_tangent_map_is_the_derivative_of_the_step():
    """Compare implicit differentiation with differences in many digits."""
    compilation = compiled("rigid_body")
    at = setting(compilation)
    step = PreciseStep(compilation, at.parameters, 0.3)
    with mpmath.workdps(50):
        difference = step.tangent(at.x)[1] - tangent_by_differences(step, at.x)
        assert mpmath.norm(difference, mpmath.inf) < 1e-25


# -- the generated code is the scheme


@pytest.mark.parametrize(("name", "run"), [(name, run) for name, run in RUNS if name in IN_CLOSED_FORM])
def test_generated_steps_are_those_of_the_scheme_to_round_off(name, run):
    """Compare the exact sums of state and compensation term before and after a step. Some steps are made first, so that
    the predictor extrapolates.
    """
    compilation = compiled(name)
    at = setting(compilation, run)
    step, raw = PreciseStep(compilation, at.parameters, at.h), RawC(compilation)
    assert raw.init(at.x, at.parameters) == 0
    for steps in (0, 1, 30, 500):
        assert raw.integrate(at.h, steps) == 0
        before = raw.exact_state()
        assert raw.step(at.h) == 0
        with mpmath.workdps(50):
            pairs = list(zip(raw.exact_state(), step(before), before, strict=True))
            error = max(abs(computed - exact) for computed, exact, _ in pairs)
            increment = max(abs(exact - start) for _, exact, start in pairs)
            size = max(abs(start) for *_, start in pairs)
        # Only the increment is rounded, not the state; the α and β of a user may have cancellation.
        bound = 8 * EPSILON * size if compilation.realisation.kind == "custom" else 16 * EPSILON * increment
        assert error <= bound + 1e-18 * size + 4e-324, f"after {steps} steps"


@pytest.mark.thin(2)
@pytest.mark.parametrize("order", slow_but([2, 8], [2, 6, 8]))
def test_generated_steps_of_high_order_are_those_of_the_scheme(order):
    compilation = compile_text(BODY + f"order: {order}\n")
    step, raw = PreciseStep(compilation, {}, 0.25), RawC(compilation)
    raw.init([0.7, -1.1, 0.4])
    for _ in range(5):
        before = raw.exact_state()
        assert raw.step(0.25) == 0
        with mpmath.workdps(50):
            error = max(abs(u - v) for u, v in zip(raw.exact_state(), step(before), strict=True))
        assert error <= 1e-16


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", NAMES)
def test_c_and_numpy_agree(name):
    """They agree to 1e-13 over 100 steps; for paths, which are slow in NumPy, over 20."""
    compilation = compiled(name)
    at, steps = setting(compilation), 100 if name in IN_CLOSED_FORM else 20
    ends = [
        solver(compilation, target).integrate(at.x, at.h, steps, stride=steps, parameters=at.parameters).x[-1]
        for target in ("c", "numpy")
    ]
    assert np.max(np.abs(ends[0] - ends[1])) <= 1e-13 * np.max(np.abs(ends[0]))


@pytest.mark.parametrize("name", NAMES)
def test_observables_agree_with_their_formulas(name):
    """Compare Hamiltonian, Casimirs and vector field of both targets with many digits."""
    compilation = compiled(name)
    at, system = setting(compilation), compilation.system
    moved = np.array(at.x) * 1.01 + 0.003
    names = {**at.parameters, **dict(zip(system.coordinates, moved.tolist(), strict=True))}
    with mpmath.workdps(40):
        exact = [
            float(v) for v in values([system.hamiltonian, *system.casimirs.values(), *system.vector_field()], names)
        ]
    for target in ("c", "numpy"):
        s = solver(compilation, target)
        evaluated_values = [float(s.hamiltonian(moved, parameters=at.parameters))]
        evaluated_values += [float(v) for v in s.casimirs(moved, parameters=at.parameters).values()]
        evaluated_values += s.vector_field(moved, parameters=at.parameters).tolist()
        scale = max(abs(v) for v in [*exact, *moved])
        np.testing.assert_allclose(evaluated_values, exact, rtol=1e-14, atol=4e-15 * scale)


# -- reversibility

REVERSIBLE = [name for name in NAMES if described(name)[2].symmetric]


@pytest.mark.parametrize("name", REVERSIBLE)
def test_a_step_back_undoes_a_step(name):
    """Check that Φ_{−h}∘Φ_h is the identity to round-off for symmetric bi-realisations."""
    compilation = compiled(name)
    at = setting(compilation)
    raw = RawC(compilation)
    raw.init(at.x, at.parameters)
    raw.integrate(at.h, 10)
    before = raw.exact_state()
    assert raw.step(at.h) == 0
    assert raw.step(-at.h) == 0
    size = np.max(np.abs(raw.x))
    with mpmath.workdps(50):
        error = max(abs(u - v) for u, v in zip(raw.exact_state(), before, strict=True))
    assert error <= 2 * EPSILON * size


@pytest.mark.parametrize("name", [n for n in REVERSIBLE if n in IN_CLOSED_FORM])
def test_many_steps_back_undo_many_steps(name):
    compilation = compiled(name)
    at, s = setting(compilation), solver(compiled(name), "c")
    there = s.integrate(at.x, at.h, 200, stride=200, parameters=at.parameters).x[-1]
    back = s.integrate(there, -at.h, 200, stride=200, parameters=at.parameters).x[-1]
    np.testing.assert_allclose(back, at.x, rtol=0, atol=2e-12 * np.max(np.abs(at.x)))


def test_one_sided_methods_are_not_reversible():
    compilation = compiled("pendulum_euler")
    at, s = setting(compilation), solver(compilation, "c")
    back = s.step(s.step(at.x, at.h), -at.h)
    assert np.max(np.abs(back - at.x)) > 1e-6


# -- known solutions


#: Cases in NumPy, which takes a thousand times longer. Another test compares NumPy with C for all systems.
IN_NUMPY = [("numpy", name) for name in QUICK if name in REFERENCES and name in IN_CLOSED_FORM]
IN_C = [("c", name) for name in REFERENCES]


@pytest.mark.thin(3)
@pytest.mark.parametrize(("target", "name"), [*IN_C, *IN_NUMPY])
def test_reference_state_is_reached(name, target):
    compilation, expected = compiled(name), REFERENCES[name]
    at, run = setting(compilation, "reference"), compilation.spec.runs["reference"]
    end = solver(compilation, target).integrate(at.x, at.h, run.steps, stride=run.steps, parameters=at.parameters).x[-1]
    state = np.array([float(v) for v in expected["state"]])
    assert np.max(np.abs(end - state)) <= expected["tolerance"]


EXACT = [(name, run) for name, run in RUNS if described(name)[0].runs[run].exact]


@pytest.mark.parametrize(("name", "run"), EXACT)
def test_closed_form_is_followed(name, run):
    """The solution is followed within the error of the method, which falls by 2^order when the step is halved."""
    compilation = compiled(name)
    at, order = setting(compilation, run), compilation.order.order
    steps = min(compilation.spec.runs[run].steps, 200)
    errors = []
    for refinement in (1, 2):
        h = at.h / refinement
        x = solver(compilation, "c").integrate(at.x, h, steps * refinement, stride=refinement, parameters=at.parameters)
        errors.append(np.max(np.abs(x.x - closed_form(compilation, run, x.t, at))[:, columns(compilation, run)]))
    assert errors[0] <= 0.1
    assert errors[1] <= max(errors[0] / 2 ** (order - 0.4), 1e-12 * np.max(np.abs(at.x)))


def columns(compilation, run):
    """Return the coordinates that have a closed form."""
    return [i for i, c in enumerate(compilation.system.coordinates) if c in compilation.spec.runs[run].exact]


def closed_form(compilation, run, times, at):
    """Return the exact solution at some times, with NaN for coordinates without a closed form."""
    formulas = compilation.spec.runs[run].exact
    coordinates = compilation.system.coordinates
    names = {**at.parameters, **{f"x0:{c}": v for c, v in zip(coordinates, at.x, strict=True)}}
    table = np.full((len(times), len(coordinates)), np.nan)
    for k, t in enumerate(times.tolist()):
        solution = values(list(formulas.values()), {**names, ELAPSED: t})
        for c, v in zip(formulas, solution, strict=True):
            table[k, coordinates.index(c)] = float(v)
    return table


def test_blow_up_of_the_species_is_followed_to_the_singularity():
    """The paper's example: at t = 0.255, 0.0004 before the singularity, with x1 beyond −5000."""
    compilation = compiled("lotka_volterra")
    at, run = setting(compilation, "blow_up"), compilation.spec.runs["blow_up"]
    trajectory = solver(compilation, "c").integrate(at.x, at.h, run.steps, parameters=at.parameters)
    exact = closed_form(compilation, "blow_up", trajectory.t, at)
    singularity = np.log((sum(at.x) - at.x[0]) / -at.x[0]) / sum(at.x)
    assert abs(singularity - 0.255385109) < 1e-9
    assert trajectory.x[-1, 0] < -2_000
    relative = np.max(np.abs(trajectory.x / exact - 1), axis=1)
    assert relative[:2_000].max() <= 1e-5
    assert relative[-1] <= 0.01
    casimir = trajectory.casimirs["C"]
    assert np.max(np.abs(casimir / casimir[0] - 1)) <= 1e-14
