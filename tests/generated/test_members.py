"""Ensembles whose members have their own parameters, steps and times: each member is a trajectory of its own."""

from itertools import product

import numpy as np
import pytest
from support import ALIKE, NAMES, SPECIES, TARGETS, compile_text, compiled, setting, slow_but, solver

from phigen.errors import ParameterError, StepError
from phigen.runtime import members as sharing

DISTINCT = [name for name in NAMES if name not in ALIKE]
#: Systems for every kind of step: implicit with a gauge, paths, explicit, with a time, with a monitor, and code without
#: lanes.
KINDS = ["rigid_body", "nambu_pendulum", "pendulum_euler", "spin_resonance", "kepler_eccentric", "toda3"]


def own(compilation, count):
    """Return the states, the steps and the other quantities of ``count`` members, by the names of the arguments."""
    at, k = setting(compilation), np.arange(count)
    parameters = {name: value * (1 + 0.003 * k) for name, value in at.parameters.items()}
    if compilation.program.time:
        parameters["t0"] = 0.1 * k
    return np.outer(1 + 0.002 * k, at.x), at.h * (1 - 0.01 * k), parameters


@pytest.mark.thin(2)
@pytest.mark.parametrize(("target", "name"), slow_but(product(TARGETS, KINDS), product(TARGETS, DISTINCT)))
def test_members_with_numbers_of_their_own_are_trajectories(name, target):
    """Members agree with trajectories to round-off. Eleven members are a full group of eight and a group that is not
    full; frames are computed in the same groups.
    """
    compilation = compiled(name)
    solve, (start, h, parameters) = solver(compilation, target), own(compilation, 11)
    frames = solve.ensemble(start, h, 10, 4, **parameters)
    assert frames.shape == (4, *start.shape)
    assert (solve.ensemble(start, h, 10, **parameters) == frames[-1]).all()
    for m in range(0, 11, 5):
        alone = solve.integrate(start[m], h[m], 10, 4, **{key: value[m] for key, value in parameters.items()}).x
        np.testing.assert_allclose(frames[:, m], alone, rtol=0, atol=1e-15 * np.max(np.abs(alone)))


@pytest.mark.thin(2)
@pytest.mark.parametrize(("name", "scheme"), [("rigid_body", None), ("lagrange_top", "splitting")])
def test_numbers_of_all_are_those_of_each_and_neighbours_do_not_matter(name, scheme):
    """Explicit steps have the same bits. Implicit ones are iterated until the slowest member of a group has
    converged.
    """
    compilation = compiled(name, 4, scheme)
    solve, at = solver(compilation, "c"), setting(compilation)
    start = np.outer(1 + 0.002 * np.arange(40), at.x)
    same = {key: np.full(40, value) for key, value in at.parameters.items()}
    shared = solve.ensemble(start, at.h, 50, **at.parameters)
    assert (solve.ensemble(start, at.h, 50, **same) == shared).all()
    others = same | {key: np.where(np.arange(40) == 21, same[key], 1.2 * same[key]) for key in same}
    among_others = solve.ensemble(start, at.h, 50, **others)[21]
    np.testing.assert_allclose(among_others, shared[21], rtol=0, atol=0 if scheme else 2e-15)


def test_the_number_of_threads_changes_no_bit():
    """There are more members than one call of the library integrates; the bits are those of a single call."""
    solve, (start, h, parameters) = solver(compiled("rigid_body"), "c"), own(compiled("rigid_body"), 11)
    start, h = np.tile(start, (300, 1)) * (1 + 1e-5 * np.arange(3300))[:, np.newaxis], np.tile(h, 300)
    parameters = {key: np.tile(value, 300) for key, value in parameters.items()}
    ends = [solve.ensemble(start, h, 40, 20, threads=threads, **parameters) for threads in (1, 2, 5)]
    assert all((end == ends[0]).all() for end in ends)


def test_parts_of_ensembles_end_where_groups_do(monkeypatch):
    monkeypatch.setattr(sharing, "cores", lambda: 3)
    asked = sharing.Members(np.zeros((1000, 2)), np.float64(1), 1000, {}, np.float64(0))
    ranges = []
    sharing.shared_out(asked, None, ranges.append)
    ranges.sort(key=lambda part: part.start)
    assert [part.start for part in ranges] == list(range(0, 1000, ranges[0].stop))
    assert ranges[0].stop % sharing.PART_GRANULARITY == 0
    assert ranges[-1].stop == 1000
    assert len(ranges) > 3


FAST = [*product(TARGETS, ["fast"])]

