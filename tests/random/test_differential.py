"""Random systems and lattices, compared with independently derived equations of motion, with finite differences, and
across all targets.

`--random N` draws N systems of each kind, with seeds from that of `--seed S` on. For example, `pytest tests/random -k
lattice --random 1 --seed 17` tests one lattice. A failure prints the smallest spec that still fails, and a script that
shows both results. In tests/, `python -m differential lattice 0:1000` tests a thousand lattices without pytest.
"""

from __future__ import annotations

import pytest
from differential.suites import SUITES

from phigen.runtime.gradients import Pullback
from phigen.runtime.solver import Solver

#: Number of systems of each kind in `make test-all`.
ALL = 50
#: Seeds in `make test`; each system takes about half a second. Ordinary systems: steps by Newton's method, by
#: splitting, and two by Gauss collocation. The second lattice has one part, and the third has the scheme series.
QUICK = {"ordinary": (0, 7, 12, 80), "lattice": (4, 7, 5)}


def pytest_generate_tests(metafunc):
    if "seed" not in metafunc.fixturenames:
        return
    asked, drawn = metafunc.config.option, []
    for kind in SUITES:
        seeds = range(asked.seed, asked.seed + (asked.random or ALL))
        quick = seeds if asked.random else QUICK[kind]
        drawn += [pytest.param(kind, s, marks=() if s in quick else pytest.mark.slow) for s in seeds]
    metafunc.parametrize(("kind", "seed"), drawn)


def test_everything_holds_for_a_random_system(kind, seed):
    outcome = SUITES[kind].outcome(seed)
    for failure in outcome.failures:
        print(f"{failure}\n")
    assert not outcome.failures, "; ".join(f"{f.check}: {f.message}" for f in outcome.failures)
    assert outcome.made, outcome.refused


@pytest.mark.slow
def test_a_wrong_gradient_is_found_in_a_small_system(monkeypatch):
    right = Solver.pullback

    def wrong(self, *arguments, **more):
        x1, x0_bar, parameters_bar = right(self, *arguments, **more)
        return Pullback(x1, x0_bar * (1 + 1e-6), parameters_bar)

    monkeypatch.setattr(Solver, "pullback", wrong)
    drawn = SUITES["ordinary"].draw(7, 0)
    (failure,) = (f for f in SUITES["ordinary"].outcome(7).failures if f.check == "gradient")
    assert "pullback and differences" in failure.message
    assert len(failure.system.terms) == 1 < len(drawn.terms)
    assert "s.pullback(" in failure.script
