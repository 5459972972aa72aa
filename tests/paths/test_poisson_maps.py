"""In many digits a step that follows paths is a Poisson map, and the generated code agrees with it to round-off."""

import mpmath
import numpy as np
import pytest
from precise_path import PATH_DIGITS, PrecisePathStep, PreciseSystem, by_paths, compile_paths, numbers, state_of
from support import TARGETS, RawC, casimir_scales, relative_defect, slow_but, solver, values

from phigen.scheme.composition import COMPOSITIONS

pytestmark = pytest.mark.usefixtures("as_users_compile")

#: Systems of the corpus: most have no bi-realisation in closed form, some have one.
NAMES = (
    "ablowitz_ladik3",
    "charged_particle",
    "engel_geodesics",
    "guiding_centre",
    "maxwell_bloch",
    "nambu_pendulum",
    "sir_epidemic",
    "sir_final_size",
    "sklyanin_gyrostat",
    "toda3_quadratic",
)
WITH_CASIMIRS = tuple(n for n in NAMES if n not in ("ablowitz_ladik3", "charged_particle", "guiding_centre"))

BACK = ("charged_particle", "sklyanin_gyrostat", "sir_epidemic", "guiding_centre")

EPS = np.finfo(float).eps


def steady(name):
    """Return state, step size and parameters of the run "long" of a system, or else of the run "reference"."""
    compilation = by_paths(name)
    return numbers(compilation, "long" if "long" in compilation.spec.runs else "reference")


#: Systems for quick tests: one for each kind of function that occurs along paths, and one with a closed form.
FEW = ("charged_particle", "engel_geodesics", "maxwell_bloch", "nambu_pendulum", "sir_epidemic", "toda3_quadratic")


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", slow_but(FEW, NAMES))
def test_step_is_a_poisson_map_and_the_generated_one(name):
    # Where order 4 is a composition, order 2 is used, which has one stage.
    compilation, at = by_paths(name, 2 if name in ("ablowitz_ladik3", "guiding_centre") else 4), steady(name)
    assert compilation.realisation.kind == "karasev"
    step = PrecisePathStep(compilation, at.parameters, at.h)
    image, tangent = step.solve(at.x)
    with mpmath.workdps(PATH_DIGITS):
        assert relative_defect(tangent, step.poisson(at.x), step.poisson(image)) < 1e-20
        scale = max(abs(float(v)) for v in [*at.x, *image])
        raw = RawC(compilation)
        assert raw.init(at.x, at.parameters) == 0
        assert raw.step(at.h) == 0
        assert max(abs(a - b) for a, b in zip(state_of(raw), image, strict=True)) <= 4 * EPS * scale
    numpy = solver(compilation, "numpy").step(at.x, h=at.h, parameters=at.parameters)
    assert max(abs(a - b) for a, b in zip(numpy, image, strict=True)) <= 4 * EPS * scale


def test_the_defect_of_a_map_that_is_not_poisson_is_seen():
    compilation, at = by_paths("charged_particle"), steady("charged_particle")
    step = PrecisePathStep(compilation, at.parameters, at.h)
    image, tangent = step.solve(at.x)
    with mpmath.workdps(PATH_DIGITS):
        tangent[0, 0] += 1e-9
        assert relative_defect(tangent, step.poisson(at.x), step.poisson(image)) > 1e-11


#: For systems that follow paths by their specs, tests/generated/test_conservation.py checks this too.
@pytest.mark.thin(1)
@pytest.mark.parametrize("name", slow_but(["engel_geodesics", "maxwell_bloch"], WITH_CASIMIRS))
def test_casimirs_do_not_drift_in_100_000_steps(name):
    compilation, at = by_paths(name), steady(name)
    casimirs, scales = list(compilation.system.casimirs.values()), casimir_scales(compilation, at)
    raw, worst = RawC(compilation), 0.0
    raw.init(at.x, at.parameters)
    with mpmath.workdps(30):
        system = PreciseSystem(compilation, at.parameters)
        before = values(casimirs, system.at(at.x))
        for _ in range(20):
            assert raw.integrate(at.h, 5_000) == 0
            after = values(casimirs, system.at(state_of(raw)))
            worst = max(worst, *(abs(a - b) / s for a, b, s in zip(after, before, scales, strict=True)))
    assert worst <= 1e-13


@pytest.mark.parametrize("h", [0.5, 2.0, 5.0])
def test_no_path_crosses_the_boundary_of_its_leaf(h):
    # Paths cannot cross the faces S I = 0 of the simplex, so no step makes a fraction negative, however large the step
    # is.
    compilation, at = by_paths("sir_epidemic"), steady("sir_epidemic")
    trajectory = solver(compilation, "c").integrate((0.99, 0.01, 0.0), h=h, steps=400, parameters=at.parameters)
    assert np.min(trajectory.x[:, :2]) > 0
    assert np.min(trajectory.x[-1, 1]) < 1e-11
    assert np.max(np.abs(trajectory.x.sum(axis=1) - 1)) < 1e-14


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("name", slow_but(["charged_particle", "sir_epidemic"], BACK))
def test_step_back_undoes_step(name, target):
    compilation, at = by_paths(name), steady(name)
    solve, count = solver(compilation, target), 100 if target == "c" else 10
    there = solve.integrate(at.x, h=at.h, steps=count, parameters=at.parameters).x[-1]
    back = solve.integrate(there, h=-at.h, steps=count, parameters=at.parameters).x[-1]
    assert np.max(np.abs(there - at.x)) > 0.01
    assert np.max(np.abs(back - at.x)) < 1e-13 * count**0.5


