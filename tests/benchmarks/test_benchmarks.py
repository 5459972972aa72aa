"""The benchmarks are valid: the classical methods to compare with (peers) have their stated orders, and the programs
that measure run.
"""

import math
from dataclasses import replace
from functools import cache

import mpmath
import numpy as np
import pytest
from systems import slow_but

pytest.importorskip("scipy")

from benchmarks import document, eccentric, ensembles, lanes, lattices, planets, tables
from benchmarks.lanes import collocation, lanes_method
from benchmarks.measure import Cell, Grid, Judge, Result, Scan, Study, run
from benchmarks.problems import PROBLEMS, volterra
from benchmarks.solvers import (
    Method,
    Run,
    build_phigen,
    c_peers,
    dop853_in_vectors,
    phigen_method,
    reference,
)
from benchmarks.studies import QUICK, methods_of

BODY, PENDULUM = PROBLEMS[0], PROBLEMS[-1]
STEPPED = [m for m in c_peers(BODY) if m.step_based]


@cache
def body_after(horizon: float, chunks: int) -> np.ndarray:
    return reference(BODY, horizon, chunks)[0]


def observed_order(method: Method) -> float:
    # Steps are large enough for errors of order 8 to exceed round-off.
    h, chunks = (0.5, 4) if method.order > 4 else (0.1, 4)
    exact = body_after(16 * h, chunks)
    coarse, fine = (method.run(BODY.start, h / k, 4 * k, chunks, math.inf) for k in (1, 2))
    errors = [np.abs(r.states - exact).max() for r in (coarse, fine)]
    return math.log2(errors[0] / errors[1])


@pytest.mark.thin(2)
@pytest.mark.parametrize("method", STEPPED, ids=lambda m: m.name)
def test_a_peer_has_its_order_on_the_rigid_body(method):
    assert observed_order(method) > method.order - 0.5


@pytest.mark.slow
@pytest.mark.parametrize("problem", slow_but(PROBLEMS[:1], PROBLEMS), ids=lambda p: p.name)
def test_all_peers_solve_the_same_system(problem):
    h = problem.typical / 20
    exact, uncertainty = reference(problem, 100 * h, 2)
    assert uncertainty < 1e-11
    for method in (*c_peers(problem), lanes_method(problem, 16)):
        setting, chunk = (h, 50) if method.step_based else (1e-8, 50 * h)
        measured = method.run(problem.start, setting, chunk, 2, math.inf)
        assert measured.status == "ok"
        assert np.abs(measured.states - exact).max() < (1e-2 if method.order == 2 else 1e-5), method.name


def test_a_tiny_case_runs_through_to_its_table():
    judge = Judge(BODY)
    methods = [phigen_method(BODY, 4, "none"), c_peers(BODY)[0]]
    cells = []
    for m in methods:
        result = run(m, 0.1, 100.0, 5, judge, math.inf)
        assert result.status == "ok"
        assert result.energy < 1e-3
        cells.append(Cell(m.name, m.family, ("energy", 1e-3), result, [result.seconds]))
    text = tables.work_precision(Study("P1", BODY.title, 100.0, [c.result for c in cells], cells, []))
    assert "best peer / phigen" in text
    assert build_phigen(BODY.spec(4)).generating > 0


def test_exact_flows_are_known_and_left_out():
    top = next(p for p in PROBLEMS if p.name == "P3")
    assert build_phigen(BODY.spec(2, "splitting")).exact
    assert not build_phigen(top.spec(2, "splitting")).exact
    methods, notes = methods_of(replace(BODY, methods=("splitting",)), QUICK)
    assert not any(m.family == "phigen" for m in methods)
    assert "phigen, splitting: left out, since its step is the exact flow of H" in notes


def test_kernels_of_lattices_by_hand_make_the_steps_of_the_generated_ones():
    """Lattice kernels written by hand make the same steps as generated ones. Otherwise the comparison of their times
    would mean nothing.
    """
    for sites, size in ((lattices.XXZ, 16), (lattices.CUBE, 4)):
        by_hand = lattices.Kernel(sites, size, True).method(0)
        lattices.expect_same(lattices.ours(sites.solver(2)), by_hand, sites.start(size))


