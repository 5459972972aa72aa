"""The choice that `phigen tune` makes, for synthetic measurements; and the lines that it prints compile to the code
that was measured.
"""

import math
import multiprocessing
import re
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support import NAMES, compile_text, compiled, described, plain, slow_but

from phigen import resources, spec
from phigen.compiler import compile_spec, emit
from phigen.errors import CheckError
from phigen.realisations.catalogue import realise
from phigen.spec.names import NEAR_INTEGRABLE
from phigen.targets.header import split
from phigen.tuning import search
from phigen.tuning.building import Built, Refusal, build, build_all
from phigen.tuning.problem import ROUNDING, SINGLE_ROUNDING, SystemProblem
from phigen.tuning.references import agreed, orbit_error
from phigen.tuning.search import Curve, cheapest_step, proposals, scan, step_for
from phigen.tuning.settings import GAUSS, OWN, SPLITTING, Setting, charts, own_setting, variants
from phigen.tuning.study import Finalist, Tuning, automatic, confirmed, ranking
from phigen.tuning.timing import nanoseconds_per_step
from phigen.tuning.trials import MARKS, Point, energy_measure, marks, orbit_measure
from phigen.tuning.tuner import TimeBudget, expected_seconds

SPECS = resources.bundled_specs()


def method(order, constant=1.0, nanoseconds=100.0, floor=1e-15, most=math.inf, asked=None):
    """Return a function that measures a fictitious method with the error constant·h^order. It appends each step size to
    ``asked``, and returns None for steps larger than ``most``.
    """

    def measure(h):
        if asked is not None:
            asked.append(h)
        error = max(constant * h**order, floor)
        return Point(h, error, error, 100.0, nanoseconds) if h <= most else None

    return measure


def points(order, steps, **constants):
    return tuple(method(order, **constants)(h) for h in steps)


# -- choice of the step size


@pytest.mark.parametrize("order", [2, 4, 8])
@pytest.mark.parametrize("accuracy", [1e-3, 1e-6, 1e-9])
def test_step_is_found_between_measured_ones_and_beyond(order, accuracy):
    exact = accuracy ** (1 / order)
    ladder = points(order, [3 * exact / 2**k for k in range(6)])
    assert step_for(ladder, accuracy, order) == pytest.approx(exact, rel=1e-6)
    coarse = points(order, [5 * exact, 3 * exact, 2 * exact])
    assert step_for(coarse, accuracy, order) == pytest.approx(exact, rel=1e-6)


def test_coarse_step_that_is_accurate_by_chance_is_not_trusted():
    ladder = list(points(4, [1, 0.5, 0.25, 0.125, 0.0625]))
    ladder[0] = replace(ladder[0], error=1e-9)
    assert step_for(ladder, 1e-3, 4) == pytest.approx(1e-3**0.25, rel=1e-6)
    assert step_for(ladder[:3], 1e-8, 4) == pytest.approx(1e-2, rel=1e-6)


def test_accuracy_below_the_rounding_cannot_be_reached():
    ladder = points(6, [0.5**k for k in range(12)], floor=3e-13)
    assert search.at_floor(ladder)
    assert step_for(ladder, 1e-13, 6) is None
    assert step_for(ladder, 4e-13, 6) is not None
    assert Curve("a", 6, ladder).cost(1e-13) == math.inf
    expected = [replace(p, rounding=1e-12) for p in points(6, [0.1, 0.07])]
    assert step_for(expected, 1e-13, 6) is None
    assert step_for(expected, 1e-11, 6) is not None


def test_errors_at_the_floor_of_single_precision_are_rounding():
    ladder = points(4, [0.5**k for k in range(9)], floor=4e-7)
    assert not search.at_floor(ladder)
    single = [replace(p, unit=SINGLE_ROUNDING) for p in ladder]
    assert search.at_floor(single)
    assert step_for(single, 1e-8, 4) is None
    assert not search.at_floor(single[:5])


def test_smaller_step_wins_where_its_iterations_are_fewer():
    ladder = [Point(h, h**4, h**4, 1.0, 300.0 if h > 0.3 else 100.0) for h in (1.0, 0.7, 0.5, 0.35, 0.25, 0.18)]
    step, cost = cheapest_step(ladder, 0.1, 4)
    assert (step, cost) == (0.25, 400.0)
    assert cheapest_step(ladder, 1e-12, 4)[0] == pytest.approx(1e-3)


