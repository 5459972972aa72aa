"""A benchmark with a broken peer is worthless: the peers have their stated orders, and the harness runs."""

import math
from functools import cache

import numpy as np
import pytest
from systems import slow_but

pytest.importorskip("scipy")

from benchmarks import lattices, tables
from benchmarks.measure import Cell, Judge, Study, run
from benchmarks.problems import PROBLEMS
from benchmarks.solvers import Method, build_phigen, c_peers, phigen_method, reference

BODY = PROBLEMS[0]


@cache
def body_after(horizon: float, chunks: int) -> np.ndarray:
    return reference(BODY, horizon, chunks)[0]


def observed_order(method: Method) -> float:
    # Coarse enough for methods of order 8 to stay above round-off.
    h, chunks = (0.5, 4) if method.order > 4 else (0.1, 4)
    exact = body_after(16 * h, chunks)
    coarse, fine = (method.run(BODY.start, h / k, 4 * k, chunks, math.inf) for k in (1, 2))
    errors = [np.abs(r.states - exact).max() for r in (coarse, fine)]
    return math.log2(errors[0] / errors[1])


@pytest.mark.parametrize("method", c_peers(BODY), ids=lambda m: m.name)
def test_a_peer_has_its_order_on_the_rigid_body(method):
    assert observed_order(method) > method.order - 0.5


@pytest.mark.parametrize("problem", slow_but(PROBLEMS[:1], PROBLEMS), ids=lambda p: p.name)
def test_all_peers_solve_the_same_system(problem):
    h = problem.typical / 20
    exact, uncertainty = reference(problem, 100 * h, 2)
    assert uncertainty < 1e-11
    for method in c_peers(problem):
        done = method.run(problem.start, h, 50, 2, math.inf)
        assert done.status == "ok"
        assert np.abs(done.states - exact).max() < (1e-2 if method.order == 2 else 1e-5), method.name


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


def test_kernels_of_lattices_by_hand_make_the_steps_of_the_generated_ones():
    """Another order of the parts, a wrong sign or angle: the comparison would mean nothing."""
    for sites, size in ((lattices.XXZ, 16), (lattices.CUBE, 4)):
        by_hand = lattices.Kernel(sites, size, True).method(0)
        lattices.expect_same(lattices.ours(sites.solver(2)), by_hand, sites.start(size))


@pytest.mark.parametrize("sites", [lattices.XXZ, lattices.FPUT, lattices.DNLS], ids=lambda s: s.name)
def test_peers_of_lattices_have_their_orders(sites):
    x, kernel = sites.start(16), lattices.Kernel(sites, 16, False)
    exact = lattices.ours(sites.solver(8))(x, 0.01, 100)[0]
    for index, order, h in ((0, 4, 0.05), (1, 8, 0.25)):
        coarse, fine = (np.abs(kernel.method(index)(x, h / k, round(k / h))[0] - exact).max() for k in (1, 2))
        assert math.log2(coarse / fine) > order - 0.7
