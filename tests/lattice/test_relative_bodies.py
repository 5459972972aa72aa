"""Bodies of a lattice in relative coordinates: parts, proofs, orders, Poisson maps, particles without mass, targets."""

from __future__ import annotations

import re
from ctypes import CDLL
from functools import cache
from pathlib import Path
from time import process_time

import numpy as np
import pytest
from click.testing import CliRunner
from lattice.lattices import with_threads
from node import answers

import phigen
import phigen.spec
from phigen.api import lattice_solver_of
from phigen.cli import group
from phigen.compilation import Compilation
from phigen.compiler import compile_spec, emit, examine
from phigen.errors import SpecError, StepError
from phigen.lattice.cell_building import cell_from_spec
from phigen.lattice.relative_bodies import INNER_MASS, lattice_bodies
from phigen.lattice.states import start_of
from phigen.runtime.lattice import LatticeSolver
from phigen.study.lattice_verification import verify_lattice
from phigen.symbolic.expression import derivatives, symbol
from phigen.symbolic.verdict import PROVED, decide_zero

TEXT = """\
phigen: 1
name: bodies
lattice: {pairs: all}
coordinates: [COORDINATES]
parameters: {G: 1, m: {value: 0, at: sites, BOUND: true}}
poisson: POISSON
hamiltonian:
  sites: KINETIC
  pairs: -G*m[a]*m[b]/sqrt(DISTANCE)
scheme: splitting
coordinates_from: CHANGE
composition: COMPOSITION
order: ORDER
"""
SCRIPT = Path(__file__).with_name("javascript.mjs")
CHANGES = ("jacobi", "democratic_heliocentric")
MASSES = np.array([1, 2e-3, 0, 1e-3, 0, 5e-4])


def text(
    change: str = "jacobi", axes: str = "xyz", composition: str = "aba-10-6-4", order: int = 4, momenta: bool = False
) -> str:
    """Return the spec of bodies, with velocities or with ``momenta``."""
    kind = "p" if momenta else "v"
    squares = " + ".join(f"{kind}{a}**2" for a in axes)
    brackets = ", ".join(f"{a}: {{v{a}: 1/m}}" for a in axes)
    names, conjugate = (", ".join(f"{k}{a}" for a in axes) for k in ("", kind))
    canonical = f"{{canonical: {{q: [{names}], p: [{conjugate}]}}}}"
    values = {
        "COORDINATES": f"{names}, {conjugate}",
        "BOUND": "positive" if momenta else "nonnegative",
        "value: 0": "value: 1" if momenta else "value: 0",
        "POISSON": canonical if momenta else f"{{brackets: {{{brackets}}}}}",
        "KINETIC": f"({squares})/(2*m)" if momenta else f"m*({squares})/2",
        "DISTANCE": " + ".join(f"({a}[a] - {a}[b])**2" for a in axes),
        "CHANGE": change,
        "COMPOSITION": composition,
        "ORDER": str(order),
    }
    spec = TEXT
    for name, value in values.items():
        spec = spec.replace(name, value)
    return spec


@cache
def compiled(spec: str, *, tangent: bool = False) -> Compilation:
    return compile_spec(phigen.spec.loads(spec), tangent=tangent)


@cache
def solver(spec: str, target: str = "c", *, tangent: bool = False) -> LatticeSolver:
    return lattice_solver_of(compiled(spec, tangent=tangent), target)


def orbits(count: int = 6, axes: int = 3, *, eccentricity: float = 0.05, seed: int = 1) -> np.ndarray:
    """Return positions and velocities of bodies on nearly circular orbits about the first, which moves too."""
    draws = np.random.default_rng(seed)
    radius, angle = 1 + 0.7 * np.arange(count), draws.uniform(0, 2 * np.pi, count)
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    x = np.zeros((2 * axes, count))
    x[:2], x[axes : axes + 2] = radius * along, across * (1 + draws.uniform(-1, 1, count) * eccentricity) / radius**0.5
    if axes == 3:
        x[2], x[5] = draws.normal(0, 0.02, (2, count))
    x[:, 0] = draws.normal(0, 0.01, 2 * axes)
    return x


