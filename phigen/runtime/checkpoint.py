"""Checkpoints of long runs: all that a run needs to go on, and what it must agree with to be the same run."""

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
#: Parts of an identity that are hashes.
HASHES = ("spec", "solver")


class MismatchError(Exception):
    """A checkpoint belongs to another run; the message says in what they differ."""


@dataclass(frozen=True)
class Checkpoint:
    """``identity`` describes the run in plain data, ``arrays`` is its state."""

    identity: Mapping[str, Any]
    arrays: Mapping[str, Any]

    def save(self, path: Path) -> None:
        """Replace the file at once: whenever the process is killed, there is a whole checkpoint."""
        text = np.frombuffer(json.dumps(self.identity).encode(), dtype=np.uint8)
        stored: dict[str, Any] = {_IDENTITY: text, **self.arrays}
        with replacing(path) as file:
            np.savez(file, allow_pickle=False, **stored)


def objection(checkpoint: Path, output: Path | None, *, resume: bool, how: str) -> str:
    """Why a run may not begin, or go on, with these files; "" where it may. ``how`` names the way to go on.

    What an interrupted run left is not overwritten, and a run that is complete is not made again by going on with it.
    """
    if not resume and checkpoint.exists():
        return f"{checkpoint} belongs to an interrupted run: continue it with {how}, or remove the file"
    if resume and output is not None and output.exists() and not checkpoint.exists():
        return f"{output} is there, but not {checkpoint}: its run is complete, and there is nothing to resume"
    return ""


def objection_to_frames(part: Path) -> str:
    """Why a run without checkpoints may not put its frames into that file; "" where it may."""
    if not part.exists():
        return ""
    return f"{part} holds the frames of an interrupted run: continue it with its checkpoints=, or remove the file"


def load(path: Path, identity: Mapping[str, Any]) -> Mapping[str, Any]:
    """The arrays of a checkpoint of that run; raises `MismatchError`, also for a file that is no checkpoint."""
    try:
        with opened(path) as file, np.load(file, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        found = json.loads(arrays.pop(_IDENTITY).tobytes())
    except (ValueError, KeyError, EOFError, TypeError, zipfile.BadZipFile) as error:
        raise MismatchError(f"{path} is not a checkpoint of phigen: {error}") from None
    # What is compared went through JSON as well: tuples are lists.
    wanted = json.loads(json.dumps(identity))
    differing = [key for key in wanted if found.get(key) != wanted[key]]
    if differing:
        told = [_difference(key, found.get(key), wanted[key]) for key in differing]
        raise MismatchError(f"{path} belongs to another run: {'; '.join(told)}")
    return arrays


def _difference(key: str, before: Any, now: Any) -> str:
    # Hashes say nothing to people.
    return f"the {key} has changed" if key in HASHES else f"{key} was {before!r} and is {now!r}"
