"""Hamiltonians that depend on the time: series, orders and targets, compared with specs in which time and energy (t, e)
are coordinates.
"""

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp
from support import COMMAND, RawC, compile_text, compiled, files, javascript, slow_but, small, solver

import phigen
from phigen import spec
from phigen.compiler import compile_spec, emit, examine
from phigen.errors import SpecError
from phigen.geometry.system import system_from_spec
from phigen.proofs.independent import compare
from phigen.realisations.catalogue import realise
from phigen.scheme.alternation import STRANG, Alternation, schedule, with_clock
from phigen.scheme.choosing import plan
from phigen.scheme.discretisation import hamilton_jacobi
from phigen.scheme.nystrom import Nystrom
from phigen.series.hamilton_jacobi import graph_series, residual
from phigen.spec.model import BirealisationChoice
from phigen.splitting.parts import split
from phigen.splitting.statements import check as check_splitting
from phigen.study.summary import exact_solution
from phigen.symbolic.expression import substitute, symbol
from phigen.symbolic.numeric import evaluate
from phigen.symbolic.verdict import decide_zero, sample_point

T0, H, STEPS = 0.3, 0.1, 20

PENDULUM = """time: t
coordinates: [q, p]
parameters: {A: 0.5, omega: 2}
poisson: {canonical: {q: [q], p: [p]}}
definitions: {drive: A*cos(omega*t)}
hamiltonian: p**2/2 - cos(q) - q*drive
"""

#: The same system with the time and its conjugate e as coordinates.
BY_HAND = """coordinates: [q, t, p, e]
parameters: {A: 0.5, omega: 2}
poisson: {canonical: {q: [q, t], p: [p, e]}}
hamiltonian: p**2/2 - cos(q) - q*A*cos(omega*t) + e
"""

BODY = """time: t
coordinates: [m1, m2, m3]
parameters: {b: 0.4, omega: 1.5}
poisson: {brackets: {m1: {m2: -m3, m3: m2}, m2: {m3: -m1}}}
casimirs: {C: m1**2 + m2**2 + m3**2}
hamiltonian: m1**2/2 + m2**2/4 + m3**2/6 - b*(m1*cos(omega*t) + m2*sin(omega*t))
tangent: true
"""

SEASONS = """time: t
coordinates: [x, y]
parameters: {s: 0.3, omega: 2}
poisson: {log_canonical: [[0, 1], [-1, 0]]}
hamiltonian: x + y - (1 + s*cos(omega*t))*log(x) - 1.5*log(y)
tangent: true
"""

#: Spins whose parts of H all depend on the time: one part, or three that do not commute.
SPIN = """time: t
coordinates: [m1, m2, m3]
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: m1*cos(t) + m2*sin(t) + 0.4*m3*t
tangent: true
"""
DRIVEN = SPIN.replace("m1*cos(t) + m2*sin(t) + 0.4*m3*t", "m1**2*cos(t)/2 + m2**2*sin(t)/3 + m3**2*exp(-t)/4")

#: Kinds of steps whose code with lanes other tests use.
QUICKLY = ("path", "newton, composed", "splitting, time by itself")

STARTS = {PENDULUM: [1.0, 0.0], BODY: [0.6, 0.5, 0.7], SEASONS: [0.6, 1.5]}
STARTS |= dict.fromkeys([SPIN, DRIVEN], STARTS[BODY])

#: Every kind of step: text, order, bi-realisation (for a splitting: the scheme), composition.
KINDS = {
    "newton": (PENDULUM, 4, "auto", "auto"),
    "newton, non-linear π": (BODY, 6, "auto", "auto"),
    "newton, log-canonical": (SEASONS, 4, "auto", "auto"),
    "newton, order 2": (BODY, 2, "cayley", "auto"),
    "newton, not symmetric": (PENDULUM, 4, "canonical-euler", "auto"),
    "explicit": (PENDULUM, 1, "canonical-euler", "auto"),
    "path": (BODY, 4, "karasev", "auto"),
    "newton, composed": (BODY, 6, "auto", "kahan-li"),
    "path, composed": (BODY, 4, "karasev", "suzuki"),
    "splitting, time with T": (PENDULUM, 4, "splitting", "force-gradient"),
    "splitting, non-linear π": (BODY, 4, "splitting", "auto"),
    "splitting, log-canonical": (SEASONS, 2, "splitting", "auto"),
    "splitting, time by itself": (SPIN, 4, "splitting", "auto"),
    "splitting in three, time by itself": (DRIVEN, 4, "splitting", "suzuki"),
}
pytestmark = pytest.mark.few(
    "newton",
    "newton, non-linear π",
    "newton, log-canonical",
    "newton, composed",
    "explicit",
    "path",
    "splitting, time with T",
    "splitting, time by itself",
    of=KINDS,
)


