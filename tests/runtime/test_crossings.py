"""Poincaré sections: crossings compared with closed forms, and properties of crossings for every kind of step."""

from itertools import product

import numpy as np
import pytest
from scipy.special import ellipj, ellipk
from support import BODY, TARGETS, compile_text, compiled, setting, slow_but, solver

from phigen import solve_ivp
from phigen.errors import StepError
from phigen.runtime.crossings import CrossingFinder, root
from phigen.runtime.ending import where_zero

pytestmark = pytest.mark.corpus

ULP = np.finfo(float).eps


def oscillator(target):
    return solver(compiled("harmonic_oscillator", 8), target)


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", ["c", "numpy"])
def test_crossings_of_the_oscillator_are_at_the_exact_times(target):
    # q = cos t rises through 0 at t = 3π/2 + 2πk.
    section = oscillator(target).section([1, 0], 0.1, 1000, lambda x: x[:, 0])
    expected = 1.5 * np.pi + 2 * np.pi * np.arange(16)
    assert len(section) == 16
    assert np.max(np.abs(section.t - expected)) < 1e-10
    assert np.max(np.abs(section.x[:, 0])) < ULP
    assert np.max(np.abs(section.x[:, 1] - 1)) < 1e-10


def test_crossings_of_the_pendulum_are_at_the_exact_times():
    # For a start from rest at the angle a, sin(q/2) = k sn(t + K, k) with k = sin(a/2) and the complete elliptic
    # integral K = K(k). So q rises through 0 at t = 3K, 7K, …
    angle = 2.0
    k = np.sin(angle / 2) ** 2
    quarter = ellipk(k)
    section = solver(compiled("pendulum", 10), "c").section([angle, 0], 0.05, 2000, lambda x: x[:, 0])
    expected = quarter * (3 + 4 * np.arange(len(section)))
    assert len(section) == 1 + (100 - 3 * quarter) // (4 * quarter)
    assert np.max(np.abs(section.t - expected)) < 1e-10
    assert np.max(np.abs(ellipj(section.t + quarter, k)[0])) < 1e-10
    assert np.max(np.abs(section.x[:, 0])) < ULP


SECTIONS = [*product(["henon_heiles", "rigid_body", "pendulum_euler", "predator_prey"], TARGETS)]
SECTIONS.append(("nambu_pendulum", "c"))


@pytest.mark.thin(2)
@pytest.mark.parametrize(("name", "target"), slow_but(SECTIONS, [*SECTIONS, *product(["guiding_centre"], TARGETS)]))
def test_crossings_lie_on_the_section_and_on_the_leaf(name, target):
    """The section g = 0 is an oblique plane through the middle of the orbit, so that it has no special position."""
    it, at = solver(compiled(name), target), setting(compiled(name))
    steps = {"guiding_centre": 60, "rigid_body": 400}.get(name, 1000)
    rows = it.integrate(at.x, at.h, steps, parameters=at.parameters)
    normal = np.arange(1.0, len(at.x) + 1)
    middle = normal @ (rows.x.max(axis=0) + rows.x.min(axis=0)) / 2
    section = it.section(at.x, at.h, steps, lambda x: x @ normal - middle, parameters=at.parameters)
    g = rows.x @ normal - middle
    assert len(section) == np.sum((g[:-1] < 0) & (g[1:] >= 0)) > 0
    size = np.abs(section.x) @ normal + abs(middle)
    assert np.max(np.abs(section.x @ normal - middle) / size) < 4 * ULP
    for casimir, values in it.casimirs(section.x, parameters=at.parameters).items():
        assert np.max(np.abs(values - rows.casimirs[casimir][0])) < 1e-13 * max(1, abs(values[0]))
    assert np.max(np.abs(it.hamiltonian(section.x, parameters=at.parameters) - rows.energy[0])) <= 2 * np.ptp(
        rows.energy
    )