def accelerations(q: np.ndarray, m: np.ndarray) -> np.ndarray:
    """Return the accelerations (axes, bodies) by gravity, derived without phigen."""
    apart = q[:, None, :] - q[:, :, None]
    cubes = np.linalg.norm(apart, axis=0) ** 3
    np.fill_diagonal(cubes, np.inf)
    return (m * apart / cubes).sum(axis=2)


def reference(x: np.ndarray, m: np.ndarray, time: float) -> np.ndarray:
    """Return the state after a time, by DOP853."""
    from scipy.integrate import solve_ivp

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        q, v = y.reshape(2, -1, len(m))
        return np.concatenate([v, accelerations(q, m)]).ravel()

    solution = solve_ivp(rate, (0, time), x.ravel(), method="DOP853", rtol=1e-13, atol=1e-15)
    return solution.y[:, -1].reshape(x.shape)


def with_momenta(x: np.ndarray, m: np.ndarray) -> np.ndarray:
    axes = len(x) // 2
    return np.concatenate([x[:axes], m * x[axes:]])


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("momenta", [False, True])
def test_the_change_the_parts_and_their_flows_are_proved(change: str, momenta: bool) -> None:
    examination = examine(phigen.spec.loads(text(change, "xy", momenta=momenta)))
    statements = examination.groups["Splitting"]
    assert len(statements) == 4
    assert {s.verdict for s in statements} == {"proved"}


def test_the_remainder_subtracts_the_potential_energy_of_the_kepler_motions() -> None:
    spec = phigen.spec.loads(text("jacobi", "xy"))
    bodies = lattice_bodies(cell_from_spec(spec), spec)
    remainder = next(flow for flow in bodies.flows().flows if flow.motion is None)
    subtracted = remainder.hamiltonian - bodies.cell.pair_hamiltonian
    m, inner = symbol("m"), symbol(INNER_MASS)
    reduced_mass = m * (inner - m) / inner
    ((x, v), _) = bodies.axes
    acceleration = derivatives([remainder.motions[0].rates[v]], INNER_MASS)[0] * inner
    residual = reduced_mass * acceleration + derivatives([subtracted], x)[0]
    assert decide_zero("force of the subtracted energy", [("", residual)], ["m"]).verdict == PROVED


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize(("change", "momenta", "axes"), [
    ("jacobi", False, "xyz"), ("democratic_heliocentric", False, "xyz"),
    ("jacobi", True, "xy"), ("democratic_heliocentric", True, "xyz"),
])  # fmt: skip
def test_orbits_are_those_of_the_equations_of_motion(change: str, momenta: bool, axes: str) -> None:
    m = np.array([1, 2e-3, 1e-4, 1e-3, 3e-4]) if momenta else MASSES
    x = orbits(len(m), len(axes))
    expected = reference(x, m, 6.0)
    if momenta:
        x, expected = with_momenta(x, m), with_momenta(expected, m)
    for target in ("c", "numpy"):
        run = solver(text(change, axes, momenta=momenta), target).integrate(x, h=0.1, steps=60, stride=60, m=m)
        np.testing.assert_allclose(run.x[-1], expected, rtol=0, atol=2e-10)


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize(("composition", "order"), [("saba-8-2", 2), ("blanes-moan", 4), ("blanes-moan", 6)])
def test_the_order_is_that_of_the_composition(change: str, composition: str, order: int) -> None:
    m = 20 * MASSES + [0, 0.01, 0, 0, 0, 0.01]  # large masses, so that the small part of H is not negligible
    m[0] = 1
    x = orbits(eccentricity=0.2)
    expected = reference(x, m, 8.0)
    one = solver(text(change, composition=composition, order=order))
    steps = (20, 40) if order == 6 else (40, 80)
    errors = [abs(one.integrate(x, h=8 / n, steps=n, stride=n, m=m).x[-1] - expected).max() for n in steps]
    assert errors[1] > 1e-11
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.6)


