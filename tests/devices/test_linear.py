"""Linear equations on devices: Gaussian elimination with pivots by selection; the code is compiled as C."""

import ctypes

import numpy as np
from support import run, tool, write

from phigen import resources

PROGRAM = """\
#include <math.h>
#define PHI_DIM 4
#define PHI_UNROLL
#include "device_linear.c"
int solve(double *matrix, double *side) { return phi_solve(matrix, side); }
"""


def test_equations_whose_pivots_are_zero_or_small_are_solved(tmp_path):
    """Solve random row permutations of triangular matrices, in which some entries are 0 or 1e-12, so that pivoting is
    needed; a singular matrix is reported.
    """
    write(tmp_path, {"solve.c": PROGRAM, "model.h": ""})
    runtime = resources.templates() / "c/runtime"
    flags = ["-std=c99", "-shared", "-fPIC", "-O1", "-I", ".", "-I", runtime, "solve.c", "-o", "solve.so"]
    run([tool("gcc"), *flags], tmp_path)
    solve = ctypes.CDLL(str(tmp_path / "solve.so")).solve
    solve.argtypes = [ctypes.c_void_p, ctypes.c_void_p]
    rng = np.random.default_rng(0)
    for _ in range(50):
        matrix = (np.triu(rng.standard_normal((4, 4)), 1) + np.eye(4))[rng.permutation(4)]
        matrix[rng.integers(4)] += 1e-12
        side = rng.standard_normal(4)
        expected, copy = np.linalg.solve(matrix, side), np.ascontiguousarray(matrix)
        assert solve(copy.ctypes.data, side.ctypes.data) == 1
        np.testing.assert_allclose(side, expected, rtol=1e-10, atol=1e-12)
    assert solve(np.ones((4, 4)).ctypes.data, np.ones(4).ctypes.data) == 0
