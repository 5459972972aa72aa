"""Tables of floats in files that grow by appended rows: ``.csv`` text, or ``.npz`` arrays of NumPy.

Rows that were flushed are not lost if the process ends, and the table can be continued after them. A ``.csv`` can be
read at any time. The rows of a ``.npz`` are collected as doubles in ``FILE.part``, until the table is closed.
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Protocol

import numpy as np

from phigen.runtime.interface import Floats
from phigen.writing import naming, replacing

SUFFIXES = (".csv", ".npz")

_ROWS = 1 << 14  # number of rows that are copied at a time from FILE.part into a .npz


@dataclass(frozen=True)
class Column:
    """Adjacent columns of a table: ``names`` are their titles in a ``.csv``, ``key`` is the name of their array in a
    ``.npz``.

    The array has shape (rows,) if it is ``flat``, else (rows, len(names)).
    """

    key: str
    names: tuple[str, ...]
    flat: bool = False


class TableFile(Protocol):
    """Protocol of a table that is being written to a file."""

    def append(self, rows: Floats) -> None:
        """Write ``rows`` (rows, columns) after the rows so far."""
        ...

    def flush(self) -> int:
        """Write buffered rows to disk, and return the size of the file in bytes. `opened` needs the size to continue
        the table.
        """
        ...

    def close(self, scalars: Mapping[str, Any]) -> None:
        """Complete the file; ``scalars`` are additional arrays of a ``.npz``."""
        ...

    def clean(self) -> None:
        """Remove auxiliary files, from which an interrupted table would be continued."""
        ...

    def discard(self) -> None:
        """Remove all files of the table, for a run that failed."""
        ...


def opened(path: str | Path, columns: Sequence[Column], size: int | None = None) -> TableFile:
    """Return a new table or, with ``size``, a table that continues after the first ``size`` bytes of an existing file.

    Raises `ValueError` for suffixes that are not in `SUFFIXES` and for files shorter than ``size``, and `OSError`.
    """
    kinds: dict[str, Callable[[Path, Sequence[Column], int | None], TableFile]] = {".csv": CsvTable, ".npz": NpzTable}
    suffix = Path(path).suffix.lower()
    if suffix not in kinds:
        raise ValueError(f"cannot write {str(path)!r}: the suffix must be {' or '.join(SUFFIXES)}")
    return kinds[suffix](Path(path), columns, size)


def write(path: str | Path, columns: Sequence[Column], rows: Floats, scalars: Mapping[str, Any]) -> None:
    """Write a complete table to a file, and close it."""
    table = opened(path, columns)
    table.append(rows)
    table.close(scalars)
    table.clean()


class CsvTable:
    """A `TableFile` of comma-separated values; every float reads back as the same float."""

    def __init__(self, path: Path, columns: Sequence[Column], size: int | None) -> None:
        self._path, self._file = path, _opened(path, size)
        if size is None:
            self._file.write((",".join(name for c in columns for name in c.names) + "\n").encode())

    def append(self, rows: Floats) -> None:
        with naming(self._path):
            self._file.write("".join(",".join(map(repr, row)) + "\n" for row in rows.tolist()).encode())

    def flush(self) -> int:
        with naming(self._path):
            return _flushed(self._file)

    def close(self, scalars: Mapping[str, Any]) -> None:
        """Close the file; ``scalars`` are not written, since a ``.csv`` has no place for them."""
        with naming(self._path):
            self._file.close()

    def clean(self) -> None:
        """Do nothing, since a ``.csv`` has no auxiliary files."""

    def discard(self) -> None:
        _discarded(self._file, self._path)


class NpzTable:
    """A `TableFile` that becomes a ``.npz`` with one array for each of the ``columns``."""

    def __init__(self, path: Path, columns: Sequence[Column], size: int | None) -> None:
        self._path, self._part, self._columns = path, path.with_name(path.name + ".part"), columns
        self._file = _opened(self._part, size)

    def append(self, rows: Floats) -> None:
        with naming(self._part):
            self._file.write(np.ascontiguousarray(rows, dtype="<f8").tobytes())

    def flush(self) -> int:
        with naming(self._part):
            return _flushed(self._file)

    def close(self, scalars: Mapping[str, Any]) -> None:
        with naming(self._part):
            self._file.close()
        width = sum(len(c.names) for c in self._columns)
        count = self._part.stat().st_size // (8 * width)
        rows: Floats = np.empty((0, width))
        if count:  # an empty file cannot be mapped
            rows = np.memmap(self._part, dtype="<f8", mode="r", shape=(count, width))
        with replacing(self._path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            first = 0
            for column in self._columns:
                self._store(archive, column, rows, first)
                first += len(column.names)
            for name, value in scalars.items():
                with archive.open(f"{name}.npy", "w") as member:
                    np.lib.format.write_array(member, np.asarray(value), allow_pickle=False)

    def clean(self) -> None:
        self._part.unlink(missing_ok=True)

    def discard(self) -> None:
        _discarded(self._file, self._part)

    def _store(self, archive: zipfile.ZipFile, column: Column, rows: Floats, first: int) -> None:
        count, width = len(rows), len(column.names)
        shape = (count,) if column.flat else (count, width)
        header = {"descr": "<f8", "fortran_order": False, "shape": shape}
        with archive.open(f"{column.key}.npy", "w", force_zip64=True) as member:
            np.lib.format.write_array_header_1_0(member, header)
            for start in range(0, count, _ROWS):
                member.write(rows[start : start + _ROWS, first : first + width].tobytes())


def _opened(path: Path, size: int | None) -> BinaryIO:
    if size is None:
        return path.open("wb")
    file = path.open("r+b")
    if file.seek(0, os.SEEK_END) < size:
        file.close()
        raise ValueError(f"{path} has fewer than the {size} bytes that were written to it")
    file.truncate(size)
    file.seek(size)
    return file


def _discarded(file: BinaryIO, path: Path) -> None:
    with suppress(OSError):  # closing flushes rows, which fails if the disk is full
        file.close()
    with suppress(OSError):
        path.unlink()


def _flushed(file: BinaryIO) -> int:
    file.flush()
    os.fsync(file.fileno())
    return file.tell()
