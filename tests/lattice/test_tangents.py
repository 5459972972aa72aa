"""Tangent vectors of lattices: the derivative of a step, exact to round-off, in every target."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from lattice.lattices import with_threads
from lattice.test_sweeps import (
    FEW,
    REAL_ONLY,
    SERIES,
    TEXTS,
    compiled,
    disorder,
    expansion,
    jacobian,
    module_of,
    poisson_at,
    start,
)

from phigen import spec as specs
from phigen.api import lattice_solver_of, solver_of
from phigen.compilation import Compilation
from phigen.compiler import compile_spec
from phigen.errors import StepError
from phigen.lattice.states import Start
from phigen.runtime.lattice import LatticeSolver
from phigen.study.lattice_verification import verify_lattice

H = 0.2


@cache
def with_tangents(name: str) -> Compilation:
    return compile_spec(compiled(name).spec, tangent=True)


@cache
def solver(name: str, target: str) -> LatticeSolver:
    return lattice_solver_of(with_tangents(name), target)


def derivative(name: str, target: str, x: np.ndarray, parameters: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return the state after a step and the matrix of its derivative, whose columns are the images of unit vectors."""
    units = np.eye(x.size).reshape(-1, *x.shape)
    after, carried = solver(name, target).step_tangent(x, H, units, parameters=parameters)
    return after, carried.reshape(x.size, x.size).T


#: Lattices that are tested in C: open ends, colours, a graph with colours, pairs, and the series on all of these.
IN_C = ("xxz_open", "sheet", "charges", "magnet", "volterra", "dragged", "tangle", "vortices")
pytestmark = pytest.mark.few("fput", "sheet", "charges", "magnet", of=TEXTS)


@pytest.mark.thin(3)
@pytest.mark.parametrize("name", [*IN_C, "fput", "ablowitz_ladik", "toda", "web", "network", "pond"])
def test_tangent_vectors_are_carried_by_the_derivative_of_a_step(name: str) -> None:
    x = start(name, FEW.get(name))
    parameters = disorder(name, x)
    after, expected = jacobian(module_of(name), x, H, parameters)
    few, near = np.eye(x.size)[::5].reshape(-1, *x.shape), 1e-11 if name in REAL_ONLY else 1e-13
    after_step, carried = solver(name, "numpy").step_tangent(x, H, few, parameters=parameters)
    np.testing.assert_allclose(after_step, after, rtol=0, atol=1e-13)
    np.testing.assert_allclose(carried.reshape(-1, x.size), expected.T[::5], rtol=0, atol=near)
    if name in IN_C:
        after_step, matrix = derivative(name, "c", x, parameters)
        np.testing.assert_allclose(after_step, after, rtol=0, atol=1e-13)
        np.testing.assert_allclose(matrix, expected, rtol=0, atol=near)
        whole = expansion(name, x.shape[1:])
        moved = matrix @ poisson_at(whole, x, parameters) @ matrix.T
        np.testing.assert_allclose(moved, poisson_at(whole, after, parameters), rtol=0, atol=1e-13)


@pytest.mark.parametrize("name", ["fput", "vortices"])
def test_the_derivative_is_that_of_the_ordinary_system(name: str) -> None:
    x = start(name, (4,))
    spec = replace(compiled(name).spec, composition="suzuki")
    lattice = lattice_solver_of(compile_spec(spec, tangent=True), "numpy")
    scheme = "series" if name in SERIES else "splitting"
    whole = replace(expansion(name, (4,)).spec(), order=4, scheme=scheme, composition="suzuki", gauge="none")
    ordinary = solver_of(compile_spec(whole, tangent=True), "numpy")
    after, carried = lattice.step_tangent(x, H, np.eye(x.size).reshape(-1, *x.shape))
    expected, matrix = ordinary.step_tangent(x.reshape(-1), H)
    np.testing.assert_allclose(after.reshape(-1), expected, rtol=0, atol=1e-14)
    np.testing.assert_allclose(carried.reshape(x.size, x.size).T, matrix, rtol=0, atol=1e-13)


@pytest.mark.thin(1)
@pytest.mark.slow
@pytest.mark.parametrize("name", ["sheet", "dragged"])
def test_steps_with_tangent_vectors_are_those_without_on_any_number_of_threads(name: str) -> None:
    x, integrator = start(name, (70, 90)), solver(name, "c")
    vectors = np.random.default_rng(4).normal(size=(2, *x.shape))

    def made() -> np.ndarray:
        *_, (state, carried) = integrator.tangents(x, 0.05, 3, vectors)
        *_, (again, in_pieces) = integrator.tangents(x, 0.05, 3, vectors, 2)
        np.testing.assert_allclose(again, state, rtol=0, atol=2e-14)
        np.testing.assert_allclose(in_pieces, carried, rtol=0, atol=2e-14)
        return np.concatenate([state[None], carried])

    first, *others = with_threads(made)
    assert all(np.array_equal(first, other) for other in others)
    np.testing.assert_allclose(first[0], integrator.integrate(x, 0.05, 3).x[-1], rtol=0, atol=2e-14)


def test_wrong_vectors_and_solvers_without_tangents_are_told() -> None:
    x = start("fput")
    with pytest.raises(ValueError, match=r"shape \(count, 2, 7\), not \(2, 7\)"):
        solver("fput", "numpy").step_tangent(x, H, x)
    with pytest.raises(TypeError, match="compile it with tangent=True"):
        lattice_solver_of(compiled("fput"), "numpy").step_tangent(x, H, x[None])


def test_a_step_that_cannot_be_made_is_told() -> None:
    x, integrator = np.array([[0.0, 9.0, 0.0, -9.0, 3.0]] * 2), solver("charges", "c")
    with pytest.raises(StepError):
        integrator.step_tangent(np.concatenate([x, 1e200 * x]), 1e300, np.ones((1, 4, 5)))


