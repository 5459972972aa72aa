"""Whether arrays over sites fit into memory, asked before they are made: Linux ends processes that find out later."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phigen.errors import Diagnostic, LimitError, Location

#: Bytes that nobody is asked about: to find out would take longer than a step of so many sites.
UNASKED = 2**24

_HINT = "fewer sites; frames in a file; real: float, which halves the solver; phigen.mpi on several machines"


def expect_room(what: str, needed: int, place: Location | None = None, hint: str = _HINT) -> None:
    """Raises `LimitError` if so many bytes are more than there can be. Where that is not known, or few, all is well."""
    if needed <= UNASKED:
        return
    free = available()
    if free is None or needed <= free:
        return
    message = f"{what} take {_readable(needed)} of memory at least, and {_readable(free)} are available"
    raise LimitError([Diagnostic(message, place, hint)])


def filled(what: str, shape: Sequence[int], dtype: type[np.floating[Any]] = np.float64) -> NDArray[Any]:
    """An array of NaN. Raises `LimitError` where it does not fit, as `expect_room`.

    It is written to at once: what ``np.empty`` promises would count as free when the next array is asked for.
    """
    expect_room(what, np.dtype(dtype).itemsize * math.prod(shape))
    return np.full(shape, np.nan, dtype)


def available() -> int | None:
    """The bytes that this process can still have, swap space too; None where the system does not say."""
    known = [free for free in (_of_machine(), *_of_groups()) if free is not None]
    return min(known, default=None)


def _of_machine() -> int | None:
    told = _table(Path("/proc/meminfo"), ":")
    if "MemAvailable" in told:
        return 1024 * (told["MemAvailable"] + told.get("SwapFree", 0))
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (ValueError, OSError, AttributeError):  # no such name, or no sysconf, on this system
        return None


def _of_groups(root: Path = Path("/sys/fs/cgroup")) -> Iterator[int | None]:
    """What control groups leave: version 2, then 1. Pages of files do not count, since they can be given up."""
    for folder, limit, used, files in (
        (root, "memory.max", "memory.current", "file"),
        (root / "memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_cache"),
    ):
        numbers = [_number(folder / name) for name in (limit, used)]
        if numbers[0] is not None and numbers[1] is not None:
            yield max(0, numbers[0] - numbers[1] + _table(folder / "memory.stat").get(files, 0))


def _number(path: Path) -> int | None:
    try:
        return int(path.read_text())
    except (OSError, ValueError):  # not there, or "max": no limit
        return None


def _table(path: Path, separator: str | None = None) -> dict[str, int]:
    """Lines of a name and a number."""
    try:
        rows = [line.split(separator, 1) for line in path.read_text().splitlines()]
        return {name: int(value.split()[0]) for name, value in rows}
    except (OSError, ValueError, IndexError):
        return {}


def _readable(size: int) -> str:
    return f"{size / 2**30:.3g} GiB" if size >= 2**30 else f"{size / 2**20:.3g} MiB"
