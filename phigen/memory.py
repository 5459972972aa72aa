"""Checks that arrays over the sites of a lattice fit into memory, before they are allocated.

Linux lets a process allocate more memory than there is, and kills the process later, when it writes to this memory. The
checks prevent this.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phigen.errors import Diagnostic, LimitError, Location

#: Largest size in bytes that is not checked: reading the free memory takes longer than a step on an array of this size.
UNCHECKED_BYTES = 2**24

_HINT = "use fewer sites, frames in a file, real: float (half the memory), or phigen.mpi on several machines"


def expect_room(what: str, byte_count: int, place: Location | None = None, hint: str = _HINT) -> None:
    """Raise `LimitError` if ``byte_count`` bytes of memory are not available.

    ``what`` is the plural subject of the message, such as "12 frames". Nothing is checked if the system does not report
    its free memory.
    """
    if byte_count <= UNCHECKED_BYTES:
        return
    available_bytes = available()
    if available_bytes is None or byte_count <= available_bytes:
        return
    message = f"{what} take {_readable(byte_count)} of memory at least, and {_readable(available_bytes)} are available"
    raise LimitError([Diagnostic(message, place, hint)])


def filled(name: str, shape: Sequence[int], dtype: type[np.floating[Any]] = np.float64) -> NDArray[Any]:
    """Return a new array, filled with NaN. Raises `LimitError` if the array does not fit into memory.

    ``name`` is the subject of the error message, such as "12 frames". Writing NaN takes the memory at once. The memory
    of an array from ``np.empty`` would still count as available when the next array is allocated.
    """
    expect_room(name, np.dtype(dtype).itemsize * math.prod(shape))
    return np.full(shape, np.nan, dtype)


def available() -> int | None:
    """Return the bytes of memory, with swap space, that this process can still allocate; None if they are unknown."""
    limits = [limit for limit in (_of_machine(), *_of_groups()) if limit is not None]
    return min(limits, default=None)


def _of_machine() -> int | None:
    """Return the free memory of the machine in bytes; if it is unknown, the whole memory; if that is unknown
    too, None.
    """
    sizes = _table(Path("/proc/meminfo"), ":")
    if "MemAvailable" in sizes:
        return 1024 * (sizes["MemAvailable"] + sizes.get("SwapFree", 0))
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (ValueError, OSError, AttributeError):  # the system has no sysconf, or sysconf does not know these names
        return None


def _of_groups(root: Path = Path("/sys/fs/cgroup")) -> Iterator[int | None]:
    """Yield the bytes that the limits of control groups leave to this process. Versions 1 and 2 of control groups are
    read.

    Nothing is yielded for groups without limits. Cached pages of files count as available, since the system can drop
    them.
    """
    for folder, limit, usage, files in (
        (root, "memory.max", "memory.current", "file"),
        (root / "memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_cache"),
    ):
        numbers = [_number(folder / name) for name in (limit, usage)]
        if numbers[0] is not None and numbers[1] is not None:
            yield max(0, numbers[0] - numbers[1] + _table(folder / "memory.stat").get(files, 0))


def _number(path: Path) -> int | None:
    try:
        return int(path.read_text())
    except (OSError, ValueError):  # there is no such file, or it says "max", which means no limit
        return None


def _table(path: Path, separator: str | None = None) -> dict[str, int]:
    """Return the numbers in a file whose lines are a name and a number: name → number. {} if the file cannot be
    read.
    """
    try:
        rows = [line.split(separator, 1) for line in path.read_text().splitlines()]
        return {name: int(value.split()[0]) for name, value in rows}
    except (OSError, ValueError, IndexError):
        return {}


def _readable(size: int) -> str:
    return f"{size / 2**30:.3g} GiB" if size >= 2**30 else f"{size / 2**20:.3g} MiB"
