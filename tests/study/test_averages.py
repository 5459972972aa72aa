"""Averages of observables along a run, with standard errors from the means of blocks of rows."""

import numpy as np
import pytest

import phigen
import phigen.spec
from phigen.study.averages import Averages


def autoregressive(rng, count, a):
    """Return ``count`` values of a random process with variance 1, in which values k rows apart have the correlation
    a^k.
    """
    noise = rng.normal(size=count) * np.sqrt(1 - a**2)
    values = np.empty(count)
    values[0] = rng.normal()
    for k in range(1, count):
        values[k] = a * values[k - 1] + noise[k]
    return values


def averages(values, **options):
    accumulator = Averages(1, **options)
    accumulator.see(np.arange(float(len(values))), values[:, np.newaxis])
    return accumulator


def test_moments_are_those_of_the_rows_however_they_come():
    rng = np.random.default_rng(1)
    rows, t = 1e6 + rng.normal(size=(1003, 3)), np.arange(1003.0)
    whole, pieces = Averages(3), Averages(3)
    whole.see(t, rows)
    for part in np.split(np.arange(1003), [1, 2, 7, 7, 500]):
        pieces.see(t[part], rows[part])
    for column, (one, other) in enumerate(zip(whole.results(), pieces.results(), strict=True)):
        assert one.mean == pytest.approx(rows[:, column].mean(), rel=1e-14)
        assert one.variance == pytest.approx(rows[:, column].var(ddof=1), rel=1e-9)
        assert (one.least, one.largest) == (rows[:, column].min(), rows[:, column].max())
        assert (other.mean, other.error) == pytest.approx((one.mean, one.error), rel=1e-9)
        assert other.correlation_time == pytest.approx(one.correlation_time, rel=1e-9)


@pytest.mark.parametrize("a", [0.0, 0.9])
def test_standard_errors_are_the_spread_of_means(a):
    """The mean of n rows has the variance (1 + a)/(1 − a)/n. The squares of the standard errors by blocks agree with
    this on average.
    """
    rng = np.random.default_rng(2)
    count, standard_errors = 4000, []
    for _ in range(60):
        (average,) = averages(autoregressive(rng, count, a)).results()
        standard_errors.append((average.error**2, average.correlation_time))
    error, time = np.mean(standard_errors, axis=0)
    ratio = (1 + a) / (1 - a)
    # The mean of 60 estimates; each has a relative spread of at most √(2/19), since it uses 20 blocks or more.
    assert error == pytest.approx(ratio / count, rel=0.15)
    assert time == pytest.approx(ratio / 2, rel=0.15)


def test_a_mean_without_blocks_would_be_too_sure():
    (average,) = averages(autoregressive(np.random.default_rng(3), 4000, 0.9)).results()
    assert average.error > 3 * np.sqrt(average.variance / 4000)


@pytest.mark.parametrize("blocks", [2, 5, 20])
def test_the_number_of_blocks_is_the_one_asked_for(blocks):
    accumulator = averages(np.random.default_rng(4).normal(size=1000), blocks=blocks)
    assert blocks <= len(accumulator.state["sums"]) < 2 * blocks
    assert len(accumulator.state["sums"]) * int(accumulator.state["size"]) <= 1000


@pytest.mark.parametrize("backwards", [False, True])
def test_rows_before_a_time_are_left_out(backwards):
    values = np.arange(10.0)[:, np.newaxis]
    t = -np.arange(10.0) if backwards else np.arange(10.0)
    accumulator = Averages(1, after=-6.0 if backwards else 6.0, backwards=backwards)
    accumulator.see(t, values)
    assert accumulator.results()[0].mean == pytest.approx(7.5)
    assert accumulator.times == (t[6], t[9])


def test_too_few_rows_are_no_numbers():
    assert np.isnan(Averages(1).results()[0].mean)
    (one,) = averages(np.ones(1)).results()
    assert one.mean == 1
    assert np.isnan(one.error)
    assert np.isnan(one.variance)


@pytest.mark.parametrize(
    ("end", "message"), [("steps: 20", "t = 2"), ("until: 1.5", "t = 1.5"), ("duration: 2", "t = 2")]
)
def test_averages_from_a_time_after_the_end_are_refused(end, message):
    text = (
        "phigen: 1\nname: o\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: p**2 + q**2\n"
        f"observables: {{o: q*p}}\nruns: {{r: {{initial: [1, 0], step: 0.1, {end}, average: {{after: AFTER}}}}}}\n"
    )
    with pytest.raises(phigen.SpecError, match=f"`after: 3` is not before the end of the run, {message}"):
        phigen.spec.loads(text.replace("AFTER", "3"))
    assert float(phigen.spec.loads(text.replace("AFTER", "1.5")).runs["r"].average.after) == 1.5


@pytest.mark.parametrize("h", [0.1, -0.1])
def test_averages_of_a_trajectory_from_a_time_after_its_end_are_refused(h):
    text = (
        "phigen: 1\nname: o\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: p**2 + q**2\n"
        "observables: {o: q*p}\n"
    )
    trajectory = phigen.compile(phigen.spec.loads(text), target="numpy").integrate([1, 0], h=h, steps=20)
    end = trajectory.t[-1]
    with pytest.raises(ValueError, match=f"after = {1.5 * end:g} is not before the end of the trajectory, t = {end:g}"):
        phigen.averages(trajectory, after=1.5 * end)
    assert phigen.averages(trajectory, after=end)["o"].mean == trajectory.observables["o"][-1]


@pytest.mark.parametrize(("a", "resolved"), [(0.0, True), (0.9, True), (0.999, False)])
def test_blocks_tell_whether_they_are_longer_than_the_correlation_time(a, resolved):
    """A block of 128 rows is longer than the integrated correlation times of 0.5 and 9.5 rows, and shorter than the one
    of 1000 rows.
    """
    (average,) = averages(autoregressive(np.random.default_rng(5), 4000, a)).results()
    assert average.resolved is resolved


@pytest.mark.parametrize("count", [12, 39, 1000])
def test_an_observable_slower_than_the_run_is_not_resolved(count):
    (average,) = averages(np.cos(np.linspace(0, 1, count))).results()
    assert not average.resolved


def test_a_conserved_observable_needs_no_blocks():
    (average,) = averages(3 + 1e-9 * np.cos(np.linspace(0, 1, 100))).results()
    assert average.resolved


def test_averages_of_a_trajectory_and_of_a_series_are_those_of_their_rows():
    text = """phigen: 1
name: chain
lattice: {axes: [i]}
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + (q[i+1] - q)**2/2
observables: {heat: {mean: p**2}, local: q}
order: 2
runs: {r: {initial: {q: sin(i), p: 0}, sizes: [6], step: 0.1, steps: 90, stride: 2, record: [heat, energy]}}
"""
    solver = phigen.compile(phigen.spec.loads(text), target="numpy")
    series = solver.run()
    start = np.stack([np.sin(np.arange(6.0)), np.zeros(6)])
    trajectory = solver.integrate(start, 0.1, 90, stride=2)
    of_series, of_trajectory = (phigen.averages(one, after=2.0, blocks=4) for one in (series, trajectory))
    assert list(of_trajectory) == ["heat"]
    heat = trajectory.observables["heat"][trajectory.t >= 2 - 1e-12]
    assert of_trajectory["heat"].mean == pytest.approx(heat.mean(), rel=1e-12)
    assert of_series["heat"].mean == pytest.approx(heat.mean(), rel=1e-12)
    assert of_series["heat"].error == pytest.approx(of_trajectory["heat"].error, rel=1e-9)
    assert of_series["energy"].variance < 1e-3
