"""Long integrations in pieces: their rows do not depend on the speed of the machine."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from support import compiled, setting, solver

from phigen.runtime import march as pieces_of


def rows(monkeypatch, durations, stride, steps=3000):
    """Return the states of a run of the rigid body in C. The clock advances by the next of ``durations`` with each
    reading."""
    clock = itertools.accumulate(itertools.cycle(durations))
    monkeypatch.setattr(pieces_of, "time", SimpleNamespace(perf_counter=lambda: next(clock)))
    compilation = compiled("rigid_body")
    session = solver(compilation, "c").backend.start(np.array([0.1, 1.0, 0.2]), setting(compilation).parameters)
    return np.concatenate([piece.x for piece in pieces_of.march(session, 0.1, steps, stride)])


@pytest.mark.parametrize("stride", [5, 100, 2000])
def test_rows_have_the_same_bits_at_any_speed(monkeypatch, stride):
    monkeypatch.setattr(pieces_of, "_CALL_STEPS", 256)
    fast, slow, changing = (rows(monkeypatch, d, stride) for d in ([0.0], [1.0], [0.0, 0.0, 0.0, 1.0]))
    assert np.array_equal(fast, slow)
    assert np.array_equal(fast, changing)


def test_calls_end_at_rows_and_at_equal_distances_between_them():
    ends = [0]
    while ends[-1] < 10_000:
        ends.append(pieces_of._call_end(ends[-1], 5000, 10_000))
    assert ends == [0, 4096, 5000, 9096, 10_000]
