"""Checkpoints of long runs: the state of an interrupted run, and the settings that identify the run."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from phigen.reading import opened
from phigen.writing import replacing

_IDENTITY = "identity"
#: Names of those settings of a run that a checkpoint stores as hashes. Error messages do not print the hashes.
HASHES = ("spec", "solver")


class MismatchError(Exception):
    """A checkpoint belongs to another run; the message lists the differences."""


@dataclass(frozen=True)
class Checkpoint:
    """A checkpoint: ``arrays`` are the state of a run, and ``identity`` are the settings of the run, as plain data."""

    identity: Mapping[str, Any]
    arrays: Mapping[str, Any]

    def save(self, path: Path) -> None:
        """Write the checkpoint to a temporary file and rename it to ``path``.

        So ``path`` is always a complete checkpoint, even if the process ends during the writing.
        """
        text = np.frombuffer(json.dumps(self.identity).encode(), dtype=np.uint8)
        entries: dict[str, Any] = {_IDENTITY: text, **self.arrays}
        with replacing(path) as file:
            np.savez(file, allow_pickle=False, **entries)


def objection(checkpoint: Path, output: Path | None, *, resume: bool, how: str) -> str:
    """Return the reason why a run may not begin, or resume, because of existing files; "" if it may.

    A new run does not overwrite the files of an interrupted run, and a complete run cannot be resumed. ``how`` is the
    option for resuming, which the message names.
    """
    if not resume and checkpoint.exists():
        return f"{checkpoint} belongs to an interrupted run: continue it with {how}, or remove the file"
    if resume and output is not None and output.exists() and not checkpoint.exists():
        return f"{output} exists, but not {checkpoint}: its run is complete, and there is nothing to resume"
    return ""


def objection_to_frames(part: Path) -> str:
    """Return the reason why a run without checkpoints may not write its frames to the file ``part``; "" if it may."""
    if not part.exists():
        return ""
    return f"{part} holds the frames of an interrupted run: continue it with its checkpoints=, or remove the file"


def load(path: Path, identity: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the arrays of the checkpoint at ``path``, for a run with the settings ``identity``.

    Raises `MismatchError` if the checkpoint belongs to another run, or if the file is not a checkpoint.
    """
    try:
        with opened(path) as file, np.load(file, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        stored_identity = json.loads(arrays.pop(_IDENTITY).tobytes())
    except (ValueError, KeyError, EOFError, TypeError, zipfile.BadZipFile) as error:
        raise MismatchError(f"{path} is not a checkpoint of phigen: {error}") from None
    # The stored identity comes from JSON, which turns tuples into lists. So the identity of this run is written as JSON
    # and read again.
    expected_identity = json.loads(json.dumps(identity))
    differing = [key for key in expected_identity if stored_identity.get(key) != expected_identity[key]]
    if differing:
        differences = [_difference(key, stored_identity.get(key), expected_identity[key]) for key in differing]
        raise MismatchError(f"{path} belongs to another run: {'; '.join(differences)}")
    return arrays


def _difference(key: str, earlier: Any, current: Any) -> str:
    # A hash is not printed: its value does not help the user.
    return f"the {key} has changed" if key in HASHES else f"{key} was {earlier!r} and is {current!r}"
