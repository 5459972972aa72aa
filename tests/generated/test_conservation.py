"""Long runs conserve Casimirs to round-off, and keep the energy error within a window that does not grow."""

from fractions import Fraction

import numpy as np
import pytest
from support import NAMES, QUICK, RUNS, TARGETS, compile_text, compiled, described, setting, slow_but, solver, values

from phigen.scheme.steps import Path
from phigen.symbolic.expression import gradient

pytestmark = [pytest.mark.usefixtures("as_users_compile"), pytest.mark.corpus]

#: Number of steps with --all; quick tests make a fifth of them.
STEPS = 100_000
WINDOWS = 10

#: Runs with fewer steps, with the reason.
FEWER_STEPS = {
    ("lotka_volterra", "blow_up"): 2_550,  # the exact solution ends soon after
    ("lotka_volterra", "takeover"): 50_000,  # two species decay like exp(−t), and underflow below 1e-308
}

#: Runs with an unbounded angle: the error of Casimirs is at least the rounding error of the angle.
GROWING = {("nambu_pendulum", "rotations")}

#: Components of the Laplace–Runge–Lenz vector: every symplectic method rotates it slowly, at a rate of the order of its
#: energy error.
PRECESSING = {("kepler", "A1"), ("kepler", "A2")}

#: Bound for errors that are due to rounding only, and have no windows to compare: the rounding errors of 1e5 steps make
#: a random walk, which ends about sqrt(1e5) units in the last place away and reaches a few times as far.
ROUND_OFF = 2e-13