PENDULUM = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: p**2/2 - cos(q)\n"
DRIVEN = "time: t\n" + PENDULUM.replace("cos(q)", "cos(q) + q*sin(t)/5")
KEPLER = """coordinates: [x, y, u, v]
poisson: {canonical: {q: [x, y], p: [u, v]}}
hamiltonian: (u**2 + v**2)/2 - 1/sqrt(x**2 + y**2)
runs: {r: {initial: [0.5, 0, 0, 1.7], step: 0.1, steps: 1}}
"""
TORQUE = "forces: {vector: {x3: 0.1 - x3/20}}\n"
#: Other kinds of steps, each with the text of a system, the start, and the index of the coordinate that crosses 0.3.
KINDS = {
    "composed": (f"{BODY}order: 4\ncomposition: triple-jump\n", [2, 4, 0.8], 1),
    "kicks": (f"{PENDULUM}order: 4\nscheme: splitting\ncomposition: force-gradient\n", [1, 0], 0),
    "time": (f"{DRIVEN}order: 4\n", [1, 0], 0),
    "time, split": (f"{DRIVEN}order: 4\nscheme: splitting\n", [1, 0], 0),
    "monitor": (f"{BODY}monitor: 1/(1 + x1**2/20)\norder: 2\n", [2, 4, 0.8], 1),
    "log": (f"{KEPLER}monitor: log\norder: 4\nscheme: splitting\n", [0.5, 0, 0, 1.7], 1),
    "forces": (f"{BODY}damping: 0.01\norder: 2\n", [2, 4, 0.8], 1),
    "vector forces, split": (f"{BODY}scheme: splitting\norder: 4\n{TORQUE}", [2, 4, 0.8], 1),
    "attitude": (f"{BODY}reconstruct: quaternion\norder: 2\n", [2, 4, 0.8], 1),
    "attitude, split": (f"{BODY}reconstruct: quaternion\nscheme: splitting\norder: 4\n", [2, 4, 0.8], 1),
}


@pytest.mark.thin(3)
@pytest.mark.parametrize(("kind", "target"), slow_but(product(KINDS, ["numpy"]), product(KINDS, TARGETS)))
def test_every_kind_of_step_is_cut_and_ends_where_a_function_vanishes(kind, target):
    """Each crossing lies within the step in which g changes its sign, and g vanishes there to round-off. A run that
    ends by a terminal event of `solve_ivp`, or by ``stop``, ends at the first crossing, with the attitude at this time.
    """
    text, start, i = KINDS[kind]
    drift = 0.01 * kind.startswith("time")

    def g(x, t=0.0):
        return x[..., i] - 0.3 - drift * t

    it = solver(compile_text(text), target)
    rows, section = it.integrate(start, 0.1, 60), it.section(start, 0.1, 60, g, direction="both")
    values = g(rows.x, rows.t)
    before = np.flatnonzero(values[:-1] * values[1:] < 0)
    assert len(section) == len(before) >= 2
    assert np.all((rows.t[before] < section.t) & (section.t < rows.t[before + 1]))
    assert np.max(np.abs(g(section.x, section.t))) < 2 * ULP

    def event(t, y):
        return g(y, t)

    event.terminal = True
    ended = solve_ivp(it, (0, rows.t[-1]), start, h=0.1, events=event)
    assert ended.t[-1] == pytest.approx(section.t[0], rel=1e-14)
    assert np.max(np.abs(ended.y[:, -1] - section.x[0])) < 1e-13
    begun = it.backend.start(np.array(start, float), it.interface.parameters)
    end = where_zero(begun, 0.1, 60, g, 0.0, timed=bool(it.interface.time))
    there, at = end.finish(begun)
    assert np.max(np.abs(there.state() - section.x[0])) < 1e-13
    if it.interface.attitude:
        cut = it.integrate(start, 0.1, until=float(section.t[0]))
        assert at * 0.1 == pytest.approx(section.t[0], rel=1e-14)
        assert np.max(np.abs(there.element() - cut.attitude[-1])) < 1e-13


def test_a_step_in_a_block_of_its_own_changes_nothing():
    session = oscillator("c").backend.start(np.array([1.0, 0.0]), {"m": 1.0, "k": 1.0})
    finder = CrossingFinder(lambda x: x[:, 0], 0.1)
    blocks = [next(finder.follow(session, 1, lambda: session.advance(0.1, 1))) for _ in range(1000)]
    pieces = [crossing for _, crossings in blocks for crossing in crossings]
    whole = oscillator("c").section([1, 0], 0.1, 1000, lambda x: x[:, 0])
    assert [t for t, _ in pieces] == whole.t.tolist()
    assert [x.tolist() for _, x in pieces] == whole.x.tolist()


