"""Steps by Karasev's paths compared with steps by closed forms: both have the same order and keep Casimirs. For linear
brackets paths give the exponential map.
"""

from dataclasses import replace
from itertools import product

import mpmath
import numpy as np
import pytest
from precise_path import PATH_DIGITS, PrecisePathStep, PreciseSystem, by_paths, compile_paths, numbers
from support import BODY, SPECIES, compile_text, gradient, slow_but, solver, spec_of, values

from phigen.compiler import compile_spec
from phigen.spec.model import BirealisationChoice

EPS = np.finfo(float).eps

CANONICAL = """coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - cos(q)
"""

#: Spec, start, step size, and Casimir as a function of the state.
BOTH = {
    "so(3)": (BODY, (0.4, -0.9, 0.6), 0.1, lambda x: x @ x),
    "log-canonical": (SPECIES.replace("x1 + x2 + x3", "x1 + x2*x3 + x3**2"), (0.4, 0.9, 0.6), 0.1, None),
    "constant": (CANONICAL, (0.4, 0.9), 0.1, None),
}


@pytest.mark.thin(3)
@pytest.mark.parametrize(
    ("name", "order"), slow_but([("so(3)", 4), ("log-canonical", 4), ("constant", 2)], product(BOTH, [2, 4]))
)
def test_paths_and_closed_form_converge_to_the_same_flow(name, order):
    text, start, h, _ = BOTH[name]
    closed, paths = compile_text(text, order), compile_paths(text, order)
    assert closed.realisation.kind != "karasev"
    assert closed.program.order == paths.program.order == order
    gaps = []
    for count in (5, 10):
        ends = [solver(c, "c").integrate(start, h=5 * h / count, steps=count).x[-1] for c in (closed, paths)]
        gaps.append(np.max(np.abs(ends[0] - ends[1])))
    if name == "log-canonical":  # different maps that differ by O(h^order)
        assert gaps[1] > 1e-12
        assert abs(np.log2(gaps[0] / gaps[1]) - order) < 0.3
    else:  # equal maps: the exponential for so(3), the midpoint rule for constant brackets
        assert gaps[0] < 1e-14


@pytest.mark.parametrize("name", slow_but(["log-canonical"], ["so(3)", "log-canonical"]))
def test_paths_and_closed_form_keep_the_casimir_to_roundoff(name):
    text, start, h, casimir = BOTH[name]
    casimir = casimir or (lambda x: x[0] * x[2] / x[1])
    for compilation in (compile_text(text, 2), compile_paths(text, 2)):
        end = solver(compilation, "c").integrate(start, h=h, steps=2000).x[-1]
        assert abs(casimir(end) / casimir(np.array(start)) - 1) < 1e-13


LINEAR = ["rigid_body", "engel_geodesics", "maxwell_bloch", "lagrange_top", "gaussian_moments"]


@pytest.mark.thin(3)
@pytest.mark.parametrize("name", slow_but(["rigid_body", "engel_geodesics", "maxwell_bloch"], LINEAR))
def test_paths_of_a_linear_bracket_are_the_exponential(name):
    specification = spec_of(name)
    run = "reference" if "reference" in specification.runs else next(iter(specification.runs))
    exponential = compile_spec(
        replace(specification, birealisation=BirealisationChoice("exponential"), gauge="none"), order=4
    )
    paths = by_paths(name, 4)
    at = numbers(paths, run)
    assert exponential.realisation.kind == "exponential"
    ends = [
        solver(c, "c").integrate(at.x, h=0.1, steps=20, parameters=at.parameters).x[-1] for c in (exponential, paths)
    ]
    assert np.max(np.abs(ends[0] - ends[1])) < 2e-14 * max(1, *np.abs(ends[0]))
    assert np.max(np.abs(ends[0] - at.x)) > 0.05


LINEAR_HAMILTONIANS = ["toda3_quadratic", "sir_final_size", "lotka_volterra"]


@pytest.mark.thin(3)
@pytest.mark.parametrize("name", LINEAR_HAMILTONIANS)
def test_paths_of_a_linear_hamiltonian_are_the_exact_flow(name):
    compilation = by_paths(name, 2)
    run = "takeover" if name == "lotka_volterra" else "reference"
    at, h = numbers(compilation, run), 0.5
    with mpmath.workdps(PATH_DIGITS):
        system = PreciseSystem(compilation, at.parameters)
        p = [h * v for v in values(_slope(compilation), system.at(at.x))]
        end = [float(v) for v in system.path([mpmath.mpf(v) for v in at.x], p)[0]]
    integrator = solver(compilation, "c").step(at.x, h=h, parameters=at.parameters)
    assert np.max(np.abs(integrator - end)) < 8 * EPS
    assert np.max(np.abs(integrator - at.x)) > 1e-3


def _slope(compilation):
    return gradient(compilation.system.hamiltonian, compilation.system.coordinates)


def test_log_canonical_paths_are_a_poisson_map_of_their_own():
    text, start, h, _ = BOTH["log-canonical"]
    closed, paths = compile_text(text, 2), compile_paths(text, 2)
    step = PrecisePathStep(paths, {}, h)
    assert step.defect(start) < 1e-22
    ends = [solver(c, "c").step(start, h=h) for c in (closed, paths)]
    assert np.max(np.abs(ends[1] - [float(v) for v in step(start)])) < 4 * EPS
    assert np.max(np.abs(ends[0] - ends[1])) > 1e-6
