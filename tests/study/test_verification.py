"""`verify` passes correct solvers, and names the checks that fail for solvers with deliberate errors."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from click.testing import CliRunner
from support import BODY, compiled, slow_but

from phigen import resources, spec
from phigen.api import solver_of
from phigen.cli import group
from phigen.compiler import compile_spec, emit
from phigen.runtime.interface import Interface
from phigen.runtime.numpy_solver import NumpySolver
from phigen.runtime.origin import read_origin
from phigen.runtime.solver import Solver
from phigen.scheme.assemble import build_program
from phigen.study import backward, measures, verification
from phigen.study.meanings import MEANINGS, meaning_of
from phigen.study.methods import by_differences, field_of, of_classical, of_solver
from phigen.study.summary import summarise
from phigen.symbolic.expression import substitute, symbol
from phigen.symbolic.symbols import momentum

TEXT = f"""phigen: 1
name: t
{BODY}casimirs: {{C: x1**2 + x2**2 + x3**2}}
order: 4
gauge: none
runs: {{tumbling: {{initial: [0.4, 1, 0.3], step: 0.2, steps: 2000, compare: [rk4]}}}}
"""
START = np.array([0.4, 1.0, 0.3])


@cache
def compilation_of(text=TEXT):
    return compile_spec(spec.loads(text), tangent=True)


def from_source(compilation, change=lambda source: source):
    """Return a NumPy solver from the generated source, which ``change`` modifies."""
    source = emit(compilation.program, "numpy", "phigen build")["t.py"]
    names = Interface("t", compilation.system.coordinates, compilation.program.order, {}, frozenset(), ("C",))
    return Solver(NumpySolver(change(source), names), names)


def verified(compilation, solvers, steps=400, h=0.2):
    return verification.verify(compilation, solvers, "tumbling", START, {}, h, steps, ("rk4",))


def failed(checks):
    return {check.name for check in checks.checks if not check.passed}


def test_rounding_errors_pass_where_all_terms_of_a_casimir_vanish():
    """A pendulum starts at its lowest point, where all terms of the Casimir m1 g1 + m2 g2 + m3 g3 are 0. Its rounding
    errors must still pass as round-off.
    """
    casimirs = "{G: g1**2 + g2**2 + g3**2, L: m1*g1 + m2*g2 + m3*g3}"
    text = f"""phigen: 1
