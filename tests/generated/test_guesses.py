"""Starting guesses affect the speed of a solver, and nothing else."""

import numpy as np
import pytest

from phigen import api, resources


@pytest.mark.parametrize("stride", [1, 8, 20000])
def test_guesses_near_a_saddle_lead_nowhere_else(stride):
    """Recurrences fitted to the long rest near the middle axis may guess 1e8, where the step has a solution as well."""
    solver = api.compile(resources.bundled_specs() / "rigid_body.yaml", order=10)
    for h in (0.55, 0.6, 0.7):
        energy = solver.integrate([0.1, 1, 0.1], h=h, steps=20000, stride=stride).energy
        assert np.ptp(energy) < 1e-8


def test_guesses_near_a_saddle_lead_members_of_ensembles_nowhere_else():
    solver = api.compile(resources.bundled_specs() / "rigid_body.yaml", order=10)
    start = np.array([[0.1 * 0.5**k, 1, 0.1] for k in range(9)])
    ends = solver.ensemble(start, h=0.6, steps=20000)
    energies = [[solver.hamiltonian(x) for x in states] for states in (start, ends)]
    np.testing.assert_allclose(energies[1], energies[0], rtol=1e-8)
