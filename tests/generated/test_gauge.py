"""The Casimir gauge: it is chosen for each trajectory, equal in C and NumPy, and with a fixed gauge the step is a
Poisson map.
"""

import re
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from click.testing import CliRunner
from golden import calls
from scipy.integrate import solve_ivp
from support import NAMES, files, slow_but, spec_of

from phigen import spec
from phigen.api import solver_of
from phigen.cli import group
from phigen.compiler import compile_spec
from phigen.errors import LimitError, SpecError
from phigen.geometry.system import system_from_spec
from phigen.realisations.catalogue import realise
from phigen.runtime.modules import load_module
from phigen.scheme.gauge import MOST_GUIDE_OPERATIONS, choose, guide_operations
from phigen.scheme.lowering import cost
from phigen.series.hamilton_jacobi import HamiltonJacobi
from phigen.symbolic.numeric import evaluate

pytestmark = pytest.mark.corpus


@cache
def gauged(name, profile="fast"):
    return compile_spec(replace(spec_of(name), profile=profile), tangent=True)


def module(compilation):
    return load_module(files(compilation, "numpy")[f"{compilation.program.name}.py"], compilation.program.name)


GAUGED = [name for name in NAMES if "init_gauge" in calls()[name]]
#: A rigid body, and a system with a path.
QUICK = ["rigid_body", "sklyanin_gyrostat"]
IN_BOTH = [("rigid_body", "fast"), ("rigid_body", "small"), ("sklyanin_gyrostat", "small")]


def start_of(name):
    run = next(iter(spec_of(name).runs.values()))
    return np.array([float(v) for v in run.initial]), float(run.step)


def test_rigid_bodies_are_gauged_and_log_canonical_systems_are_not():
    assert {"rigid_body", "rigid_body_dual", "so4_manakov"} <= set(GAUGED)
    assert not {"lotka_volterra", "volterra5", "predator_prey", "kowalevski_top", "rigid_body_paper"} & set(GAUGED)


@pytest.mark.parametrize("name", GAUGED)
def test_step_is_a_poisson_map_for_a_fixed_gauge(name):
    compilation = gauged(name)
    numpy, system = module(compilation), compilation.system
    x, h = start_of(name)
    image, tangent = numpy.step_tangent(x, 4 * h, gauge=numpy.gauge(x))

    def pi(at):
        values = {p.name: float(p.value) for p in system.parameters} | dict(zip(system.coordinates, at, strict=True))
        return np.array(evaluate([e for row in system.poisson for e in row], values)).reshape(len(at), len(at))

    defect = np.max(np.abs(tangent @ pi(x) @ tangent.T - pi(image))) / np.max(np.abs(pi(image)))
    assert defect <= 1e-12


def leading_error(name):
    """Return Σ|π∇S_3|² over the samples of the solver, as a function of the gauge, and the size of the error
    vectors.
    """
    numpy, (x, _) = module(gauged(name)), start_of(name)
    points = numpy._samples(numpy.DEFAULT_PARAMETERS, x[np.newaxis])

    def vectors(gauge):
        return numpy._guide(numpy.DEFAULT_PARAMETERS, np.array(gauge, dtype=float)[:, np.newaxis], points)

    return vectors, numpy.gauge(x)


@pytest.mark.parametrize("name", GAUGED)
def test_leading_error_is_cubic_in_the_gauge(name):
    """Its square is then a polynomial of degree six, as the solver assumes when it fits seven values."""
    vectors, gauge = leading_error(name)
    for c in range(len(gauge)):
        along = np.array([vectors(gauge + t * np.eye(len(gauge))[c]) for t in range(5)])
        assert np.max(np.abs(np.diff(along, 4, axis=0))) <= 1e-12 * np.max(np.abs(along))
        assert np.max(np.abs(np.diff(along, 1, axis=0))) > 1e-3 * np.max(np.abs(along))


@pytest.mark.parametrize("name", GAUGED)
def test_the_gauge_chosen_is_best_along_each_axis(name):
    vectors, gauge = leading_error(name)
    least = np.sum(vectors(gauge) ** 2)
    for c in range(len(gauge)):
        for change in [*np.linspace(-2, 2, 81), -1e-2, 1e-2]:
            moved = gauge + change * np.abs(gauge[c]) * np.eye(len(gauge))[c]
            assert np.sum(vectors(moved) ** 2) >= least * (1 - 1e-4), (gauge, change)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("away", [1e-12, 1e-3, 0.1])