@cache
def compilation_of(kind):
    text, order, birealisation, composition = KINDS[kind]
    specification = spec.loads(f"phigen: 1\nname: t\n{text}order: {order}\n")
    if birealisation == "splitting":
        return compile_spec(replace(specification, composition=composition), scheme="splitting")
    specification = replace(specification, birealisation=BirealisationChoice(birealisation), composition=composition)
    return compile_spec(specification)


def start_of(kind):
    return np.array(STARTS[KINDS[kind][0]])


def terms_of(text, kind, count):
    system = system_from_spec(spec.loads(f"phigen: 1\nname: t\n{text}"))
    realisation = realise(system, BirealisationChoice(kind))
    return system, realisation, hamilton_jacobi(system, realisation, count).polynomial(count)


@pytest.mark.parametrize("kind", ["constant", "canonical-euler"])
def test_the_series_is_that_of_the_pair_typed_by_hand(kind):
    _, realisation, derived = terms_of(PENDULUM, kind, 4)
    both, whole, by_hand = terms_of(BY_HAND, "constant", 4)
    if kind == "canonical-euler":  # the spec with (t, e) keeps the midpoint rule
        alpha = [*realisation.alpha[:1], whole.alpha[1], *realisation.alpha[1:], whole.alpha[3]]
        listed = graph_series(both.hamiltonian, alpha, both.coordinates, 4, symmetric=False)
    else:
        listed = [by_hand.tower.expression(s) for s in by_hand.terms]
    for i, (mine, theirs) in enumerate(zip(derived.terms, listed, strict=True), 1):
        difference = derived.tower.expression(mine) - theirs + (symbol("e") if i == 1 else 0)
        assert decide_zero(f"S_{i}", [("", difference)]).verdict == "proved"


def test_the_residual_knows_both_terms_of_the_equation():
    system, realisation, series = terms_of(PENDULUM, "canonical-euler", 3)
    whole = residual(series, system.hamiltonian, realisation.alpha, system.coordinates, system.times)
    assert all(r == 0 for r in whole)
    frozen = residual(series, system.hamiltonian, realisation.alpha, system.coordinates)
    assert [bool(r == 0) for r in frozen] == [True, True, False]  # −½ ∂_τ H and ½ ∂_τ S_1 cancel in the second


@pytest.mark.parametrize("order", [2, 6])
def test_steps_are_those_with_the_pair_typed_by_hand(order):
    mine = solver(compile_text(PENDULUM, order), "numpy").integrate([1, 0], H, 100, t0=T0)
    theirs = solver(compile_text(BY_HAND, order), "numpy").integrate([1, T0, 0, 0], H, 100)
    assert mine.x == pytest.approx(theirs.x[:, [0, 2]], abs=1e-14)
    assert mine.t == pytest.approx(theirs.x[:, 1], abs=1e-14)


