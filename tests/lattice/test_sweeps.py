"""Sweeps over the sites of lattices, compared with the ordinary system of a few sites: field, H, steps, orders, Poisson
maps.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lattice.lattices import with_threads
from systems import compile_text

import phigen
from phigen import spec as specs
from phigen.api import lattice_solver_of
from phigen.compilation import Compilation
from phigen.compiler import compile_spec, emit
from phigen.errors import SpecError, StepError
from phigen.lattice.cell_building import cell_from_spec
from phigen.lattice.expansion import Expansion, expand
from phigen.proofs import lattice_statements, statements
from phigen.runtime.lattice import LatticeSolver
from phigen.runtime.modules import load_module
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.arrays import evaluate
from phigen.symbolic.verdict import PROVED, REFUTED

SPINS = """
coordinates: [x, y, z]
poisson: {lie_algebra: {name: so(3)}}
casimirs: {C: x**2 + y**2 + z**2}
"""
CANONICAL = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
BOND = '"-J*(x*x[i+1] + y*y[i+1] + 1.3*z*z[i+1]) - B*z + A*x**2"'
TEXTS = {
    "xxz": f"lattice: {{axes: [i], boundary: periodic}}\nparameters: {{J: 1.2, A: 0.3, B: {{value: 0.2, at: sites}}}}"
    f"{SPINS}hamiltonian: {BOND}",
    "xxz_open": f"lattice: {{axes: [i], boundary: open}}\nparameters: {{J: 1.2, A: 0.3, B: {{value: 0.2, at: sites}}}}"
    f"{SPINS}hamiltonian: {BOND}",
    "sheet": f"lattice: {{axes: [i, j], boundary: [periodic, open]}}{SPINS}hamiltonian: "
    '"-(x*x[i+1] + y*y[i+1] + z*z[i+1] + x*x[j+1] + y*y[j+1] + z*z[j+1]) + (x*y[j+2] - y*x[j+2])/2"',
    "cube": "lattice: {axes: [i, j, k], boundary: [open, periodic, periodic]}\n"
    f'{CANONICAL}hamiltonian: "p**2/2 + q**4/4 + ((q[i+1]-q)**2 + (q[j+1]-q)**2 + (q[k+1]-q)**2)/2"',
    "fput": "lattice: {axes: [i], boundary: open}\nparameters: {a: 0.25, b: {value: 0.5, positive: true}}\n"
    f'{CANONICAL}hamiltonian: "p**2/2 + (q[i+1]-q)**2/2 + a*(q[i+1]-q)**3/3 + b*(q[i+1]-q)**4/4"',
    "dnls": "lattice: {axes: [i], boundary: periodic}\nparameters: {e: {value: 0.1, at: sites}}\n"
    f'{CANONICAL}hamiltonian: "-(q*q[i+1] + p*p[i+1]) + e*(q**2 + p**2) + (q**2 + p**2)**2/4"',
    "ablowitz_ladik": "lattice: {axes: [i], boundary: periodic}\ncoordinates: [q, p]\n"
    "poisson: {brackets: {q: {p: 1 + q**2 + p**2}}}\n"
    'hamiltonian: "-(q*q[i+1] + p*p[i+1]) + log(1 + q**2 + p**2)"',
    "toda": "lattice: {axes: [i], boundary: open}\ncoordinates: [a, b]\n"
    'poisson: {brackets: {a: {b: a/2, "b[i+1]": -a/2}}}\nhamiltonian: b**2/2 + 2*a**2',
    "charges": "lattice: {pairs: all}\ncoordinates: [x, y, px, py]\n"
    "parameters: {k: 0.5, m: {value: 1.2, at: sites, positive: true}}\n"
    "poisson: {canonical: {q: [x, y], p: [px, py]}}\nhamiltonian: {sites: (px**2 + py**2)/(2*m) + (x**2 + y**2)/2, "
    'pairs: "k/sqrt(1/4 + (x[a] - x[b])**2 + (y[a] - y[b])**2)"}',
    # exchange, Dzyaloshinskii–Moriya coupling, anisotropy: parts of all sites, and parts of the sites of one colour
    "magnet": "lattice: {graph: bonds}\nparameters: {J: {value: 1.2, at: bonds}, D: 0.4, B: {value: 0.2, at: sites}}"
    f"{SPINS}hamiltonian: {{sites: -B*z + x**2/5, "
    'bonds: "-J*(x[a]*x[b] + y[a]*y[b] + z[a]*z[b]) + D*(x[a]*y[b] - y[a]*x[b])"}',
    "oscillators": "lattice: {graph: bonds}\nparameters: {k: {value: 1, at: bonds, positive: true}}\n"
    f'{CANONICAL}hamiltonian: {{sites: p**2/2 + q**4/4, bonds: "-k*cos(q[a] - q[b])"}}',
    "web": "lattice: {graph: eats}\ncoordinates: [x]\n"
    "parameters: {A: {value: 1, at: bonds}, k: {value: 1, at: sites}}\n"
    'poisson: {bonds: {"x[a]": {"x[b]": "A*x[a]*x[b]"}}}\nhamiltonian: {sites: x - k*log(x)}',
    # brackets along bonds that update no field which they read: no colours
    "network": "lattice: {graph: bonds}\ncoordinates: [q, p]\nparameters: {W: {value: 1, at: bonds}}\n"
    'poisson: {bonds: {"q[a]": {"p[b]": W}}}\nhamiltonian: {sites: p**2/2 + q**4/4}',
    "volterra": "lattice: {axes: [i], boundary: periodic}\ncoordinates: [a]\n"
    'poisson: {brackets: {a: {"a[i+1]": "a*a[i+1]"}}}\nhamiltonian: a',
    # Systems for which no splitting exists.
    "twisted": "lattice: {axes: [i], boundary: open}\nbirealisation: cayley\nparameters: {B: {value: 0.2, at: sites}}"
    f'{SPINS}hamiltonian: "-(x*x[i+1] + y*y[i+1] + z*z[i+1]) + B*x*y[i+1]*z[i+2]"',
    "dragged": "lattice: {axes: [i, j], boundary: [periodic, open]}\nparameters: {g: 0.3}\n"
    f'{CANONICAL}hamiltonian: "(1 + g*q**2)*p**2/2 + p*p[j+1]/4 - cos(q[i+1] - q) - q*cos(q[j+1])"',
    "pond": "lattice: {axes: [i], boundary: periodic}\nparameters: {k: 0.7, c: {value: 1.0, at: sites}}\n"
    'coordinates: [a]\npoisson: {brackets: {a: {"a[i+1]": "c*c[i+1]*a*a[i+1]"}}}\n'
    'hamiltonian: "a - k*log(a) + a*a[i+1]/4"',
    "stretched": "lattice: {axes: [i], boundary: open}\nscheme: series\ncoordinates: [a, b]\n"
    'poisson: {brackets: {a: {b: a/2, "b[i+1]": -a/2}}}\nhamiltonian: b**2/2 + 2*a**2 + a**2*b*b[i+1]/5',
    "tangle": "lattice: {graph: bonds}\nscheme: series\nparameters: {J: {value: 1.2, at: bonds}, D: 0.4, B: 0.3}"
    f'{SPINS}hamiltonian: {{sites: D*z**2 - B*x, bonds: "-J*(x[a]*x[b] + y[a]*y[b]) + D*x[a]*z[b]"}}',
    "vortices": "lattice: {pairs: all}\ncoordinates: [x, y]\nparameters: {G: {value: 1, at: sites, positive: true}}\n"
    "poisson: {brackets: {x: {y: 1/G}}}\nhamiltonian: {sites: G*(x**2 + 2*y**2), "
    'pairs: "-G[a]*G[b]*log(1 + (x[a] - x[b])**2 + (y[a] - y[b])**2)/2"}',
}
#: A lattice with second neighbours along the axis of the wavefront blocking.
BEYOND = "phigen: 1\nname: beyond\norder: 2\nlattice: {axes: [i, j, k], boundary: periodic}\n"
BEYOND += f'{CANONICAL}hamiltonian: "p**2/2 + q**2/2 - q*q[i+2]/3 - q*q[j+1]/4 - q*q[k+1]/5"\n'
#: Lattices that are integrated by the scheme series.
SERIES = ("twisted", "dragged", "pond", "stretched", "tangle", "vortices")

#: Quick cases: open ends, a plane, pairs, graphs with and without brackets along bonds, colours, the series.
pytestmark = pytest.mark.few(
    "fput", "sheet", "charges", "magnet", "web", "volterra", "twisted", "dragged", "tangle", of=TEXTS
)
#: Bonds of the graphs: a triangle with two tails, a double bond, and an isolated site.
BONDS = np.array([[0, 1], [1, 2], [2, 0], [2, 3], [4, 3], [3, 4], [4, 5]])
SIZES = {"sheet": (4, 5), "cube": (3, 4, 3), "volterra": (6,), "toda": (5,), "dragged": (4, 5), "stretched": (5,)}
FEW = {
    "sheet": (3, 3),
    "cube": (2, 2, 2),
    "charges": (4,),
    "oscillators": (7,),
    "dragged": (3, 3),
    "vortices": (4,),
    "tangle": (7,),
}


@cache
def compiled(name: str, order: int = 4, composition: str = "auto") -> Compilation:
    text = f"phigen: 1\nname: {name}\norder: {order}\ncomposition: {composition}\n{TEXTS[name]}\n"
    return compile_spec(specs.loads(text))


@cache
def solver(name: str, order: int = 4, target: str = "numpy", composition: str = "auto") -> LatticeSolver:
    return lattice_solver_of(compiled(name, order, composition), target)


@cache
def expansion(name: str, sizes: tuple[int, ...]) -> Expansion:
    cell = cell_from_spec(compiled(name).spec)
    return expand(cell, sizes, BONDS.tolist() if cell.relation == "graph" else ())


def start(name: str, sizes: tuple[int, ...] | None = None, seed: int = 1) -> np.ndarray:
    sizes = sizes or SIZES.get(name, (7,))
    fields = len(compiled(name).spec.coordinates)
    x = 0.6 * np.random.default_rng(seed).normal(size=(fields, *sizes))
    return np.abs(x) + 0.2 if name in ("volterra", "toda", "web", "pond", "stretched") else x


def disorder(name: str, x: np.ndarray) -> dict[str, Any]:
    about = solver(name).interface
    drawn = {p: np.random.default_rng(7).normal(size=x.shape[1:]) for p in about.at_sites}
    drawn |= {p: np.random.default_rng(8).normal(size=len(BONDS)) for p in about.at_bonds}
    parameters = {p: np.abs(values) + 0.5 if p in about.positive else values for p, values in drawn.items()}
    return parameters | ({"bonds": BONDS} if about.graph else {})


def bonds_of(name: str) -> dict[str, Any]:
    return {"bonds": BONDS} if solver(name).interface.graph else {}


def values_of(whole: Expansion, x: np.ndarray, parameters: dict[str, Any]) -> dict[str, float]:
    numbers = {p.name: parameters.get(p.name, np.full(whole.sizes, float(p.value)) if p.at == "sites" else p.value)
               for p in whole.cell.parameters}  # fmt: skip
    return dict(zip(whole.coordinates, x.reshape(-1), strict=True)) | whole.numbers(numbers)


def poisson_at(whole: Expansion, x: np.ndarray, parameters: dict[str, Any]) -> np.ndarray:
    entries, index = whole.poisson(), {c: k for k, c in enumerate(whole.coordinates)}
    entry_values = evaluate(list(entries.values()), values_of(whole, x, parameters))
    matrix = np.zeros((len(index), len(index)))
    for (a, b), value in zip(entries, entry_values, strict=True):
        matrix[index[a], index[b]] = float(value)
    return matrix


@pytest.mark.thin(3)
@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize("target", ["numpy", "c"])
def test_field_and_energy_are_those_of_the_ordinary_system(name: str, target: str) -> None:
    x = start(name, FEW.get(name))
    parameters, whole = disorder(name, x), expansion(name, x.shape[1:])
    ordinary = whole.spec()
    gradient = np.empty(x.size)
    values = values_of(whole, x, parameters)
    (energy,) = evaluate([ordinary.hamiltonian], values)
    from phigen.symbolic.expression import gradient as slopes

    gradient = np.array(evaluate(slopes(ordinary.hamiltonian, whole.coordinates), values), dtype=float)
    field = poisson_at(whole, x, parameters) @ gradient
    integrator = solver(name, target=target)
    np.testing.assert_allclose(integrator.vector_field(x, **parameters).reshape(-1), field, atol=1e-13)
    assert integrator.hamiltonian(x, **parameters) == pytest.approx(float(energy), rel=1e-13, abs=1e-13)


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", TEXTS)
def test_c_makes_the_steps_of_numpy(name: str) -> None:
    x = start(name)
    by = {t: solver(name, target=t).integrate(x, 0.05, 40, 15, **disorder(name, x)) for t in ("c", "numpy")}
    np.testing.assert_allclose(by["c"].x, by["numpy"].x, rtol=0, atol=3e-14)
    np.testing.assert_allclose(by["c"].energy, by["numpy"].energy, atol=1e-13)


@pytest.mark.parametrize("name", ["fput", "cube", "toda", "charges", "oscillators"])
def test_steps_are_those_of_the_ordinary_splitting_with_the_same_parts(name: str) -> None:
    x = start(name, FEW.get(name, (4,)))
    lattice = solver(name, 4, "numpy", "suzuki").integrate(x, 0.1, 10, **bonds_of(name))
    whole = replace(expansion(name, x.shape[1:]).spec(), order=4, scheme="splitting", composition="suzuki")
    from phigen.api import solver_of

    ordinary = solver_of(compile_spec(whole), "numpy").integrate(x.reshape(-1), 0.1, 10)
    np.testing.assert_allclose(lattice.x.reshape(len(lattice), -1), ordinary.x, rtol=0, atol=1e-13)


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", sorted({*SERIES} - {"stretched"}))  # for its π the ordinary system follows paths
def test_steps_of_the_series_are_those_of_the_ordinary_system(name: str) -> None:
    x = start(name, FEW.get(name, (5,)))
    integrator, parameters = solver(name, 4, "numpy"), disorder(name, x)
    lattice = integrator.integrate(x, 0.1, 10, **parameters)
    numbers = {p: parameters.get(p, v) for p, v in integrator.interface.parameters.items()}
    whole = expansion(name, x.shape[1:])
    choice = BirealisationChoice("product", of="cayley") if name == "twisted" else BirealisationChoice()
    from phigen.api import solver_of

    spec = replace(whole.spec(), order=4, birealisation=choice, composition="suzuki", gauge="none")
    ordinary = solver_of(compile_spec(spec), "numpy").integrate(x.reshape(-1), 0.1, 10, **whole.numbers(numbers))
    np.testing.assert_allclose(lattice.x.reshape(len(lattice), -1), ordinary.x, rtol=0, atol=1e-13)


@pytest.mark.thin(3)
@pytest.mark.parametrize(
    ("name", "order"),
    [
        *((name, 4) for name in TEXTS),
        ("xxz", 2),
        ("fput", 6),
        ("ablowitz_ladik", 2),
        ("dnls", 8),
        *(pytest.param(name, 2, marks=pytest.mark.slow) for name in SERIES),
        ("twisted", 6),
        ("dragged", 8),
    ],
)
def test_order_is_that_of_the_method(name: str, order: int) -> None:
    x, integrator = start(name), solver(name, order, "c")
    parameters, span = disorder(name, x), 0.8
    far = integrator.integrate(x, span / 512, 512, 512, **parameters).x[-1]
    counts = (8, 16) if order < 8 else (4, 8)  # with more steps the error is due to rounding
    errors = [np.abs(integrator.integrate(x, span / n, n, n, **parameters).x[-1] - far).max() for n in counts]
    assert np.log2(errors[0] / errors[1]) > order - 0.35


def module_of(name: str) -> Any:
    return load_module(emit(compiled(name).program, "numpy", "phigen")[f"{name}.py"], name)


def jacobian(module: Any, x: np.ndarray, h: float, parameters: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return the state after a step, and the derivative of the step."""
    _, sites = module._started(x, parameters)
    rows = module._coefficients(sites, h)
    columns = []
    for k in range(x.size):
        unit = np.zeros(x.shape)
        unit.reshape(-1)[k] = 1.0
        columns.append(_slope(lambda t, unit=unit: module._advance(sites, rows, x + t * unit, {})))
    return module._advance(sites, rows, x, {}).real, np.array(columns).T