def test_a_gauge_is_found_near_steady_rotations(away, axis):
    """Near a steady rotation the motion starts slowly; samples must still cover it."""
    numpy, x = module(gauged("rigid_body")), np.full(3, away)
    x[axis] = 1.0
    points = numpy._samples(numpy.DEFAULT_PARAMETERS, x[np.newaxis])
    assert np.max(np.abs(np.linalg.norm(points, axis=-1) - np.linalg.norm(x))) < 0.2
    assert numpy.gauge(x) == pytest.approx([0.5], abs=0.03)


def test_short_code_takes_the_gauge_by_which_the_gradient_is_smallest_at_the_start():
    """This choice gains most of what the search of fast code gains."""
    name = "rigid_body"
    short, (x, _) = module(gauged(name, "small")), start_of(name)
    i1, i2, i3 = short.DEFAULT_PARAMETERS.values()
    slope = x / [i1, i2, i3]
    assert short.gauge(x) == pytest.approx([slope @ x / (2 * x @ x)], rel=1e-14)
    vectors, best = leading_error(name)
    errors = [np.linalg.norm(vectors(gauge)) for gauge in (best, short.gauge(x), np.zeros(1))]
    assert errors[0] < errors[1] < errors[2] / 4, errors
    assert np.array_equal(short.gauge(np.zeros(3)), [0.0])


@pytest.mark.thin(2)
@pytest.mark.parametrize(("name", "profile"), slow_but(IN_BOTH, dict.fromkeys([*IN_BOTH, *product(GAUGED, ["fast"])])))
def test_both_targets_choose_the_same_gauge(name, profile):
    compilation = gauged(name, profile)
    x, h = start_of(name)
    ends = [solver_of(compilation, target).integrate(x, h=h, steps=100).x[-1] for target in ("c", "numpy")]
    assert np.max(np.abs(ends[0] - ends[1])) <= 1e-13 * np.max(np.abs(x))


@pytest.mark.parametrize("name", slow_but(QUICK, GAUGED))
def test_casimirs_stay_at_roundoff(name):
    x, h = start_of(name)
    trajectory = solver_of(gauged(name), "c").integrate(x, h=h, steps=20_000, stride=100)
    for values in trajectory.casimirs.values():
        assert np.max(np.abs(values - values[0])) <= 1e-13 * max(1.0, abs(values[0]))


@pytest.mark.thin(2)
@pytest.mark.parametrize("order", [2, 4, 6])
def test_order_is_kept_and_the_error_is_smaller(order):
    """Compare steps of the free rigid body with the flow by another method."""
    x, _ = start_of("rigid_body")
    field = solver_of(gauged("rigid_body"), "numpy").vector_field
    reference = solve_ivp(lambda _, y: field(y), (0, 10), x, method="DOP853", rtol=2.3e-14, atol=1e-16).y[:, -1]
    errors = {}
    for setting in ("auto", "none"):
        solver = solver_of(compile_spec(replace(spec_of("rigid_body"), gauge=setting), order=order), "c")
        steps = (20, 40) if order > 2 else (100, 200)
        ends = [solver.integrate(x, h=10 / n, steps=n).x[-1] for n in steps]
        errors[setting] = [np.max(np.abs(end - reference)) for end in ends]
        assert abs(np.log2(errors[setting][0] / errors[setting][1]) - order) < 0.35, errors
    assert errors["auto"][1] < errors["none"][1] / 2, errors  # measured: 2.8, 4.8, 3.4 times


def test_members_of_an_ensemble_choose_for_themselves():
    compilation = gauged("rigid_body")
    x, h = start_of("rigid_body")
    members = np.array([x, 2 * x[::-1], x + 0.3])
    for target in ("c", "numpy"):
        solver = solver_of(compilation, target)
        together = solver.ensemble(members, h=h, steps=50)
        alone = np.array([solver.integrate(m, h=h, steps=50).x[-1] for m in members])
        assert np.max(np.abs(together - alone)) <= 1e-13