def errors(solve, field, x0, span, counts):
    reference = solve_ivp(field, (T0, T0 + span), x0, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    return np.array([np.max(np.abs(solve(x0, span / n, n) - reference)) for n in counts])


@pytest.mark.thin(2)
@pytest.mark.parametrize("kind", KINDS)
def test_the_order_is_that_of_autonomous_systems(kind):
    compilation = compilation_of(kind)
    integrator = solver(compilation, "numpy")
    steps = (20, 40) if compilation.order.order < 6 else (8, 16)
    coarse, fine = errors(
        lambda x, h, n: integrator.integrate(x, h, n, n, t0=T0).x[-1],
        lambda t, x: integrator.vector_field(x, t),
        start_of(kind),
        2.0,
        steps,
    )
    assert np.log2(coarse / fine) == pytest.approx(compilation.order.order, abs=0.45)


@pytest.mark.parametrize("shift", [-H / 2, H / 2])
def test_the_time_at_an_end_of_the_step_gives_order_one_only(shift):
    integrator = solver(compilation_of("newton"), "numpy")
    coarse, fine = errors(
        lambda x, h, n: integrator.integrate(x, h, n, n, t0=T0 + shift * h / H).x[-1],
        lambda t, x: integrator.vector_field(x, t),
        start_of("newton"),
        2.0,
        (20, 40),
    )
    assert np.log2(coarse / fine) == pytest.approx(1, abs=0.1)


#: Cases in C; code with lanes is covered by the quick kinds.
IN_C = [*product(KINDS, ["small"]), *product(QUICKLY, ["fast"])]


@pytest.mark.thin(3)
@pytest.mark.parametrize(("kind", "profile"), slow_but(IN_C, product(KINDS, ["small", "fast"])))
def test_c_agrees_with_numpy_to_roundoff(kind, profile):
    compilation, x0 = compilation_of(kind), start_of(kind)
    expected = solver(compilation, "numpy").integrate(x0, H, STEPS, t0=T0)
    variant = compilation if profile == "fast" else small(compilation)
    c = solver(variant, "c").integrate(x0, H, STEPS, t0=T0)
    assert c.x == pytest.approx(expected.x, abs=1e-13)
    assert c.t == pytest.approx(expected.t, abs=0)
    assert c.energy == pytest.approx(expected.energy, abs=1e-13)
    field = solver(compilation, "numpy").vector_field(c.x[-1], c.t[-1])
    assert solver(variant, "c").vector_field(c.x[-1], c.t[-1]) == pytest.approx(field, abs=1e-13)


@pytest.mark.thin(2)
@pytest.mark.parametrize("kind", KINDS)
def test_javascript_agrees_with_numpy_to_roundoff(kind):
    compilation, x0 = compilation_of(kind), start_of(kind)
    expected = solver(compilation, "numpy").integrate(x0, H, STEPS, t0=T0)
    value = "[[...s.x], s.t, s.hamiltonian(), [...s.vectorField()]]"
    options = f"x0: {x0.tolist()}, t0: {T0}"
    x, t, energy, field = javascript(compilation, options, f"s.integrate({H}, {STEPS})", value)
    assert x == pytest.approx(expected.x[-1], abs=1e-13)
    assert (t, energy) == pytest.approx((expected.t[-1], expected.energy[-1]), abs=1e-13)
    last = solver(compilation, "numpy").vector_field(expected.x[-1], expected.t[-1])
    assert field == pytest.approx(last, abs=1e-13)


def test_the_time_is_counted_not_added_up():
    integrator = solver(compilation_of("newton"), "c")
    t = integrator.integrate([1, 0], 0.1, 1000, 1000, t0=0.3).t
    assert t.tolist() == [0.3, 0.3 + 1000 * 0.1]
    assert integrator.integrate([1, 0], H, 7, t0=T0).x[-1].tolist() == steps_in_two(integrator, 3, 4)


def steps_in_two(compiled_system, first, second):
    """Return the state after first + second steps; in between the session is saved and resumed."""
    session = compiled_system.backend.start(np.array([1.0, 0.0]), {"A": 0.5, "omega": 2.0}, T0)
    session.advance(H, first)
    session = compiled_system.backend.restored(session.saved(), {"A": 0.5, "omega": 2.0})
    session.advance(H, second)
    return session.state().tolist()


def test_a_saved_session_goes_on_at_its_time():
    integrator = solver(compilation_of("newton"), "numpy")
    assert integrator.integrate([1, 0], H, 7, t0=T0).x[-1].tolist() == steps_in_two(integrator, 3, 4)


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_ensembles_start_at_the_time_of_all_members(target):
    integrator = solver(compilation_of("newton, non-linear π"), target)
    starts = np.random.default_rng(3).normal(size=(5, 3))
    ends = integrator.ensemble(starts, H, STEPS, t0=T0)
    for x0, end in zip(starts, ends, strict=True):
        assert end == pytest.approx(integrator.integrate(x0, H, STEPS, STEPS, t0=T0).x[-1], abs=1e-13)


POISSON = ["newton, non-linear π", "newton, log-canonical", "path", "splitting, time by itself"]


@pytest.mark.parametrize("kind", POISSON)
@pytest.mark.parametrize("target", ["c", "numpy"])
def test_steps_are_poisson_maps(kind, target):
    compilation = compilation_of(kind)
    system = compilation.system
    x, tangent = solver(compilation, target).step_tangent(start_of(kind), H, t0=T0)

    def tensor(at):
        flat = evaluate([e for row in system.poisson for e in row], dict(zip(system.coordinates, at, strict=True)))
        return np.reshape(flat, (len(at), len(at)))

    assert tangent @ tensor(start_of(kind)) @ tangent.T == pytest.approx(tensor(x), abs=1e-13)


def test_casimirs_are_constant_and_the_statements_are_proved():
    long = solver(compilation_of("newton, non-linear π"), "c").integrate([0.6, 0.5, 0.7], H, 5000, 50)
    assert np.ptp(long.casimirs["C"]) < 1e-13
    assert np.ptp(long.energy) > 0.1
    examination = examine(spec.loads(f"phigen: 1\nname: t\n{BODY}"))
    assert {s.verdict for s in examination.groups["Hamilton–Jacobi series"]} == {"proved"}


def test_invariants_may_depend_on_the_time():
    moving = "time: t\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: p**2/2 - q*t\n"
    for invariant, verdict in (("p - t**2/2", "proved"), ("p - t**2/3", "refuted")):
        examination = examine(spec.loads(f"phigen: 1\nname: t\n{moving}invariants: {{F: {invariant}}}\n"))
        assert [s.verdict for s in examination.groups["Invariants"]] == [verdict]


def test_what_depends_on_the_time_only_is_computed_once_in_a_step():
    step = compilation_of("newton, non-linear π").program.step
    assert "t" not in step.linearise.inputs
    assert step.renewed > 0
    text = emit(compilation_of("newton, non-linear π").program, "c", COMMAND)["t.c"]
    assert text.count("cos(") == text.count("sin(") == 3  # refresh, the Hamiltonian, the vector field


def test_sections_may_depend_on_the_time():
    integrator = solver(compilation_of("newton"), "c").section([1, 0], H, 100, lambda x, t: np.sin(t + x[:, 0]), t0=T0)
    assert len(integrator) > 0
    assert np.sin(integrator.t + integrator.x[:, 0]) == pytest.approx(0, abs=1e-13)


def test_a_time_is_asked_for_where_there_is_one_and_refused_where_there_is_none():
    timed, timeless = solver(compilation_of("newton"), "c"), solver(compile_text(BY_HAND, 2), "c")
    with pytest.raises(TypeError, match="t is missing"):
        timed.hamiltonian([1, 0])
    with pytest.raises(TypeError, match="does not depend on the time"):
        timeless.integrate([1, 0, 0, 0], H, 1, t0=1.0)
    with pytest.raises(ValueError, match="t0 must be finite"):
        timed.integrate([1, 0], H, 1, t0=np.inf)


def test_the_hamiltonian_takes_a_time_for_each_state():
    compilation = compilation_of("newton")
    point = sample_point(["q", "p", "t"], (), 1)
    x, t = [[float(point["q"]), float(point["p"])]] * 2, [float(point["t"]), 2.0]
    formula = substitute([compilation.system.hamiltonian], {})
    for target in ("c", "numpy"):
        values = solver(compilation, target).hamiltonian(x, t)
        for value, at in zip(values, t, strict=True):
            named = {"q": x[0][0], "p": x[0][1], "t": at, "A": 0.5, "omega": 2.0}
            assert value == pytest.approx(evaluate(formula, named)[0], rel=1e-14)


def test_the_python_api_takes_a_start(tmp_path):
    path = tmp_path / "driven.yaml"
    path.write_text(f"phigen: 1\nname: driven\n{PENDULUM}", encoding="utf-8")
    solver = phigen.compile(phigen.load(path), target="numpy")
    assert solver.step([1, 0], H, t0=T0) == pytest.approx(solver.integrate([1, 0], H, 1, t0=T0).x[-1], abs=0)


@pytest.mark.parametrize("kind", ["constant", "canonical-euler"])
def test_a_step_is_the_flow_of_the_modified_hamiltonian_which_depends_on_the_time(kind):
    specification = spec.loads(f"phigen: 1\nname: t\n{PENDULUM}order: 2\nmodified_hamiltonian: 2\n")
    compilation = compile_spec(replace(specification, birealisation=BirealisationChoice(kind)))
    integrator, x0 = solver(compilation, "numpy"), np.array([0.6, 0.5])
    modified, width = integrator.backend.module.modified_hamiltonian, 1e-4

    def field(t, x, h):
        q, p = ((modified(x + e, h, t) - modified(x - e, h, t)) / (2 * width) for e in width * np.eye(2))
        return [p, -q]

    missed = []
    for h in (0.4, 0.2):
        flow = solve_ivp(field, (T0, T0 + h), x0, method="DOP853", rtol=1e-12, atol=1e-13, args=(h,)).y[:, -1]
        missed.append(np.max(np.abs(integrator.step(x0, h, t0=T0) - flow)))
    assert np.log2(missed[0] / missed[1]) > compilation.program.modified.power + 0.6


@pytest.mark.parametrize("kind", ["newton, log-canonical", "newton, not symmetric"])
def test_sympy_derives_the_same_series(kind):
    agreements = list(compare(compilation_of(kind), 3))
    assert {c.statement.verdict for c in agreements} == {"proved"}
    assert ("∇S_h" in [c.statement.name for c in agreements]) == compilation_of(kind).realisation.symmetric


def test_systems_from_sympy_may_have_a_time():
    q, p, t = sympy.symbols("q p t", real=True)
    system = phigen.System.from_sympy([q, p], [[0, 1], [-1, 0]], p**2 / 2 + q**2 / 2 - q * sympy.cos(t), time=t)
    assert system.to_sympy().time == t
    assert phigen.compile(system, target="numpy").integrate([1, 0], H, 3, t0=1.0).t[-1] == 1.0 + 3 * H
    with pytest.raises(SpecError, match="unknown symbol t"):
        phigen.System.from_sympy([q, p], [[0, t], [-t, 0]], p**2 / 2, time=t)


@pytest.mark.parametrize("h", [0.1, 0.05])
def test_a_spin_in_resonance_follows_rabis_solution(h):
    compilation = compiled("spin_resonance")
    run = compilation.spec.runs["resonance"]
    trajectory = solver(compilation, "c").integrate([0, 0, 1], h, round(20 / h))
    solution = exact_solution(
        compilation.system, run, compilation.spec.parameters_of(run), trajectory.x[0], trajectory.t
    )
    error = np.max(np.abs(trajectory.x - np.stack([solution[c] for c in compilation.system.coordinates], axis=1)))
    assert error < 1e-6 * (h / 0.1) ** 4 * 1.1
    assert trajectory.x[-1, 2] == pytest.approx(np.cos(0.3 * 20), abs=1e-6)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind.startswith("splitting")])
