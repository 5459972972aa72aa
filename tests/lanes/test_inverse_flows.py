"""The reverse pass of an ensemble recomputes states by inverse flows. These call no further elementary functions than
the flows and their transposes.
"""

from collections import Counter
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support import compile_text

from phigen import spec
from phigen.compiler import compile_spec
from phigen.lanes.in_lanes import in_lanes
from phigen.lanes.inverse_flows import recomputing_transposes
from phigen.scheme.lowering import operation_counts, with_numbers_shared
from phigen.symbolic.expression import ZERO, number, symbol, topological
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.numeric import evaluate
from phigen.symbolic.symbols import coefficient

SPECS = Path(__file__).parents[2] / "specs"
TOP = """coordinates: [x1, x2, x3]
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: x1**2/2 + x2**2/4
scheme: splitting
order: 4
composition: suzuki
adjoint: true
"""


@cache
def made(name):
    options = {"scheme": "splitting", "profile": "fast", "adjoint": True}
    return compile_spec(spec.load(SPECS / f"{name}.yaml"), **options).program


@pytest.mark.parametrize("name", ["spin_chain5", "lagrange_top", "kepler", "lotka_volterra"])
def test_transposes_that_recompute_the_start_of_a_flow_agree_with_those_from_the_start(name):
    """A transpose that starts from the state at the end of a flow recomputes the state at the start, and returns the
    same cotangents as the transpose that reads the state at the start.
    """
    program, rng = made(name), np.random.default_rng(5)
    step, n = program.step, program.dimension
    transposes = recomputing_transposes(program, step)
    values = {**{p.name: p.value for p in program.parameters}, **dict.fromkeys(step.prepare.inputs["h"], 0.3)}
    values |= dict.fromkeys(step.prepare.inputs.get("kick", ()), 0.01)
    coef = {coefficient(k): value for k, value in enumerate(evaluate(step.prepare.roots, values))}
    for flow, back, undone in zip(step.flows, step.adjoint.steps, transposes, strict=True):
        start = 0.5 + 0.4 * rng.random(n)
        before = dict(zip(program.coordinates, start, strict=True))
        end = start + evaluate(flow.roots, {**coef, **before})
        bar = dict(zip(back.inputs["increment_bar"], rng.normal(size=n), strict=True))
        expected = evaluate(back.roots, {**coef, **bar, **before})
        values = evaluate(undone.roots, {**coef, **bar, **dict(zip(program.coordinates, end, strict=True))})
        moved = np.array([e is not ZERO for e in undone.outputs[2].values])
        assert values[: len(expected)] == pytest.approx(expected, rel=1e-13, abs=1e-14)
        assert np.array(values[len(expected) :])[moved] == pytest.approx(start[moved], rel=1e-14, abs=1e-14)
        assert np.array_equal(end[~moved], start[~moved])


@pytest.mark.parametrize("name", ["spin_chain5", "lagrange_top", "pendulum"])
def test_inverse_flows_call_only_functions_that_flows_and_transposes_call(name):
    def calls(kernel):
        return {e for e in topological(kernel.roots) if e.op in FUNCTIONS}

    step = made(name).step
    for flow, back, undone in zip(
        step.flows, step.adjoint.steps, recomputing_transposes(made(name), step), strict=True
    ):
        assert Counter(e.op for e in calls(undone)) <= Counter(e.op for e in calls(flow) | calls(back))


def test_monitored_flows_are_not_batched_as_they_also_update_the_time():
    assert made("kepler_eccentric").monitor
    assert in_lanes(made("kepler_eccentric")) is None


def test_products_with_one_number_share_it():
    a, b, c = map(symbol, "abc")
    half = number(Fraction(1, 2))
    shared_products = with_numbers_shared([half * (a * b), half * (a * c) + a])
    assert operation_counts(shared_products) == {"additions": 1, "multiplications": 3, "divisions": 0, "functions": 0}
    values = {"a": 3.0, "b": 5.0, "c": 7.0}
    assert evaluate(shared_products, values) == [7.5, 13.5]
    assert with_numbers_shared([half * (a * b) + a * b]) == [half * (a * b) + a * b]


def test_damped_flows_are_not_recomputed_by_inverse_flows():
    program = compile_text(TOP).program
    assert len(recomputing_transposes(program, program.step)) == 2
    program = compile_text(f"{TOP}damping: 1/9\n").program
    assert recomputing_transposes(program, program.step) == ()