def canonical(x: np.ndarray, m: np.ndarray) -> np.ndarray:
    """Return π of positions and velocities."""
    axes = len(x) // 2
    inverse, zero = np.diag(np.tile(1 / m, axes)), np.zeros((axes * len(m),) * 2)
    return np.block([[zero, inverse], [-inverse, zero]])


@pytest.mark.parametrize("target", ["c", "numpy"])
@pytest.mark.parametrize("change", CHANGES)
def test_a_step_is_a_poisson_map(change: str, target: str) -> None:
    m = np.array([1, 0.03, 0.02, 0.1])
    x = orbits(4, 2, eccentricity=0.3)
    one = solver(text(change, "xy", composition="saba-4-2", order=2), target, tangent=True)
    after, carried = one.step_tangent(x, 0.3, np.eye(16).reshape(16, 4, 4), m=m)
    matrix = carried.reshape(16, 16).T
    structure = canonical(x, m)
    np.testing.assert_allclose(after, one.integrate(x, h=0.3, steps=1, m=m).x[-1], rtol=0, atol=1e-14)
    np.testing.assert_allclose(matrix @ structure @ matrix.T, structure, rtol=0, atol=2e-12)
    near = [one.integrate(x + d, h=0.3, steps=1, m=m).x[-1] for e in np.eye(16) for d in
            (1e-6 * e.reshape(4, 4), -1e-6 * e.reshape(4, 4))]  # fmt: skip
    differences = np.array([(a - b).ravel() / 2e-6 for a, b in zip(near[::2], near[1::2], strict=True)]).T
    np.testing.assert_allclose(matrix, differences, rtol=0, atol=1e-8)


def written_out(count: int, change: str, composition: str, order: int) -> str:
    """Return the ordinary spec of bodies in a plane, with canonical momenta."""
    q, p = ([f"{k}{a}{i}" for a in "xy" for i in range(count)] for k in ("", "p"))
    kinetic = (f"(px{i}**2 + py{i}**2)/(2*m{i})" for i in range(count))
    pairs = (f"m{i}*m{j}/sqrt((x{i} - x{j})**2 + (y{i} - y{j})**2)" for i in range(count) for j in range(i))
    return (
        f"phigen: 1\nname: written_out\ncoordinates: [{', '.join([*q, *p])}]\n"
        f"parameters: {{{', '.join(f'm{i}: {{value: 1, positive: true}}' for i in range(count))}}}\n"
        f"poisson: {{canonical: {{q: [{', '.join(q)}], p: [{', '.join(p)}]}}}}\n"
        f"hamiltonian: {' + '.join(kinetic)} - {' - '.join(pairs)}\n"
        f"scheme: splitting\ncoordinates_from: {change}\ncomposition: {composition}\norder: {order}\n"
    )


@pytest.mark.thin(4, of_all=1)
@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize(("composition", "order"), [("wisdom-holman-17", 2), ("aba-8-6-4", 4), ("wisdom-holman", 2)])
def test_a_lattice_is_its_ordinary_spec(change: str, composition: str, order: int) -> None:
    m = np.array([1, 2e-3, 1e-3, 3e-3])
    x = with_momenta(orbits(4, 2), m)
    masses = {f"m{i}": float(v) for i, v in enumerate(m)}
    ordinary = phigen.compile(phigen.spec.loads(written_out(4, change, composition, order)))
    expected = ordinary.integrate(x.ravel(), h=0.2, steps=60, stride=20, **masses)
    for target in ("c", "numpy"):
        lattice = solver(text(change, "xy", composition, order, momenta=True), target)
        run = lattice.integrate(x, h=0.2, steps=60, stride=20, m=m)
        np.testing.assert_allclose(run.x.reshape(4, -1), expected.x, rtol=0, atol=2e-13)


