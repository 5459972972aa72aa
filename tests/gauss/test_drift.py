"""The fixed-point sweeps of a Gauss step stop late enough: the mean energy of many members of an ensemble does not
drift.
"""

from dataclasses import replace

import numpy as np
import pytest
from support import solver

from phigen.compiler import compile_spec
from phigen.runtime import toolchain
from phigen.spec import loads

HENON = """
phigen: 1
name: henon
coordinates: [q1, q2, p1, p2]
poisson:
  canonical: {q: [q1, q2], p: [p1, p2]}
hamiltonian: (p1**2 + p2**2 + q1**2 + q2**2)/2 + q1**2*q2 - q2**3/3
scheme: gauss
order: 12
"""
STEPS = 20_000


def energy(x):
    q1, q2, p1, p2 = np.moveaxis(x, -1, 0)
    return (p1**2 + p2**2 + q1**2 + q2**2) / 2 + q1**2 * q2 - q2**3 / 3


@pytest.mark.parametrize(("profile", "members"), [("fast", 128), pytest.param("small", 512, marks=pytest.mark.slow)])
def test_mean_energy_does_not_drift(profile, members, monkeypatch):
    """The mean energy error of the members is zero within its standard error: 5e-15 in SIMD batches of members, and
    2.4e-15 with the profile small, which computes the stages in a loop.

    With the weaker stopping criterion that suffices for single trajectories, the mean would drift by −9e-14 in batches
    and by 2e-14 in loops.
    """
    monkeypatch.setattr(toolchain, "BASE_FLAGS", (*toolchain.BASE_FLAGS, "-O3"))  # for ten million steps
    method = solver(compile_spec(replace(loads(HENON), profile=profile)), "c")
    draws = np.random.default_rng(1).normal(size=(members, 4))
    starts = 0.15 * draws / np.linalg.norm(draws, axis=1, keepdims=True)
    ends = method.ensemble(starts, 0.7, STEPS)
    errors = energy(ends) / energy(starts) - 1
    assert abs(errors.mean()) <= 6 * errors.std() / np.sqrt(members)
    assert errors.std() / np.sqrt(members) <= 6e-15
