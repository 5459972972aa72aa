"""Blocks of steps and batches of members on paths in SIMD lanes. Where a lane fails, single steps replace it."""

import ctypes
from functools import cache

import numpy as np
import pytest
from precise_path import by_paths, compile_paths
from support import BODY, COMMAND, RawC, compiled

from phigen.compiler import emit
from phigen.lanes.in_lanes import Blocks, in_lanes
from phigen.scheme.assemble import MAX_PATH_LANE_DIMENSION

POLE = "coordinates: [x, y]\npoisson: {brackets: {x: {y: x**2}}}\nhamiltonian: y + x*y/9\n"
LOGARITHM = "coordinates: [x, y]\npoisson: {brackets: {x: {y: log(x)}}}\nhamiltonian: y - x*y\n"
ROOT = "coordinates: [x, y, z]\npoisson: {nambu: [z - sqrt(x)]}\nhamiltonian: y**2/2 + z + x*y/4\n"
KINK = "coordinates: [x, y]\npoisson: {brackets: {x: {y: 1 + abs(x)}}}\nhamiltonian: y + x*y/4\n"
TURNING = BODY.replace("x1**2/2 + x2**2/4 + x3**2/6", "x1 + x2*x3/50")

#: Systems by name: spec, start, step size, number of steps, and the difference between the starts of successive
#: members.
SYSTEMS = {
    "pole": (POLE, (0.3, 0.2), 0.05, 48, (0.1, 0.1)),  # some members reach the pole of x' = x²
    "logarithm": (LOGARITHM, (0.9, 0.1), 0.05, 60, (-0.12, 0.05)),  # the last members start at x < 0
    "root": (ROOT, (0.9, -0.5, 0.3), 0.05, 24, (-0.07, 0.02, 0.0)),  # x reaches 0, where √x is singular
    "kink": (KINK, (-0.8, 0.3), 0.05, 60, (0.1, 0.0)),  # paths cross x = 0, where their series diverges
    "turning": (TURNING, (0.2, 0.5, -0.7), 6.0, 40, (0.0, 0.01, 0.0)),  # about one rotation in a step: paths are split
    "turned": (TURNING, (0.2, 0.5, -0.7), 2.5, 60, (0.0, 0.01, 0.0)),  # series need more terms than the SIMD code has
}


@cache
def system(name):
    """Compile a system of `SYSTEMS` with paths, at order 4."""
    return compile_paths(SYSTEMS[name][0], 4)


def alone(compilation, start, h, steps):
    """Make single steps until one fails. Return the last state, the number of steps made, and the status of the last
    step.
    """
    raw, status = RawC(compilation), 0
    assert raw.init(start) == 0
    while status == 0 and raw.counters[0] < steps:
        status = raw.step(h)
    return raw.x.copy(), int(raw.counters[0]), status


@pytest.mark.thin(3)
@pytest.mark.parametrize("name", SYSTEMS)
def test_steps_and_failures_of_blocks_are_those_of_single_steps(name):
    _, start, h, steps, apart = SYSTEMS[name]
    compilation = system(name)
    assert isinstance(in_lanes(compilation.program), Blocks)
    for k in (0, 5):
        begin = np.add(start, k * np.array(apart))
        x, steps_made, status = alone(compilation, begin, h, steps)
        raw = RawC(compilation)
        raw.init(begin)
        assert raw.integrate(h, steps) == status
        assert raw.counters[0] == steps_made
        np.testing.assert_allclose(raw.x, x, rtol=1e-12, atol=1e-13)


@pytest.mark.thin(3, of_all=1)
@pytest.mark.parametrize("members", [1, 11])
@pytest.mark.parametrize("name", SYSTEMS)
def test_members_that_fail_leave_their_group_as_they_would_alone(name, members):
    _, start, h, steps, apart = SYSTEMS[name]
    compilation = system(name)
    starts = np.add(start, np.outer(np.arange(members), apart))
    x, status = np.array(starts.T, order="C"), np.zeros(members, dtype=np.uint8)
    worst = RawC(compilation).call(
        "ensemble",
        ctypes.c_int,
        None,
        ctypes.c_void_p(x.ctypes.data),
        ctypes.c_size_t(members),
        ctypes.c_double(h),
        ctypes.c_size_t(steps),
        ctypes.c_void_p(status.ctypes.data),
    )
    expected = [alone(compilation, row, h, steps) for row in starts]
    assert list(status) == [s for _, _, s in expected]
    assert worst == next((s for _, _, s in expected if s), 0)
    near = 1e-9 if name == "pole" else 1e-12  # round-off grows near the pole
    np.testing.assert_allclose(x.T, [row for row, _, _ in expected], rtol=near, atol=1e-13)
    if members > 1 and name in ("pole", "logarithm", "root"):
        assert 0 < np.count_nonzero(status) < members


def test_paths_of_few_coordinates_are_followed_in_lanes():
    for name, few in (("nambu_pendulum", True), ("charged_particle", False)):
        program = compiled(name).program
        assert (program.dimension <= MAX_PATH_LANE_DIMENSION) == few
        assert isinstance(in_lanes(program), Blocks) == few


def test_paths_where_the_spec_wants_no_lanes_have_no_blocks():
    text = f"{POLE}solver: {{lanes: false}}\n"
    with_lanes, without = (emit(compile_paths(t, 4).program, "c", COMMAND)["t.c"] for t in (POLE, text))
    assert "t_block(" in with_lanes
    assert "lanes" not in without
    assert len(without.splitlines()) < 0.4 * len(with_lanes.splitlines())


def test_blocks_of_steps_on_paths_keep_casimirs_to_roundoff():
    compilation = by_paths("rigid_body", 4)
    raw = RawC(compilation)
    raw.init((0.1, 1.0, 0.1))
    assert raw.integrate(0.1, 20_000) == 0
    assert raw.counters[1] < 2.2 * raw.counters[0]  # blocks take few passes; single steps would take more
    assert abs(raw.x @ raw.x - 1.02) < 2e-15
