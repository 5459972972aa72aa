"""Steps so large that sweeps do not contract: Newton's method, by elimination in C, by Krylov spaces in NumPy."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from phigen import spec as specs
from phigen.api import lattice_solver_of, solver_of
from phigen.compilation import Compilation
from phigen.compiler import compile_spec, emit
from phigen.lattice.building import cell_from_spec
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
}
#: Few sites, whose matrix is a full one, and many.
SIZES = {"ring": [(5,), (31,)], "chain": [(4,), (23,)], "waves": [(6,), (40,)], "sheet": [(3, 4)]}
CASES = [(name, sizes) for name, listed in SIZES.items() for sizes in listed]


@cache
def compiled(name: str) -> Compilation:
    return compile_spec(specs.loads(f"phigen: 1\nname: stiff_{name}\n{TEXTS[name]}\n"))


def start(name: str, sizes: tuple[int, ...]) -> np.ndarray:
    return 0.1 * np.random.default_rng(3).normal(size=(len(compiled(name).spec.coordinates), *sizes))


@pytest.mark.parametrize(("name", "sizes"), CASES)
def test_steps_that_sweeps_cannot_make_are_those_of_the_ordinary_system(name: str, sizes: tuple[int, ...]) -> None:
    x, compilation = start(name, sizes), compiled(name)
    module = load_module(emit(compilation.program, "numpy", "phigen")[f"stiff_{name}.py"], f"stiff_{name}")
    rows, sites = module._coefficients(module._Sites(x.shape, {}), 0.2), module._Sites(x.shape, {})
    with np.errstate(all="ignore"), pytest.raises(module.FailedError):
        module._by_sweeps(rows[0], x, x, sites)
    whole = expand(cell_from_spec(compilation.spec), sizes).spec()
    ordinary = replace(whole, order=compilation.order.order, composition="auto" if name != "ring" else "suzuki")
    if x.size < 20:
        expected = solver_of(compile_spec(replace(ordinary, gauge="none", scheme="series")), "numpy")
        reference = expected.integrate(x.reshape(-1), 0.2, 5).x[-1].reshape(x.shape)
    else:
        reference = module.integrate(x, 0.2, 5)[-1]
    for target in ("numpy", "c") if name != "sheet" else ("numpy",):
        found = lattice_solver_of(compilation, target).integrate(x, 0.2, 5, 5).x[-1]
        np.testing.assert_allclose(found, reference, rtol=0, atol=1e-12)
