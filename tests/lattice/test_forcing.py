"""Forces, damping and noise at the sites of lattices, compared with the ordinary system of a few sites."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from phigen import spec as specs
from phigen.api import lattice_solver_of, solver_of
from phigen.compilation import Compilation
from phigen.compiler import compile_spec, emit
from phigen.errors import SpecError
from phigen.geometry.system import system_from_spec
from phigen.lattice.expansion import Expansion, expand
from phigen.lattice.states import Start
from phigen.proofs import lattice_statements
from phigen.runtime.arguments import Beginning
from phigen.runtime.lattice import LatticeSolver
from phigen.runtime.numpy_lattice import NumpyLatticeSession
from phigen.spec.yaml_text import spec_text
from phigen.study import lattice_noise
from phigen.study.lattice_errors import BALANCE, CHANGE, errors_of
from phigen.study.lattice_verification import verify_lattice
from phigen.symbolic.arrays import evaluate
from phigen.symbolic.verdict import PROVED

SPINS = "coordinates: [x, y, z]\npoisson: {lie_algebra: {name: so(3)}}\ncasimirs: {C: x**2 + y**2 + z**2}\n"
CANONICAL = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
BATH = "noise:\n" + "".join(f"  {c}: {{hamiltonian: {c}, amplitude: sqrt(2*l*T)}}\n" for c in "xyz")
HEAT = "parameters: {l: {value: 0.3, positive: true}, T: {value: 0.5, at: sites, positive: true}}\n"
FORCED = {
    # damping of a lattice with open ends, in a rotating field
    "damped": "lattice: {axes: [i], boundary: open}\ntime: t\nparameters: {l: 0.3, B: {value: 0.2, at: sites}}\n"
    f'damping: l\n{SPINS}hamiltonian: "-(x*x[i+1] + y*y[i+1] + z*z[i+1]) - B*(x*cos(t) + y*sin(t))"',
    # friction has its own flow, in a splitting with a force that is a vector
    "friction": "lattice: {axes: [i], boundary: periodic}\nparameters: {g: 0.3, w: {value: 1, at: sites}}\n"
    f'forces: {{covector: {{q: g*p}}, vector: {{p: w, q: "p[i+1]/5"}}}}\n{CANONICAL}'
    'hamiltonian: "p**2/2 - cos(q[i+1] - q)"',
    # brackets with neighbours: the stencil of the damping is twice as wide
    "stretched": "lattice: {axes: [i], boundary: open}\nparameters: {l: 0.3}\nscheme: series\ndamping: l\n"
    'forces: {covector: {b: "a[i+1]*l"}}\ncoordinates: [a, b]\n'
    'poisson: {brackets: {a: {b: a/2, "b[i+1]": -a/2}}}\nhamiltonian: b**2/2 + 2*a**2',
    "web": "lattice: {graph: bonds}\nparameters: {J: {value: 1.2, at: bonds}, l: 0.3}\ndamping: l\n"
    f'{SPINS}hamiltonian: {{sites: -z, bonds: "-J*(x[a]*x[b] + y[a]*y[b] + z[a]*z[b])"}}',
    "whirls": "lattice: {pairs: all}\nparameters: {l: 0.2, G: {value: 1, at: sites, positive: true}}\n"
    "damping: l*(1 + x**2)\nforces: {vector: {x: -l*x}}\ncoordinates: [x, y]\npoisson: {brackets: {x: {y: 1/G}}}\n"
    'hamiltonian: {sites: G*x**2, pairs: "-G[a]*G[b]*log(1 + (x[a] - x[b])**2 + (y[a] - y[b])**2)/2"}',
}
NOISY = {
    "bath": f"lattice: {{axes: [i, j], boundary: [periodic, open]}}\nscheme: series\n{HEAT}damping: l\n{BATH}{SPINS}"
    'hamiltonian: "-(x*x[i+1] + y*y[i+1] + z*z[i+1] + x*x[j+1] + y*y[j+1] + z*z[j+1])"',
    # sites of two colours are damped one after the other; the anisotropy acts on all sites
    "cool": f"lattice: {{axes: [i, j], boundary: [periodic, open]}}\n{HEAT}damping: l\n{BATH}{SPINS}"
    'hamiltonian: "-(x*x[i+1] + y*y[i+1] + z*z[i+1] + x*x[j+1] + y*y[j+1] + z*z[j+1]) - z**2/5"',
    # one part of H between the flows of the noise
    "free": f"lattice: {{axes: [i]}}\nscheme: splitting\n{HEAT}{BATH}{SPINS}hamiltonian: -z",
    "warm": f"lattice: {{graph: bonds}}\n{HEAT}damping: l\n{BATH}{SPINS}"
    'hamiltonian: {sites: -z, bonds: "-(x[a]*x[b] + y[a]*y[b] + z[a]*z[b])"}',
}
#: Friction and noise, in a splitting with several parts.
LANGEVIN = (
    "lattice: {axes: [i], boundary: periodic}\nparameters: {g: 0.3, T: 0.5}\nforces: {covector: {q: g*p}}\n"
    f"noise: {{w: {{hamiltonian: q, amplitude: sqrt(2*g*T)}}}}\n{CANONICAL}"
    'hamiltonian: "p**2/2 + (q[i+1] - q)**2/2 + q**2/2"'
)
#: Noise before and after the flows of three parts, on a plane.
HOT = (
    f"lattice: {{axes: [i, j], boundary: [periodic, open]}}\nscheme: splitting\n{HEAT}{BATH}{SPINS}"
    'hamiltonian: "-(x*x[i+1] + y*y[i+1] + z*z[i+1] + x*x[j+1] + y*y[j+1] + z*z[j+1])"'
)
#: Noise and a potential, both functions of q: steps follow paths of the noise exactly.
KICKED = (
    f"lattice: {{axes: [i]}}\nnoise: {{w: {{hamiltonian: q, amplitude: 1/4}}}}\n{CANONICAL}"
    'hamiltonian: "q**4/4 + q*q[i+1]"'
)
TEXTS = {**FORCED, **NOISY, "langevin": LANGEVIN, "hot": HOT, "kicked": KICKED}
BONDS = np.array([[0, 1], [1, 2], [2, 0], [2, 3], [4, 3], [3, 4]])
SIZES = {"web": (5,), "warm": (5,), "bath": (3, 2), "hot": (3, 2), "cool": (4, 2)}
pytestmark = pytest.mark.few("damped", "stretched", "web", "bath", "cool", "free", "langevin", of=TEXTS)


@cache
def compiled(name: str, order: int = 2) -> Compilation:
    return compile_spec(specs.loads(f"phigen: 1\nname: {name}\norder: {order}\n{TEXTS[name]}\n"))


@cache
def solver(name: str, order: int = 2, target: str = "numpy") -> LatticeSolver:
    return lattice_solver_of(compiled(name, order), target)


def given(name: str) -> tuple[np.ndarray, dict[str, Any]]:
    """Return a state, and all parameters including the bonds."""
    spec, sizes, random = compiled(name).spec, SIZES.get(name, (4,)), np.random.default_rng(1)
    lengths = {"sites": sizes, "bonds": (len(BONDS),), "all": ()}
    values: dict[str, Any] = {p.name: random.uniform(0.5, 1.5, lengths[p.at]) for p in spec.parameters}
    values |= {"bonds": BONDS} if spec.lattice and spec.lattice.graph else {}
    return random.uniform(0.2, 1.2, size=(len(spec.coordinates), *sizes)), values


def expansion(name: str) -> tuple[Expansion, dict[str, float]]:
    cell, (x, values) = compiled(name).cell, given(name)
    assert cell is not None
    whole = expand(cell, x.shape[1:], values.get("bonds", np.empty((0, 2))).tolist())
    return whole, whole.numbers(values)


def at_start(name: str) -> dict[str, Any]:
    return {"t": 0.4} if name == "damped" else {}


@pytest.mark.parametrize("name", FORCED)
def test_the_field_with_forces_is_that_of_the_expansion(name: str) -> None:
    whole, numbers = expansion(name)
    x, values = given(name)
    spec = specs.loads(spec_text(whole.spec()))  # the text that phigen show --expand prints
    here = numbers | dict(zip(spec.coordinates, x.reshape(-1), strict=True)) | at_start(name)
    field = evaluate(system_from_spec(spec).vector_field(), here)
    integrator = solver(name).vector_field(x, parameters=values, **at_start(name))
    np.testing.assert_allclose(integrator.reshape(-1), np.array(field, dtype=float), atol=1e-13)


@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("name", FORCED)
def test_steps_with_forces_have_their_order(name: str, order: int) -> None:
    x, values = given(name)
    begin = at_start(name).get("t", 0.0)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        now = {"t": t} if at_start(name) else {}
        return solver(name).vector_field(y.reshape(x.shape), parameters=values, **now).reshape(-1)

    exact = solve_ivp(rate, (begin, begin + 0.4), x.reshape(-1), "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    asked: dict[str, Any] = {"parameters": values, **({"t0": begin} if at_start(name) else {})}
    integrator = solver(name, order)
    errors = [np.abs(integrator.integrate(x, 0.4 / n, n, n, **asked).x[-1].reshape(-1) - exact).max() for n in (4, 8)]
    assert np.log2(errors[0] / errors[1]) > order - 0.3


@pytest.mark.parametrize("name", ["damped", "web", "bath", "cool"])
def test_covectors_and_noise_keep_the_casimirs_of_every_site(name: str) -> None:
    x, values = given(name)
    run = solver(name).integrate(x, 0.1, 30, 10, parameters=values)
    for casimir in run.casimirs.values():
        assert np.abs(casimir - casimir[0]).max() <= 1e-13


@pytest.mark.parametrize("name", TEXTS)
def test_what_is_claimed_is_proved(name: str) -> None:
    compilation = compiled(name)
    groups = lattice_statements.lattice(compilation.cell) | lattice_statements.sweeps(compilation)
    assert [str(s) for group in groups.values() for s in group if s.verdict != PROVED] == []
    titles = [s.name for s in groups.get("Noise", ())]
    stationary = [t for t in titles if t.startswith("the density exp(−H/θ) on the leaves is stationary, with θ = T")]
    assert len(stationary) == (name in ("bath", "cool", "warm", "langevin"))
    alike = [s for s in groups.get("Noise", ()) if "where θ is the same at all sites" in s.detail]
    assert len(alike) == (name in ("bath", "cool", "warm"))  # T is a parameter at sites


def increments(name: str, h: float, steps: int, draws: dict[str, int]) -> np.ndarray:
    """Return the increments of all sites in the order of the sources of the expansion, (steps, draws)."""
    module, (x, _) = solver(name).backend._module, given(name)  # type: ignore[attr-defined]
    sites = type(
        "Sites",
        (),
        {"increments": None, "sizes": x.shape[1:], "h": h, "seed": draws["seed"], "member": draws["member"]},
    )()
    rows = []
    for step in range(steps):
        sites.step = draws["step0"] + step
        parts = [module._draw(sites, part) for part in range(module.PARTS_OF_NOISE)]
        rows.append(np.concatenate([part.reshape(len(part), -1).T.reshape(-1) for part in parts]))
    return np.array(rows)


@pytest.mark.parametrize("name", [name for name in NOISY if name != "cool"])
def test_noisy_steps_are_those_of_the_expansion_with_the_same_increments(name: str) -> None:
    x, values = given(name)
    draws = {"seed": 7, "member": 3, "step0": 11}
    whole, numbers = expansion(name)
    scheme = "splitting" if name == "free" else "series"
    ordinary = solver_of(compile_spec(replace(whole.spec(), order=2), scheme=scheme), "numpy")
    expected = ordinary.integrate(
        x.reshape(-1), 0.05, increments=increments(name, 0.05, 3, draws), parameters=numbers
    ).x[-1]
    final = solver(name).integrate(x, 0.05, 3, parameters=values, **draws).x[-1]
    np.testing.assert_allclose(final.reshape(-1), expected, rtol=0, atol=1e-13)


def test_increments_are_independent_and_of_variance_h() -> None:
    module = solver("free").backend._module  # type: ignore[attr-defined]
    sites = type("Sites", (), {"increments": None, "sizes": (20_000,), "h": 0.3, "seed": 1, "member": 0, "step": 5})()
    first, second = (module._draw(sites, part) for part in (0, 1))
    sites.step = 6
    drawn = np.array([*first, *second, *module._draw(sites, 0), *np.roll(first, 1, axis=1)])
    correlations = np.corrcoef(drawn) - np.eye(len(drawn))
    assert np.abs(correlations).max() < 4 / np.sqrt(20_000)
    np.testing.assert_allclose(drawn.var(axis=1), 0.15, rtol=0.05)
    sites.step, sites.h = 5, -0.3
    np.testing.assert_array_equal(module._draw(sites, 0), -second)


@pytest.mark.thin(1)
@pytest.mark.parametrize("name", ["bath", "langevin", "damped", "cool", "hot"])
def test_c_makes_the_steps_of_numpy_and_goes_on_with_the_same_bits(name: str, tmp_path: Path) -> None:
    x, values = given(name)
    draws = {"seed": 3, "member": 1, "step0": 2} if compiled(name).program.noise else {}
    asked: dict[str, Any] = {**draws, "parameters": values}
    integrator = solver(name, 2, "c")
    run = integrator.integrate(x, 0.05, 9, 3, **asked)
    np.testing.assert_allclose(run.x[-1], solver(name).integrate(x, 0.05, 9, 3, **asked).x[-1], rtol=0, atol=1e-13)
    checkpoint = tmp_path / "kept"

    def stop(steps_done: int) -> None:
        if steps_done == 6:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        integrator.integrate(x, 0.05, 9, 3, checkpoints=checkpoint, progress=stop, **asked)
    assert integrator.integrate(x, 0.05, 9, 3, checkpoints=checkpoint, **asked).x.tobytes() == run.x.tobytes()


@pytest.mark.parametrize("name", ["bath", "free", "langevin"])
def test_a_step_of_minus_h_undoes_one_of_h(name: str) -> None:
    x, values = given(name)
    there = solver(name).step(x, 0.1, seed=2, step0=9, parameters=values)
    back = solver(name).step(there, -0.1, seed=2, step0=9, parameters=values)
    np.testing.assert_allclose(back, x, rtol=0, atol=1e-13)


def test_members_of_an_ensemble_have_noise_of_their_own() -> None:
    x, values = given("bath")
    both = solver("bath").ensemble(np.array([x, x]), 0.1, 3, seed=5, member=4, parameters=values)
    for k, member in enumerate((4, 5)):
        alone = solver("bath").integrate(x, 0.1, 3, seed=5, member=member, parameters=values)
        np.testing.assert_allclose(both[k], alone.x[-1], rtol=0, atol=1e-14)
    assert np.abs(both[0] - both[1]).max() > 0.01


def test_friction_and_noise_have_the_gibbs_measure() -> None:
    integrator = solver("langevin", 2, "c")
    run = integrator.integrate(np.zeros((2, 512)), 0.1, 1500, 15, seed=1, parameters={"g": 0.5, "T": 0.7})
    q, p = run.x[20:, 0], run.x[20:, 1]
    waves = 2 * np.pi * np.arange(512) / 512
    np.testing.assert_allclose((p**2).mean(), 0.7, rtol=0.02)
    np.testing.assert_allclose((q**2).mean(), (0.7 / (3 - 2 * np.cos(waves))).mean(), rtol=0.03)


#: One source of noise with several parts of H; three sources that do not commute, before and after the parts of a
#: splitting; steps whose errors are rounding errors.
STRONG = {"langevin": (1.0, 60), "hot": (0.5, (6, 6)), "kicked": (np.inf, 60)}


def strongly(name: str, paths: int = 2) -> float:
    random, sizes = np.random.default_rng(3), STRONG[name][1]
    x, values = given(name)
    x = random.uniform(0.2, 1.2, size=(len(x), *np.atleast_1d(sizes)))
    values = {n: v if n == "bonds" else float(np.mean(v)) for n, v in values.items()}
    return lattice_noise.strong_order(compiled(name), x, values, None, 0.1, paths)


@pytest.mark.parametrize("name", STRONG)
def test_the_strong_order_is_reached_on_lattices(name: str) -> None:
    assert strongly(name) == pytest.approx(STRONG[name][0], abs=0.15)


def test_steps_along_other_increments_have_no_strong_order(monkeypatch: pytest.MonkeyPatch) -> None:
    right = NumpyLatticeSession.advance_along
    monkeypatch.setattr(NumpyLatticeSession, "advance_along", lambda s, h, dw: right(s, h, 1.05 * dw))
    assert strongly("langevin", 1) < 0.4


def mean_map(compiled_lattice: Compilation, h: float) -> np.ndarray:
    """Return the expectation of a step of linear motion at a site, a matrix. Every site has its own increments;
    together they are the nodes of a quadrature.
    """
    points, weights = np.polynomial.hermite_e.hermegauss(5)
    noise, count = compiled_lattice.program.noise, len(compiled_lattice.program.coordinates)
    assert noise is not None
    draws = len(noise.sources) * noise.parts
    nodes = np.array(list(product(points, repeat=draws))).T.reshape(noise.parts, len(noise.sources), -1)
    weight = np.prod(list(product(weights / weights.sum(), repeat=draws)), axis=1)
    solver, columns = lattice_solver_of(compiled_lattice, "numpy"), []
    for unit in np.eye(count):
        x = np.tile(unit[:, None], len(weight))
        session: Any = solver.started(Beginning(x, h, solver.values(None, {}, x.shape[1:])))
        session.advance_along(h, np.sqrt(h / noise.parts) * nodes[None])
        columns.append(session.state() @ weight)
    return np.array(columns).T


@pytest.mark.parametrize(("scheme", "order"), [("splitting", 2), ("series", 1)])
def test_the_weak_order_is_reached_on_lattices(scheme: str, order: int) -> None:
    noise = "noise: {x: {hamiltonian: x, amplitude: 0.7}, y: {hamiltonian: y, amplitude: 0.9}}\n"
    text = f"lattice: {{axes: [i]}}\nscheme: {scheme}\norder: 2\n{noise}{SPINS}hamiltonian: -z - x/2"
    compilation = compile_spec(specs.loads(f"phigen: 1\nname: turning\n{text}\n"))
    fields = [lattice_noise._field(compilation.spec, s) for s in ("x", "y")]
    drift, *spread = (s.vector_field(np.eye(3)) for s in (lattice_solver_of(compilation, "numpy"), *fields))
    exact = expm(drift + sum(b @ b for b in spread) / 2)
    coarse, fine = (np.abs(np.linalg.matrix_power(mean_map(compilation, 1 / n), n) - exact).max() for n in (8, 16))
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.25)


@pytest.mark.parametrize("name", ["cool", "web"])
def test_damping_by_colours_takes_energy_in_every_step_and_keeps_spins(name: str) -> None:
    """If neighbouring sites were damped at once, or all sites twice, the state would end elsewhere, or the energy would
    grow in some step.
    """
    (x, values), asked = given(name), {"seed": 1} if name == "cool" else {}
    values |= {n: 1e-40 for n in values if n == "T"} | {"l": 0.3}
    run = solver(name, 2, "c").integrate(x, 0.05, 400, parameters=values, **asked)
    assert (np.diff(run.energy) < 1e-14).all()
    assert np.abs(run.casimirs["C"] - run.casimirs["C"][0]).max() < 1e-13
    np.testing.assert_allclose(run.x[20], solver(name).integrate(x, 0.05, 20, 20, parameters=values, **asked).x[-1])
    series = compile_spec(specs.loads(f"phigen: 1\nname: s\nscheme: series\norder: 2\n{TEXTS[name]}\n"))
    exact = lattice_solver_of(series, "c").integrate(x, 0.002, 500, 500, parameters=values, **asked).x[-1]
    fine = solver(name, 2, "c").integrate(x, 0.025, 40, 40, parameters=values, **asked).x[-1]
    assert np.abs(run.x[20] - exact).max() / np.abs(fine - exact).max() == pytest.approx(4, rel=0.1)


@pytest.mark.thin(1)
@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["series", "splitting"])
def test_an_open_chain_of_spins_has_its_energy_at_every_temperature(scheme: str) -> None:
    text = (
        TEXTS["bath"]
        .replace("scheme: series", f"scheme: {scheme}")
        .replace("axes: [i, j], boundary: [periodic, open]", "axes: [i], boundary: open")
    )
    text = text.replace(" + x*x[j+1] + y*y[j+1] + z*z[j+1]", "")
    chain = lattice_solver_of(compile_spec(specs.loads(f"phigen: 1\nname: chain\norder: 2\n{text}\n")), "c")
    x = np.random.default_rng(0).normal(size=(3, 1024))
    x /= np.sqrt((x**2).sum(axis=0))
    for T in (0.4, 1.0):
        run = chain.integrate(x, 0.1, 600, 20, seed=4, T=T, l=0.3)
        # The energy of each bond has the distribution of a spin in a field: its variance is that of T² (1/T² −
        # 1/sinh²(1/T)).
        energies = run.energy[10:] / 1023
        expected, variance = -(1 / np.tanh(1 / T) - T), T**2 - 1 / np.sinh(1 / T) ** 2
        independent = 600 * 0.1 * 2 / 3 / 10  # number of independent frames: the correlation time is ten time units
        assert abs(energies.mean() - expected) < 3 * np.sqrt(variance / 1023 / independent) + 0.005
        assert np.abs(run.casimirs["C"] - 1).max() < 1e-13


@pytest.mark.slow
def test_runs_report_the_work_of_forces_and_verification_claims_what_holds() -> None:
    x, values = given("damped")
    cell = compiled("damped", 4).cell
    assert cell is not None
    errors = [
        errors_of(cell, solver("damped", 4).integrate(x, h, steps, parameters=values))[BALANCE].max()
        for h, steps in ((0.1, 12), (0.05, 24))
    ]
    assert errors[0] > 10 * errors[1]
    assert errors[1] < 1e-5
    y, heat = given("langevin")
    bath = compiled("langevin").cell
    assert bath is not None
    assert CHANGE in errors_of(bath, solver("langevin").integrate(y, 0.1, 5, parameters=heat))
    start = Start(y.shape[1:], y, heat, np.empty((0, 2), dtype=np.int64))
    carrying = compile_spec(compiled("langevin").spec, tangent=True)
    solvers = {"numpy": lattice_solver_of(carrying, "numpy")}
    verification = verify_lattice(carrying, solvers, "run", start, 0.05, 20, seed=1, quick=True)
    assert verification.failures == []
    names = {c.name for c in verification.checks}
    assert {"observed order, without the noise", "energy: largest change", "reversibility"} <= names
    assert any("tangent map against differences" in name for name in names)
    assert {"strong order, along common paths", "steps that fail with the largest increments"} <= names
    assert not any("Poisson identity" in c.name for c in verification.checks)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (TEXTS["bath"].replace("hamiltonian: x,", 'hamiltonian: "x*x[i+1]",'), "must not name neighbours"),
        (f"order: 4\n{TEXTS['bath']}", "steps are not composed"),
        ("scheme: splitting\n" + TEXTS["damped"].replace("damping: l", "damping: l*z"), "damping has no elementary"),
        # Systems that are refused for other reasons than colours, and one that no colouring separates.
        (f"scheme: splitting\nlattice: {{axes: [i]}}\ndamping: 0.1\n{CANONICAL}"
         'hamiltonian: "q*q[i+1] + (q**2 + p**2)**2"',
         "on the lattice: phigen cannot solve the equation of q"),
        (f"scheme: splitting\nlattice: {{axes: [i]}}\ndamping: 0.1\n{SPINS}"
         'hamiltonian: "-x*x[i+1] - x*x[i+2] - z*z[i+3] - y*y[i+4]"', "damped at the same time"),
        (TEXTS["free"].replace("hamiltonian: x,", "hamiltonian: x*y + z**3,"), "needs the flow of the noise x"),
        ("damping: 0.1\nlattice: {graph: b}\ncoordinates: [x]\npoisson: {bonds: {'x[a]': {'x[b]': 1}}}\n"
         "hamiltonian: {sites: x**2}", "damping: not offered together with poisson: bonds"),
    ],
)  # fmt: skip
def test_what_cannot_be_combined_is_refused_where_it_stands(text: str, said: str) -> None:
    with pytest.raises(SpecError, match=said) as caught:
        compile_spec(specs.loads(f"phigen: 1\nname: refused\n{text}\n"))
    assert all(d.location for d in caught.value.diagnostics)


def test_headers_say_what_holds_with_forces_and_noise() -> None:
    (_, code), *_ = sorted(emit(compiled("bath").program, "c", "").items())
    for said in (
        "with forces a step is not a Poisson map; the forces conserve all Casimirs",
        "noise: x, y, z; in the sense of",
    ):
        assert said in code


@pytest.mark.parametrize(("name", "target"), [("bath", "numpy"), ("bath", "c"), ("langevin", "numpy")])
def test_tangent_vectors_are_carried_along_the_path_of_the_noise(name: str, target: str) -> None:
    compilation = compile_spec(compiled(name).spec, tangent=True)
    solver, (x, values) = lattice_solver_of(compilation, target), given(name)
    along, asked = np.random.default_rng(0).normal(size=x.shape), {"seed": 4, "parameters": values}
    after, (carried,) = solver.step_tangent(x, 0.05, along[None], **asked)
    np.testing.assert_allclose(after, solver.step(x, 0.05, **asked), rtol=0, atol=1e-14)
    ahead, behind = (solver.step(x + e * along, 0.05, **asked) for e in (1e-5, -1e-5))
    np.testing.assert_allclose(carried, (ahead - behind) / 2e-5, rtol=0, atol=1e-8)
