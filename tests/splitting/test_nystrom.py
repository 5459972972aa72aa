"""Methods for {V, {V, {V, T}}} = 0: order conditions, the choice of the compiler, kicks with modified potential."""

from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from clock import processor_seconds_below
from splitting import nystrom_algebra as algebra
from support import TARGETS, compile_text, compiled, setting, slow_but, small, solver

from phigen.compiler import emit
from phigen.errors import SpecError
from phigen.notation.flows import formulas
from phigen.notation.latex import document
from phigen.scheme import alternation, choosing, nystrom
from phigen.scheme.order import Order
from phigen.scheme.splitting import build_splitting
from phigen.splitting.kicks import kicks
from phigen.splitting.parts import split
from phigen.splitting.ring import KICK
from phigen.splitting.statements import check
from phigen.study import measures
from phigen.study.methods import of_solver
from phigen.symbolic.expression import derivatives, substitute, symbol
from phigen.symbolic.verdict import REFUTED

PLANE = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
TOP = (
    "coordinates: [P1, P2, P3, G1, G2, G3]\npoisson:\n  brackets:\n    P1: {P2: -P3, P3: P2, G2: -G3, G3: G2}\n"
    "    P2: {P3: -P1, G3: -G1, G1: G3}\n    P3: {G1: -G2, G2: G1}\n"
)


def named(method):
    return f"{method.name}-{method.order}-{len(method.times)}"


METHODS = pytest.mark.parametrize("method", nystrom.METHODS, ids=named)


@pytest.mark.thin(2)
@METHODS
def test_order_conditions_hold_to_thirty_digits_up_to_the_order_and_not_beyond(method):
    residuals = algebra.defects(method, method.order + 1)
    assert max(residuals[d] for d in range(1, method.order + 1)) < 1e-30
    assert residuals[method.order + 1] == pytest.approx(method.error, rel=0.01)


@METHODS
def test_coefficients_are_a_palindrome_and_no_kick_vanishes(method):
    assert method.times == method.times[::-1]
    assert method.multiples == method.multiples[::-1]
    assert len(method.multiples) in (0, method.kicks)
    kicks = method.times[0 if method.kicks_first else 1 :: 2]
    assert len(kicks) == method.kicks
    assert min(map(abs, kicks)) > 1e-3
    flows = method.schedule().flows
    assert [part for part, _ in flows] == [i % 2 for i in range(len(method.times))]
    assert [row for _, row in flows] == list(range(len(method.times)))


def test_a_changed_coefficient_breaks_the_conditions():
    method = nystrom.METHODS[0]
    off = (method.times[0] + Fraction(1, 10**20), *method.times[1:])
    assert algebra.defects(replace(method, times=off), 4)[1] > 1e-21


def composition_of(text, order, name="auto"):
    """Return the name of the composition, and whether its kicks are modified."""
    step = compile_text(text + f"composition: {name}\n", order, "splitting").program.step
    return step.composition, bool(step.schedule.multiples)


@pytest.mark.parametrize("order", [4, 6, 8])
@pytest.mark.parametrize("name", ["kowalevski_top", "lagrange_top", "henon_heiles", "toda3", "engel_geodesics"])
def test_mechanical_systems_get_fewer_flows_than_alternations_need(name, order):
    program = compiled(name, order, "splitting").program
    step = program.step
    assert step.composition in nystrom.NAMES
    others = alternation.schedule(alternation.find("auto", order), 2)
    least = min(len(m.times) for m in nystrom.METHODS if m.order == order and m.name == step.composition)
    assert least <= len(step.schedule.flows)
    assert any("= 0" in fact for fact in program.about.facts)
    assert order < 8 or len(step.schedule.flows) < len(others.flows)


def test_the_price_of_kicks_decides_whether_they_are_modified():
    beside_a_dear_drift = TOP + "hamiltonian: (P1**2 + P2**2 + 2*P3**2)/4 + G1\n"
    beside_a_cheap_one = PLANE + "hamiltonian: p**2/2 + exp(sin(exp(q)) + q*cos(q**2))\n"
    assert composition_of(beside_a_dear_drift, 6) == ("force-gradient", True)
    assert composition_of(beside_a_cheap_one, 6) == ("blanes-moan-rkn", False)


