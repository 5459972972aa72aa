"""Random systems and lattices against independent equations, differences, and all targets.

`--random N` draws N of each kind, from the seed `--seed S` on: `pytest tests/random -k lattice --random 1 --seed 17` is
one lattice. A failure prints the smallest spec that still fails, and a script that shows both sides. In tests/,
`python -m differential lattice 0:1000` goes through many without pytest.
"""

from __future__ import annotations

import pytest
from differential.suites import SUITES

from phigen.runtime.gradients import Pullback
from phigen.runtime.solver import Solver

#: How many of each kind `make test-all` draws.
ALL = 50
#: Those of `make test`, which take half a second or so each: steps by Newton's method, by flows, and two by Gauss
#: collocation; of lattices the second has one part, and the third is a series.
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
