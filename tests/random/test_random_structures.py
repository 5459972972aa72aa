"""Random Poisson structures and Hamiltonians have the properties that tests check for the corpus.

PHIGEN_RANDOM_SEEDS sets the number of seeds of each kind with --all; otherwise there is one seed.
"""

import os
from functools import cache
from itertools import product

import mpmath
import numpy as np
import pytest
from precise_path import PrecisePathStep, PreciseSystem, flow_at_one, state_of
from random_structures import KINDS, draw
from support import TARGETS, PreciseStep, RawC, compile_text, slow_but, solver, values

from phigen import spec
from phigen.compiler import examine
from phigen.symbolic.verdict import CHECKED, PROVED

pytestmark = pytest.mark.slow

EPS = np.finfo(float).eps
SEEDS = int(os.environ.get("PHIGEN_RANDOM_SEEDS", "1"))
DRAWS = slow_but(product(KINDS, [0]), product(KINDS, range(SEEDS)))


@cache
def system_of(kind, seed, order):
    """Return the compilation of a random system, and the random system itself."""
    drawn = draw(kind, seed)
    return compile_text(drawn.text, order), drawn


@cache
def scale_of(kind, seed):
    """Return a step size that is small compared with the shortest time scale of the vector field at the start."""
    compilation, drawn = system_of(kind, seed, 2)
    system = PreciseSystem(compilation, {})
    field = compilation.system.vector_field()
    x = np.array(drawn.start)

    def at(y):
        return np.array([float(v) for v in values(field, system.at([mpmath.mpf(float(c)) for c in y]))])

    columns = [(at(x + 1e-6 * e) - at(x - 1e-6 * e)) / 2e-6 for e in np.eye(len(x))]
    speed = max(np.linalg.norm(columns, 2), np.linalg.norm(at(x)) / np.linalg.norm(x))
    return 2.0 ** np.floor(np.log2(0.1 / speed))


@pytest.mark.parametrize(("kind", "seed"), DRAWS)
def test_mathematics_is_proved(kind, seed):
    examination = examine(spec.loads(f"phigen: 1\nname: t\n{draw(kind, seed).text}"), order=4)
    assert examination.obstacle is None
    jacobi = [s for s in examination.statements if s.name.startswith("Jacobi")]
    assert [s.verdict for s in jacobi] == [PROVED]
    for statement in examination.statements:
        assert statement.verdict == PROVED or (statement.verdict == CHECKED and "rank" in statement.name), statement


@pytest.mark.parametrize(("kind", "seed"), DRAWS)
def test_step_is_a_poisson_map_and_the_generated_one(kind, seed):
    compilation, drawn = system_of(kind, seed, 2)
    h = float(scale_of(kind, seed))
    precise = (PrecisePathStep if compilation.realisation.path else PreciseStep)(compilation, {}, h)
    assert precise.defect(drawn.start) < 1e-15
    image = [float(v) for v in precise(drawn.start)]
    raw = RawC(compilation)
    raw.init(drawn.start, {})
    assert raw.step(h) == 0
    ends = [[float(v) for v in state_of(raw)], solver(compilation, "numpy").step(drawn.start, h=h)]
    for end in ends:
        assert np.max(np.abs(np.array(end) - image)) <= 8 * EPS * np.max(np.abs(image))


@pytest.mark.thin(1)
@pytest.mark.parametrize("order", slow_but([2], [2, 4]))
@pytest.mark.parametrize(("kind", "seed"), DRAWS)
def test_observed_order_is_the_stated_one(kind, seed, order):
    compilation, drawn = system_of(kind, seed, order)
    h, counts = float(scale_of(kind, seed)), (8, 16, 32)
    with mpmath.workdps(25):
        system, field = PreciseSystem(compilation, {}), compilation.system.vector_field()
        time = mpmath.mpf(8 * h)
        start = [mpmath.mpf(v) for v in drawn.start]
        expected = flow_at_one(lambda x: [time * v for v in values(field, system.at(x))], start)
    expected = np.array([float(v) for v in expected])
    solve = solver(compilation, "c")
    ends = [solve.integrate(drawn.start, h=8 * h / n, steps=n).x[-1] for n in counts]
    errors = np.array([np.max(np.abs(end - expected)) for end in ends])
    if errors[-1] < 1e-13:  # errors of high order vanish in round-off
        assert errors[0] < 1e-10
        return
    assert abs(np.log2(errors[1] / errors[2]) - order) < 0.25


@pytest.mark.parametrize(("kind", "seed"), DRAWS)
def test_casimirs_are_constant_to_roundoff(kind, seed):
    compilation, drawn = system_of(kind, seed, 4)
    h, casimirs = float(scale_of(kind, seed)), list(compilation.system.casimirs.values())
    raw = RawC(compilation)
    raw.init(drawn.start, {})
    with mpmath.workdps(30):
        system = PreciseSystem(compilation, {})
        before, largest = values(casimirs, system.at(drawn.start)), 0.0
        for _ in range(40):
            if raw.integrate(h, 5):
                break  # some solutions become infinite in finite time
            largest = max(largest, float(np.max(np.abs(raw.x))))
            for a, b in zip(values(casimirs, system.at(state_of(raw))), before, strict=True):
                assert abs(a - b) < 1e-13 * max(1, largest**3, abs(b))
    assert raw.counters[0] >= 20
    assert len(casimirs) >= len(drawn.casimirs)


@pytest.mark.parametrize(("kind", "seed"), DRAWS)
def test_steps_back_undo_steps(kind, seed):
    compilation, drawn = system_of(kind, seed, 4)
    h, raw = float(scale_of(kind, seed)), RawC(compilation)
    raw.init(drawn.start, {})
    assert raw.integrate(h, 20) == 0
    assert np.max(np.abs(raw.x - drawn.start)) > 1e-3
    assert raw.integrate(-h, 20) == 0
    assert np.max(np.abs(raw.x - drawn.start)) < 1e-12


@pytest.mark.parametrize(("kind", "seed"), DRAWS)
def test_numpy_and_c_agree_to_roundoff(kind, seed):
    compilation, drawn = system_of(kind, seed, 4)
    h = float(scale_of(kind, seed))
    ends = [solver(compilation, t).integrate(drawn.start, h=h, steps=10).x[-1] for t in TARGETS]
    assert np.max(np.abs(ends[0] - ends[1])) < 1e-13 * np.max(np.abs(ends[0]))