def test_either_part_may_be_the_one_that_kicks():
    compilation = compile_text(PLANE + "hamiltonian: p**2/2 + p*q**2\n", 4, "splitting")
    assert compilation.program.step.composition in nystrom.NAMES
    v = compilation.splitting.flows[compilation.splitting.kick].hamiltonian
    assert derivatives([v], "p")[0] != 0


#: Systems that miss the Nyström type by one term or power.
FAILING = {
    "a quartic kinetic energy": PLANE + "hamiltonian: p**4 + p**2/2 + q**2/2 + cos(q)\n",
    "a kinetic energy with P1**4": TOP + "hamiltonian: P1**4/8 + G2\n",
    "two species": "coordinates: [x, y]\npoisson: {log_canonical: [[0, 1], [-1, 0]]}\n"
    "hamiltonian: x + y - log(x) - log(y)\n",
    "one term too many, with a parameter": PLANE + "parameters: {e: 0.1}\nhamiltonian: p**2/2 + e*p**4 + cos(q)\n",
    "a rigid body": "coordinates: [x, y, z]\npoisson: {brackets: {x: {y: -z, z: y}, y: {z: -x}}}\n"
    "hamiltonian: x**2/2 + y**2/3 + z**2/5\n",
}


@pytest.mark.parametrize("text", FAILING.values(), ids=FAILING)
def test_where_the_condition_fails_by_one_term_the_alternation_is_taken(text):
    assert composition_of(text, 6) == ("blanes-moan", False)
    with pytest.raises(SpecError) as caught:
        composition_of(text, 6, "blanes-moan-rkn")
    (diagnostic,) = caught.value.diagnostics
    assert "composition blanes-moan-rkn needs {V, {V, {V, T}}} = 0" in diagnostic.message
    assert "does not hold here" in diagnostic.message
    assert diagnostic.location.line == text.count("\n") + 3


def test_three_parts_and_orders_that_a_name_lacks_are_refused():
    lattice = "coordinates: [x, y, z]\npoisson: {log_canonical: [[0,1,-1],[-1,0,1],[1,-1,0]]}\nhamiltonian: x + y + z\n"
    with pytest.raises(SpecError, match=r"needs H = T \+ V, of two parts; this H has 3"):
        composition_of(lattice, 6, "force-gradient")
    with pytest.raises(SpecError, match="this H has 1 part"):
        composition_of(PLANE + "hamiltonian: p**2/2\n", 6, "force-gradient")
    with pytest.raises(SpecError, match="composition force-gradient offers the orders 4, 6, 8, not 10") as caught:
        composition_of(PLANE + "hamiltonian: p**2/2 + cos(q)\n", 10, "force-gradient")
    assert caught.value.diagnostics[0].hint == "write order: 8, or composition: auto"
    with pytest.raises(SpecError, match="needs scheme: splitting"):
        compile_text(PLANE + "hamiltonian: p**2/2 + cos(q)\ncomposition: force-gradient\n", 6, "series")


@cache
def forced(name, method):
    """Return the solver of a system of the corpus with a method and the tangent map; short C without batches of
    members.
    """
    compiled_system = small(compiled(name, method.order, "splitting"))
    (kick,) = [
        k for k in kicks(compiled_system.system, split(compiled_system.system)) if k.modified or not method.multiples
    ]
    choice = choosing.chosen(split(compiled_system.system), Order(method.order, 0), method, kick)
    program = build_splitting(
        compiled_system.system,
        choice,
        compiled_system.gauge,
        compiled_system.spec.overridden(tangent=True, profile="small"),
    )
    return replace(compiled_system, program=program, splitting=choice.splitting)


@cache
def reference(name):
    """Return a solver of high order."""
    return solver(small(compiled(name, 10, "splitting")), "c")


#: Times over which errors are larger than rounding and smaller than 1.
SPANS = {"kowalevski_top": 6, "henon_heiles": 8, "nambu_pendulum": 4}


