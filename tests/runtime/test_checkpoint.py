"""Checkpoints: `load` returns the arrays that were stored, and refuses damaged files and those of another run."""

import numpy as np
import pytest

from phigen.runtime.checkpoint import Checkpoint, MismatchError, load

IDENTITY = {"spec": "abc", "steps": 10, "initial": (1.0, 2.0)}


@pytest.fixture
def path(tmp_path):
    """Return the path of a stored checkpoint."""
    Checkpoint(IDENTITY, {"x": np.arange(3.0)}).save(tmp_path / "run.checkpoint")
    return tmp_path / "run.checkpoint"


def test_arrays_come_back(path):
    assert load(path, IDENTITY)["x"].tolist() == [0.0, 1.0, 2.0]


def test_another_run_is_refused(path):
    with pytest.raises(MismatchError, match="steps was 10 and is 11"):
        load(path, IDENTITY | {"steps": 11})


@pytest.mark.parametrize("damage", [lambda b: b[: len(b) // 2], lambda b: b"", lambda b: b"no zip", lambda b: b[:80]])
def test_damaged_files_are_refused(path, damage):
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(MismatchError, match="not a checkpoint"):
        load(path, IDENTITY)


def test_a_single_array_is_no_checkpoint(path):
    with path.open("wb") as file:
        np.save(file, np.zeros(2))
    with pytest.raises(MismatchError, match="not a checkpoint"):
        load(path, IDENTITY)