def test_scan_finds_the_step_and_the_largest_that_can_be_made():
    asked = []
    points = scan(method(6, most=1.3, asked=asked), 0.01, 50.0, 1e-8, 6)
    assert 1.3 / search.FINER < points[0].step <= 1.3
    assert cheapest_step(points, 1e-8, 6)[0] == pytest.approx(1e-8 ** (1 / 6), rel=0.05)
    assert [p.step for p in points] == sorted((p.step for p in points), reverse=True)
    assert len(asked) < 35
    assert scan(method(6), 0.01, 0.5, 1e-8, 6)[0].step == 0.5
    assert scan(method(2, most=0.0), 0.1, 1.0, 1e-3, 2) == ()


def test_scan_stops_where_it_would_cost_too_much_and_when_time_is_up():
    asked = []
    scan(method(2, asked=asked), 1.0, 2.0, 1e-12, 2, worth=1e4)
    assert len(asked) < 12
    asked.clear()
    scan(method(2, asked=asked), 1.0, 2.0, 1e-12, 2, patience=lambda: len(asked) < 5)
    assert len(asked) == 5


def test_scan_goes_on_to_cheaper_smaller_steps():
    def measure(h):
        return Point(h, h**4, h**4, 1.0, 300.0 if h > 0.02 else 60.0)

    step, _ = cheapest_step(scan(measure, 0.1, 1.0, 1e-5, 4), 1e-5, 4)
    assert 0.01 < step <= 0.02


@pytest.mark.parametrize(("step", "short"), [(0.70913, 0.709), (1.0, 1.0), (0.001, 0.001), (123456.0, 123000.0)])
def test_proposed_step_has_few_digits_and_is_not_larger(step, short):
    assert search.rounded_down(step) == short


# -- choice of the candidates


def model(setting):
    """Return the cost of a setting for a fictitious system: the best is order 10 of cayley without gauge."""
    base = {"exponential": 3.0, "cayley": 2.0, "karasev": 40.0}[setting.kind] * (1 + 0.08 * (setting.order - 10) ** 2)
    return base * (0.7 if setting.gauge == "none" else 1.0) * (1 if setting.composition == "none" else 6)


def searched(start, refusing=lambda setting: False):
    """Return the settings that a search tries with the costs of `model`, and those that are refused."""
    tried, refused = {}, []
    while start:
        for s in start:
            if refusing(s):
                refused.append(s)
            else:
                error = 1e-9
                point = Point(1.0, error, error, 1.0, model(s))
                tried[s] = Curve(s.kind, s.order, (point,), s, gauged=True)
        start = [s for s in proposals(tried, refused, 1e-8) if s not in tried and s not in refused]
    return tried, refused


def test_search_climbs_to_the_best_order_and_tries_it_without_gauge():
    tried, _ = searched([Setting(kind, 4) for kind in ("exponential", "cayley", "karasev")])
    assert min(tried, key=model) == Setting("cayley", 10, gauge="none")
    assert len(tried) < 24
    assert [s.order for s in tried if s.kind == "karasev"] == [4]  # much slower, so higher orders are not tried
    assert {s.composition for s in tried} > {"none"}


def test_search_ends_at_orders_that_are_refused_and_tries_none_twice():
    asked = []

    def refusing(setting):
        asked.append(setting)
        return setting.order > 6

    tried, _ = searched([Setting("cayley", 4)], refusing)
    assert max(s.order for s in tried) == 6
    assert len(asked) == len(set(asked))


def test_search_goes_down_where_high_orders_do_not_pay():
    tried = {
        Setting("cayley", order): Curve("cayley", order, points(2, [1.0], nanoseconds=cost), Setting("cayley", order))
        for order, cost in ((4, 100.0), (6, 200.0))
    }
    assert Setting("cayley", 2) in proposals(tried, [], 2.0)
    assert Setting("cayley", 8) not in proposals(tried, [], 2.0)


def test_where_nothing_reaches_the_accuracy_the_search_goes_up():
    ladder = points(4, [0.5**k for k in range(12)], floor=1e-10)
    tried = {Setting("cayley", k): Curve("cayley", k, ladder, Setting("cayley", k)) for k in (4, 6)}
    assert Setting("cayley", 8) in proposals(tried, [], 1e-12)


def test_expected_time_of_building_grows_as_that_of_lower_orders_did():
    curves = [Curve("cayley", k, (), Setting("cayley", k), seconds=s) for k, s in ((4, 1.0), (6, 4.0))]
    assert expected_seconds(Setting("cayley", 8), curves) == pytest.approx(16.0)
    assert expected_seconds(Setting("exponential", 8), curves) == 0.0
    split = [Curve("splitting", 4, (), Setting(SPLITTING, 4, composition="auto"), seconds=3.0)]
    assert expected_seconds(Setting(SPLITTING, 8, composition="auto"), split) == 3.0