@pytest.mark.thin(2)
@pytest.mark.parametrize("sites", [lattices.XXZ, lattices.FPUT, lattices.DNLS], ids=lambda s: s.name)
def test_peers_of_lattices_have_their_orders(sites):
    x, kernel = sites.start(16), lattices.Kernel(sites, 16, False)
    exact = lattices.ours(sites.solver(8))(x, 0.01, 100)[0]
    for index, order, h in ((0, 4, 0.05), (1, 8, 0.25)):
        coarse, fine = (np.abs(kernel.method(index)(x, h / k, round(k / h))[0] - exact).max() for k in (1, 2))
        assert math.log2(coarse / fine) > order - 0.7


# Gauss methods with stages in SIMD lanes ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("order", "h"), slow_but([(16, 2.5)], [(4, 0.2), (8, 1.0), (12, 2.0), (16, 2.5)]), ids=lambda v: str(v)
)
def test_gauss_in_lanes_has_its_order(order, h):
    method, horizon = lanes_method(BODY, order), 20.0
    exact = body_after(horizon, 4)
    errors = [
        np.abs(method.run(BODY.start, h / k, round(horizon * k / h / 4), 4, math.inf).states - exact).max()
        for k in (1, 2)
    ]
    assert errors[1] > 1e-14
    assert math.log2(errors[0] / errors[1]) > order - 1.0


def test_gauss_in_lanes_keeps_quadratic_invariants_without_a_drift():
    """Energy and Casimir do not drift. If the a_ij were rounded one by one, so that μ_ij + μ_ji = 1 fails, the energy
    would drift in proportion to time.
    """
    measured = lanes_method(BODY, 16).run(BODY.start, 0.5, 2000, 100, math.inf)
    errors = Judge(BODY).errors(measured.states)
    assert measured.status == "ok"
    assert max(errors["energy"], errors["casimir"]) < 3e-14


@pytest.mark.slow
def test_sine_in_lanes_is_right_to_rounding():
    """The sine in SIMD lanes is exact to rounding: over many rotations of the pendulum, the only problem with a sine,
    the orbit agrees with the reference.
    """
    spinning = (0.3, 40.0, 0.0)
    fast = replace(PENDULUM, start=spinning, typical=0.002)
    exact, _ = reference(fast, 4.0, 2)
    measured = lanes_method(fast, 16).run(spinning, 0.01, 200, 2, math.inf)
    assert np.abs(measured.states - exact).max() < 1e-11


def test_coefficients_of_gauss_are_symplectic():
    _, a, b = collocation(8)
    with mpmath.workdps(60):
        defect = max(abs(b[i] * a[i][j] + b[j] * a[j][i] - b[i] * b[j]) for i in range(8) for j in range(8))
        assert defect < 1e-40
        assert abs(sum(b) - 1) < 1e-40


def test_a_predictor_reproduces_slow_signals():
    stages = 8
    nodes = [float(c) for c in collocation(stages)[0]]
    past = np.array([np.cos(0.5 * (c - back)) for back in (1, 2) for c in nodes])
    weights = lanes.predictors(stages)[1].reshape(lanes.HISTORY, stages, stages)
    guess = sum(weights[m] @ past[m * stages : (m + 1) * stages] for m in range(lanes.HISTORY))
    assert np.abs(guess - np.cos(0.5 * np.array(nodes))).max() < 1e-8


# grids of step sizes -------------------------------------------------------------------------------------------------


def pretending(best: float) -> Method:
    """Return a fictitious method that is always accurate enough and cheapest at the step ``best``."""

    def run(start, h, chunk, chunks, limit):
        return Run(np.tile(start, (chunks, 1)), 1e-3 + abs(math.log(h / best)), chunk * chunks, 0, "ok")

    return Method("pretending", run, 4)


def scanned(best: float) -> Scan:
    scan = Scan(Grid(pretending(best), BODY), Judge(BODY), [("energy", 1e-4)], math.inf)
    scan.extend_finer()
    return scan


def test_a_best_setting_at_the_end_of_its_grid_extends_the_grid():
    scan = scanned(best=5.5)
    assert scan.best_at_coarse_end()  # the scan begins at step 2, below the best 5.5
    scan.extend_coarser()
    assert not scan.failure()
    cheapest = min(scan.results.values(), key=lambda r: r.seconds)
    assert 4.5 < cheapest.setting < 6.7
    assert max(r.setting for r in scan.results.values()) > cheapest.setting


def test_a_grid_that_cannot_be_extended_is_a_failure():
    scan = scanned(best=1e6)
    scan.extend_coarser()
    assert "is the best for energy 1e-04" in scan.failure()