#: Specs with states or parameters of three members, the second of which cannot start.
REFUSED = {
    "monitor": ("hamiltonian: p**2/2 + a*cos(q)\nmonitor: q\n", [[1.0, 0.1], [-1.0, 0.2], [0.5, 0.3]], {}),
    "coefficient": (
        "hamiltonian: p**2/2 + q**2/(2*(a - 1))\nscheme: splitting\n",
        [[1.0, 0.1], [1.1, 0.2], [0.5, 0.3]],
        {"a": [1.5, 1.0, 2.0]},
    ),
}


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("kind", REFUSED)
def test_a_member_that_cannot_begin_leaves_the_others_their_runs(target, kind):
    text, start, values = REFUSED[kind]
    pair = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
    solve = solver(compile_text(f"{pair}parameters: {{a: {{value: 1.3}}}}\norder: 4\n{text}"), target)
    for stride in (None, 2):
        with pytest.raises(ParameterError) as refused:
            solve.ensemble(start, 0.01, 6, stride, **values)
        assert refused.value.members == (1,)
        states = refused.value.trajectory
        for m in (0, 2):
            run = solve.integrate(start[m], 0.01, 6, stride or 6, **{key: value[m] for key, value in values.items()})
            np.testing.assert_allclose(states[..., m, :], run.x if stride else run.x[-1], rtol=1e-14)
        if stride:
            assert np.isnan(states[1:, 1]).all()
        else:
            np.testing.assert_array_equal(states[1], start[1])


@pytest.mark.thin(3)
@pytest.mark.parametrize(("target", "profile"), slow_but(FAST, [*FAST, ("c", "small")]))
@pytest.mark.parametrize("scheme", ["series", "splitting"])
def test_a_member_that_fails_has_no_frames_from_then_on(target, profile, scheme):
    """Of four members, the second reaches the singularity of its solution after 239 steps, and the parameters of the
    last are refused.
    """
    solve = solver(compile_text(f"{SPECIES}order: 4\nprofile: {profile}\n", scheme=scheme), target)
    start = np.array([[0.3, 0.9, 0.6], [-3.0, 5.0, 0.001], [0.5, 0.2, 0.1]])
    h = np.array([1e-3, 1e-3, 2e-3])
    with pytest.raises(StepError) as many:
        solve.ensemble(start, h, 390, 50)
    assert many.value.members == (1,)
    frames = many.value.trajectory
    assert frames.shape == (9, 3, 3)
    with pytest.raises(StepError) as single:
        solve.integrate(start[1], 1e-3, 390, 50)
    last = single.value.step // 50
    assert 2 <= last <= 6
    np.testing.assert_allclose(frames[: last + 1, 1], single.value.trajectory.x[: last + 1], rtol=1e-9)
    assert np.isnan(frames[last + 1 :, 1]).all()
    for m in (0, 2):
        np.testing.assert_allclose(frames[:, m], solve.integrate(start[m], h[m], 390, 50).x, rtol=1e-13)


@pytest.mark.parametrize("target", TARGETS)
def test_what_is_not_given_to_each_is_that_of_all(target):
    solve = solver(compiled("rigid_body"), target)
    state = [0.1, 1.0, 0.2]
    ends = solve.ensemble(state, 0.1, 10, I2=[2.0, 2.5])
    assert ends.shape == (2, 3)
    assert ends.tolist() == solve.ensemble([state, state], [0.1, 0.1], 10, I2=[2.0, 2.5]).tolist()
    assert not (ends[0] == ends[1]).any()


@pytest.mark.parametrize(
    ("arguments", "error", "said"),
    [
        ({"I2": [1.0, 2.0]}, ValueError, "'I2' must have shape"),
        ({"h": [0.1, 0.0, 0.1]}, ValueError, "must not be 0"),
        ({"h": [0.1, np.nan, 0.1]}, ValueError, "step size h must be finite"),
        ({"I9": [1.0, 2.0, 3.0]}, TypeError, "unknown parameter 'I9'"),
        ({"I1": [1.0, 2.0, 3.0], "parameters": {"I1": 1}}, TypeError, "given twice"),
        ({"I1": [1.0, 0.0, 3.0]}, ValueError, "'I1' of member 1 must be positive, not 0.0"),
        ({"I1": np.array([1.0, 2.0, 3.0j])}, TypeError, "'I1' must be real"),
        ({"I1": ["1", "2", "3"]}, TypeError, "'I1' must be an array of numbers"),
        ({"I1": [10**400] * 3}, ValueError, "'I1' must be finite"),
        ({"t0": [1.0, 0.0, 3.0]}, TypeError, "does not depend on the time"),
        ({"stride": 0}, ValueError, "stride must be at least 1"),
        ({"threads": 0}, ValueError, "threads must be at least 1"),
        ({"X0": [1.0, 0.0, 0.0]}, ValueError, "X0 must have shape"),
    ],
)
def test_wrong_arguments_of_members_are_errors(arguments, error, said):
    solve = solver(compiled("rigid_body"), "c")
    call_arguments = {"X0": np.ones((3, 3)), "h": 0.1, "steps": 1, **arguments}
    with pytest.raises(error, match=said):
        solve.ensemble(**call_arguments)