def test_of_equally_cheap_methods_the_lowest_order_comes_first():
    def finalist(order, cost, stages=1):
        return Finalist(Curve("a", order, (), stages=stages), points(2, [1.0])[0], (cost, cost, 9.0))

    ranked = ranking([finalist(10, 1.0), finalist(6, 1.04), finalist(4, 1.03, 5), finalist(2, 1.2), finalist(8, 1.01)])
    assert [f.curve.order for f in ranked] == [6, 10, 8, 4, 2]
    assert ranking([]) == []
    gauged, plain = (
        Finalist(Curve("a", 6, (), gauged=g), points(2, [1.0])[0], (1.0 - 0.01 * g,)) for g in (True, False)
    )
    assert ranking([gauged, plain]) == [plain, gauged]


def tuner_of(grows, budget=1e6):
    """Return the result of a search with one method of order 4, and a tuner. Over the horizon, the error of the method
    is ``grows`` times that in a scan.
    """
    curve = Curve("a", 4, points(4, [0.5**k for k in range(8)]), Setting("a", 4))

    def measure(method, h, span):
        return replace(points(4, [h], constant=grows if span > 100 else 1.0)[0], time=span)

    return curve, SimpleNamespace(
        accuracy=1e-6, methods={curve.key: None}, measures={True: measure}, piece=100.0, referring=False,
        problem=SimpleNamespace(horizon=1e4), clock=TimeBudget(budget),
    )  # fmt: skip


def test_choice_of_the_model_is_compared_with_what_was_measured():
    ladder = [0.5**k for k in range(12)]
    by_kind = {kind: Setting(kind, 4, "none") for kind in ("constant", "splitting", "gauss")}
    curves = tuple(
        Curve(kind, 4, points(4, ladder, nanoseconds=cost), by_kind[kind])
        for kind, cost in (("constant", 100.0), ("splitting", 50.0), ("gauss", 300.0))
    )
    tuning = Tuning("energy", 1e-8, 10.0, 10.0, curves, (), None, None, automatic="series")
    assert tuning.automatic_ratio == pytest.approx(2.0)
    assert replace(tuning, automatic="gauss").automatic_ratio == pytest.approx(6.0)
    best = [Finalist(curves[0], curves[0].points[0])]
    assert automatic(compiled("henon_heiles", 4), best) == "splitting"
    assert automatic(compiled("henon_heiles", 4), []) == ""


@pytest.mark.parametrize("grows", [1.0, 2.0, 5.0])
def test_step_that_misses_the_accuracy_over_the_horizon_is_reduced(grows):
    curve, tuner = tuner_of(grows)
    point = confirmed(tuner, curve)
    assert point.time == 1e4
    assert 0.3e-6 < point.error <= 1e-6


def test_what_never_reaches_the_accuracy_over_the_horizon_is_not_proposed():
    curve, tuner = tuner_of(1e6)
    assert confirmed(tuner, curve) is None


def test_run_that_the_budget_does_not_allow_is_confirmed_over_a_part():
    curve, tuner = tuner_of(1.0, budget=2e-2)
    assert 100.0 <= confirmed(tuner, curve).time < 1e4


# -- errors for longer runs


class Drifting:
    """Fictitious method: the first coordinate of the state is 1 + rate·t + wobble·sin²t."""

    rounding = ROUNDING

    def __init__(self, rate=0.0, wobble=0.0):
        self.rate, self.wobble = rate, wobble

    def rows(self, h, steps, stride):
        t = h * np.append(np.arange(0, steps, stride), steps)
        return np.column_stack([1 + self.rate * t + self.wobble * np.sin(t) ** 2, np.zeros_like(t)])

    def walk(self, h):
        return lambda steps: None


def oscillator(horizon):
    system = compiled("harmonic_oscillator", 2).system
    values = {p.name: 1.0 for p in system.parameters}
    return SystemProblem(np.array([1.0, 0.0]), values, 0.1, horizon, system=system)


def test_bounded_energy_error_is_that_of_the_horizon_and_drift_is_extrapolated():
    problem = oscillator(1e6)
    bounded = energy_measure(problem)(Drifting(wobble=1e-6), 0.1, 100.0)
    assert bounded.error == pytest.approx(bounded.measured, rel=1e-3)
    drifting = energy_measure(problem, bounded=False)(Drifting(rate=1e-9), 0.1, 100.0)
    assert drifting.error == pytest.approx(1e4 * drifting.measured, rel=0.2)
    steady = energy_measure(problem, bounded=False)(Drifting(wobble=1e-6), 0.1, 100.0)
    assert steady.error == pytest.approx(steady.measured, rel=1e-3)