@pytest.mark.slow  # tests/generated/test_conservation.py is similar
@pytest.mark.parametrize("name", ["charged_particle", "sklyanin_gyrostat", "guiding_centre"])
def test_energy_error_does_not_grow(name):
    compilation, at = by_paths(name), steady(name)
    trajectory = solver(compilation, "c").integrate(at.x, h=at.h, steps=40_000, stride=2, parameters=at.parameters)
    error = np.abs(trajectory.energy - trajectory.energy[0])
    windows = [np.max(part) for part in np.array_split(error, 8)]
    assert max(windows) / min(windows) < 1.5
    assert max(windows) > 1e-12  # errors are above round-off


@pytest.mark.parametrize("name", slow_but(["charged_particle", "sir_epidemic"], [*BACK[:3], "maxwell_bloch"]))
def test_numpy_and_c_agree_to_roundoff(name):
    compilation, at = by_paths(name), steady(name)
    ends = [solver(compilation, t).integrate(at.x, h=at.h, steps=50, parameters=at.parameters).x[-1] for t in TARGETS]
    assert np.max(np.abs(ends[0] - ends[1])) < 1e-13


def test_members_of_an_ensemble_do_not_disturb_one_another():
    compilation, at = by_paths("sklyanin_gyrostat"), steady("sklyanin_gyrostat")
    draw = np.random.default_rng(3)
    members = np.array(at.x) * draw.uniform(0.01, 3, (7, 1))
    for target in TARGETS:
        solve = solver(compilation, target)
        together = solve.ensemble(members, h=at.h, steps=1)
        for member, end in zip(members, together, strict=True):
            alone = solve.integrate(member, h=at.h, steps=1).x[-1]
            assert np.max(np.abs(alone - end)) <= 8 * EPS * np.max(np.abs(member))


ORDERS = [
    *((name, order) for name in ("charged_particle", "sklyanin_gyrostat", "nambu_pendulum") for order in (2, 4)),
    ("maxwell_bloch", 6),
    ("sir_epidemic", 4),
    ("guiding_centre", 4),
]


@pytest.mark.thin(3)
@pytest.mark.parametrize(("name", "order"), slow_but([o for o in ORDERS if o[0] in FEW], ORDERS))
def test_observed_order_is_the_stated_one(name, order):
    compilation, at = by_paths(name, order), steady(name)
    assert compilation.program.order == order
    time = 8 * at.h
    steps = [8, 16, 32] if order < 6 else [4, 8, 16]
    errors = _errors(compilation, at, time, steps)
    rates = np.log2(errors[:-1] / errors[1:])
    assert abs(rates[-1] - order) < 0.15
    assert errors[-1] > 100 * EPS


@pytest.mark.parametrize("composition", COMPOSITIONS, ids=lambda c: f"{c.name}-{c.order}")
def test_fractions_of_a_composition_satisfy_the_order_conditions_to_roundoff(composition):
    # Of the order conditions this test checks those on power sums: Σγ = 1, Σγ³ = 0, Σγ⁵ = 0, …. The fractions γ are
    # symmetric under reversal.
    fractions = composition.fractions
    assert fractions == fractions[::-1]
    assert abs(sum(fractions) - 1) < 4 * EPS
    for power in range(3, composition.order, 2):
        assert abs(sum(f**power for f in fractions)) < 1e-14


COMPOSED = [("suzuki", 4), ("triple-jump", 4), ("kahan-li", 6), ("yoshida", 6), ("kahan-li", 8), ("yoshida", 8)]


@pytest.mark.thin(2)
@pytest.mark.parametrize(("composition", "order"), slow_but([COMPOSED[0], COMPOSED[2]], COMPOSED))
def test_symmetric_composition_of_paths_has_its_order(composition, order):
    text = """coordinates: [x, y, z]
poisson: {brackets: {x: {y: 1}, y: {z: x}}}
hamiltonian: (y**2 + z**2)/2
runs: {reference: {initial: [0.5, 1, 0.25], step: 0.5, steps: 8}}
"""
    compilation = compile_paths(text, order, composition)
    assert len(compilation.program.fractions) > 1
    counts = {4: [16, 32, 64], 6: [8, 16, 32], 8: [6, 9, 12]}[order]
    errors = _errors(compilation, numbers(compilation, "reference"), 4.0, counts)
    rates = np.log(errors[:-1] / errors[1:]) / np.log(np.array(counts[1:]) / np.array(counts[:-1]))
    assert abs(rates[-1] - order) < 0.5
    assert errors[-1] > 100 * EPS


def _errors(compilation, at, time, counts):
    """Return the errors at ``time`` in the maximum norm, for each number of steps in ``counts``, compared with the flow
    in many digits.
    """
    expected = np.array([float(v) for v in _flow(compilation, at, time)])
    solve = solver(compilation, "c")
    ends = [solve.integrate(at.x, h=time / n, steps=n, parameters=at.parameters).x[-1] for n in counts]
    return np.array([np.max(np.abs(end - expected)) for end in ends])


def _flow(compilation, at, time):
    from equations import extrapolated

    with mpmath.workdps(30):
        system = PreciseSystem(compilation, at.parameters)
        field = compilation.system.vector_field()
        return extrapolated(lambda x: values(field, system.at(x)), at.x, time, 4 + int(2 * time), 12)
