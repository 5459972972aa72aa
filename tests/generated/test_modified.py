"""The modified Hamiltonian in generated code is constant along trajectories to its stated order, in C and NumPy."""

import ctypes
import math
import warnings
from functools import cache

import numpy as np
import pytest
from support import BODY, RawC, files, solver

from phigen import SpecError, spec
from phigen.compiler import compile_spec

CASIMIR = "casimirs: {C: x1**2 + x2**2 + x3**2}\n"
SYSTEMS = {
    "plain": f"{BODY}{CASIMIR}order: 2\ngauge: none\n",
    "gauged": f"{BODY}{CASIMIR}order: 2\ngauge: auto\n",
    "one-sided": "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: p**2/2 - cos(q)\n"
    "birealisation: canonical-euler\norder: 1\n",
}


@cache
def compile_with(text, count):
    return compile_spec(spec.loads(f"phigen: 1\nname: t\nmodified_hamiltonian: {count}\n{text}"))


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("name", SYSTEMS)
def test_constant_to_higher_order(name, count):
    compilation = compile_with(SYSTEMS[name], count)
    integrator = solver(compilation, "numpy")
    module = integrator.backend.module
    x0 = np.array([0.4, 1.0, 0.3][: len(compilation.system.coordinates)])
    gauge = module.gauge(x0) if compilation.program.gauge else None
    spreads = []
    for h in (0.2, 0.1):
        x = integrator.integrate(x0, h, round(6 / h)).x
        spreads.append(np.ptp(module.modified_hamiltonian(x, h, gauge=gauge)))
    expected = compilation.program.order + (2 if compilation.realisation.symmetric else 1) * count
    assert math.log2(spreads[0] / spreads[1]) > expected - 0.4


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", SYSTEMS)
def test_targets_agree(name):
    compilation = compile_with(SYSTEMS[name], 2)
    x, n = np.array([0.4, 1.0, 0.3]), compilation.program.dimension
    module = solver(compilation, "numpy").backend.module
    gauge = module.gauge(x[:n])
    raw = RawC(compilation)
    middle = [ctypes.c_void_p(gauge.ctypes.data)] if compilation.program.gauge else []
    place = ctypes.c_void_p(x.ctypes.data)
    value_in_c = raw.call("modified_hamiltonian", ctypes.c_double, None, *middle, ctypes.c_double(0.1), place)
    assert value_in_c == pytest.approx(float(module.modified_hamiltonian(x[:n], 0.1)), rel=1e-14)
    assert value_in_c != pytest.approx(float(module.hamiltonian(x[:n])), rel=1e-6)


def test_numpy_is_as_silent_where_it_overflows_as_the_other_functions():
    module = solver(compile_with(SYSTEMS["plain"], 2), "numpy").backend.module
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not np.isfinite(module.modified_hamiltonian(np.full(module.DIM, 1e200), 0.1))


def test_only_on_request():
    assert all("modified_hamiltonian" not in text for text in files(compile_with(SYSTEMS["plain"], 0), "c").values())


def test_not_for_compositions():
    with pytest.raises(SpecError, match="composition"):
        compile_with(f"{BODY}order: 6\ncomposition: kahan-li\n", 1)
