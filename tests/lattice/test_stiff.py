"""Steps so large that fixed-point sweeps do not converge: Newton's method, by elimination in C for chains, otherwise by
Krylov spaces.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from lattice.lattices import LATTICES, with_threads
from tools import run, write

from phigen import spec as specs
from phigen.api import lattice_solver_of, solver_of
from phigen.compilation import Compilation
from phigen.compiler import compile_spec, emit
from phigen.errors import StepError
from phigen.lattice.cell_building import cell_from_spec
from phigen.lattice.expansion import expand
from phigen.runtime.modules import load_module

CANONICAL = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nscheme: series\n"
TEXTS = {
    "ring": f"order: 4\nlattice: {{axes: [i]}}\n{CANONICAL}hamiltonian: p**2/2 + 200*(q[i+2]-q)**2 + q**2*cos(q[i+1])",
    "chain": f"order: 2\nlattice: {{axes: [i], boundary: open}}\n{CANONICAL}"
    "hamiltonian: p**2/2 + 200*(q[i+1]-q)**2 + q**4/4",
    "waves": "order: 2\nlattice: {axes: [i]}\ncoordinates: [u]\n"
    'poisson: {brackets: {u: {"u[i+1]": 30}}}\nhamiltonian: (u[i+1] - u)**2/2 - u**3/6',
    "sheet": f"order: 2\nlattice: {{axes: [i, j], boundary: [open, periodic]}}\n{CANONICAL}"
    "hamiltonian: p**2/2 + 200*((q[i+1]-q)**2 + (q[j+1]-q)**2) + q**4/4",
    "net": f"order: 4\nlattice: {{graph: bonds}}\nparameters: {{k: {{value: 200, at: bonds}}}}\n{CANONICAL}"
    'hamiltonian: {sites: p**2/2 + q**4/4, bonds: "k*(q[a]-q[b])**2 + q[a]*p[b]**2/9"}',
    "swarm": f"order: 2\nlattice: {{pairs: all}}\nparameters: {{m: {{value: 1, at: sites}}}}\n{CANONICAL}"
    'hamiltonian: {sites: p**2/(2*m), pairs: "100*m[a]*m[b]*(q[a]-q[b])**2/(1 + (q[a]-q[b])**2)"}',
}
#: Linear waves: one Newton correction solves a stage to round-off, and a second one does not improve it.
LINEAR = f"order: 2\nlattice: {{axes: [i]}}\n{CANONICAL}hamiltonian: p**2/2 + 200*(q[i+1]-q)**2 + q*q[i+2] + p*p[i+1]/3"
PLANE = f"order: 2\nlattice: {{axes: [i, j]}}\n{CANONICAL}hamiltonian: p**2/2 + 200*((q[i+1]-q)**2 + (q[j+1]-q)**2)"
DRIVER = r"""
#include <stdio.h>
#include <stdlib.h>
#include "linear.c"
int main(void)
{
    const size_t sizes[] = { SIZES };
    double x[800];
    for (int k = 0; k < 800; ++k) x[k] = sin(k * k);
    linear_solver s;
    if (linear_init(&s, NULL, sizes, x, malloc(linear_work_size(sizes))) != linear_OK) return 1;
    linear_set_step(&s, STEP);
    linear_range(&s, s.coef);
    linear_copy(s.y[0], s.x, &s);
    const double first = linear_corrected(&s, s.coef, 0), second = linear_corrected(&s, s.coef, 1);
    linear_params_bar none;
    s.sweeps = 0;
    if (linear_step(&s, STEP) != linear_OK) return 2;
    const size_t taken = s.sweeps;
    void *trail = malloc(linear_trail_size(&s, 1));
    s.sweeps = 0;
    if (linear_step_adjoint(&s, STEP, x, x, &none, trail) != linear_OK) return 3;
    printf("%g %g %zu %zu", first, second, taken, s.sweeps - taken);
    return 0;
}
"""
#: A lattice whose step has no solution for large h: y = a + h²/4 exp(y).
BURSTING = f"order: 2\nlattice: {{axes: [i, j]}}\n{CANONICAL}hamiltonian: p**2/2 - exp(q) + q*q[i+1]*q[j+1]/9"
#: Sizes: few sites, whose matrix is full, and many sites.
SIZES = {
    "ring": [(5,), (31,)],
    "chain": [(4,), (23,)],
    "waves": [(6,), (40,)],
    "sheet": [(3, 4), (9, 8)],
    "net": [(6,), (30,)],
    "swarm": [(5,)],
}
CASES = [(name, sizes) for name, listed in SIZES.items() for sizes in listed]
pytestmark = pytest.mark.few("sheet", "net", of=SIZES)


@cache
def compiled(name: str) -> Compilation:
    return compile_spec(specs.loads(f"phigen: 1\nname: stiff_{name}\nadjoint: true\ntangent: true\n{TEXTS[name]}\n"))


def bonds(name: str, sites: int) -> dict[str, np.ndarray]:
    """Return the bonds of a ring with chords."""
    if name != "net":
        return {}
    ring = np.arange(sites)
    return {"bonds": np.stack([ring, (ring * 7 + 3) % sites], axis=1)[(ring * 6 + 3) % sites != 0]}


def start(name: str, sizes: tuple[int, ...]) -> np.ndarray:
    return 0.1 * np.random.default_rng(3).normal(size=(len(compiled(name).spec.coordinates), *sizes))


@pytest.mark.thin(3)
@pytest.mark.parametrize(("name", "sizes"), CASES)
def test_steps_that_sweeps_cannot_make_are_those_of_the_ordinary_system(name: str, sizes: tuple[int, ...]) -> None:
    x, compilation, more = start(name, sizes), compiled(name), bonds(name, sizes[0])
    module = load_module(emit(compilation.program, "numpy", "phigen")[f"stiff_{name}.py"], f"stiff_{name}")
    _, sites = module._started(x, more)
    rows = module._coefficients(sites, 0.2)
    with np.errstate(all="ignore"), pytest.raises(module.FailedError):
        module._by_sweeps(rows[0], x, x, sites)
    if x.size < 20:
        whole = expand(cell_from_spec(compilation.spec), sizes, more["bonds"].tolist() if more else ())
        order = compilation.order.order
        spec = replace(whole.spec(), order=order, composition="suzuki" if order > 2 else "auto", gauge="none")
        ordinary = solver_of(compile_spec(replace(spec, scheme="series")), "numpy")
        reference = ordinary.integrate(x.reshape(-1), 0.2, 5).x[-1].reshape(x.shape)
    else:
        reference = module.integrate(x, 0.2, 5, **more)[-1]
    for target in ("numpy", "c"):
        final = lattice_solver_of(compilation, target).integrate(x, 0.2, 5, 5, **more).x[-1]
        np.testing.assert_allclose(final, reference, rtol=0, atol=1e-12)


@pytest.mark.thin(2)
@pytest.mark.parametrize(("name", "sizes"), CASES)
def test_cotangents_go_back_through_such_steps(name: str, sizes: tuple[int, ...]) -> None:
    """Cotangents use elimination with the transposed matrix, or Krylov spaces, as tangent vectors use those of the
    matrix.
    """
    solver = lattice_solver_of(compiled(name), "c")
    x, more, random = start(name, sizes), bonds(name, sizes[0]), np.random.default_rng(4)
    bar, along = random.normal(size=(2, *x.shape))
    ((_, (carried,)),) = solver.tangents(x, 0.2, 5, along[None], 5, **more)
    assert np.sum(solver.pullback(x, 0.2, 5, bar, **more).x0_bar * along) == pytest.approx(
        np.sum(bar * carried), rel=1e-12
    )


@pytest.mark.slow
def test_short_code_follows_sweeps_by_differences_and_solves_stages_to_round_off_too() -> None:
    x, compilation = start("sheet", (9, 8)), compiled("sheet")
    short = lattice_solver_of(compile_spec(compilation.spec, profile="small"), "c")
    reference = lattice_solver_of(compilation, "numpy").integrate(x, 0.2, 5, 5).x[-1]
    np.testing.assert_allclose(short.integrate(x, 0.2, 5, 5).x[-1], reference, rtol=0, atol=1e-13)


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", ["numpy", "c"])
@pytest.mark.parametrize("profile", ["fast", "small"])
def test_equations_without_a_solution_are_told(target: str, profile: str) -> None:
    spec = specs.loads(f"phigen: 1\nname: bursting\n{BURSTING}\n")
    solver, x = lattice_solver_of(compile_spec(spec, profile=profile), target), np.zeros((2, 3, 4))
    with pytest.raises(StepError, match="NO_CONVERGENCE") as failure:  # the matrix at x is singular
        solver.integrate(x, 2.0, 5, 1)
    assert np.array_equal(failure.value.trajectory.x[-1], x)


@pytest.mark.thin(2)
@pytest.mark.parametrize(
    ("profile", "axes", "h", "left"), [("fast", "i", 0.2, 1e-13), ("small", "i", 0.05, 1e-5), ("fast", "ij", 0.1, 1e-5)]
)
def test_one_correction_solves_a_linear_stage(profile: str, axes: str, h: float, left: float, tmp_path: Path) -> None:
    """On a ring the correction is solved by elimination and by a Krylov space; in a plane by a Krylov space of the
    matrix with a block-diagonal preconditioner.

    With a wrong matrix, stages would be solved too, by more corrections; and so would they in the plane without the
    preconditioner.
    """
    text, sizes = (LINEAR, "40") if axes == "i" else (PLANE, "19,21")
    program = compile_spec(specs.loads(f"phigen: 1\nname: linear\nadjoint: true\n{text}\n"), profile=profile).program
    write(tmp_path, {**emit(program, "c", "phigen"), "driver.c": DRIVER})
    run(["cc", "-std=c99", f"-DSTEP={h}", f"-DSIZES={sizes}", "-o", "driver", "driver.c", "-lm"], tmp_path)
    first, second, forth, back = map(float, run(["./driver"], tmp_path).split())
    assert first > 0.1
    assert second < left * first
    assert back <= forth


@pytest.mark.parametrize("adjoint", ["false", "true"])
def test_functions_of_lanes_are_there_if_loops_over_sites_call_them(adjoint: str) -> None:
    """Unless there is a transpose, only the derivative of a stage along y needs the derivative of φ, and it does not
    call the lane version.
    """
    spec = specs.loads(f"{LATTICES['spin_graph']}scheme: series\nadjoint: {adjoint}\n")
    text = emit(compile_spec(spec).program, "c", "phigen")["spin_graph.c"]
    names = re.findall(r"^static inline double (\w+_(?:lane|near))\(", text, re.M)
    called = ["spin_graph_phi0_lane"] + ["spin_graph_phi1_lane"] * (adjoint == "true")
    assert [name for name in names if text.count(f"{name}(") > 1] == names == called


@pytest.mark.parametrize("graph", [False, True])
def test_short_code_has_no_functions_of_derivatives_that_are_differences(graph: bool) -> None:
    text = f"phigen: 1\nname: ripple\nprofile: small\n{CANONICAL}"
    text += "lattice: {graph: g}\nhamiltonian: {sites: p**2/2, bonds: 'cos(q[a] - q[b])'}\n" if graph else ""
    text += "" if graph else "lattice: {axes: [i]}\nhamiltonian: 'p**2/2 - cos(q[i+1] - q)'\n"
    code = emit(compile_spec(specs.loads(text)).program, "c", "phigen")["ripple.c"]
    assert re.findall(r"^static inline double (\w+)_lane\(", code, re.M) == ["ripple_sin"] * (not graph)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ring", "net"])
def test_short_code_makes_the_same_steps(name: str) -> None:
    x, more = start(name, (30,)), bonds(name, 30)
    short = compile_spec(compiled(name).spec, profile="small")
    by = [lattice_solver_of(c, "c").integrate(x, 0.2, 5, 5, **more).x[-1] for c in (short, compiled(name))]
    np.testing.assert_allclose(*by, rtol=0, atol=1e-12)


def test_threads_make_the_same_bits() -> None:
    x, solver = start("sheet", (50, 90)), lattice_solver_of(compiled("sheet"), "c")
    assert len({run.tobytes() for run in with_threads(lambda: solver.step(x, 0.1))}) == 1
