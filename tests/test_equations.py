"""Systems of the corpus compared with equations of motion written by hand and with reference states computed without
phigen.
"""

import json
from pathlib import Path

import mpmath
import numpy as np
import pytest
from equations import FIELDS, extrapolated
from precise_path import numbers
from support import compiled, solver, values

from phigen import resources

pytestmark = pytest.mark.corpus

REFERENCES = json.loads(Path(__file__).with_name("references.json").read_text(encoding="utf-8"))["references"]
BUNDLED = {path.stem for path in resources.bundled_specs().glob("*.yaml")}


@pytest.mark.parametrize("name", sorted(BUNDLED & set(FIELDS)))
def test_vector_field_is_that_of_the_equations_of_motion(name):
    system = compiled(name).system
    centre = numbers(compiled(name), "reference").x
    draw = np.random.default_rng(1)
    with mpmath.workdps(30):
        for _ in range(3):
            x = [mpmath.mpf(v + w) for v, w in zip(centre, draw.uniform(0.01, 0.1, len(centre)), strict=True)]
            at = {**dict(zip(system.coordinates, x, strict=True)), **_parameters(name)}
            computed, expected = values(system.vector_field(), at), FIELDS[name](x)
            for a, b in zip(computed, expected, strict=True):
                assert abs(a - b) <= 1e-28 * (1 + abs(b))


def _parameters(name):
    """Return the default values of the parameters, exactly as the decimal numbers in the spec."""
    return {p.name: mpmath.mpf(str(float(p.value))) for p in compiled(name).system.parameters}


@pytest.mark.parametrize("name", sorted(set(REFERENCES) & set(FIELDS)))
def test_reference_state_is_the_solution_in_many_digits(name):
    expected, run = REFERENCES[name], compiled(name).spec.runs["reference"]
    with mpmath.workdps(30):
        start = [mpmath.mpf(v.numerator) / v.denominator for v in run.initial]
        pieces = 10 + int(expected["time"])
        state = extrapolated(FIELDS[name], start, expected["time"], pieces, 13)
        for computed, stated in zip(state, expected["state"], strict=True):
            assert abs(computed - mpmath.mpf(stated)) < 1e-13


@pytest.mark.parametrize("name", sorted(set(REFERENCES) & set(FIELDS)))
def test_run_ends_at_the_reference_state(name):
    compilation, expected = compiled(name), REFERENCES[name]
    run = compilation.spec.runs["reference"]
    at = numbers(compilation, "reference")
    trajectory = solver(compilation, "c").integrate(at.x, h=at.h, steps=int(run.steps), stride=int(run.steps))
    error = np.max(np.abs(trajectory.x[-1] - np.array([float(v) for v in expected["state"]])))
    assert error <= expected["tolerance"]
