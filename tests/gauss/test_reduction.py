"""Gauss steps whose fixed-point sweeps iterate momenta only: positions follow from the momenta by the square of the
matrix of coefficients, as in Nyström methods.
"""

from fractions import Fraction

import numpy as np
import pytest
from support import compile_text, solver

from phigen.gauss.tableau import DOUBLE, SINGLE, tableau

CANONICAL = "coordinates: [q1, q2, p1, p2]\npoisson:\n  canonical: {q: [q1, q2], p: [p1, p2]}\nscheme: gauss\n"
HENON = CANONICAL + "hamiltonian: (p1**2 + p2**2 + q1**2 + q2**2)/2 + q1**2*q2 - q2**3/3\norder: "
MAGNETIC = CANONICAL + "order: 8\nhamiltonian: ((p1 + q2)**2 + (p2 - q1)**2)/2 + q1**2*q2**2\n"
NAMBU = (
    "coordinates: [theta, p, V]\npoisson:\n  matrix:\n    - [0, 1, 0]\n"
    "    - [-1, 0, -sin(theta)]\n    - [0, sin(theta), 0]\nhamiltonian: p**2/2 + V\nscheme: gauss\norder: 16\n"
    "structure: to truncation\n"
)


def reduced(text):
    return compile_text(text).program.step.reduced


@pytest.mark.parametrize("precision", [DOUBLE, SINGLE])
@pytest.mark.parametrize("stages", range(1, 9))
def test_reduced_steps_are_exactly_symplectic(stages, precision):
    """The rounded coefficients satisfy the conditions of Suris for symplectic Nyström methods exactly: ν_ij − ν_ji =
    τ_i − τ_j.
    """
    table = tableau(stages, precision)
    nu = [[Fraction(v) for v in row] for row in table.doubled]
    tau = [Fraction(t) for t in table.times]
    assert all(nu[i][j] - nu[j][i] == tau[i] - tau[j] for i in range(stages) for j in range(stages))
    assert all(float(1 - t) == 1 - t for t in tau)
    mu, b = np.array(table.mixing), np.array(table.weights)
    assert np.abs(np.array(table.doubled) - mu @ np.diag(b) @ mu).max() < 8 * float(precision.spacing)


def test_positions_follow_from_momenta():
    sweeps = reduced(HENON + "8")
    assert (sweeps.iterated, sweeps.followers) == ((2, 3), (0, 1))


def test_unknowns_that_no_other_depends_on_are_not_iterated():
    sweeps = reduced(NAMBU)
    assert (sweeps.iterated, sweeps.followers) == ((1,), (0,))


def test_brackets_of_positions_exclude_reduced_sweeps_of_exact_steps():
    """With this order of coordinates q1 and p1 would follow from q2 and p2. They have a nonzero bracket, so the
    conditions of Suris do not suffice, and all unknowns are iterated.
    """
    text = CANONICAL.replace("q1, q2, p1, p2]\n", "q1, p1, q2, p2]\n", 1) + "order: 8\nhamiltonian: q1*q2 + p1*p2\n"
    assert reduced(text) is None
    assert reduced(CANONICAL + "order: 8\nhamiltonian: q1*q2 + p1*p2\n").followers == (0, 1)


def test_unknowns_that_depend_on_themselves_are_iterated_all():
    assert reduced(MAGNETIC) is None


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize("text", [HENON + "4", HENON + "12", HENON + "16", NAMBU])
def test_reduced_sweeps_solve_the_equations_of_all_unknowns(text):
    """C, which iterates momenta only, agrees with NumPy, which iterates all unknowns."""
    x = [0.3, 0.4, 0.0] if "theta" in text else [0.0, 0.1, 0.49, 0.0]
    compilation = compile_text(text)
    ends = [solver(compilation, target).integrate(x, 0.4, 50).x[-1] for target in ("c", "numpy")]
    assert np.abs(ends[0] - ends[1]).max() < 1e-14