def test_splittings_are_proved_with_the_time_at_rest(kind):
    compilation = compilation_of(kind)
    statements = list(check_splitting(compilation.discretised, compilation.splitting))
    assert all(s.holds for s in statements)
    kicks = [s.name for s in statements if "∂t" in s.name]
    assert kicks == (["{H_2, ∂H_2/∂t} = 0"] if kind == "splitting, time with T" else [])


def test_a_drift_that_depends_on_the_time_rules_kicks_out():
    """With V + e in place of V the conditions of these methods do not hold; the order would be one less."""
    heavy = PENDULUM.replace("p**2/2 - cos(q) - q*drive", "p**2/2*(1 + cos(t)/2) - cos(q)")
    for text, kind in ((PENDULUM, Nystrom), (heavy, Alternation)):
        system = system_from_spec(spec.loads(f"phigen: 1\nname: t\n{text}"))
        assert isinstance(plan(system, split(system.frozen), 4, "auto").method, kind)


def test_every_flow_sees_the_time_of_its_place():
    halves = schedule(STRANG, 2)
    assert with_clock(halves, 0, 2).moments == (0.0, 0.5, 0.0)  # ½ T, V, ½ T: V in the middle
    assert with_clock(halves, 1, 2).moments == (0.0, 0.0, 1.0)
    alone = with_clock(halves, 1, 1)
    assert (alone.flows, alone.moments) == ([(0, 0), (0, 2)], (0.0, 0.0, 1.0))
    with pytest.raises(ValueError, match="two times"):
        with_clock(schedule(STRANG, 5), 2, 5)


@pytest.mark.thin(2)
@pytest.mark.parametrize("kind", ["newton, non-linear π", "newton, composed", "path"])
def test_blocks_of_steps_see_the_time_of_each_step(kind):
    compilation = compilation_of(kind)
    assert "t_renew_lanes" in files(compilation, "c")["t.c"]
    single = replace(compilation, program=replace(compilation.program, lanes=False))
    rows = [solver(c, "c").integrate(start_of(kind), 0.05, 800, 100, t0=T0).x for c in (compilation, single)]
    assert rows[0] == pytest.approx(rows[1], abs=1e-13)
    assert evaluations(compilation, kind) != evaluations(single, kind)


def evaluations(compilation, kind):
    """Return the number of evaluations of the generating function in 800 steps."""
    raw = RawC(compilation)
    assert raw.init(start_of(kind)) == 0
    assert raw.integrate(0.05, 800) == 0
    return int(raw.counters[1])
