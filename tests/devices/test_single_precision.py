"""Ensembles in single precision on devices, compared with C."""

import re

import numpy as np
import nvrtc
import pytest
from support import COMMAND, compile_text

import phigen
from phigen.compiler import emit

pytest.importorskip("pyopencl")

BODY = """
coordinates: [x1, x2, x3]
parameters: {I1: 1, I2: 2}
poisson:
  brackets: {x1: {x2: -x3, x3: x2}, x2: {x3: -x1}}
hamiltonian: (x1**2/I1 + x2**2/I2 + x3**2/3)/2
casimirs: {C: x1**2 + x2**2 + x3**2}
real: float
"""


@pytest.mark.parametrize(
    "scheme", [pytest.param("series", marks=pytest.mark.slow), pytest.param("splitting", marks=pytest.mark.slow)]
)
def test_members_have_the_bits_of_c_and_its_casimirs(scheme, tmp_path):
    """Members agree with C bit by bit. Thanks to compensated sums, 500 steps change a Casimir by a few rounding errors
    only.
    """
    compilation = compile_text(f"{BODY}order: 2\nscheme: {scheme}\n")
    device, c = (phigen.compile(compilation, target, profile="small") for target in ("opencl", "c"))
    x0 = np.random.default_rng(2).standard_normal((20, 3)) + 1
    frames, expected = (solver.ensemble(x0, 0.05, 500, stride=100) for solver in (device, c))
    np.testing.assert_array_equal(frames, expected)
    casimir = np.square(frames).sum(axis=-1)
    assert np.ptp(casimir / casimir[0], axis=0).max() < 8 * np.finfo(np.float32).eps
    (text,) = emit(compilation.program, "device", COMMAND).values()
    assert not re.search(r"\bdouble\b", text.split("*/", 1)[1].replace("numbers in double", ""))
    if nvrtc.is_installed():
        kernel = nvrtc.assembled(nvrtc.ptx(text, "sm_90"), "sm_90", tmp_path)["t_ensemble_kernel"]
        assert kernel.spilled == 0