def test_correctors_remove_the_error_of_first_order() -> None:
    x, m = orbits(), MASSES
    errors = []
    for composition in ("wisdom-holman", "wisdom-holman-3", "wisdom-holman-17"):
        run = solver(text("jacobi", composition=composition, order=2)).integrate(x, h=0.2, steps=400, stride=20, m=m)
        errors.append(abs(run.energy / run.energy[0] - 1).max())
    assert errors[0] > 20 * errors[1] > 40 * errors[2]


@pytest.mark.parametrize("change", CHANGES)
def test_two_bodies_move_exactly(change: str) -> None:
    m, x = np.array([1, 0.3]), orbits(2, 2, eccentricity=0.5)
    run = solver(text(change, "xy", composition="saba-4-2", order=2)).integrate(x, h=7.0, steps=1, m=m)
    if change == "jacobi":
        np.testing.assert_allclose(run.x[-1], reference(x, m, 7.0), rtol=0, atol=1e-11)
    else:  # the motion of the first body is in B
        assert abs(run.x[-1] - reference(x, m, 7.0)).max() > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("target", ["c", "numpy"])
def test_particles_without_mass_do_nothing_to_others(change: str, target: str) -> None:
    m, x = np.array([1, 1e-3, 5e-4, 0, 0, 0, 0]), orbits(7)
    one = solver(text(change), target)
    together, alone = (one.integrate(x[:, :n], h=0.2, steps=50, stride=50, m=m[:n]) for n in (7, 3))
    np.testing.assert_allclose(together.x[-1][:, :3], alone.x[-1], rtol=0, atol=1e-13)
    assert abs(together.energy - alone.energy).max() < 1e-15
    light = one.integrate(x, h=0.2, steps=50, stride=50, m=np.where(m > 0, m, 1e-12))
    np.testing.assert_allclose(together.x[-1], light.x[-1], rtol=0, atol=1e-9)
    assert abs(together.x[-1][:, 3:] - x[:, 3:]).max() > 0.1


def test_jacobi_coordinates_take_particles_between_the_others() -> None:
    x = orbits()
    order = [0, 1, 3, 5, 2, 4]
    one = solver(text("jacobi"))
    mixed, last = (one.integrate(x[:, k], h=0.05, steps=80, stride=80, m=MASSES[k]) for k in (range(6), order))
    np.testing.assert_allclose(mixed.x[-1][:, order], last.x[-1], rtol=0, atol=1e-10)


def test_a_swarm_costs_in_proportion_to_its_particles() -> None:
    one = solver(text("democratic_heliocentric", composition="saba-4-2", order=2))

    def seconds(particles: int) -> float:
        m = np.concatenate([[1, 1e-3, 1e-3], np.zeros(particles)])
        session = one.session(orbits(3 + particles) * 1.0, m=m)
        session.step(0.05, 2)
        times = []
        for _ in range(5):
            begin = process_time()
            session.step(0.05, 20)
            times.append(process_time() - begin)
        return min(times)

    try:
        CDLL("libgomp.so.1").omp_set_num_threads(1)  # waiting threads would add processor time
        assert seconds(4000) < 24 * seconds(400)  # a sum over all pairs would take a hundred times as long
    finally:
        CDLL("libgomp.so.1").omp_set_num_threads(2)