def test_crossings_closer_than_a_step_are_found():
    # In each period, cos t exceeds 1 − 1e-7 only for a time of 9e-4, much shorter than the step of 0.1.
    level, half = 1 - 1e-7, np.arccos(1 - 1e-7)
    above = oscillator("c").section([1, 0], 0.1, 1900, lambda x: x[:, 0] - level)
    assert np.allclose(above.t, 2 * np.pi * np.arange(1, 31) - half, atol=1e-9)
    below = oscillator("c").section([1, 0], 0.1, 1900, lambda x: x[:, 0] + level)
    assert np.allclose(below.t, 2 * np.pi * np.arange(30) + np.pi + half, atol=1e-9)


@pytest.mark.parametrize("level", [1.0, -1.0, 1 + 1e-9])
def test_tangencies_end(level):
    section = oscillator("c").section([1, 0], 0.1, 1000, lambda x: x[:, 0] - level)
    assert len(section) <= 16
    assert np.all(np.abs(section.x[:, 0] - level) < 4 * ULP)


def test_sections_are_crossed_where_g_rises_in_time():
    forwards = oscillator("c").section([0, 1], 0.1, 100, lambda x: x[:, 0])
    backwards = oscillator("c").section([0, 1], -0.1, 100, lambda x: x[:, 0])
    assert np.allclose(forwards.t, [0, 2 * np.pi])  # the start is on the section
    assert np.allclose(backwards.t, [0, -2 * np.pi])
    assert np.all(forwards.x[:, 1] > 0)
    assert np.all(backwards.x[:, 1] > 0)


def test_no_crossings_at_rest_or_away_from_the_section():
    assert len(oscillator("c").section([0, 0], 0.1, 100, lambda x: x[:, 0])) == 0
    assert len(oscillator("c").section([1, 0], 0.1, 100, lambda x: x[:, 0] - 2)) == 0


def test_steps_to_a_crossing_are_divided_if_they_do_not_converge(monkeypatch):
    """A step to a crossing begins without the predictor of the running session, so the iteration may not converge for a
    large step, which is then divided. In this test all steps above 0.03 fail, except the regular steps of 0.1.
    """
    from phigen.runtime.c_session import CSession
    from phigen.runtime.interface import BackendError

    advance = CSession.advance

    def refusing(self, h, steps):
        if h != 0.1 and h > 0.03:
            raise BackendError("NO_CONVERGENCE", 0, np.empty((0, 2)))
        advance(self, h, steps)

    monkeypatch.setattr(CSession, "advance", refusing)
    section = oscillator("c").section([1, 0], 0.1, 1000, lambda x: x[:, 0])
    assert np.allclose(section.t, 1.5 * np.pi + 2 * np.pi * np.arange(16), atol=1e-10)
    assert np.max(np.abs(section.x[:, 0])) < ULP


def test_a_failing_run_keeps_its_crossings():
    lotka = solver(compiled("lotka_volterra"), "c")
    with pytest.raises(StepError) as caught:
        lotka.section([-3, 5, 0.001], 0.001, 1000, lambda x: x[:, 1] - 6)
    assert len(caught.value.trajectory) == 1


def test_tables_of_crossings(tmp_path):
    section = oscillator("c").section([1, 0], 0.1, 1000, lambda x: x[:, 0])
    section.save(tmp_path / "s.csv")
    section.save(tmp_path / "s.npz")
    text = np.loadtxt(tmp_path / "s.csv", delimiter=",", skiprows=1)
    assert text.tolist() == np.column_stack([section.t, section.x]).tolist()
    with np.load(tmp_path / "s.npz") as stored:
        assert stored["t"].tolist() == section.t.tolist()
        assert stored["x"].tolist() == section.x.tolist()
        assert stored["coordinates"].tolist() == ["q", "p"]
    oscillator("c").section([1, 0], 0.1, 10, lambda x: x[:, 0]).save(tmp_path / "none.npz")
    with np.load(tmp_path / "none.npz") as stored:
        assert stored["x"].shape == (0, 2)


@pytest.mark.parametrize(("f", "zero"), [(lambda x: x**3 - 0.1, 0.1 ** (1 / 3)), (lambda x: np.expm1(x - 0.7), 0.7),
                                         (lambda x: np.sign(x - 0.3), 0.3), (lambda x: x**9, 0.0)])  # fmt: skip
def test_roots_are_found_to_the_last_bits(f, zero):
    asked = []
    root_value = root(lambda x: asked.append(x) or f(x), -0.5, f(-0.5), 1.0, f(1.0))
    assert abs(root_value - zero) < 1e-15
    assert len(asked) < 90