name: t
coordinates: [m1, m2, m3, g1, g2, g3]
poisson: {{lie_algebra: {{name: se(3), sign: minus}}}}
hamiltonian: (m1**2 + m2**2 + m3**2)/2 + 10*g3
casimirs: {casimirs}
"""
    compilation = compilation_of(text)
    start = np.array([0.3, 1.2, 0.0, 0.0, 0.0, -1.0])
    solver = solver_of(compilation, "c")
    rows = solver.integrate(start, h=0.02, steps=10_000).x
    subject = verification.Subject(
        compilation, solver, {"c": of_solver(solver, {})}, {}, {}, start, 0.02, 10_000, 0.0, field_of(solver, {})
    )
    assert all(check.passed for check in verification.conservation_checks(subject, rows))
    rows[5000:, 0] += 1e-9
    wrong = [check.name for check in verification.conservation_checks(subject, rows) if not check.passed]
    assert wrong == ["Casimir L: largest error"]


@pytest.mark.slow
def test_modified_hamiltonian_is_constant_to_higher_order_for_each_correction():
    compilation = compilation_of()
    verification = verified(compilation, {"c": solver_of(compilation, "c")})
    orders = {c.name: c.value for c in verification.checks if c.name.startswith("modified")}
    assert len(orders) == backward.CORRECTIONS
    assert orders["modified H, 1 correction: order"] == pytest.approx(6, abs=0.2)


def test_a_good_solver_passes_and_is_compared_with_rk4():
    compilation = compilation_of()
    measured = verified(compilation, {t: solver_of(compilation, t) for t in ("c", "numpy")}, steps=2000)
    assert measured.failures == []
    checks = {c.name: c for c in measured.checks}
    assert checks["observed order"].value == pytest.approx(4, abs=0.1)
    assert checks["observed order"].others["rk4"] == pytest.approx(4, abs=0.1)
    assert checks["Casimir C: largest error"].value < 1e-14 < 1e-6 < checks["Casimir C: largest error"].others["rk4"]
    assert checks["energy: last/first window"].limit
    assert checks["energy: last/first window"].others["rk4"] > verification.GROWTH
    assert checks["Poisson defect, exact tangent"].value < 1e-15 < checks["Poisson defect, exact tangent"].others["rk4"]
    assert checks["largest step that converges, in steps of the run"].value > 1


PENDULUM = """phigen: 1
name: t
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - cos(q)
order: 4
"""


@pytest.mark.parametrize(
    "text", [TEXT, PENDULUM, f"{PENDULUM}scheme: splitting\n"], ids=["body", "series", "splitting"]
)
def test_states_at_rest_in_the_origin_are_verified(text):
    """All errors are 0, and so are the states by which they would be divided."""
    compilation = compile_spec(spec.loads(text), tangent=True, adjoint=True)
    solvers = {target: solver_of(compilation, target) for target in ("c", "numpy")}
    start = [0.0] * len(compilation.system.coordinates)
    measured = verification.verify(compilation, solvers, "rest", start, {}, 0.1, 20, quick=True)
    assert measured.failures == []
    values = {check.name: check.value for check in measured.checks}
    assert values["observed order (errors at round-off)"] == np.inf
    assert values["agreement of c and numpy"] == values["reversibility: a step there and back"] == 0


def test_rk4_posing_as_the_step_is_found_out():
    compilation = compilation_of()

    def change(source):
        fake = (
            "\n\ndef _advance(coef, x, carry, memory):\n    h = FAKE_STEP\n    f = lambda y: _vector_field({}, y)\n"
            "    a = f(x)\n    b = f(x + h / 2 * a)\n    c = f(x + h / 2 * b)\n    d = f(x + h * c)\n"
            "    change = h / 6 * (a + 2 * b + 2 * c + d)\n    return x + change, carry, memory, np.full(len(x), '')\n"
            "\n\n_old_coefficients = _coefficients\n\n\ndef _coefficients(parameters, x, h, gauge):\n"
            "    global FAKE_STEP\n    FAKE_STEP = h\n    return _old_coefficients(parameters, x, h, gauge)\n"
        )
        return source + fake

    verification = verified(compilation, {"c": solver_of(compilation, "c"), "numpy": from_source(compilation, change)})
    assert "agreement of c and numpy" in failed(verification)
    assert "reversibility: a step there and back" in failed(verification)
    assert "tangent map against differences" in failed(verification)
    alone = verified(compilation, {"numpy": from_source(compilation, change)})
    assert "Casimir C: largest error" in failed(alone)
    assert "observed order" not in failed(alone)  # RK4 does have order 4
    assert any(f.startswith("Casimir C: largest error: changed by") for f in alone.failures)


def test_a_wrong_sign_of_the_quadratic_term_is_found_out():
    """The solver uses α of the exponential bi-realisation with the opposite sign of the terms of even degree in p."""
    compilation = compilation_of()
    names = {momentum(c): -symbol(momentum(c)) for c in compilation.system.coordinates}
    wrong = tuple(-e for e in substitute(compilation.realisation.displacement, names))
    realisation = replace(compilation.realisation, displacement=wrong)
    arguments = (compilation.system, realisation, compilation.order, compilation.gauged, compilation.scheme)
    program = build_program(*arguments, compilation.spec.overridden(tangent=True))
    bad = replace(compilation, program=program)
    arguments = verified(bad, {"c": solver_of(bad, "c")})
    assert {"Poisson defect, exact tangent", "observed order"} <= failed(arguments)
    assert any("is not round-off" in f for f in arguments.failures)


def test_a_loose_tolerance_is_found_out():
    text = TEXT.replace("order: 4", "order: 4\nsolver: {tolerance: 1e-6}")
    compilation = compilation_of(text)
    verification = verified(compilation, {"c": solver_of(compilation, "c")})
    assert "reversibility: a step there and back" in failed(verification)
    assert any("a step of −h miss the start by" in f for f in verification.failures)


def test_a_lower_order_than_stated_is_found_out():
    compilation = compilation_of()
    low = compilation_of(TEXT.replace("order: 4", "order: 2"))
    posing = replace(low, order=compilation.order)
    verification = verified(posing, {"c": solver_of(low, "c")})
    assert "observed order: 2.00 instead of 4" in verification.failures


def test_targets_that_disagree_are_found_out():
    compilation, low = compilation_of(), compilation_of(TEXT.replace("order: 4", "order: 2"))
    verification = verified(compilation, {"c": solver_of(compilation, "c"), "numpy": solver_of(low, "numpy")})
    assert "agreement of c and numpy" in failed(verification)


def test_energy_drift_of_dissipative_methods_is_judged():
    """The limit for the growth of the energy error lies between the growth for a Poisson integrator and that
    for RK4.
    """
    compilation = compilation_of()
    solver = solver_of(compilation, "c")
    rk4 = of_classical("rk4", solver, {}).rows(START, 0.4, 2000, 1)
    states = of_solver(solver, {}).rows(START, 0.4, 2000, 1)
    times = 0.4 * np.arange(2001)
    growth = [summarise("", compilation.system, None, {}, times, rows).energy.growth for rows in (states, rk4)]
    assert growth[0] < 1.5 < verification.GROWTH < growth[1]


@pytest.mark.slow
def test_approximate_realisations_are_labelled_and_held_to_their_order():
    text = TEXT.replace("order: 4", "order: 4\nbirealisation: {kind: spray}")
    compilation = compilation_of(text)
    assert not compilation.realisation.exact
    verification = verified(compilation, {"c": solver_of(compilation, "c"), "numpy": solver_of(compilation, "numpy")})
    assert "approximate" in verification.label
    assert verification.failures == []
    assert "approximate" in {c.name: c for c in verification.checks}["Poisson defect, exact tangent"].limit


def test_differences_are_good_to_ten_digits():
    compilation = compilation_of()
    method = of_solver(solver_of(compilation, "c"), {})
    assert np.max(np.abs(by_differences(method, START, 0.2) - method.tangent(START, 0.2))) < 1e-10


@pytest.mark.slow
def test_a_gauge_is_held_fixed():
    compilation = compilation_of(TEXT.replace("gauge: none", "gauge: auto"))
    assert compilation.program.gauge
    verification = verified(compilation, {t: solver_of(compilation, t) for t in ("c", "numpy")})
    assert verification.failures == []


# -- phigen verify


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "t.yaml"
    path.write_text(TEXT, encoding="utf-8")
    return path


def test_command_prints_a_table(file):
    result = CliRunner().invoke(group, ["verify", "--quick", str(file)])
    assert result.exit_code == 0, result.output
    assert "observed order" in result.output
    assert "rk4" in result.output
    assert "FAILED" not in result.output


@pytest.mark.slow
@pytest.mark.parametrize("steps", [1, 4])
def test_a_run_of_few_steps_is_verified(file, steps):
    file.write_text(TEXT.replace("steps: 2000", f"steps: {steps}"), encoding="utf-8")
    result = CliRunner().invoke(group, ["verify", "--quick", str(file)])
    assert result.exit_code == 0, result.output


@pytest.mark.slow
def test_command_for_machines_and_exit_code(file, monkeypatch):
    monkeypatch.setattr(verification, "ONE_STEP", 0.0)
    result = CliRunner().invoke(group, ["verify", "--quick", "--json", str(file)])
    assert result.exit_code == 5
    (data,) = json.loads(result.stdout)
    assert data["passed"] is False
    assert {c["name"] for c in data["checks"] if not c["passed"]}
    assert "verification failed" in result.stderr
    assert "reversibility" in result.stderr


@pytest.mark.parametrize("meaning", MEANINGS, ids=lambda m: m.row)
def test_the_documentation_gives_the_meaning_of_each_row(meaning):
    page = (resources.bundled_specs().parent / "docs" / "commands.md").read_text(encoding="utf-8")
    assert f"| {meaning.row} | {meaning.measures} | {meaning.failure or '–'} |" in page


@pytest.mark.slow
@pytest.mark.parametrize("name", slow_but(["rigid_body"], ["rigid_body", "predator_prey"]))
def test_every_row_has_a_meaning(name):
    compilation = compile_spec(compiled(name).spec, tangent=True)
    run = next(iter(compilation.spec.runs.values()))
    values = compilation.spec.parameters_of(run)
    solvers = {"numpy": solver_of(compilation, "numpy")}
    start = [float(v) for v in run.initial]
    measured = verification.verify(compilation, solvers, run.name, start, values, float(run.step), 8, quick=True)
    for check in measured.checks:
        meaning = meaning_of(check.name)
        assert meaning.failure or not check.limit, check.name


@pytest.mark.slow
def test_command_draws_the_modified_hamiltonian_of_one_spec(tmp_path):
    (tmp_path / "a.yaml").write_text(TEXT, encoding="utf-8")
    (tmp_path / "b.yaml").write_text(TEXT.replace("name: t", "name: b"), encoding="utf-8")
    picture = tmp_path / "a.svg"

    def verify(*files):
        names = [str(tmp_path / file) for file in files]
        return CliRunner().invoke(group, ["verify", "--quick", "--plot", str(picture), *names])

    assert verify("a.yaml", "b.yaml").exit_code == 2
    assert not picture.exists()
    verification = verify("a.yaml")
    assert verification.exit_code == 0
    assert picture.read_text(encoding="utf-8").count("<path") > 10
    assert f"wrote {picture}" in verification.stderr
    assert str(read_origin(picture)).endswith(" by verify")


def test_derivatives_are_compared_near_a_singularity_too():
    """The start is close to the sun. Difference quotients with a step of two thousandths of the largest coordinate
    would reach across the sun, so the step must be smaller.
    """
    text = (
        "coordinates: [q1, q2, p1, p2]\npoisson: {canonical: {q: [q1, q2], p: [p1, p2]}}\nscheme: splitting\norder: 2\n"
    )
    text += "hamiltonian: (p1**2 + p2**2)/2 - 1/sqrt(q1**2 + q2**2)\n"
    kepler = solver_of(compilation_of(f"phigen: 1\nname: t\n{text}"), "numpy")
    method = of_solver(kepler, {})
    assert measures.tangent_error(method, np.array([0.01, 0.0, 0.0, 14.1]), 1e-4) < 1e-8
    wrong = replace(method, tangent=lambda x, h: 1.00001 * method.tangent(x, h))
    assert measures.tangent_error(wrong, np.array([0.01, 0.0, 0.0, 14.1]), 1e-4) > 1e-6


def test_a_bracket_that_nearly_vanishes_may_have_rounding_errors_of_the_state():
    """Near its zeros the bracket {u, v} = v + u² only has 12 correct digits, because u and v are rounded. The check
    must pass, and still detect a relative error of 1e-8 in the tangent map.
    """
    text = "coordinates: [u, v]\npoisson: {pullback: {of: {lie_algebra: {name: aff(1)}}, map: {y1: u, y2: v + u**2}}}\n"
    text += "hamiltonian: (u**2 + v**2)/2 + v\norder: 2\ntangent: true\n"
    compilation = compilation_of(f"phigen: 1\nname: t\n{text}")
    method = of_solver(solver_of(compilation, "numpy"), {})
    for v in np.linspace(-2.2649, -2.2640, 7):
        near = np.array([1.505, v])
        assert measures.poisson_defect(compilation.system, {}, method, near, 0.02) < 2e-15
        wrong = replace(method, tangent=lambda x, h: (1 + 1e-8) * method.tangent(x, h))
        assert measures.poisson_defect(compilation.system, {}, wrong, near, 0.02) > 1e-14