def test_a_fixed_gauge_is_that_of_the_spec():
    """The discretisation of H − λC without a gauge is that of H with ``gauge: {C: λ}``."""
    text = "phigen: 1\nname: t\ncoordinates: [x, y, z]\nparameters: {k: 2}\ncasimirs: {C: x**2+y**2+z**2}\norder: 4\n"
    text += "poisson: {brackets: {x: {y: -z, z: y}, y: {z: -x}}}\n"
    plain = f"{text}hamiltonian: x**2/2+y**2/4+z**2/6-(x**2+y**2+z**2)*k/8\ngauge: none\n"
    fixed = f"{text}hamiltonian: x**2/2+y**2/4+z**2/6\ngauge: {{C: k/8}}\n"
    ends = []
    for source in (plain, fixed):
        solver = solver_of(compile_spec(spec.loads(source)), "c")
        ends.append(solver.integrate([1, 1, 1], h=0.3, steps=20).x[-1])
    assert np.max(np.abs(ends[0] - ends[1])) <= 1e-14


def test_the_gauge_of_what_is_no_casimir_is_refused():
    text = "phigen: 1\nname: t\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: q**2+p**2\n"
    with pytest.raises(SpecError, match="D is not a Casimir of this system"):
        compile_spec(spec.loads(f"{text}gauge: {{D: 1}}\n"))


@pytest.mark.parametrize("name", GAUGED)
def test_operations_of_the_error_term_are_estimated_before_it_is_derived(name):
    program = gauged(name).program
    estimate = guide_operations(gauged(name).gauge.applied(gauged(name).system))
    assert cost(program.gauge.guide.roots) <= 1.3 * estimate <= 8 * cost(program.gauge.guide.roots)
    assert estimate <= MOST_GUIDE_OPERATIONS / 3
    assert not gauged(name).notes


def neural(terms, rest=""):
    """Return a spec on so(3)* with ``terms`` terms of tanh, whose S_3 grows like the cube of their number."""
    numbers = range(terms)
    declared = ", ".join(f"{letter}{k}: {(7 * k + i) % 5 - 2.3}" for k in numbers for i, letter in enumerate("auvwc"))
    h = " + ".join(f"a{k}*tanh(u{k}*x + v{k}*y + w{k}*z + c{k})" for k in numbers)
    text = f"phigen: 1\nname: neural\ncoordinates: [x, y, z]\nparameters: {{{declared}}}\norder: 2\n"
    return f"{text}poisson: {{lie_algebra: {{name: so(3)}}}}\nhamiltonian: {h}\n{rest}"


def test_a_gauge_that_costs_more_than_it_gains_is_left_out_and_said(tmp_path, monkeypatch):
    """With eight terms S_3 has 53,000 monomials, and deriving it took a minute."""
    monkeypatch.setattr(HamiltonJacobi, "polynomial", lambda *_: pytest.fail("the series was derived"))
    source = spec.loads(neural(8))
    system = system_from_spec(source)
    chosen = choose(system, realise(system, source.birealisation), "auto")
    assert not chosen.gauge.free
    (note,) = chosen.gauge.notes
    assert re.fullmatch(r"gauge: auto leaves out C1: the search .* about \d{6} operations; the limit is 10000", note)
    monkeypatch.undo()
    file = tmp_path / "neural.yaml"
    file.write_text(neural(3))
    for command in (["check"], ["build", "-o", str(tmp_path)], ["show"]):
        result = CliRunner().invoke(group, [command[0], str(file), *command[1:]])
        assert result.exit_code == 0, result.output
        assert "gauge: auto leaves out C1" in result.output
    assert "gauge: auto leaves out C1" in " ".join((tmp_path / "neural" / "neural.c").read_text().split())


def test_a_program_too_large_by_the_gauge_of_its_spec_names_the_gauge():
    text = "phigen: 1\nname: t\ncoordinates: [x, y, z]\nparameters: {a: 1}\norder: 8\ncomposition: none\n"
    text += "poisson: {lie_algebra: {name: so(3)}}\nhamiltonian: x**2 + 2*y**2 + z\n"
    text += "casimirs: {C: (x**2 + y**2 + z**2)**14}\ngauge: {C: a}\n"
    with pytest.raises(LimitError, match=r":10:1: error: with this gauge S_1 … S_7 .*\n  hint: gauge: none, or"):
        compile_spec(spec.loads(text))