def test_rounding_grows_like_the_square_root_of_the_number_of_steps():
    point = energy_measure(oscillator(1e6))(Drifting(), 0.1, 100.0)
    assert 3e-13 < point.error < 1e-12


def test_orbit_error_is_extrapolated_linearly():
    def solution(spacing, count):
        return np.column_stack([np.ones(count + 1), np.zeros(count + 1)])

    point = orbit_measure(oscillator(1e4), solution)(Drifting(rate=1e-9), 0.1, 100.0)
    assert point.measured == pytest.approx(1e-7, rel=0.03)
    assert point.error == pytest.approx(1e-5, rel=0.03)
    assert point.growth == pytest.approx(1.0, abs=0.02)


class Learning:
    """Fictitious method with steps of 100 ns. After 96 steps, calls of at least 1000 steps change to steps of 25 ns.
    Each call takes 2 µs in addition.
    """

    def __init__(self, clock):
        self.clock = clock

    def walk(self, h):
        steps_done, fast = 0, False

        def make(steps):
            nonlocal steps_done, fast
            slow = 0 if fast else min(steps, max(0, 96 - steps_done))
            fast = fast or steps - slow >= 1000
            steps_done += steps
            self.clock[0] += 2e-6 + 100e-9 * steps - 75e-9 * (steps - slow) * fast

        return make


@pytest.mark.parametrize(("steps", "nanoseconds"), [(20, 100), (500, 100), (10**4, 26), (10**7, 25)])
def test_time_of_a_step_is_that_of_a_whole_run_without_the_call(monkeypatch, steps, nanoseconds):
    clock = [0.0]
    monkeypatch.setattr(time, "thread_time", lambda: clock[0])
    assert nanoseconds_per_step(Learning(clock), 0.1, steps) == pytest.approx(nanoseconds, rel=0.1)


def test_orbit_is_compared_at_the_times_of_its_own_steps():
    stride, count = marks(1000.0, 0.7)
    assert 0.7 * stride * count <= 1000.0
    assert 0.7 * stride * (count + 1) > 1000.0
    states = Drifting(rate=1e-9).rows(0.7, stride * count, stride)
    error = orbit_error(states, 0.7 * stride, Drifting(), 0.1, 1.0)
    assert error == pytest.approx(0.7e-9 * stride * count)


def test_orbit_error_that_grows_faster_than_linearly_is_extrapolated_so():
    class Rounding(Drifting):
        def rows(self, h, steps, stride):
            t = h * np.append(np.arange(0, steps, stride), steps)
            return np.column_stack([1 + 1e-13 * t**1.5, np.zeros_like(t)])

    def solution(spacing, count):
        return np.column_stack([np.ones(count + 1), np.zeros(count + 1)])

    point = orbit_measure(oscillator(1e4), solution)(Rounding(), 0.1, 100.0)
    assert point.error == pytest.approx(1e-13 * 1e4**1.5, rel=0.1)


def test_references_that_disagree_are_no_reference():
    reference = agreed(Drifting(), Drifting(rate=1e-12), 0.1, 100.0, 1e-8, 1.0)
    assert reference.uncertainty == pytest.approx(1e-10)
    assert reference(0.5, MARKS).shape == (MARKS + 1, 2)
    with pytest.raises(CheckError, match=r"must agree, but at t = 20[^ ]* of 100 the two"):
        agreed(Drifting(), Drifting(rate=1e-10), 0.1, 100.0, 1e-8, 1.0)


# -- settings and their lines in a spec


def pasted(source, lines):
    """Return the text of a spec in which ``lines`` replace the lines with the same keys."""
    keys = "|".join(["terms", *(line.split(":")[0] for line in lines)])
    return re.sub(rf"(?m)^({keys}):.*\n(?:[ \t]+.*\n)*", "", source) + "\n".join(lines) + "\n"


CASES = [
    ("rigid_body", Setting("cayley", 6)),
    ("rigid_body", Setting("exponential", 4, composition="suzuki")),
    ("rigid_body", Setting("exponential", 4, gauge="none")),
    ("henon_heiles", Setting("canonical-euler", 1)),
    ("henon_heiles", Setting(SPLITTING, 6, "none", "auto")),
    ("henon_heiles", Setting("constant", 5)),
    ("nambu_pendulum", Setting("karasev", 6)),
    ("lotka_volterra", Setting("log-canonical", 6, gauge=OWN)),
    ("pendulum_euler", Setting(OWN, 2)),
]


