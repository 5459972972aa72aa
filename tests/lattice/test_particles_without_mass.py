"""Parameters at sites that may be 0: test particles and passive tracers, whose equations need quotients in which the
parameter cancels.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner
from node import asked

import phigen
import phigen.spec
from phigen.api import emit
from phigen.cli import group
from phigen.compiler import compile_spec
from phigen.lattice.cancelling import cancelled, common_powers, divided
from phigen.symbolic.expression import call, number, sqrt, symbol

BODIES = """\
phigen: 1
name: bodies
lattice: {RELATION}
coordinates: [x, y, vx, vy]
parameters: {G: 1, m: {value: 0, at: sites, nonnegative: true}}
poisson: {brackets: {x: {vx: 1/m}, y: {vy: 1/m}}}
hamiltonian:
  sites: m*(vx**2 + vy**2)/2
  KIND: -G*m[a]*m[b]/sqrt((x[a] - x[b])**2 + (y[a] - y[b])**2)
runs:
  belt:
    parameters: {m: [1, 0.01, 0, 0]}
    initial: {x: [0, 1, 2, 0], y: [0, 0, 0, 3], vx: [0, 0, 0, -0.577], vy: [0, 1, 0.707, 0]}
    step: 0.05
    steps: 200
"""
PAIRS = BODIES.replace("RELATION", "pairs: all").replace("KIND", "pairs")
ALL_BONDS = [[0, 1], [0, 2], [0, 3], [2, 1], [1, 3], [3, 2]]
BONDS = BODIES.replace("RELATION", "graph: bonds").replace("KIND", "bonds") + f"    bonds: {ALL_BONDS}\n"

TRACERS = """\
phigen: 1
name: tracers
coordinates: [x, y]
parameters: {g: {value: 1, at: sites}}
lattice: {pairs: all}
poisson: {brackets: {x: {y: 1/g}}}
hamiltonian: {pairs: "-g[a]*g[b]*log((x[a] - x[b])**2 + (y[a] - y[b])**2)/(4*pi)"}
runs:
  r:
    initial: {x: [0, 1, 2, 0.5], y: [1, 0, 0.5, 2]}
    parameters: {g: [1, 2, 0, -0.5]}
    step: 0.02
    steps: 100
"""


def accelerations(x, m):
    """Return the accelerations (axes, bodies) by gravity of bodies at x."""
    apart = x[:, None, :] - x[:, :, None]
    cubes = np.linalg.norm(apart, axis=0) ** 3
    np.fill_diagonal(cubes, np.inf)
    return (m * apart / cubes).sum(axis=2)


def dragged(x, g):
    """Return the velocities (axes, vortices) that vortices of circulations g at x cause."""
    apart = x[:, :, None] - x[:, None, :]
    squares = (apart**2).sum(axis=0)
    np.fill_diagonal(squares, np.inf)
    return np.array([-(g * apart[1] / squares).sum(axis=1), (g * apart[0] / squares).sum(axis=1)]) / (2 * np.pi)


@pytest.mark.thin(3)
@pytest.mark.parametrize(
    ("text", "target", "profile"),
    [
        (PAIRS, "c", "fast"),
        (PAIRS, "numpy", "fast"),
        (BONDS, "c", "small"),
        (PAIRS + "scheme: series\n", "c", "fast"),
        (BONDS + "scheme: series\n", "c", "small"),
        (BONDS + "scheme: series\n", "numpy", "fast"),
    ],
)
def test_test_particles_fall_as_all_bodies_do(text, target, profile):
    solver = phigen.compile(phigen.spec.loads(text + "order: 4\n"), target=target, profile=profile)
    run = solver.run()
    field = solver.vector_field(run.x[-1], **run.parameters)
    np.testing.assert_array_equal(field[:2], run.x[-1][2:])
    expected = accelerations(run.x[-1][:2], np.array([1, 0.01, 0, 0]))
    np.testing.assert_allclose(field[2:], expected, rtol=1e-13, atol=1e-15)
    heavier = solver.run(m=np.array([1, 0.01, 1e-9, 1e-9]))
    assert 0 < np.abs(heavier.x[-1] - run.x[-1]).max() < 1e-7
    assert np.ptp(run.energy) < 1e-6 * abs(run.energy[0])


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_tracers_are_carried_by_vortices(target):
    solver = phigen.compile(phigen.spec.loads(TRACERS), target=target)
    run = solver.run()
    g = np.array([1, 2, 0, -0.5])
    expected = dragged(run.x[-1], g)
    np.testing.assert_allclose(solver.vector_field(run.x[-1], **run.parameters), expected, rtol=1e-13)
    alone = np.array([0, 1, 3])
    without = solver.integrate(run.x[0][:, alone], 0.02, 100, g=g[alone])
    np.testing.assert_allclose(run.x[-1][:, alone], without.x[-1], atol=1e-13)


@pytest.mark.parametrize("text", [PAIRS, TRACERS])
def test_javascript_moves_particles_without_mass_alike(text, tmp_path):
    spec = phigen.spec.loads(text)
    run = phigen.compile(spec, target="numpy").run()
    (module,) = emit(compile_spec(spec).program, "js", "").values()
    path = tmp_path / "solver.mjs"
    path.write_text(module)
    params = {k: np.ravel(v).tolist() if np.ndim(v) else v for k, v in run.parameters.items()}
    options = json.dumps({"x0": run.x[0].ravel().tolist(), "sizes": [4], "params": params})
    steps = f"const s = new module.Solver({options}); s.integrate({run.h}, {run.steps}); return [...s.x]"
    np.testing.assert_allclose(asked(path, steps), run.x[-1].ravel(), rtol=1e-12, atol=1e-13)


@pytest.mark.slow
def test_methods_for_test_particles_are_verified_with_their_gradients(tmp_path):
    path = tmp_path / "bodies.yaml"
    path.write_text(PAIRS)
    result = CliRunner().invoke(group, ["verify", str(path), "--adjoint", "--quick", "--json"], prog_name="phigen")
    assert result.exit_code == 0, result.output
    assert '"Poisson identity on 3 sites, m = 0.01 instead of 0"' in result.stdout
    assert '"gradient against differences on all sites"' in result.stdout


def test_powers_of_named_symbols_are_multiplied_together():
    m, k, x = map(symbol, ("m", "k", "x"))
    (one,) = cancelled([(m * x + m**2 * k) / m], ["m"])
    assert one == x + m * k
    (root,) = cancelled([sqrt(m * x) / m], ["m"])
    assert root == sqrt(m * x) * (1 / m)
    (sine,) = cancelled([call("sin", m * (k / m)) * m**-2 * (m**3 - x * m**2)], ["m"])
    assert sine == call("sin", k) * (m - x)
    assert common_powers([m * x, m**2 * k - m], ["m", "k"]) == {"m": 1}
    assert common_powers([m * x, number(1) + m], ["m"]) == {}
    assert divided(m**2 * k - m * x, {"m": 1}) == m * k - x
