"""Lattice sizes that are not multiples of the periods of the colouring: the terms across the boundary seam are separate
parts.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lattice.lattices import with_threads
from lattice.test_javascript import node
from lattice.test_sweeps import poisson_at
from systems import slow_but

import phigen
from phigen.compiler import compile_spec, emit
from phigen.lattice.cell_building import cell_from_spec
from phigen.lattice.expansion import expand
from phigen.runtime.lattice import LatticeSolver
from phigen.spec import loads

H = 0.1

SPINS = "coordinates: [x, y, z]\npoisson: {lie_algebra: {name: so(3)}}\n"
#: Specs: brackets with the next site and the one after it, with three colours; bonds of spins that do not commute, with
#: time dependence and a parameter at sites; both kinds of coupling along two axes; damping by colours.
TEXTS = {
    "volterra": 'coordinates: [a]\npoisson: {brackets: {a: {"a[i+1]": "a*a[i+1]"}}}\nhamiltonian: a\n',
    "bogoyavlensky": (
        'coordinates: [a]\npoisson: {brackets: {a: {"a[i+1]": "a*a[i+1]", "a[i+2]": "a*a[i+2]"}}}\nhamiltonian: a\n'
    ),
    "twisted": SPINS
    + "time: t\nparameters: {D: 0.7, B: {value: 0.3, at: sites}}\n"
    + "hamiltonian: D*cos(t)*(x*y[i+1] - y*x[i+1]) - z*z[i+1] + B*z**2\n",
    "sheet": (
        'coordinates: [a]\npoisson: {brackets: {a: {"a[i+1]": "a*a[i+1]", "a[j+1]": "a*a[j+1]/2"}}}\nhamiltonian: a\n'
    ),
    "layer": SPINS + "hamiltonian: 0.7*(x*y[i+1] - y*x[i+1]) - z*z[i+1] + 0.3*x*z[j+1] - y*y[j+1]\n",
    "damped": SPINS + "parameters: {k: 0.2}\nhamiltonian: -x*x[i+1] - y*y[i+1] - z*z[i+1]\ndamping: k\n",
}
#: Sizes with one and two remaining sites; with one seam, with the other one, and with both and their corner.
SIZES = {
    "volterra": [(3,), (7,)],
    "bogoyavlensky": [(13,), (14,)],
    "twisted": [(7,)],
    "sheet": [(5, 4), (4, 5), (5, 5)],
    "layer": [(3, 5)],
}
CASES = [(name, sizes) for name, listed in SIZES.items() for sizes in listed]
#: Cases in C, which is the same for all sizes with a seam: for each lattice the largest size, which has all seams.
IN_C = slow_but([("bogoyavlensky", (14,))], [(name, listed[-1]) for name, listed in SIZES.items()])


def text(name: str, run: tuple[int, ...], profile: str) -> str:
    axes, start = ("i", "j")[: len(run)], ", ".join(f"{f}: 1" for f in ("xyz" if SPINS in TEXTS[name] else "a"))
    runs = f"runs: {{r: {{sizes: {list(run)}, initial: {{{start}}}, step: 0.1, steps: 1}}}}\n"
    lattice = f"lattice: {{axes: [{', '.join(axes)}], boundary: periodic}}\norder: 4\nprofile: {profile}\n"
    return f"phigen: 1\nname: {name}\n{lattice}{TEXTS[name]}{runs}"


@cache
def solver(
    name: str, run: tuple[int, ...], target: str = "numpy", profile: str = "fast", *, adjoint: bool = False
) -> LatticeSolver:
    """Return a solver for runs of a size, which decides whether there is a seam."""
    solver = phigen.compile(loads(text(name, run, profile)), target=target, tangent=not adjoint, adjoint=adjoint)
    assert isinstance(solver, LatticeSolver)
    return solver


def odd(name: str) -> tuple[int, ...]:
    """Return sizes that are not multiples of the periods of the colouring, without additional colours."""
    return (13, 7) if name in ("sheet", "layer") else (7,)


def start(name: str, sizes: tuple[int, ...]) -> np.ndarray:
    fields = len(solver(name, odd(name)).coordinates)
    return np.exp(0.4 * np.random.default_rng(1).normal(size=(fields, *sizes)))


@pytest.mark.thin(2)
@pytest.mark.parametrize(("name", "sizes"), [*CASES[:-1], pytest.param(*CASES[-1], marks=pytest.mark.slow)])
def test_steps_are_poisson_maps(name: str, sizes: tuple[int, ...]) -> None:
    x, integrator = start(name, sizes), solver(name, odd(name))
    whole = expand(cell_from_spec(loads(text(name, odd(name), "fast"))), sizes, ())
    after, carried = integrator.step_tangent(x, H, np.eye(x.size).reshape(-1, *x.shape))
    matrix = carried.reshape(x.size, x.size).T
    moved = matrix @ poisson_at(whole, x, {}) @ matrix.T
    np.testing.assert_allclose(moved, poisson_at(whole, after, {}), rtol=0, atol=2e-14)


@pytest.mark.thin(2)
@pytest.mark.parametrize(("name", "sizes"), CASES)
def test_steps_follow_h_with_their_order(name: str, sizes: tuple[int, ...]) -> None:
    x, integrator = start(name, sizes), solver(name, odd(name))
    field, small = integrator.vector_field(x, **({"t": 0.0} if integrator.interface.time else {})), 1e-3
    ahead, back = (integrator.integrate(x, h, 1).x[-1] for h in (small, -small))
    np.testing.assert_allclose((ahead - back) / (2 * small), field, rtol=0, atol=1e-4 * np.abs(field).max())
    precise = integrator.integrate(x, 0.2 / 16, 16).x[-1]
    errors = [np.abs(integrator.integrate(x, 0.2 / n, n).x[-1] - precise).max() for n in (2, 4)]
    assert 3.7 < np.log2(errors[0] / errors[1]) < 4.5


@pytest.mark.thin(1)
@pytest.mark.parametrize("profile", ["fast", pytest.param("small", marks=pytest.mark.slow)])
@pytest.mark.parametrize(("name", "sizes"), IN_C)
def test_c_makes_the_steps_of_numpy(name: str, sizes: tuple[int, ...], profile: str) -> None:
    x, h = start(name, sizes), 0.2
    vectors = np.random.default_rng(2).normal(size=(2, *x.shape))
    (after, carried), expected = (
        solver(name, odd(name), *how).step_tangent(x, h, vectors) for how in (("c", profile), ("numpy",))
    )
    np.testing.assert_allclose(after, expected[0], rtol=0, atol=1e-14 * np.abs(after).max())
    np.testing.assert_allclose(carried, expected[1], rtol=0, atol=1e-13 * np.abs(carried).max())


@pytest.mark.slow
def test_javascript_makes_the_steps_of_numpy(tmp_path: Path) -> None:
    jobs: list[dict[str, Any]] = []
    for k, (name, sizes) in enumerate(CASES):
        path = tmp_path / f"{name}{k}.mjs"
        program = compile_spec(loads(text(name, odd(name), "fast"))).program
        path.write_text(next(iter(emit(program, "js", "phigen").values())), encoding="utf-8")
        options = {"x0": start(name, sizes).ravel().tolist(), "sizes": sizes}
        jobs.append({"module": path.as_uri(), "options": options, "h": H, "steps": 3})
    for (name, sizes), answer in zip(CASES, node(jobs), strict=True):
        x = solver(name, odd(name)).integrate(start(name, sizes), H, 3).x[-1]
        np.testing.assert_allclose(answer["x"], x.ravel(), rtol=0, atol=1e-13 * np.abs(x).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bogoyavlensky", "sheet"])
def test_bits_are_those_of_any_number_of_threads(name: str) -> None:
    sizes = (4099,) if name == "bogoyavlensky" else (75, 83)
    x, integrator = start(name, sizes), solver(name, odd(name), "c")
    first, *others = with_threads(lambda: integrator.integrate(x, H, 3).x[-1])
    assert all(np.array_equal(first, other) for other in others)
    np.testing.assert_allclose(first, solver(name, odd(name)).integrate(x, H, 3).x[-1], rtol=0, atol=1e-13)


@pytest.mark.parametrize("target", ["numpy", pytest.param("c", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["volterra", "layer"])
def test_sizes_that_colours_fit_have_the_bits_of_a_solver_without_a_seam(name: str, target: str) -> None:
    sizes = (6,) if name == "volterra" else (6, 4)
    x = start(name, sizes)
    with_seam, without = (solver(name, run, target).integrate(x, H, 5).x for run in (odd(name), sizes))
    assert np.array_equal(with_seam, without)


@pytest.mark.thin(1)
@pytest.mark.parametrize("target", ["numpy", pytest.param("c", marks=pytest.mark.slow)])
@pytest.mark.parametrize(("name", "sizes"), IN_C)
def test_pullback_is_the_gradient_of_the_run(name: str, sizes: tuple[int, ...], target: str) -> None:
    x, integrator, random = start(name, sizes), solver(name, odd(name), target, adjoint=True), np.random.default_rng(5)
    bar, along, width = random.normal(size=(3, *x.shape)), random.normal(size=x.shape), 1e-3
    _, x0_bar, _ = integrator.pullback(x, 0.05, 4, bar, 2)

    def weighed(e: float) -> float:
        return float(np.sum(bar * integrator.integrate(x + e * along, 0.05, 4, 2).x))

    weights = ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))
    slope = sum(w * (weighed(k * width) - weighed(-k * width)) for k, w in weights) / width
    assert np.sum(x0_bar * along) == pytest.approx(slope, rel=1e-8)


@pytest.mark.slow
def test_damping_by_colours_takes_energy_in_every_step_and_keeps_spins() -> None:
    integrator = solver("damped", (7,))
    x = start("damped", (9,))
    run = integrator.integrate(x, 0.3, 50)
    assert (np.diff(run.energy) < 0).all()
    np.testing.assert_allclose((run.x**2).sum(axis=1)[-1], (x**2).sum(axis=0), rtol=1e-13)
    small = 1e-3
    ahead, back = (integrator.integrate(x, h, 1).x[-1] for h in (small, -small))
    np.testing.assert_allclose((ahead - back) / (2 * small), integrator.vector_field(x), rtol=0, atol=1e-4)


def test_too_small_sizes_and_open_ends_beside_have_no_seam() -> None:
    with pytest.raises(ValueError, match="5 sites along i; neighbours and brackets need 6 or more"):
        solver("bogoyavlensky", (7,)).integrate(np.ones((1, 5)), H, 1)
    spec = loads(text("sheet", (7, 7), "fast").replace("boundary: periodic", "boundary: [periodic, open]"))
    (method,) = (fact for fact in compile_spec(spec).program.about.facts if fact.startswith("scheme: series"))
    assert "7 along i is not a multiple of 2" in method


def test_a_lattice_with_a_seam_has_no_steps_by_hand() -> None:
    backend: Any = solver("volterra", (7,), "c").backend
    with pytest.raises(ValueError, match="without a boundary seam"):
        backend.stages()