def test_ensembles_extend_their_grids():
    def advance(x, h):
        return 1e-3 + abs(math.log(h / 7.0))

    trials = ensembles.scanned(ensembles.Bodies(1.0), ensembles.Contestant("", "", advance, 1.0, 0.5))
    assert ensembles.best(trials, 1e-4).setting == 8.0
    assert trials[0].setting > 8.0


def test_a_table_names_the_variant_and_the_setting_of_a_row():
    result = Result("DOP853 compensated", "peer", 8, 1e-9, 1.0, 1, 0, "ok", "compensated", step_based=False)
    ours = Result("phigen 4", "phigen", 4, 0.5, 2.0, 1, 0, "ok", "order 4")
    target = ("energy", 1e-8)
    cells = [Cell("phigen", "phigen", target, ours, [2.0]), Cell("DOP853 in C", "peer", target, result, [1.0])]
    text = tables.work_precision(Study("P1", "a body", 1.0, [], cells, []))
    assert "0.50 [0.50–0.50] (compensated, 1e-09)" in text
    assert "**1** (order 4, h=0.5)" in text


def test_dop853_in_vectors_makes_the_steps_of_dop853():
    problem = volterra(9)
    plain = next(m for m in c_peers(problem) if m.name == "DOP853 in C")
    one, other = (m.run(problem.start, 0.05, 20, 1, math.inf).states for m in (plain, dop853_in_vectors(problem)))
    assert np.abs(one - other).max() < 1e-13


# an eccentric orbit --------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_all_rows_of_the_eccentric_orbit_cover_the_same_physical_time():
    """Steps with a monitor are equal in fictitious time, so a period takes a varying number of steps; each row must
    still cover the same physical time.
    """
    periods = 3
    end = periods * eccentric.PERIOD
    trials = [
        (eccentric.monitored("splitting", 4, periods, 0).trial, 400),
        (eccentric.monitored("series", 4, periods, 0).trial, 200),
        (eccentric.monitored("gauss", 16, periods, 0).trial, 20),
        (eccentric.controlled(periods), 1e-9),
        (eccentric.gauss(16, periods), 20),
    ]
    for trial, setting in trials:
        row = trial(setting)
        assert end <= row.time < end + 0.03 * eccentric.PERIOD, row.method
        assert row.worst < 1e-2, row.method
        assert row.seconds > 0
        assert row.steps > 20 * periods


def test_heyoka_covers_the_same_physical_time():
    pytest.importorskip("heyoka")
    row = eccentric.taylor(3)(1e-10)
    assert row.time == 3 * eccentric.PERIOD
    assert row.worst < 1e-6


# tables in the page --------------------------------------------------------------------------------------------------


def test_a_table_replaces_what_stands_between_its_markers():
    begin, end = document.markers("steps")
    text = document.replaced(f"before\n{begin}\nold\n{end}\nafter", "steps", "new\n")
    assert text == f"before\n{begin}\n\nnew\n\n{end}\nafter"
    with pytest.raises(LookupError, match="no place for growth"):
        document.replaced(text, "growth", "new")


def test_the_document_has_a_place_for_every_table():
    names = [f"work-{p.name}" for p in PROBLEMS]
    for name in (*names, "summary", "machine", "steps", "ensembles", "growth", "build", "lattices", "eccentric",
                 "gradients", "sharing", "devices", "pullbacks", "pullbacks-members",
                 "pullbacks-lattices"):  # fmt: skip
        document.replaced(document.page(name).read_text(encoding="utf-8"), name, "")


@pytest.mark.slow
def test_all_methods_follow_the_same_planets(monkeypatch):
    """Ten years after the same start, all methods agree on the positions of the planets, including those of other
    packages if they are installed.
    """
    monkeypatch.setattr(planets, "PHIGEN", [m for m in planets.PHIGEN if m[1].startswith("aba") and m[3] == 10])
    masses, q, v, gm = planets.planets()
    contestants = [*planets.phigen_methods(masses, q, v), *planets.rebound_methods(masses, q, v, gm, print)]
    ends = [c.advance(round(planets.DECADE / c.step)) for c in contestants]
    for positions, velocities in ends:
        np.testing.assert_allclose(positions, ends[0][0], rtol=0, atol=1e-5)
        assert abs(planets.energy(masses, positions, velocities, gm) / planets.energy(masses, q, v, gm) - 1) < 1e-11
    assert np.abs(masses @ ends[0][0]).max() < 1e-13