@pytest.fixture
def trajectory(name, run, request):
    """Return a long trajectory by the solver in C."""
    compilation, steps = compiled(name), STEPS if request.config.option.all else STEPS // 5
    at, steps = setting(compilation, run), min(steps, FEWER_STEPS.get((name, run), STEPS))
    stride = max(1, steps // 4_000)
    return solver(compilation, "c").integrate(at.x, at.h, steps, stride=stride, parameters=at.parameters)


@pytest.mark.thin(3)
@pytest.mark.parametrize(("name", "run"), RUNS)
def test_what_is_conserved_stays_where_it_was(name, run, trajectory):
    check_casimirs(name, run, trajectory)
    if (name, run) != ("lotka_volterra", "blow_up"):
        check_energy(name, trajectory)
    if run == next(iter(compiled(name).spec.runs)):
        check_invariants(name, trajectory)


def conditioning(compilation, states, parameters, casimir):
    """Return the largest Σ|x_i ∂C/∂x_i| of some states: relative rounding errors ε of x change C by ε times
    this sum.
    """
    slopes = gradient(compilation.system.casimirs[casimir], compilation.system.coordinates)
    sizes = []
    for row in states[:: max(1, len(states) // 50)]:
        at = {**parameters, **dict(zip(compilation.system.coordinates, row.tolist(), strict=True))}
        sizes.append(sum(abs(float(d) * x) for d, x in zip(values(slopes, at), row, strict=True)))
    return max(sizes)


def check_casimirs(name, run, trajectory):
    """Check that a Casimir is constant to round-off."""
    for casimir, casimir_values in trajectory.casimirs.items():
        scale = size_of_casimir(compiled(name), trajectory, casimir, growing=(name, run) in GROWING)
        assert np.max(np.abs(casimir_values - casimir_values[0])) <= 1e-13 * scale, casimir


WITH_CASIMIRS = [name for name in NAMES if described(name)[1].casimirs]


@pytest.mark.parametrize("name", slow_but(QUICK, WITH_CASIMIRS))
def test_casimirs_are_constant_to_round_off_in_numpy(name):
    compilation = compiled(name)
    at, steps = setting(compilation), 20 if isinstance(compilation.program.step, Path) else 200
    trajectory = solver(compilation, "numpy").integrate(at.x, at.h, steps, stride=10, parameters=at.parameters)
    for casimir, casimir_values in trajectory.casimirs.items():
        scale = size_of_casimir(compilation, trajectory, casimir)
        assert np.max(np.abs(casimir_values - casimir_values[0])) <= 2e-15 * scale, casimir


def size_of_casimir(compilation, trajectory, casimir, *, growing=False):
    """Return the value of a Casimir or, if the value is 0 or x grows, the change of C by unit relative changes of x."""
    value = abs(trajectory.casimirs[casimir][0])
    if growing:
        return conditioning(compilation, trajectory.x, trajectory.parameters, casimir)
    terms = conditioning(compilation, trajectory.x[:1], trajectory.parameters, casimir)
    if terms == 0:  # all products in C vanish at the start
        terms = conditioning(compilation, trajectory.x, trajectory.parameters, casimir)
    return value if value > 1e-3 * terms else terms


def energy_scale(compilation, trajectory):
    """Return the energy or, if it is nearly zero, its change by unit relative changes of x."""
    slopes = gradient(compilation.system.hamiltonian, compilation.system.coordinates)
    at = {**trajectory.parameters, **dict(zip(compilation.system.coordinates, trajectory.x[0].tolist(), strict=True))}
    slope = [float(d) for d in values(slopes, at)]
    return max(abs(trajectory.energy[0]), 1e-3 * float(np.abs(np.array(slope) * trajectory.x[0]).sum()))


def check_energy(name, trajectory):
    """Check that the largest error of the last window is below 1.5 times that of the first, or that both are
    round-off.
    """
    error = np.abs(trajectory.energy - trajectory.energy[0]) / energy_scale(compiled(name), trajectory)
    windows = [window.max() for window in np.array_split(error[1:], WINDOWS)]
    assert windows[-1] < 1.5 * windows[0] or max(windows) <= ROUND_OFF
    slope = np.polyfit(np.linspace(0, 1, len(error)), error, 1)[0]
    assert abs(slope) <= max(0.5 * max(windows), ROUND_OFF), "a linear trend"


def check_invariants(name, trajectory):
    """Check that other first integrals of integrable systems, which the method does not know, stay within a
    window too.
    """
    compilation = compiled(name)
    rows = trajectory.x[:: len(trajectory) // 1000]
    for invariant, e in compilation.system.invariants.items():
        if (name, invariant) in PRECESSING:
            continue
        values_along_run = np.array([float(v) for v in evaluated(compilation, e, rows, trajectory.parameters)])
        error = np.abs(values_along_run - values_along_run[0])
        halves = [half.max() for half in np.array_split(error[1:], 2)]
        scale = max(abs(values_along_run[0]), np.abs(rows).max() * 1e-3)
        assert halves[1] < 1.5 * halves[0] or max(halves) <= ROUND_OFF * scale, invariant


def evaluated(compilation, e, rows, parameters):
    """Return the values of an expression at many states."""
    names = compilation.system.coordinates
    return [values([e], {**parameters, **dict(zip(names, row.tolist(), strict=True))})[0] for row in rows]


FREE = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: p**2/2\n"
KINDS = ("birealisation: canonical-euler\norder: 1\n", "order: 2\n", "birealisation: karasev\norder: 2\n",
         "scheme: splitting\norder: 2\n")  # fmt: skip


@pytest.mark.thin(3)
@pytest.mark.parametrize("target", [*TARGETS, "generated module"])
@pytest.mark.parametrize("kind", KINDS, ids=["explicit", "newton", "path", "splitting"])
def test_rounding_errors_of_sums_are_carried_along(kind, target):
    """For a free particle h p is exact, and only q + h p is rounded. Without compensated summation 1,000 errors
    add up.
    """
    h, steps, p = 0.125, 1000, 1 / 3
    if target in TARGETS:
        end = solver(compile_text(FREE + kind), target).integrate([0.1, p], h, steps, stride=steps).x[-1, 0]
    else:
        end = solver(compile_text(FREE + kind), "numpy").backend.module.integrate([0.1, p], h, steps)[-1, 0]
    assert abs(Fraction(float(end)) - Fraction(0.1) - steps * Fraction(h) * Fraction(p)) <= np.spacing(end)
