"""Generated solvers of splittings: orders, Casimirs, the Poisson identity, reversibility, failing steps."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from support import (
    COMMAND,
    TARGETS,
    WARNINGS,
    compile_text,
    compiled,
    described,
    run,
    setting,
    slow_but,
    small,
    solver,
    tool,
    write,
)  # fmt: skip

from phigen.compiler import compile_proved, compile_spec, emit, examine
from phigen.errors import CheckError, StepError
from phigen.scheme.choosing import plan
from phigen.scheme.splitting import build_splitting
from phigen.splitting.parts import split
from phigen.study import measures
from phigen.study.methods import of_solver
from phigen.study.verification import verify

SYSTEMS = ["rigid_body", "kowalevski_top", "lotka_volterra", "toda3", "henon_heiles", "charged_particle"]

PLANE = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
ROD = PLANE + "parameters: {g: 1}\nhamiltonian: p**2/2 - g*cos(q)\n"


def splitting_of(name, order):
    """Return the solver of a system of the corpus as a splitting, with its tangent map."""
    return compile_spec(described(name)[0], order=order, scheme="splitting", tangent=True)


@cache
def short(name, order):
    """Return the splitting with short C, which lacks batches of members."""
    return small(compiled(name, order, "splitting"))


#: Times over which errors are larger than rounding and smaller than 1.
SPANS = {"spin_chain5": 1.5, "kowalevski_top": 6, "predator_prey": 12, "toda3": 6, "charged_particle": 2}


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", slow_but({*SPANS} - {"spin_chain5", "toda3"}, SPANS))
@pytest.mark.parametrize("order", slow_but([2, 6], [2, 4, 6, 8]))
def test_observed_order_is_the_stated_one(name, order):
    at = setting(compiled(name, order, "splitting"))
    solve, reference = (solver(short(name, k), "c") for k in (order, 8))
    span = SPANS[name]
    fine = reference.integrate(at.x, span / 1024, 1024, parameters=at.parameters).x[-1]

    def error(steps):
        try:
            end = solve.integrate(at.x, span / steps, steps, parameters=at.parameters).x[-1]
        except StepError:  # the largest steps may be too large
            return np.inf
        return np.max(np.abs(end - fine)) / np.max(np.abs(fine))

    errors = [error(n) for n in (4, 8, 16, 32, 64, 128)]
    slopes = [np.log2(a / b) for a, b in pairwise(errors) if a < 1e-2 and b > 1e-13]
    assert slopes, "the test needs another time"
    assert max(slopes) > order - 0.3


@pytest.mark.thin(3)
@pytest.mark.parametrize("name", SYSTEMS)
def test_step_is_a_reversible_poisson_map_that_keeps_casimirs_in_both_targets(name):
    compiled_system = splitting_of(name, 4)
    at = setting(compiled_system)
    images = []
    for target in TARGETS:
        method = of_solver(solver(compiled_system, target), at.parameters, None)
        x = np.array(at.x)
        assert measures.poisson_defect(compiled_system.system, at.parameters, method, x, at.h) < 1e-14
        assert measures.tangent_error(method, x, at.h) < 1e-8
        assert measures.reversal(method, x, at.h) < 1e-14
        run = solver(compiled_system, target).integrate(x, at.h, 500, parameters=at.parameters)
        for values in run.casimirs.values():
            assert np.ptp(values) <= 2e-14 * max(1, np.max(np.abs(values)))
        images.append(run.x[20])
    assert np.max(np.abs(images[0] - images[1])) < 1e-14 * np.max(np.abs(images[0]))


@pytest.mark.parametrize("target", TARGETS)
def test_step_size_and_parameters_are_those_of_the_call(target):
    solve = solver(compile_text(ROD, 4, "splitting"), target)
    there = solve.step([1.0, 0.5], 0.3, g=2.0)
    assert solve.step(there, -0.3, g=2.0) == pytest.approx([1.0, 0.5], abs=1e-15)
    assert np.max(np.abs(solve.step([1.0, 0.5], 0.3) - there)) > 1e-2
    many = solve.ensemble([[1.0, 0.5], [0.0, 2.0]], 0.3, 7, g=2.0)
    alone = [solve.integrate(x, 0.3, 7, g=2.0).x[-1] for x in ([1.0, 0.5], [0.0, 2.0])]
    np.testing.assert_allclose(many, alone, rtol=0, atol=1e-15)


@pytest.mark.parametrize("target", TARGETS)
def test_a_step_that_leaves_the_numbers_fails_and_the_state_before_it_stands(target):
    text = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: p**2/2 - exp(q)\n"
    solve = solver(compile_text(text, 4, "splitting"), target)
    with pytest.raises(StepError) as caught:
        solve.integrate([0.0, 1.0], 0.5, 100)
    assert caught.value.status == "NOT_FINITE"
    assert len(caught.value.trajectory) == caught.value.step + 1
    assert np.isfinite(caught.value.trajectory.x).all()


def test_exact_flow_is_followed_in_one_piece():
    text = "coordinates: [x, y, z]\npoisson: {brackets: {x: {y: -z, z: y}, y: {z: -x}}}\nhamiltonian: x**2\n"
    compilation = compile_text(text, 2, "splitting")
    assert [len(compilation.splitting.flows), len(compilation.program.step.schedule.flows)] == [1, 1]
    x = solver(compilation, "c").step([0.3, 0.4, 1.2], 7.0)
    turned = 0.4 * np.cos(4.2) + 1.2 * np.sin(4.2)
    assert x[:2] == pytest.approx([0.3, turned], abs=1e-15)


@pytest.mark.slow
def test_a_wrong_sign_in_one_flow_falls_short_of_the_order():
    compilation = compiled("kowalevski_top", 4, "splitting")
    at = setting(compilation)
    flow = compilation.splitting.flows[0]
    wrong = replace(flow, increment=tuple(-e for e in flow.increment))
    planted = replace(compilation.splitting, flows=(wrong, *compilation.splitting.flows[1:]))
    choice = replace(plan(compilation.system, split(compilation.system), 4, "auto"), splitting=planted)
    program = build_splitting(compilation.system, choice, compilation.gauge, compilation.spec.overridden(tangent=True))
    bad = replace(compilation, program=program, splitting=planted)
    solvers = {target: solver(bad, target) for target in TARGETS}
    verified = verify(bad, solvers, "planted", at.x, at.parameters, at.h, 100, quick=True)
    assert any(f.startswith("observed order") for f in verified.failures)


def test_refuted_flows_are_not_compiled(monkeypatch):
    from phigen.proofs import statements

    genuine = statements.check_splitting
    compilation = compiled("kowalevski_top", 4, "splitting")

    def planted(system, splitting, noise):
        flow = splitting.flows[1]
        wrong = replace(flow, increment=tuple(-e for e in flow.increment))
        return genuine(system, replace(splitting, flows=(splitting.flows[0], wrong, *splitting.flows[2:])), noise)

    monkeypatch.setattr(statements, "check_splitting", planted)
    assert [s.name[:19] for s in examine(compilation.spec, scheme="splitting").refuted] == ["the flow Φ of H_2: "]
    with pytest.raises(CheckError, match="H_2"):
        compile_proved(compilation.spec, scheme="splitting")


@pytest.mark.thin(2)
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("name", SYSTEMS)
def test_c_compiles_without_a_warning(name, compiler, tmp_path):
    write(tmp_path, emit(compiled(name, 4, "splitting").program, "c", COMMAND))
    run([tool(compiler), "-std=c99", *WARNINGS, "-fsyntax-only", f"{name}.c"], tmp_path)