@pytest.mark.parametrize("target", TARGETS)
def test_a_step_too_large_for_one_member_is_that_of_no_other(target):
    """A failed step is repeated with the parameters and the step size of the same member."""
    solve, start = solver(compiled("rigid_body"), target), [0.1, 1.0, 0.2]
    with pytest.raises(StepError) as many:
        solve.ensemble(start, [0.1, 1e3, 0.05], 10, I2=[0.9, 1.1, 1.2])
    assert many.value.members == (1,)
    for m, (h, I2) in {0: (0.1, 0.9), 2: (0.05, 1.2)}.items():
        alone = solve.integrate(start, h, 10, I2=I2).x[-1]
        np.testing.assert_allclose(many.value.trajectory[m], alone, rtol=0, atol=1e-15)


@pytest.mark.parametrize("name", [*KINDS[:-1], "lagrange_top", "dzhanibekov", "thermal_chain"])
def test_members_in_numpy_have_the_same_bits_beside_one_that_fails(name, monkeypatch):
    """A member fails in the middle of a step, when predictors, compensation terms, times, noise and attitudes of the
    others are in use.
    """
    compilation, others = compiled(name), np.array([0, 1, 3])
    solve, (start, h, parameters) = solver(compilation, "numpy"), own(compilation, 4)
    h = h[0] if solve.interface.noise else h
    paths = {"seed": 3} if solve.interface.noise else {}
    module, calls = solve.backend.module, []
    advance = module._advance

    def fail_once(stage, x, carry, memory):
        following, rest, memory, status = advance(stage, x, carry, memory)
        calls.append(None)
        if len(calls) == 7 * len(module.FRACTIONS):
            status = np.where(np.arange(len(x)) == 2, "SINGULAR", status)
        return following, rest, memory, status

    run = solve.attitudes if solve.interface.attitude else solve.ensemble
    good = run(start, h, 12, 5, **parameters, **paths)
    monkeypatch.setattr(module, "_advance", fail_once)
    with pytest.raises(StepError) as failed:
        run(start, h, 12, 5, **parameters, **paths)
    assert (failed.value.members, failed.value.step, failed.value.status) == ((2,), 6, "SINGULAR")
    partial_run = failed.value.trajectory
    pairs = (
        [(partial_run.x, good.x), (partial_run.attitude, good.attitude)]
        if solve.interface.attitude
        else [(partial_run, good)]
    )
    for beside, alone in pairs:
        assert np.array_equal(beside[:, others], alone[:, others])
        assert np.array_equal(beside[:2, 2], alone[:2, 2])
        assert np.isnan(beside[2:, 2]).all()


@pytest.mark.parametrize("name", ["rigid_body", "nambu_pendulum", "duffing"])
def test_members_whose_guess_misleads_begin_again_with_their_own_numbers(name):
    """With the coefficients, parameters, steps or times of the first members in place of their own, the steps would
    differ.
    """
    compilation, few = compiled(name), np.array([1, 3])
    module, (x, h, member_parameters) = solver(compilation, "numpy").backend.module, own(compilation, 4)
    t0 = member_parameters.pop("t0", np.zeros(4))

    def stage(members):
        parameters = module._values({key: value[members] for key, value in member_parameters.items()})
        coefficients = module._coefficients(parameters, x[members], h[members], None)[0]
        return module._renewed(coefficients, t0[members], h[members]) if compilation.program.time else coefficients

    everybody, still = stage(np.arange(4)), np.zeros_like(x)
    for batched, alone in zip(module._stage_at(everybody, few), stage(few), strict=True):
        for a, b in (
            zip(batched.values(), alone.values(), strict=True) if isinstance(alone, dict) else [(batched, alone)]
        ):
            np.testing.assert_array_equal(a, b)
    misled = still.copy()
    misled[few] = 1e6 * (1 + x[few])
    expected, *_ = module._advance(everybody, x, still, (still, still))
    with np.errstate(all="ignore"):
        assert (module._solved(everybody, x, still, misled)[3] != "").any()
        batched, _, _, status = module._advance(everybody, x, still, (misled, misled))
    assert (status == "").all()
    np.testing.assert_allclose(batched, expected, rtol=0, atol=1e-14 * np.max(np.abs(expected)))
