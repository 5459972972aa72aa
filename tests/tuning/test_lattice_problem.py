"""Lattices in `phigen tune`: the search is the same as for other systems; the fields of all sites form one state
vector.
"""

import time
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from phigen import spec as specs
from phigen.api import lattice_solver_of
from phigen.compiler import compile_spec
from phigen.tuning import lattice_problem, study
from phigen.tuning.building import Built, build
from phigen.tuning.problem import Classical
from phigen.tuning.scales import fastest_rate
from phigen.tuning.settings import OWN, SPLITTING, Setting, own_setting
from phigen.tuning.timing import nanoseconds_per_step
from phigen.tuning.trials import energy_measure
from phigen.tuning.tuner import TimeBudget

CHAIN = """phigen: 1
name: chain
lattice: {axes: [i], boundary: periodic}
coordinates: [q, p]
parameters: {m: {value: 1 + i/N_i, at: sites, positive: true}, a: 0.5}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: "p**2/(2*m) + (q[i+1] - q)**2/2 + a*q**4/4"
order: 4
runs: {wave: {sizes: [24], initial: {q: sin(2*pi*i/N_i), p: 0}, step: 0.05, steps: 2000}}
"""
KDV = """phigen: 1
name: kdv
lattice: {axes: [i], boundary: periodic}
coordinates: [u]
poisson: {brackets: {u: {"u[i+1]": 1/2}}}
hamiltonian: -u**3/6 + (u[i+1] - u)**2/2
scheme: series
order: 4
"""


@pytest.fixture(autouse=True)
def in_numpy(monkeypatch):
    monkeypatch.setattr(
        lattice_problem, "lattice_solver_of", lambda compilation: lattice_solver_of(compilation, "numpy")
    )
    monkeypatch.setattr("phigen.tuning.building.chosen_target", lambda target: "numpy")


@cache
def compiled():
    return compile_spec(specs.loads(CHAIN))


def problem(sizes=(24,), **settings):
    run = compiled().spec.runs["wave"]
    run = replace(run, lattice=replace(run.lattice, sizes=sizes))
    return lattice_problem.lattice_problem(compiled(), run, settings, 0.05, 10.0, 1.0)


def candidate(setting_problem):
    return setting_problem.method(lattice_solver_of(compiled(), "numpy").backend)


def test_errors_of_the_energy_fall_with_the_order_in_units_of_the_sites():
    chain = problem()
    coarse, fine = (energy_measure(chain)(candidate(chain), h, 10.0).measured for h in (0.2, 0.1))
    assert np.log2(coarse / fine) == pytest.approx(4, abs=0.5)
    x = chain.start.reshape(2, 24)
    density = lattice_solver_of(compiled(), "numpy").density(x, parameters=chain.parameters)
    assert chain.unit.size == pytest.approx(np.abs(density).sum())
    assert problem(a=0.7).parameters["a"] == 0.7


def test_classical_methods_follow_the_same_motion():
    chain = problem()
    initial = chain.start.copy()
    raced = chain.classical(compiled(), ["rk4", "dop853"], initial)
    ours = candidate(chain).rows(0.02, 50, 50)[-1]
    theirs = [Classical(raced.runners[name], initial, chain).rows(0.02, 50, 50)[-1] for name in ("rk4", "dop853")]
    assert np.abs(theirs[1] - ours).max() < 1e-7 < np.abs(chain.start - ours).max()
    assert np.abs(theirs[0] - theirs[1]).max() < 1e-7


def test_the_fastest_rate_of_many_sites_is_found_without_all_eigenvalues():
    omega = np.linspace(0.1, 3.0, 200)
    x = np.zeros((1, 400))

    def field(states):
        q, p = states[:, :200], states[:, 200:]
        return np.hstack([omega * p, -omega * q])

    assert fastest_rate(field, x) == pytest.approx(3.0, rel=0.15)


def test_large_grids_are_measured_on_fewer_sites_where_their_start_is_known():
    reduced = problem((60_000,))
    assert reduced.whole == (60_000,)
    assert reduced.sizes[0] <= lattice_problem.MOST_SITES
    assert reduced.start.reshape(2, -1).shape[1] == reduced.sizes[0]
    assert reduced.most_rows * len(reduced.start) <= 1.1 * lattice_problem.MOST_NUMBERS


def test_settings_of_lattices_mean_what_is_built():
    own_choice, candidate_built = own_setting(compiled()), None
    assert own_choice.is_splitting
    assert {s.kind for s in problem().guesses(own_choice)} >= {"constant", "cayley", SPLITTING}
    for setting in (Setting(SPLITTING, 6, "none", "auto"), Setting("constant", 6, OWN, "auto")):
        candidate_built = build(compiled().spec, None, setting)
        assert isinstance(candidate_built, Built)
        assert (candidate_built.order, candidate_built.stages > 1, candidate_built.exact) == (6, True, True)
        lines = "\n".join(setting.lines())
        again = compile_spec(specs.loads(CHAIN.replace("order: 4\n", f"{lines}\n")))
        assert (again.label, again.order.order) == (candidate_built.kind, 6)
    series = own_setting(compile_spec(specs.loads(KDV)))
    assert (series.kind, series.composition, series.lines()[0]) == ("auto", "auto", "scheme: series")


def test_used_up_budget_leaves_only_the_setting_of_the_spec(monkeypatch):
    """If the time budget is used up, the setting of the spec is measured at one step, confirmed and timed once. No
    other candidate and no classical method is measured.
    """
    clock, timed, lattice_run = TimeBudget(1.0, time.perf_counter() - 100.0), [], problem()

    def counted(method, h, steps):
        timed.append(h)
        return nanoseconds_per_step(method, h, steps)

    monkeypatch.setattr(study, "nanoseconds_per_step", counted)
    tuning = study.tune(compiled(), lattice_run, "energy", 1e-2, clock)
    assert [curve.setting for curve in tuning.curves] == [own_setting(compiled())]
    assert (len(tuning.curves[0].points), len(tuning.finalists), tuning.peers, tuning.present) == (1, 1, (), None)
    assert len(timed) == 1


def test_the_energy_of_a_lattice_is_examined_at_a_bounded_number_of_states():
    assert problem().most_rows == lattice_problem.LATTICE_ROWS