def _slope(curve: Any) -> np.ndarray:
    """Return the derivative of a curve at 0: by a complex step, or by differences if functions take real
    numbers only.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error", np.exceptions.ComplexWarning)
        try:
            return curve(1e-30j).imag.reshape(-1) / 1e-30
        except (np.exceptions.ComplexWarning, TypeError):
            weights = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
            return sum(w * (curve(k * 4e-3) - curve(-k * 4e-3)) for k, w in weights.items()).reshape(-1) / 4e-3


#: Lattices whose steps do not accept complex numbers.
REAL_ONLY = ("ablowitz_ladik", "magnet", "oscillators", "web", "network")


def poisson_defect(name: str, module: Any) -> float:
    """Return the largest entry of DΦ π DΦᵀ − π∘Φ for the ordinary system."""
    x = start(name, FEW.get(name))
    parameters, whole = disorder(name, x), expansion(name, x.shape[1:])
    after, derivative = jacobian(module, x, 0.2, parameters)
    moved = derivative @ poisson_at(whole, x, parameters) @ derivative.T
    return float(np.abs(moved - poisson_at(whole, after, parameters)).max())


@pytest.mark.thin(3)
@pytest.mark.parametrize("name", TEXTS)
def test_a_step_is_a_poisson_map(name: str) -> None:
    assert poisson_defect(name, module_of(name)) < (1e-9 if name in REAL_ONLY else 1e-12)


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", ["volterra", "sheet", "web", "magnet"])
def test_neighbours_moved_at_once_where_brackets_couple_them_are_noticed(name: str) -> None:
    module = module_of(name)
    if name in ("web", "magnet"):
        coloured = module._Coloured.__init__
        module._Coloured.__init__ = lambda sites, *of: (coloured(sites, *of), sites.colours.__imul__(0))[0]
    else:
        module.COLOURS = 1  # planted error: every sweep updates all sites at once
    assert poisson_defect(name, module) > 1e-4


def test_the_midpoint_rule_is_noticed() -> None:
    module = module_of("xxz")

    def midpoint(sites: Any, rows: Any, x: np.ndarray, past: Any) -> np.ndarray:
        def field(y: np.ndarray) -> np.ndarray:
            real, imaginary = (
                module._vector_field(sites.parameters, part, sites) for part in (y.real, y.real + 1e20 * y.imag)
            )
            return real + 1e-20j * (imaginary - real)

        return x + 0.2 * field(x + 0.1 * field(x))

    module._advance = midpoint
    assert poisson_defect("xxz", module) > 1e-4


@pytest.mark.parametrize("name", ["xxz", "twisted"])
def test_spins_keep_their_lengths(name: str) -> None:
    x = start(name, (16,))
    run = solver(name, 2, "c").integrate(x / np.sqrt((x**2).sum(axis=0)), 0.05, 20_000, 20_000)
    lengths = run.casimirs["C"]
    assert lengths.shape == (2, 16)
    assert np.abs(lengths[-1] - lengths[0]).max() < 5e-14


@pytest.mark.parametrize("name", SERIES)
@pytest.mark.parametrize("target", ["numpy", "c"])
def test_steps_of_the_series_are_undone_by_steps_back(name: str, target: str) -> None:
    x, integrator = start(name), solver(name, 4, target)
    there = integrator.integrate(x, 0.1, 5, 5, **disorder(name, x)).x[-1]
    back = integrator.integrate(there, -0.1, 5, 5, **disorder(name, x)).x[-1]
    assert np.abs(there - x).max() > 0.05
    np.testing.assert_allclose(back, x, rtol=0, atol=5e-14)


def test_large_angles_are_turned_exactly_too() -> None:
    x = start("xxz", (9,))
    by = [solver("xxz", 2, t).step(x, 3.0, J=4.0) for t in ("c", "numpy")]
    np.testing.assert_allclose(by[0], by[1], atol=2e-13)


def test_atoms_that_fly_apart_have_no_force_between_them_and_an_energy() -> None:
    """exp(−800) is 0, and outside of the range of the lane version of exp: steps failed there, and energies
    were NaN.
    """
    morse = '"p**2/2 + (1 - exp(-(q[i+1] - q)))**2"'
    text = f"lattice: {{axes: [i], boundary: open}}\n{CANONICAL}hamiltonian: {morse}\nscheme: splitting\norder: 2\n"
    compilation = compile_text(text)
    x = np.array([[0.0, 0.3, 800.0, 800.4], [0.1, 0.0, 0.5, -0.2]])
    solver, other = (lattice_solver_of(compilation, target) for target in ("c", "numpy"))
    for seen in ("density", "vector_field"):
        np.testing.assert_allclose(getattr(solver, seen)(x), getattr(other, seen)(x), rtol=1e-13, atol=1e-14)
    runs = [s.integrate(x, 0.1, 20) for s in (solver, other)]
    np.testing.assert_allclose(runs[0].x, runs[1].x, rtol=0, atol=1e-11)  # distances of 800 have rounding errors
    np.testing.assert_allclose(runs[0].energy, runs[1].energy, rtol=1e-11)


def test_loops_say_which_rows_they_read() -> None:
    text = emit(compiled("sheet").program, "c", "phigen")["sheet.c"]
    assert set(re.findall(r"row->at\[[1-9]\];(.*)", text)) == {" /* i - 1 */", " /* i + 1 */"}


def test_each_sweep_says_what_it_moves_and_those_of_equal_code_are_one() -> None:
    text = emit(compiled("magnet").program, "c", "phigen")["magnet.c"]
    comments = re.findall(
        r"/\* (The flow of [^/]*) \*/\nstatic inline void magnet_(sweep\w+)\([^{]*\{(.*?)\n\}", text, re.S
    )
    for said, name, body in comments:
        moved = re.findall(r"^ *(\w)_row\[i\] =", body, re.M)
        assert all(line.endswith(f"{', '.join(moved)} rotated.") for line in said.split("\n")), (name, said)
    bodies = [body for *_, body in comments]
    assert len(bodies) == len(set(bodies)) < sum(said.count("The flow of") for said, *_ in comments)


def test_parts_that_differ_in_the_order_of_fields_have_one_loop_in_short_code() -> None:
    short = compile_spec(compiled("magnet", 2).spec, profile="small")
    integrator, text = lattice_solver_of(short, "c"), emit(short.program, "c", "phigen")["magnet.c"]
    assert re.findall(r"void magnet_(sweep\w*)\(const double", text) == ["sweep1", "sweep_x_z", "sweep3"]
    x = start("magnet", (4200,))
    ring = {"bonds": np.stack([np.arange(4200), (np.arange(4200) * 7 + 1) % 4200], axis=1)}
    mine, *others = with_threads(lambda: integrator.integrate(x, 0.05, 2, 2, **ring).x[-1])
    assert all(np.array_equal(mine, other) for other in others)
    np.testing.assert_allclose(mine, solver("magnet", 2).integrate(x, 0.05, 2, 2, **ring).x[-1], rtol=0, atol=3e-14)


@pytest.mark.thin(3)
@pytest.mark.parametrize("name", ["sheet", "magnet", "dragged"])
def test_threads_make_the_same_bits(name: str) -> None:
    integrator, x = solver(name, 2, "c"), start(name, (70, 90) if name != "magnet" else (6300,))
    ring = {"bonds": np.stack([np.arange(6300), (np.arange(6300) * 7 + 1) % 6300], axis=1)} if name == "magnet" else {}
    assert len({run.tobytes() for run in with_threads(lambda: integrator.integrate(x, 0.05, 5, 5, **ring).x[-1])}) == 1


def test_long_rows_in_pieces_make_the_same_steps() -> None:
    x = start("xxz", (5000,))
    by = [solver("xxz", 2, t).integrate(x, 0.1, 3, 3).x[-1] for t in ("c", "numpy")]
    np.testing.assert_allclose(by[0], by[1], atol=1e-14)


@pytest.mark.parametrize(("name", "sizes"), [("xxz", (104,)), ("volterra", (48,)), ("beyond", (10, 4, 8))])
def test_flows_that_are_made_at_once_make_the_steps_of_flow_after_flow(name: str, sizes: tuple[int, ...]) -> None:
    """Wavefront blocking applies to a large lattice. Its state consists of copies of a small one, which therefore moves
    as it does alone, with any number of threads.
    """
    order = 2 if name == "beyond" else 4
    integrator = lattice_solver_of(compile_spec(specs.loads(BEYOND)), "c") if order == 2 else solver(name, order, "c")
    x = np.abs(0.5 + 0.3 * np.random.default_rng(2).normal(size=(len(integrator.interface.coordinates), *sizes)))
    alone = integrator.integrate(x, 0.05, 5, 5).x[-1]
    copies = [1, 270_000 // alone.size, *[1] * (len(sizes) - 1)]
    for together in with_threads(lambda: integrator.integrate(np.tile(x, copies), 0.05, 5, 5).x[-1]):
        assert np.array_equal(together, np.tile(alone, copies))


def test_compensated_sums_keep_lengths_of_spins_and_the_bits_of_runs_in_pieces() -> None:
    text = f"phigen: 1\nname: rounding\norder: 2\nsolver: {{compensated: true}}\n{TEXTS['xxz']}"
    integrator, x = lattice_solver_of(compile_spec(specs.loads(text)), "c"), start("xxz", (64,))
    whole = integrator.integrate(x, 0.05, 50_000, 25_000).x
    worst = np.abs(np.linalg.norm(whole, axis=1) - np.linalg.norm(x, axis=0)).max()
    plain = solver("xxz", 2, "c").integrate(x, 0.05, 50_000, 50_000).x[-1]
    assert worst < 8e-15 < np.abs(np.linalg.norm(plain, axis=0) - np.linalg.norm(x, axis=0)).max()
    session = integrator.session(x)
    session.step(0.05, 25_000)
    other = session.copy()
    other.step(0.05, 25_000)
    assert np.array_equal(session.x, whole[1])
    assert np.array_equal(other.x, whole[2])
    np.testing.assert_allclose(integrator.step(x, 0.05), solver("xxz", 2).step(x, 0.05), rtol=0, atol=1e-15)


#: Systems whose steps have no open last flow, with one part and with noise; and one with an open last flow.
COMPENSATED = {
    "rotors": """