@pytest.mark.thin(3, of_all=1)
@pytest.mark.parametrize(
    ("change", "composition"), [*((c, "aba-10-6-4") for c in CHANGES), ("jacobi", "wisdom-holman-5")]
)
def test_all_targets_agree(change: str, composition: str, tmp_path: Path) -> None:
    for kind, m in (("velocities", MASSES), ("momenta", np.where(MASSES > 0, MASSES, 1e-4))):
        momenta = kind == "momenta"
        x = orbits() if not momenta else with_momenta(orbits(), m)
        spec = text(change, composition=composition, order=4 if composition == "aba-10-6-4" else 2, momenta=momenta)
        vectors = np.random.default_rng(5).normal(size=(2, *x.shape)) * (m if momenta else 1)
        carried = {t: solver(spec, t, tangent=True).step_tangent(x, 0.3, vectors, m=m) for t in ("c", "numpy")}
        states = {t: solver(spec, t).integrate(x, h=0.3, steps=20, m=m).x[-1] for t in ("c", "numpy")}
        (module,) = emit(compiled(spec, tangent=True).program, "js", "").values()
        (tmp_path / f"{kind}.mjs").write_text(module, encoding="utf-8")
        job = {"module": (tmp_path / f"{kind}.mjs").as_uri(), "h": 0.3}
        options = {"x0": x.ravel().tolist(), "sizes": [6], "params": {"m": m.tolist()}}
        job["options"] = options
        jobs = [{**job, "steps": 20}, {**job, "vectors": vectors.reshape(2, -1).tolist()}]
        run, tangent = answers(SCRIPT, jobs)
        states["js"] = np.array(run["x"]).reshape(x.shape)
        carried["js"] = np.array(tangent["after"]).reshape(x.shape), np.array(tangent["carried"]).reshape(2, *x.shape)
        for target in ("numpy", "js"):
            np.testing.assert_allclose(states[target], states["c"], rtol=0, atol=1e-13)
            np.testing.assert_allclose(carried[target][0], carried["c"][0], rtol=0, atol=1e-14)
            np.testing.assert_allclose(carried[target][1], carried["c"][1], rtol=0, atol=1e-12)


UNBOUNDED = {False: ", nonnegative: true", True: ", positive: true"}
MASSES_NOT_ALLOWED = {
    "negative": ([1, -1e-3, 0], False, "must be nonnegative at all sites"),
    "not finite": ([1, np.nan, 0], False, "must be finite at all sites"),
    "no first mass": ([0, 1, 1], False, "must be positive at the first site"),
    "no mass at all": (0.0, False, "must be positive at the first site"),
    "momenta": ([1, 1e-3, 0], True, "must be positive at all sites"),
}


@pytest.mark.parametrize("target", ["c", "numpy"])
@pytest.mark.parametrize("name", MASSES_NOT_ALLOWED)
def test_masses_are_checked(name: str, target: str) -> None:
    m, momenta, message = MASSES_NOT_ALLOWED[name]
    spec = text(momenta=momenta).replace(UNBOUNDED[momenta], "")
    with pytest.raises(ValueError, match=message):
        solver(spec, target).integrate(orbits(3), h=0.1, steps=1, m=np.array(m, dtype=float))


@pytest.mark.parametrize("change", CHANGES)
def test_solvers_refuse_masses_without_a_finite_sum(change: str, tmp_path: Path) -> None:
    x, huge = orbits(4), np.array([1, 1e308, 1e308, 1e308])
    for target in ("c", "numpy"):
        with pytest.raises(StepError, match="no step can be made"):
            solver(text(change), target).integrate(x, h=0.1, steps=1, m=huge)
    (module,) = emit(compiled(text(change)).program, "js", "").values()
    (tmp_path / "bodies.mjs").write_text(module, encoding="utf-8")
    options = {"x0": x.ravel().tolist(), "sizes": [4], "params": {"m": huge.tolist()}}
    (answer,) = answers(
        SCRIPT, [{"module": (tmp_path / "bodies.mjs").as_uri(), "h": 0.1, "steps": 1, "options": options}]
    )
    assert answer["status"] == "BAD_ARGUMENT"


RUN = "runs: {one: {initial: {x: [POSITIONS], y: 0, vx: 0, vy: [SPEEDS]}, step: 0.1, steps: 40}}\n"