@pytest.mark.thin(3)
@pytest.mark.parametrize(
    ("name", "setting"), slow_but(CASES[::2], CASES), ids=[f"{n}-{s.described()}" for n, s in CASES]
)
def test_lines_of_a_setting_compile_to_what_was_measured(name, setting):
    specification = spec.load(SPECS / f"{name}.yaml")
    candidate = build(specification, compiled(name).system, setting)
    lines = replace(setting, order=candidate.order).lines()
    again = spec.loads(pasted(specification.source, lines), f"{name}.yaml")
    applied = setting.applied(specification)
    assert (again.gauge, again.composition, again.scheme) == (applied.gauge, applied.composition, applied.scheme)
    copy = emit(compile_spec(again).program, "c", "phigen build")
    assert code_of(candidate.files) == code_of(copy)


def code_of(files):
    """Return the generated code without the headers of files and without the hash of the spec."""
    return [re.sub(r"[0-9a-f]{64}", "", split(text)[1]) for _, text in sorted(files.items())]


@pytest.mark.parametrize("name", NAMES)
def test_own_setting_names_the_bi_realisation_of_the_spec(name):
    specification, system, realisation = described(name)
    plain_choice = replace(plain(specification), order=4, terms=None)
    choice = specification.birealisation
    kind = realisation.kind if choice.kind not in ("custom", "group-map", "spray") and choice.side == "q" else OWN
    again = realise(system, Setting(kind, 4).applied(plain_choice).birealisation)
    assert (again.alpha, again.beta, again.path) == (realisation.alpha, realisation.beta, realisation.path)


def test_charts_leave_out_what_needs_formulas_and_start_with_those_that_are_built_quickly():
    own_choice = own_setting(compiled("rigid_body", 6))
    settings = charts(compiled("rigid_body").system, own_choice)
    assert {s.kind for s in settings[:4]} == {SPLITTING, GAUSS}
    assert settings[4:6] == [replace(own_choice, order=4), replace(own_choice, order=8)]
    kinds = {s.kind for s in settings}
    assert "cayley" in kinds
    assert SPLITTING in kinds
    assert kinds & {"custom", "group-map", "spray", "auto", "karasev"} == set()
    assert "karasev" in {s.kind for s in charts(compiled("lotka_volterra").system, Setting("log-canonical", 2))}


@pytest.mark.parametrize(("eps", "tried"), [("0.001", True), ("0.5", False)])
def test_charts_try_methods_for_small_perturbations_where_there_is_one(eps, tried):
    text = "coordinates: [x, y, px, py]\npoisson: {canonical: {q: [x, y], p: [px, py]}}\nscheme: splitting\n"
    compilation = compile_text(text + f"hamiltonian: (px**2 + py**2)/2 - 1/sqrt(x**2 + y**2) - {eps}*x**2\n", 4)
    names = [
        s.composition for s in charts(compilation.system, own_setting(compilation)) if s.composition in NEAR_INTEGRABLE
    ]
    offered = ["saba-8-2", "wisdom-holman-17", "wisdom-holman-modified-17", "aba-8-4", "aba-10-6-4"]
    assert names == (offered if tried else [])
    for setting in charts(compilation.system, own_setting(compilation)):
        if setting.composition in NEAR_INTEGRABLE:
            again = compile_spec(setting.applied(compilation.spec))
            assert (again.program.step.composition, again.order.order) == (setting.composition, setting.order)


def test_variants_compose_symmetric_methods_only():
    assert variants(Setting("constant", 8), False, True) == [Setting("constant", 8, composition="kahan-li")]
    assert variants(Setting("constant", 2), False, True) == [Setting("constant", 4, composition="suzuki")]
    assert variants(Setting(SPLITTING, 8), False, True) == []
    assert variants(Setting("canonical-euler", 2), False, False) == []


# -- building candidates


def test_inapplicable_settings_are_reported_and_slow_ones_stopped():
    specification, system, _ = described("henon_heiles")
    outcomes = dict(
        build_all(specification, system, [Setting("cayley", 4), Setting("constant", 2)], time.perf_counter() + 600)
    )
    assert outcomes[Setting("cayley", 4)].inapplicable
    assert isinstance(outcomes[Setting("constant", 2)], Built)
    specification, system, _ = described("spin_chain5")
    ((_, late),) = build_all(specification, system, [Setting("exponential", 6)], time.perf_counter() + 0.5)
    assert isinstance(late, Refusal)
    assert "no time" in late.reason
    assert multiprocessing.active_children() == []