lattice: {axes: [i]}
coordinates: [x, y, z]
poisson: {lie_algebra: {name: so(3)}}
parameters: {B: {value: 1 + i/N_i, at: sites}}
hamiltonian: B*z
""",
    "kicked": """
lattice: {axes: [i]}
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + (q[i+1] - q)**2/2
noise: {bath: {hamiltonian: q, amplitude: 0.1}}
""",
    "xxz": TEXTS["xxz"],
}


@pytest.mark.parametrize("name", COMPENSATED)
@pytest.mark.parametrize("step", [0.05, 0.02])
def test_copies_of_sessions_have_the_compensation_terms(name: str, step: float) -> None:
    text = f"phigen: 1\nname: rounding\norder: 2\nsolver: {{compensated: true}}\n{COMPENSATED[name]}"
    solver = lattice_solver_of(compile_spec(specs.loads(text)), "c")
    x = np.random.default_rng(3).normal(size=(len(solver.interface.coordinates), 16))
    session = solver.session(x).step(0.05, 400)
    other = session.copy()
    assert np.array_equal(other.step(step, 40).x, session.step(step, 40).x)


@pytest.mark.parametrize("asked", ["scheme: series", "adjoint: true"])
def test_sums_that_cannot_be_compensated_are_refused(asked: str) -> None:
    text = f"phigen: 1\nname: rounding\n{asked}\nsolver: {{compensated: true}}\n{TEXTS['xxz']}"
    with pytest.raises(SpecError, match=r"spec.yaml:4.*compensated is only offered for lattices with scheme splitting"):
        compile_spec(specs.loads(text, "spec.yaml"))


def test_frames_go_to_files(tmp_path: Any) -> None:
    x, integrator = start("fput"), solver("fput", target="c")
    plain = integrator.integrate(x, 0.1, 10, 4)
    streamed = integrator.integrate(x, 0.1, 10, 4, output=tmp_path / "frames.npy")
    assert np.array_equal(np.load(tmp_path / "frames.npy"), plain.x)
    assert np.array_equal(streamed.x, plain.x)
    assert plain.x.shape == (4, 2, 7)
    integrator.integrate(x, 0.1, 10, 4, output=tmp_path / "run.npz", a=0.3)
    with np.load(tmp_path / "run.npz") as stored:
        assert stored["x"].shape == (4, 2, 7)
        assert stored["parameter_a"] == 0.3
    assert sorted(p.name for p in tmp_path.iterdir()) == ["frames.npy", "run.npz"]


def test_a_run_goes_on_from_its_checkpoint(tmp_path: Any) -> None:
    x, integrator = start("fput"), solver("fput", target="c")
    whole = integrator.integrate(x, 0.1, 12, 3)

    def stop(steps_done: int) -> None:
        if steps_done == 6:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        integrator.integrate(x, 0.1, 12, 3, checkpoints=tmp_path / "state", progress=stop)
    resumed = integrator.integrate(x, 0.1, 12, 3, checkpoints=tmp_path / "state")
    assert np.array_equal(resumed.x, whole.x)
    assert not (tmp_path / "state").exists()


def test_files_of_interrupted_and_complete_runs_are_respected(tmp_path: Any) -> None:
    x, integrator = start("fput"), solver("fput")
    files = {"output": tmp_path / "frames.npy", "checkpoints": tmp_path / "state"}

    def stop(steps_done: int) -> None:
        if steps_done == 6:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        integrator.integrate(x, 0.1, 12, 3, progress=stop, **files)
    left = {path: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(ValueError, match="to an interrupted run: continue it with resume=True, or remove the file"):
        integrator.integrate(x, 0.1, 12, 3, resume=False, **files)
    with pytest.raises(ValueError, match="the frames of an interrupted run: continue it with its checkpoints="):
        integrator.integrate(x, 0.1, 12, 3, output=files["output"])
    assert left == {path: path.read_bytes() for path in tmp_path.iterdir()}
    whole = integrator.integrate(x, 0.1, 12, 3, **files)
    with pytest.raises(ValueError, match="its run is complete, and there is nothing to resume"):
        integrator.integrate(x, 0.1, 12, 3, **files)
    assert np.array_equal(integrator.integrate(x, 0.1, 12, 3, resume=False, **files).x, whole.x)
    assert list(tmp_path.iterdir()) == [files["output"]]


def test_a_run_that_fails_leaves_nothing_to_go_on_with(tmp_path: Any) -> None:
    integrator = solver("fput")
    with pytest.raises(StepError):
        integrator.integrate(
            start("fput"), 1e200, 12, 3, output=tmp_path / "frames.npy", checkpoints=tmp_path / "state"
        )
    assert not list(tmp_path.iterdir())


NOTHING_MOVES = {
    "grid": "lattice: {axes: [i]}\ncoordinates: [a]\npoisson: {brackets: {a: {}}}\nhamiltonian: a**2/2 + a*a[i+1]\n",
    "graph": "lattice: {graph: g}\ncoordinates: [a]\npoisson: {bonds: {}}\nhamiltonian: {sites: a**2/2}\n",
    "pairs": "lattice: {pairs: all}\ncoordinates: [a]\npoisson: {brackets: {}}\nhamiltonian: {pairs: 'a[a]*a[b]'}\n",
    "flat": "lattice: {axes: [i]}\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: 3\n",
    "zero": "lattice: {axes: [i]}\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: 0\n",
    "zero graph": "lattice: {graph: g}\ncoordinates: [a]\npoisson: {bonds: {'a[a]': {'a[b]': 1}}}\nhamiltonian: 0\n",
    "zero pairs": "lattice: {pairs: all}\ncoordinates: [a]\npoisson: {brackets: {}}\nhamiltonian: {pairs: 0}\n",
}


@pytest.mark.parametrize("target", ["numpy", pytest.param("c", marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", NOTHING_MOVES)
def test_without_brackets_or_forces_nothing_moves(kind: str, target: str) -> None:
    spec = specs.loads(f"phigen: 1\nname: nothing\n{NOTHING_MOVES[kind]}")
    solver = phigen.compile(spec, target, tangent=True, adjoint=True)
    x = np.random.default_rng(1).normal(size=(len(spec.coordinates), 4))
    more = {"bonds": [[0, 1], [1, 2]]} if "graph" in kind else {}
    assert np.array_equal(solver.integrate(x, 0.1, 3, **more).x, [x] * 4)
    vectors = np.random.default_rng(2).normal(size=(2, *x.shape))
    assert np.array_equal(solver.step_tangent(x, 0.1, vectors, **more)[1], vectors)
    assert np.array_equal(solver.pullback(x, 0.1, 3, vectors[0], **more).x0_bar, vectors[0])


def test_colours_of_a_graph_part_the_ends_of_all_bonds() -> None:
    bonds = np.random.default_rng(5).integers(0, 40, size=(150, 2))
    bonds = bonds[bonds[:, 0] != bonds[:, 1]]
    _, sites = module_of("web")._started(np.ones((1, 40)), {"bonds": bonds})
    assert (sites.colours[bonds[:, 0]] != sites.colours[bonds[:, 1]]).all()
    by = [solver("web", 2, t).step(np.linspace(0.5, 2, 40)[None], 0.02, bonds=bonds) for t in ("c", "numpy")]
    np.testing.assert_allclose(by[0], by[1], rtol=1e-14)


def test_an_ensemble_has_disorder_of_its_own() -> None:
    x, integrator = start("dnls"), solver("dnls", target="c")
    energies = np.random.default_rng(3).normal(size=(3, 7))
    final = integrator.ensemble(np.stack([x] * 3), 0.1, 20, e=energies)
    for member in range(3):
        assert np.array_equal(final[member], integrator.integrate(x, 0.1, 20, 20, e=energies[member]).x[-1])


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_members_of_a_lattice_have_numbers_and_steps_of_their_own(target: str) -> None:
    """All members start from one state; their frames are those of `integrate`."""
    x, integrator = start("fput"), solver("fput", target=target)
    h, name = np.array([0.1, 0.05, 0.02]), "a"
    strengths = np.array([0.5, 1.0, 2.0])
    frames = integrator.ensemble(x, h, 10, 4, threads=2, **{name: strengths})
    for member in range(3):
        alone = integrator.integrate(x, h[member], 10, 4, **{name: strengths[member]})
        assert np.array_equal(frames[:, member], alone.x)
    with pytest.raises(ValueError, match="has 2 members, not 3"):
        integrator.ensemble(np.stack([x] * 3), 0.1, 10, **{name: strengths[:2]})


def test_members_of_a_lattice_fail_by_themselves() -> None:
    x = np.array([[0.0, 9.0, 0.0, -9.0, 3.0]] * 2)
    with pytest.raises(StepError, match="1 member") as failure:
        solver("fput", target="c").ensemble(x, [0.5, 1e-4], 100, 50)
    assert failure.value.members == (0,)
    assert np.isnan(failure.value.trajectory[-1, 0]).all()
    assert np.isfinite(failure.value.trajectory[:, 1]).all()


def test_a_failing_step_leaves_the_state_before_it() -> None:
    x = np.array([[0.0, 9.0, 0.0, -9.0, 3.0]] * 2)
    with pytest.raises(StepError, match="NOT_FINITE") as failure:
        solver("fput", target="c").integrate(x, 0.5, 100, 7)
    run = failure.value.trajectory
    assert np.isfinite(run.x).all()
    assert len(run) >= 1


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_a_step_whose_coefficients_are_not_finite_fails_as_one_whose_state_is_not(target: str) -> None:
    text = f"phigen: 1\nname: pushed\n{TEXTS['fput']}\nforces: {{vector: {{p: -p}}}}\norder: 4\n"
    compilation = compile_spec(specs.loads(text), adjoint=True)
    solver, x = lattice_solver_of(compilation, target), np.ones((2, 4))
    for act in (
        solver.integrate,
        lambda *run: solver.pullback(*run, x),
        lambda *run: solver.ensemble(x[None], *run[1:]),
    ):
        with pytest.raises(StepError) as failure:
            act(x, -1e10, 3)
        assert failure.value.status == "NOT_FINITE"


@pytest.mark.parametrize("energy", ["z + x/3", "z + x*cos(t)"])
def test_coefficients_call_functions_that_are_defined_before(energy: str) -> None:
    """Without a dependence of ∇H on the state, steps of the series compute φ once, with the coefficients."""
    time = "time: t\n" if "t)" in energy else ""
    text = f"lattice: {{axes: [i]}}\n{time}coordinates: [x, y, z]\npoisson: {{lie_algebra: so(3)}}\nscheme: series\n"
    compilation = compile_text(f"{text}hamiltonian: {energy}\n")
    x = np.array([[0.6] * 4, [0.0] * 4, [0.8] * 4])
    ends = [lattice_solver_of(compilation, target).integrate(x, 0.1, 4).x[-1] for target in ("c", "numpy")]
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-15)


def test_rotors_turn_by_angles_up_to_the_limit_of_the_functions() -> None:
    text = "lattice: {axes: [i]}\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
    compilation = compile_text(f"{text}hamiltonian: p**2/2 - cos(q[i+1] - q) - cos(q)\n")
    x = np.array([9.9e7 + np.arange(20.0), np.full(20, 3.0)])
    runs = [lattice_solver_of(compilation, target).integrate(x, 0.05, 40) for target in ("c", "numpy")]
    np.testing.assert_allclose(runs[0].x[-1][1], runs[1].x[-1][1], rtol=0, atol=1e-6)  # angles are rounded to 1.5e-8
    assert abs(runs[0].energy[-1] - runs[0].energy[0]) < 1e-3
    with pytest.raises(StepError, match="compute sin and cos of angles up to 1e8"):
        lattice_solver_of(compilation, "c").integrate(x + 2e6, 0.05, 40)


def test_a_start_where_h_is_not_defined_is_said_with_its_site() -> None:
    x = np.ones((1, 8))
    x[0, 5] = -1.5
    text = "lattice: {axes: [i]}\ncoordinates: [a]\nhamiltonian: a + log(a)**2\n"
    compilation = compile_text(f'{text}poisson: {{brackets: {{a: {{"a[i+1]": "a*a[i+1]"}}}}}}\n')
    with pytest.raises(StepError, match=r"H is not finite at the start: at the site \(5\), where a = -1.5"):
        lattice_solver_of(compilation, "numpy").integrate(x, 0.1, 2)


@pytest.mark.parametrize(
    ("x", "more", "error", "said"),
    [
        (np.zeros((2, 7)), {}, ValueError, r"shape \(3, N_i\)"),
        (np.zeros((3, 1)), {}, ValueError, "1 sites along i"),
        (np.full((3, 7), np.nan), {}, ValueError, "finite"),
        (np.zeros((3, 7)), {"B": np.zeros(6)}, ValueError, r"shape \(7,\)"),
        (np.zeros((3, 7)), {"K": 1.0}, TypeError, "unknown parameter"),
        (np.zeros((1, 7)), {}, TypeError, "bonds= is missing"),
        (np.zeros((1, 3)), {"bonds": BONDS}, ValueError, r"bond 3 runs from 2 to 3, .* from 0 to 2"),
        (np.zeros((1, 7)), {"bonds": [[0, 1], [2, 2]]}, ValueError, "bond 1 runs from 2 to 2"),
        (np.zeros((1, 7)), {"bonds": BONDS, "A": np.ones(3)}, ValueError, r"shape \(7,\), not \(3,\)"),
    ],
)
def test_wrong_arguments_are_told(x: np.ndarray, more: dict[str, Any], error: type[Exception], said: str) -> None:
    with pytest.raises(error, match=said):
        solver("web" if len(x) == 1 else "xxz").integrate(x, 0.1, 1, **more)


def test_odd_sizes_do_not_fit_two_colours() -> None:
    with pytest.raises(
        ValueError, match="multiples of 2; compile from a spec that has a run of this size, or with scheme='series'"
    ):
        solver("volterra").integrate(np.ones((1, 7)), 0.1, 1)


@pytest.mark.parametrize(
    ("sizes", "scheme", "step"),
    [
        ([8], "auto", "sites of 2 colours"),
        ([9], "auto", "sites of 2 colours and a seam"),
        ([8, 9], "splitting", "sites of 2 colours and a seam"),
    ],
)
def test_colours_are_such_as_all_runs_have_sizes_for(sizes: list[int], scheme: str, step: str) -> None:
    runs = "".join(f"  r{n}: {{sizes: [{n}], initial: {{x: 1 + i/9}}, step: 0.1, steps: 1}}\n" for n in sizes)
    text = f"lattice: {{axes: [i], boundary: periodic}}\nscheme: {scheme}\ncoordinates: [x]\nhamiltonian: x\n"
    compilation = compile_text(f'{text}poisson: {{brackets: {{x: {{"x[i+1]": "x*x[i+1]"}}}}}}\nruns:\n{runs}')
    assert any(fact.endswith(step) for fact in compilation.program.about.facts)
    assert {s.verdict for group in lattice_statements.sweeps(compilation).values() for s in group} == {PROVED}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('scheme: splitting\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n'
         'hamiltonian: "exp(q*p[i+1] + p)"', "do not commute"),
        ('coordinates: [q, p]\npoisson: {brackets: {q: {p: 1 + q**2*p**2}}}\n'
         'hamiltonian: "exp(q*p[i+1] + p)"', "(?s)do not commute.*karasev follows paths"),
        ('coordinates: [a, b]\npoisson: {brackets: {a: {"b[i+1]": "a + b[i+1]"}}}\nscheme: series\n'
         'hamiltonian: "a*b[i+1]"', "which couple neighbours"),
        ('coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nscheme: series\norder: 12\n'
         'hamiltonian: "p**2/2 + q*q[i+1]"', "the orders 2, 4, 4, 6, 6, 8, 8, 10, not 12"),
        ('scheme: splitting\ncoordinates: [x]\npoisson: {brackets: {x: {"x[i+2]": "x*x[i+2]"}}}\nhamiltonian: x\n'
         'runs: {odd: {sizes: [5], initial: {x: 1}, step: 0.1, steps: 1}}',
         "(?s)5 along i is not a multiple of 3.*for example 3"),
    ],
)  # fmt: skip
def test_what_has_no_step_is_refused(text: str, said: str) -> None:
    with pytest.raises(SpecError, match=said):
        compile_text(f"lattice: {{axes: [i], boundary: periodic}}\n{text}")


def with_default(value: str, target: str = "numpy") -> LatticeSolver:
    """Return a solver of a chain whose parameter e has this default, with a run of nine sites."""
    run = "runs: {nine: {sizes: [9], initial: {q: 1, p: 0}, step: 0.1, steps: 2}}"
    text = TEXTS["dnls"].replace("value: 0.1", f"value: {value}")
    spec = specs.loads(f"phigen: 1\nname: disordered\n{text}\nadjoint: true\n{run}\n")
    return lattice_solver_of(compile_spec(spec), target)


UNEVEN = '"cos(i + 2*pi*i/N_i)"'


@pytest.mark.parametrize(
    ("value", "e"),
    [
        (UNEVEN, np.cos(np.arange(7) * (1 + 2 * np.pi / 7))),
        ("{random: normal, seed: 5, scale: 2}", 2 * np.random.default_rng(5).normal(size=7)),
        ("[1, 2, 3, 4, 5, 6, 7]", np.arange(1.0, 8)),
    ],
)
def test_defaults_are_made_at_the_sizes_of_the_state(value: str, e: np.ndarray) -> None:
    x, integrator = start("dnls"), with_default(value)
    run = integrator.integrate(x, 0.1, 2)
    np.testing.assert_allclose(run.parameters["e"], e, rtol=1e-15)
    explicit = {"e": run.parameters["e"]}
    assert np.array_equal(run.x, integrator.integrate(x, 0.1, 2, **explicit).x)
    assert np.array_equal(run.x, integrator.run(sizes=[7], x0=x).x) or "[" in value
    assert integrator.hamiltonian(x) == integrator.hamiltonian(x, **explicit)
    assert np.array_equal(
        integrator.ensemble(np.stack([x, -x]), 0.1, 2), integrator.ensemble(np.stack([x, -x]), 0.1, 2, **explicit)
    )
    gradients = [integrator.pullback(x, 0.1, 2, x, **parameters).parameters_bar["e"] for parameters in ({}, explicit)]
    assert np.array_equal(*gradients)
    with pytest.raises(TypeError, match="'e' is given twice"):
        integrator.integrate(x, 0.1, 1, e=0.2, parameters={"e": 0.1})


def test_defaults_of_other_sizes_are_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "e.npy", np.ones(9))
    hint = re.escape("hint: give e=, an array of shape (7,), or one number")
    with pytest.raises(SpecError, match=rf"(?s)<string>:\d+:\d+: error: e: 3 values, not 7.*{hint}"):
        with_default("[1, 2, 3]").integrate(start("dnls"), 0.1, 1)
    with pytest.raises(SpecError, match=rf"(?s)e: cannot read .*9.*7.*{hint}"):
        with_default(str(tmp_path / "e.npy")).hamiltonian(start("dnls"))


@pytest.mark.parametrize("name", TEXTS)
def test_methods_are_proved(name: str) -> None:
    compilation = compiled(name)
    ((group, sweep_statements),) = lattice_statements.sweeps(compilation).items()
    if name in SERIES:
        assert len(sweep_statements) == 7
    else:
        assert group == statements.SPLITTING
        assert len(sweep_statements) == 1 + len(compilation.program.step.parts)
    assert {s.verdict for s in sweep_statements} == {PROVED}


def test_a_wrong_flow_is_refuted() -> None:
    compilation = compiled("xxz")
    plan = compilation.sweeps
    first, *others = plan.flows
    (motion,) = first.motions
    wrong = {f: -e if f == "y" else e for f, e in motion.solution.items()}
    flows = (replace(first, motions=(replace(motion, solution=wrong),)), *others)
    broken = replace(plan, choice=replace(plan.choice, splitting=replace(plan.choice.splitting, flows=flows)))
    verdicts = [s.verdict for s in lattice_statements.sweeps(replace(compilation, sweeps=broken))[statements.SPLITTING]]
    assert verdicts == [PROVED, REFUTED, PROVED, PROVED]