PUSHED = """\
phigen: 1
name: pushed
lattice: {axes: [i]}
coordinates: [q, p]
time: t
parameters: {g: 0.1, T: 0.3, F: {value: 0.2, at: sites}}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + (q[i+1]-q)**2/2 + q**4/4 - F*q**2*cos(t)
forces: {vector: {p: -g*p}}
noise: {w: {hamiltonian: T*q**2/2}}
"""


def test_tangent_vectors_go_with_time_forces_and_noise() -> None:
    """The increments of the noise are the same in both targets, and for all states."""
    compilation = compile_spec(specs.loads(PUSHED), tangent=True)
    x, draws = start("fput", (6,)), {"t0": 0.3, "seed": 3, "step0": 5}
    vectors, h, e = np.random.default_rng(0).normal(size=(2, 2, 6)), 0.1, 1e-5
    for target in ("c", "numpy"):
        solver = lattice_solver_of(compilation, target)
        ahead, behind = (solver.step(x + d * vectors[0], h, **draws) for d in (e, -e))
        after, carried = solver.step_tangent(x, h, vectors, **draws)
        np.testing.assert_allclose(after, solver.step(x, h, **draws), rtol=0, atol=1e-14)
        np.testing.assert_allclose(carried[0], (ahead - behind) / (2 * e), rtol=0, atol=1e-9)


class Midpoint(LatticeSolver):
    """Steps of the implicit midpoint rule for quadratic fields: they conserve the lengths of spins, but are not Poisson
    maps.
    """

    def step(self, x: Any, h: float, **_: Any) -> np.ndarray:
        y = x
        for _ in range(16):
            y = x + h * self.vector_field((x + y) / 2)
        return y

    def step_tangent(self, x: Any, h: float, vectors: Any, **_: Any) -> tuple[np.ndarray, np.ndarray]:
        after, units = self.step(x, h), np.eye(x.size).reshape(-1, *x.shape)
        middle = (x + after) / 2
        slopes = [(self.vector_field(middle + e) - self.vector_field(middle - e)).ravel() / 2 for e in units]
        half, one = h / 2 * np.array(slopes).T, np.eye(x.size)
        matrix = np.linalg.solve(one - half, one + half)
        return after, (matrix @ vectors.reshape(len(vectors), -1).T).T.reshape(vectors.shape)


class Backwards(LatticeSolver):
    """Solver with a planted error: its derivative is that of a step of opposite sign."""

    def step_tangent(self, x: Any, h: float, vectors: Any, **more: Any) -> tuple[np.ndarray, np.ndarray]:
        return self.step(x, h), super().step_tangent(x, -h, vectors, **more)[1]


class Rounded(LatticeSolver):
    """Solver with a planted error: its derivative has an error slightly larger than rounding."""

    def step_tangent(self, *of: Any, **more: Any) -> tuple[np.ndarray, np.ndarray]:
        after, carried = super().step_tangent(*of, **more)
        return after, carried * (1 + 2e-12)


RING = """phigen: 1
name: ring
lattice: {axes: [i], boundary: periodic}
coordinates: [x, y, z]
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: -(x*x[i+1] + y*y[i+1] + 0.7*z*z[i+1]) - 0.3*z
casimirs: {C: x**2 + y**2 + z**2}
order: 2
"""
NOISY = "noise: {kicks: {hamiltonian: x, amplitude: 0.3}, turns: {hamiltonian: z, amplitude: 0.2}}\n"


@pytest.mark.thin(3)
@pytest.mark.parametrize(
    ("kind", "text", "short"),
    [
        (LatticeSolver, RING + NOISY, []),
        (Midpoint, RING, ["Poisson identity"]),
        pytest.param(Backwards, RING, ["Poisson identity", "tangent map"], marks=pytest.mark.slow),
        (Rounded, RING, ["Poisson identity"]),
    ],
)
def test_verification_tells_poisson_maps_to_roundoff(kind: type[LatticeSolver], text: str, short: list[str]) -> None:
    compilation = compile_spec(specs.loads(text), tangent=True)
    plain = lattice_solver_of(compilation, "numpy")
    x = np.random.default_rng(5).normal(size=(3, 6))
    begin = Start((6,), x, {}, np.empty((0, 2), dtype=np.int64))
    seed = 2 if "noise" in text else None
    solvers = {"numpy": kind(plain.backend, plain.interface)}
    verification = verify_lattice(compilation, solvers, "run", begin, 0.1, 20, seed=seed)
    failed = {c.name for c in verification.checks if not c.passed}
    assert [s for s in ("Poisson identity", "tangent map") if any(name.startswith(s) for name in failed)] == short
    assert any(c.name.startswith("Poisson identity on 3 sites") for c in verification.checks)


def test_lattices_at_rest_have_errors_at_round_off() -> None:
    """The state is an equilibrium, where steps of all sizes change nothing."""
    text = """phigen: 1
name: rest
lattice: {axes: [i], boundary: periodic}
coordinates: [a, b]
poisson: {brackets: {a: {b: a/2, "b[i+1]": -a/2}}}
hamiltonian: a**2/2 + b**2/2
order: 4
"""
    compilation = compile_spec(specs.loads(text), tangent=True)
    begin = Start((8,), np.full((2, 8), 1.3), {}, np.empty((0, 2), dtype=np.int64))
    solvers = {"numpy": lattice_solver_of(compilation, "numpy")}
    (order, *_) = verify_lattice(compilation, solvers, "run", begin, 0.1, 20).checks
    assert order.passed
    assert (order.name, order.value) == ("observed order (errors at round-off)", np.inf)
