"""Lattices whose Hamiltonian depends on the time, compared with the ordinary system of a few of their sites."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from phigen import spec as specs
from phigen.api import lattice_solver_of
from phigen.compilation import Compilation
from phigen.compiler import compile_spec
from phigen.geometry.system import system_from_spec
from phigen.lattice.energy_balance import Power, integral
from phigen.lattice.expansion import expand
from phigen.lattice.states import Start
from phigen.proofs import lattice_statements
from phigen.runtime.arguments import Beginning
from phigen.runtime.lattice import LatticeSolver
from phigen.spec.model import Spec
from phigen.spec.yaml_text import spec_text
from phigen.study.lattice_errors import BALANCE, errors_of
from phigen.study.lattice_verification import verify_lattice
from phigen.symbolic.arrays import evaluate
from phigen.symbolic.expression import gradient
from phigen.symbolic.verdict import PROVED

SPINS = "coordinates: [x, y, z]\npoisson: {lie_algebra: {name: so(3)}}\ncasimirs: {C: x**2 + y**2 + z**2}\n"
CANONICAL = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
TEXTS = {
    # all parts depend on the time, which advances separately; a phase at each site
    "driven": "lattice: {axes: [i], boundary: open}\nparameters: {w: 1.7, f: {value: 0.3*i, at: sites}}\n"
    f'{SPINS}hamiltonian: "-(x*x[i+1] + y*y[i+1] + z*z[i+1]) - cos(w*t + f)*z - 0.3*(x + y)*t"',
    # the time advances with the kinetic energy
    "pushed": "lattice: {axes: [i, j], boundary: [periodic, open]}\nparameters: {w: 2}\ninvariants: {F: p - t}\n"
    f'{CANONICAL}hamiltonian: "p**2/2 - cos(q[i+1] - q)*sin(w*t) - cos(q[j+1] - q) - q"',
    "melting": "lattice: {axes: [i], boundary: periodic}\nscheme: series\nparameters: {w: 2}\n"
    f'{CANONICAL}hamiltonian: "(1 + q**2*sin(w*t)/3)*p**2/2 + p*p[i+1]/4*cos(t) + q**2/2"',
    "coloured": "lattice: {graph: bonds}\nparameters: {J: {value: 1.2, at: bonds}, w: 2}\n"
    f'{SPINS}hamiltonian: {{sites: -sin(w*t)*z + x**2/5, bonds: "-J*cos(t)*(x[a]*x[b] + z[a]*z[b]) + x[a]*y[b]/3"}}',
    "charged": "lattice: {pairs: all}\nscheme: series\ncoordinates: [x, y]\nparameters: {w: 2}\n"
    'poisson: {brackets: {x: {y: 1}}}\nhamiltonian: {sites: x**2*cos(w*t)/2, pairs: "(1 + sin(t)/2)/'
    '(1 + (x[a] - x[b])**2 + (y[a] - y[b])**2)"}',
}  # fmt: skip
BONDS = np.array([[0, 1], [1, 2], [2, 0], [2, 3], [4, 3], [3, 4]])
SIZES = {"pushed": (3, 4), "coloured": (5,)}
pytestmark = pytest.mark.few("driven", "melting", "coloured", of=TEXTS)
T0 = 0.7


@cache
def compiled(name: str, order: int = 2) -> Compilation:
    return compile_spec(specs.loads(f"phigen: 1\nname: {name}\ntime: t\norder: {order}\n{TEXTS[name]}\n"))


@cache
def solver(name: str, order: int = 2, target: str = "numpy") -> LatticeSolver:
    return lattice_solver_of(compiled(name, order), target)


def given(name: str) -> tuple[np.ndarray, dict[str, Any]]:
    """Return a state, and all parameters including the bonds."""
    spec, sizes, random = compiled(name).spec, SIZES.get(name, (4,)), np.random.default_rng(1)
    lengths = {"sites": sizes, "bonds": (len(BONDS),), "all": ()}
    values = {p.name: random.uniform(0.5, 1.5, lengths[p.at]) for p in spec.parameters}
    bonds = {"bonds": BONDS} if spec.lattice and spec.lattice.graph else {}
    return random.normal(size=(len(spec.coordinates), *sizes)), values | bonds


def expanded(name: str) -> tuple[Spec, dict[str, Any]]:
    """Return the ordinary spec, and its values at T0."""
    cell, (x, values) = compiled(name).cell, given(name)
    assert cell is not None
    whole = expand(cell, x.shape[1:], values.get("bonds", np.empty((0, 2))).tolist())
    spec = whole.spec()
    return spec, whole.numbers(values) | dict(zip(spec.coordinates, x.reshape(-1), strict=True)) | {"t": T0}


@pytest.mark.parametrize("name", TEXTS)
def test_energy_and_field_are_those_of_the_expansion(name: str) -> None:
    spec, here = expanded(name)
    x, values = given(name)
    system = system_from_spec(specs.loads(spec_text(spec)))  # the text that phigen show --expand prints
    np.testing.assert_allclose(
        solver(name).hamiltonian(x, T0, parameters=values), evaluate([spec.hamiltonian], here)[0]
    )
    field = solver(name).vector_field(x, T0, parameters=values).reshape(-1)
    np.testing.assert_allclose(field, np.array(evaluate(system.vector_field(), here), dtype=float), atol=1e-14)
    rate = evaluate(gradient(spec.hamiltonian, ["t"]), here)[0]
    cell = compiled(name).cell
    assert cell is not None
    power = Power(cell)(x, field.reshape(x.shape), {**values, "t": T0})
    np.testing.assert_allclose(power, rate, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("name", TEXTS)
def test_steps_have_their_order(name: str, order: int) -> None:
    x, values = given(name)
    integrator = solver(name, order)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        return solver(name).vector_field(y.reshape(x.shape), t, parameters=values).reshape(-1)

    exact = solve_ivp(rate, (T0, T0 + 0.4), x.reshape(-1), "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    errors = [
        np.abs(integrator.integrate(x, 0.4 / n, n, n, t0=T0, parameters=values).x[-1].reshape(-1) - exact).max()
        for n in (4, 8)
    ]
    assert np.log2(errors[0] / errors[1]) > order - 0.3


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", ["driven", "melting", "coloured"])
def test_c_makes_the_steps_of_numpy_and_goes_on_with_the_same_bits(name: str, tmp_path: Path) -> None:
    x, values = given(name)
    integrator = solver(name, 4, "c")
    asked: dict[str, Any] = {"t0": T0, "parameters": values}
    run = integrator.integrate(x, 0.05, 9, 3, **asked)
    np.testing.assert_allclose(run.x[-1], solver(name, 4).integrate(x, 0.05, 9, 3, **asked).x[-1], rtol=0, atol=1e-13)
    np.testing.assert_allclose(run.t, T0 + 0.05 * np.array([0, 3, 6, 9]))
    np.testing.assert_allclose(
        run.energy[-1], integrator.hamiltonian(run.x[-1], run.t[-1], parameters=values), rtol=1e-13
    )
    checkpoint = tmp_path / "kept"

    def stop(steps_done: int) -> None:
        if steps_done == 6:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        integrator.integrate(x, 0.05, 9, 3, checkpoints=checkpoint, progress=stop, **asked)
    again = integrator.integrate(x, 0.05, 9, 3, checkpoints=checkpoint, **asked)
    assert again.x.tobytes() == run.x.tobytes()


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_states_at_times_are_steps_from_the_nearest_frame_at_its_time(target: str) -> None:
    x, values = given("driven")
    integrator, h, asked = solver("driven", 4, target), 0.1, {"parameters": values}
    run, every = (integrator.integrate(x, h, 10, stride, t0=T0, **asked) for stride in (4, 1))
    times = T0 + np.array([0.0, 0.3, 0.83, 1.0, 0.57])
    states = run.at(times)
    assert states.shape == (5, *x.shape)
    np.testing.assert_allclose(states[[0, 3]], run.x[[0, -1]], rtol=0, atol=0)
    np.testing.assert_allclose(
        states[1], every.x[3], rtol=0, atol=1e-13
    )  # a step of negative size from the frame at 0.4
    np.testing.assert_allclose(states[2], integrator.step(run.x[2], 0.03, t0=T0 + 0.8, **asked), rtol=0, atol=1e-14)
    after = integrator.step(integrator.step(run.x[1], h, t0=T0 + 0.4, **asked), 0.07, t0=T0 + 0.5, **asked)
    np.testing.assert_allclose(states[4], after, rtol=0, atol=1e-14)
    with pytest.raises(ValueError, match=r"between 0\.7 and 1\.7"):
        run.at(2.0)


def test_states_at_times_go_back_too_and_with_noise_are_frames() -> None:
    x, values = given("driven")
    back = solver("driven", 4).integrate(x, -0.1, 5, 5, t0=T0, parameters=values)
    np.testing.assert_allclose(
        back.at(T0 - 0.02)[0], solver("driven", 4).step(x, -0.02, t0=T0, parameters=values), rtol=0, atol=1e-14
    )
    noise = "noise: {n: {hamiltonian: z}}"
    text = f'phigen: 1\nname: bath\nlattice: {{axes: [i]}}\n{SPINS}hamiltonian: "x*x[i+1]"\n{noise}\n'
    noisy = lattice_solver_of(compile_spec(specs.loads(text)), "numpy").integrate(x, 0.1, 4, 2, seed=1)
    np.testing.assert_array_equal(noisy.at([0.2, 0.0]), noisy.x[[1, 0]])
    with pytest.raises(ValueError, match="is between two stored states, where the path of the noise is not known"):
        noisy.at(0.1)


def test_sweeps_by_hand_know_the_time() -> None:
    x, values = given("driven")
    integrator = solver("driven", 4, "c")
    session = integrator.started(Beginning(x, 0.05, values, T0))
    session.begin(0.05)
    for step in range(2):
        session.passed(0.05, step)
        for stage in range(len(integrator.backend.stages()) - 1):
            session.sweep(stage, 1, 0, x.shape[1])
    one = integrator.step(integrator.step(x, 0.05, t0=T0, parameters=values), 0.05, t0=T0 + 0.05, parameters=values)
    np.testing.assert_allclose(session.state(), one, rtol=0, atol=1e-14)


def test_the_energy_is_in_balance_with_the_work_of_the_time() -> None:
    x, values = given("driven")
    cell = compiled("driven").cell
    assert cell is not None
    errors = [
        errors_of(cell, solver("driven", 4).integrate(x, h, steps, t0=T0, parameters=values))[BALANCE].max()
        for h, steps in ((0.2, 10), (0.1, 20))
    ]
    assert np.log2(errors[0] / errors[1]) > 3.5
    assert errors[1] < 1e-6


@pytest.mark.parametrize("steps", [0.5, 1.5, 4])
def test_the_work_of_a_short_run_is_as_exact_as_that_of_a_long_one(steps: float) -> None:
    """Polynomials through the values of the run alone would have degree 1 to 4."""
    x, values = given("driven")
    cell = compiled("driven").cell
    assert cell is not None
    run = solver("driven", 4).integrate(x, 0.05, until=T0 + 0.05 * steps, t0=T0, parameters=values)
    assert errors_of(cell, run)[BALANCE].max() < 2e-8


def test_integrals_along_steps_are_those_of_polynomials() -> None:
    t = np.arange(12) * 0.3
    for count in (12, 3):
        power = min(count, 8) - 1
        cumulative, _ = integral(t[:count] ** power, 0.3)
        np.testing.assert_allclose(cumulative, t[:count] ** (power + 1) / (power + 1), atol=1e-12)


@pytest.mark.parametrize("name", TEXTS)
def test_parts_flows_and_dated_invariants_are_proved(name: str) -> None:
    compilation = compiled(name)
    groups = lattice_statements.lattice(compilation.cell) | lattice_statements.sweeps(compilation)
    assert [str(s) for group in groups.values() for s in group if s.verdict != PROVED] == []


@pytest.mark.slow
def test_verification_judges_the_balance_of_energy() -> None:
    x, values = given("pushed")
    compilation = compile_spec(compiled("pushed").spec, order=4, tangent=True)
    start = Start(x.shape[1:], x, values, np.empty((0, 2), dtype=np.int64))
    verification = verify_lattice(
        compilation, {"numpy": lattice_solver_of(compilation, "numpy")}, "run", start, 0.1, 60, t0=T0
    )
    rows = {c.name: c for c in verification.checks}
    assert verification.failures == []
    assert rows["energy balance: largest error"].value < 1e-5
    assert rows["invariant F: largest error"].value < 1e-13
    assert rows["Poisson identity on 3×3 sites"].value < 1e-14


def test_the_time_is_asked_for() -> None:
    x, values = given("driven")
    with pytest.raises(TypeError, match="t is missing"):
        solver("driven").hamiltonian(x, parameters=values)
    assert solver("driven").casimirs(x, parameters=values)["C"].shape == x.shape[1:]