@pytest.mark.thin(3)
@METHODS
@pytest.mark.parametrize("name", slow_but(["kowalevski_top"], SPANS))
def test_observed_order_is_the_stated_one(name, method):
    compiled_system = forced(name, method)
    at, solve, span = setting(compiled_system), solver(compiled_system, "c"), SPANS[name]
    fine = reference(name).integrate(at.x, span / 512, 512, parameters=at.parameters).x[-1]

    def error(steps):
        end = solve.integrate(at.x, span / steps, steps, parameters=at.parameters).x[-1]
        return np.max(np.abs(end - fine)) / np.max(np.abs(fine))

    errors = [error(n) for n in (4, 8, 16, 32, 64)]
    slopes = [np.log2(a / b) for a, b in pairwise(errors) if a < 1e-2 and b > 1e-13]
    assert slopes, "the test needs another time"
    assert max(slopes) > method.order - 0.4


@pytest.mark.thin(2)
@pytest.mark.parametrize("method", slow_but(nystrom.METHODS[::3], nystrom.METHODS), ids=named)
def test_step_is_a_reversible_poisson_map_in_both_targets(method):
    compiled_system = forced("kowalevski_top", method)
    at = setting(compiled_system)
    images = []
    for target in TARGETS:
        step, x = of_solver(solver(compiled_system, target), at.parameters, None), np.array(at.x)
        assert measures.poisson_defect(compiled_system.system, at.parameters, step, x, 0.3) < 1e-14
        assert measures.tangent_error(step, x, 0.3) < 1e-8
        assert measures.reversal(step, x, 0.3) < 1e-14
        run = solver(compiled_system, target).integrate(x, 0.3, 200, parameters=at.parameters)
        for values in run.casimirs.values():
            assert np.ptp(values) <= 2e-14 * max(1, np.max(np.abs(values)))
        images.append(run.x[10])
    assert np.max(np.abs(images[0] - images[1])) < 1e-13 * np.max(np.abs(images[0]))


def test_a_wrong_multiple_of_the_gradient_is_refuted():
    compilation = compiled("kowalevski_top", 8, "splitting")
    v = compilation.splitting.flows[compilation.splitting.kick]
    wrong = replace(v, hamiltonian=substitute([v.hamiltonian], {KICK: 2 * symbol(KICK)})[0])
    flows = tuple(wrong if f is v else f for f in compilation.splitting.flows)
    verdicts = {s.name: s.verdict for s in check(compilation.system, replace(compilation.splitting, flows=flows))}
    assert verdicts["dH_1/dκ = {H_1, {H_1, H_2}}"] == REFUTED
    assert verdicts["{H_1, {H_1, {H_1, H_2}}} = 0"] != REFUTED


def test_a_condition_that_does_not_hold_is_refuted():
    compilation = compiled("spin_chain5", 6, "splitting")
    refuted = [
        s.name for s in check(compilation.system, replace(compilation.splitting, kick=0)) if s.verdict == REFUTED
    ]
    assert refuted == ["{H_1, {H_1, {H_1, H_2}}} = 0"]


def test_the_multiple_of_the_gradient_has_its_letter_in_formulas_and_files():
    compilation = compiled("kowalevski_top", 8, "splitting")
    assert r"H_{1} &= G_{1} + \kappa" in document(compilation)
    assert dict(formulas(compilation, None))["H_1"] == "G1 + κ*(G2**2 + 1/2*G3**2)"
    assert (
        "The flow of H_1 = G1 + κ*(G2**2 + 1/2*G3**2)"
        in emit(compilation.program, "c", "", single_file=True)["kowalevski_top.c"]
    )


def test_four_bodies_are_decided_by_degrees_and_kicked_plainly():
    names = [f"{c}{i}" for i in range(4) for c in "xy"]
    forces = [f"1/sqrt((x{i} - x{j})**2 + (y{i} - y{j})**2)" for i in range(4) for j in range(i)]
    kinetic, potential = " + ".join(f"p{n}**2" for n in names), " - ".join(forces)
    momenta = ", ".join(f"p{n}" for n in names)
    text = (
        f"coordinates: [{', '.join(names)}, {momenta}]\n"
        f"poisson: {{canonical: {{q: [{', '.join(names)}], p: [{momenta}]}}}}\n"
        f"hamiltonian: ({kinetic})/2 - {potential}\n"
    )
    with processor_seconds_below(10):
        assert composition_of(text, 6) == ("blanes-moan-rkn", False)