@pytest.mark.thin(3, of_all=1)
@pytest.mark.parametrize("masses", ["0.3", "0, 0, 1.0e-3", "0, 1.0e-3, 0, 2.0e-4, 0, 0, 0, 0"])
def test_bodies_are_verified_on_a_few_of_them_with_the_first(masses: str) -> None:
    count = 1 + len(masses.split(","))
    run = RUN.replace("POSITIONS", ", ".join(map(str, range(count))))
    run = run.replace("SPEEDS", ", ".join(f"{i and i**-0.5:.3f}" for i in range(count)))
    spec = phigen.spec.loads(
        text(axes="xy", composition="saba-4-2", order=2).replace("value: 0", f"value: [1, {masses}]") + run
    )
    compilation = compile_spec(spec, tangent=True)
    solvers = {t: lattice_solver_of(compilation, t) for t in ("c", "numpy")}
    verification = verify_lattice(compilation.by_sweeps(), solvers, "one", start_of(spec, spec.runs["one"]), 0.1, 40)
    assert [c.name for c in verification.checks if not c.passed] == []
    assert f"Poisson identity on {min(count, 3)} sites" in {c.name.split(",")[0] for c in verification.checks}


@pytest.mark.parametrize(
    ("masses", "momenta", "message"),
    [
        ("[0, 1]", False, "the first body needs a positive mass, not 0"),
        ("[-1, 1]", False, "the first body needs a positive mass, not -1"),
        ("[1, -1]", False, "masses must be nonnegative, but -1 at site 1"),
        ("[1, 0]", True, "bodies with momenta must have positive masses, but 0 at site 1"),
    ],
)
def test_masses_of_runs_are_refused_at_their_place(masses: str, momenta: bool, message: str) -> None:
    spec = text(axes="xy", momenta=momenta).replace(UNBOUNDED[momenta], "")
    spec = re.sub("value: [01]", f"value: {masses}", spec)
    run = RUN.replace("POSITIONS", "0, 1").replace("SPEEDS", "0, 1")
    loaded = phigen.spec.loads(spec + (run.replace("vx", "px").replace("vy", "py") if momenta else run))
    with pytest.raises(SpecError, match=message) as caught:
        start_of(loaded, loaded.runs["one"])
    assert caught.value.diagnostics[0].location.line == 5


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize("target", ["c", "numpy"])
@pytest.mark.parametrize("change", CHANGES)
def test_a_collision_is_an_error_and_a_hyperbola_is_not(change: str, target: str) -> None:
    m, x = np.array([1, 1e-3, 0.0]), orbits(3, 2)
    fast = x.copy()
    fast[2:, 2] *= 3  # escapes on a hyperbola
    run = solver(text(change, "xy"), target).integrate(fast, h=0.05, steps=200, stride=200, m=m)
    np.testing.assert_allclose(run.x[-1], reference(fast, m, 10.0), rtol=0, atol=1e-8)
    met = x.copy()
    if change == "jacobi":
        m = np.array([1.0, 0, 0])
        met[2:, 1] = met[2:, 0]  # falls into the first body
    else:
        met[:, 2] = met[:, 0]  # at the place of the first body
    with pytest.raises(StepError) as raised:
        solver(text(change, "xy"), target).integrate(met, h=3.0, steps=3, m=m)
    assert raised.value.status == "NOT_FINITE"


@pytest.mark.parametrize("change", CHANGES)
def test_threads_do_not_change_the_bits(change: str) -> None:
    x, m = orbits(1200, 2), np.zeros(1200)
    m[:3] = 1, 1e-3, 5e-4
    one = solver(text(change, "xy", composition="saba-4-2", order=2), tangent=True)
    vector = np.random.default_rng(2).normal(size=(1, *x.shape))

    def run() -> np.ndarray:
        carried = one.step_tangent(x, 0.2, vector, m=m)[1]
        return np.concatenate([one.integrate(x, h=0.2, steps=5, stride=5, m=m).x[-1], carried[0]])

    first, *others = with_threads(run)
    assert all(np.array_equal(first, other) for other in others)


@pytest.mark.parametrize("target", ["c", "js"])
def test_comments_name_the_parts_of_h_and_no_internal_symbols(target: str) -> None:
    compilation = compile_spec(phigen.spec.loads(text()))
    generated = " ".join("".join(emit(compilation.program, target, "phigen").values()).split())
    assert "inner:" not in generated
    for part in ("H_1 = A, the Hamiltonian of", "H_2 = H - A, where A is the Hamiltonian of"):
        assert f"The flow of {part} the Kepler motions in Jacobi coordinates" in re.sub(r" (\*|#) ", " ", generated)


@pytest.mark.parametrize(("change", "most"), [("jacobi", 920), ("democratic_heliocentric", 890)])
def test_short_code_makes_the_same_steps_by_any_number_of_threads(change: str, most: int) -> None:
    x, m = orbits(1200), np.zeros(1200)
    m[:3] = 1, 1e-3, 5e-4
    spec = text(change, composition="saba-4-2", order=2)
    short = compile_spec(phigen.spec.loads(spec), profile="small")
    lines = [line for part in emit(short.program, "c", "phigen").values() for line in part.splitlines()]
    assert len(lines) <= most
    assert not [line for line in lines if "omp barrier" in line]
    one = lattice_solver_of(short, "c")
    expected = solver(spec).integrate(x, h=0.2, steps=5, stride=5, m=m).x[-1]
    first, *others = with_threads(lambda: one.integrate(x, h=0.2, steps=5, stride=5, m=m).x[-1])
    np.testing.assert_allclose(first, expected, rtol=0, atol=1e-12)
    assert all(np.array_equal(first, other) for other in others)


def test_runs_continue_and_steps_backward_return() -> None:
    x, one = orbits(), solver(text("jacobi"))
    session = one.session(x, m=MASSES)
    for _ in range(4):
        session.step(0.2, 5)
    whole = one.integrate(x, h=0.2, steps=20, stride=20, m=MASSES)
    np.testing.assert_allclose(session.x, whole.x[-1], rtol=0, atol=1e-14)
    session.step(-0.2, 20)
    np.testing.assert_allclose(session.x, x, rtol=0, atol=1e-13)


NOISE = "noise: {n: {hamiltonian: x, amplitude: 1}}\n"
REFUSED = {
    "noise": (text() + NOISE, "cannot be combined with noise"),
    "a monitor": (text() + "monitor: log\n", "cannot be combined with monitor"),
    "gradients": (text() + "adjoint: true\n", "cannot be combined with adjoint"),
    "another force": (text().replace("/sqrt(", "*("), "no multiple of one over the distance"),
    "a charge": (text().replace("-G*m[a]*m[b]", "-m[a]**2*m[b]**2"), "not proportional"),
    "a field": (text().replace("sites: m*(", "sites: m*x**2 + m*("), "not the kinetic energy"),
    "another mass": (text().replace("{vx: 1/m}", "{vx: 2/m}"), "neither 1 nor 1/m"),
    "a corrector": (text(composition="wisdom-holman-modified-17"), "is not offered for lattices"),
    "no scheme": (text().replace("scheme: splitting\n", ""), "belongs to scheme: splitting"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_does_not_fit_is_refused_at_its_place(name: str) -> None:
    spec, message = REFUSED[name]
    with pytest.raises(SpecError) as raised:
        compile_spec(phigen.spec.loads(spec))
    (diagnostic,) = raised.value.diagnostics
    assert message in diagnostic.message
    assert diagnostic.location
    assert diagnostic.hint


def test_devices_are_refused_at_the_key(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="devices have no steps in relative coordinates"):
        emit(compiled(text()).program, "device", "")
    (tmp_path / "bodies.yaml").write_text(text(), encoding="utf-8")
    command = ["build", str(tmp_path / "bodies.yaml"), "-t", "device", "-o", str(tmp_path / "out")]
    result = CliRunner().invoke(group, command, prog_name="phigen")
    assert result.exit_code == 1
    assert (
        "bodies.yaml:11:19: error: coordinates_from: the target device cannot make steps in relative coordinates"
        in " ".join(result.stderr.split())
    )
    assert not (tmp_path / "out").exists()
