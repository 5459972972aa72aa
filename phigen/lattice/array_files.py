"""Arrays and bonds of lattices in files: ``.npy`` arrays, and ``.csv`` tables with or without a line of names.

A file with wrong contents raises `ValueError`. If one line of a ``.csv`` file is wrong, the message has the number of
this line. A file that cannot be read raises `OSError`.
"""

from __future__ import annotations

import tokenize
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from phigen.reading import opened, opened_text
from phigen.spec import limits
from phigen.spec.problems import counted, did_you_mean, one_of, shown

Floats = NDArray[np.float64]

#: Column names for the two sites that a bond connects.
ENDS = ("a", "b")


@dataclass(frozen=True)
class NumberTable:
    """The numbers of a ``.csv`` file.

    ``rows`` has the numbers. ``names`` has the column names in the first line of the file; it is () if the file has no
    column names.
    """

    path: Path
    names: tuple[str, ...]
    rows: Floats

    def line(self, row: int) -> str:
        """Return the text "line N" for messages. Line N of the file has the numbers of row ``row``."""
        with opened_text(self.path) as stream:
            line_numbers = [number for number, text in enumerate(stream, 1) if text.split("#")[0].strip()]
        return f"line {line_numbers[row + bool(self.names)]}"


def values_in(path: Path, name: str, shape: tuple[int, ...]) -> Floats:
    """Return the array in a ``.npy`` or ``.csv`` file.

    ``name`` is the name of the field or parameter. A ``.csv`` table of one column may have this name as its column
    name. Raises `ValueError` if the array does not have the given ``shape``, or contains anything but finite real
    numbers.
    """
    if path.suffix == ".npy":
        return _array(path, shape)
    table = _table(path)
    if table.names not in ((), (name,)):
        raise ValueError(f"its columns are {', '.join(table.names)}; expected one column {name}, or no names")
    rows = table.rows.reshape(-1) if len(shape) == 1 and 1 in table.rows.shape else table.rows
    _expect_shape(rows.shape, shape)
    if not np.isfinite(rows).all():
        raise ValueError(f"{table.line(int(np.argwhere(~np.isfinite(table.rows))[0][0]))}: not a finite number")
    return rows


def bonds_in(path: Path, parameters: Collection[str]) -> tuple[NDArray[np.int64], dict[str, Floats]]:
    """Return the bonds in a ``.csv`` file, and the columns of parameters by name.

    The bonds are an array of shape (bonds, 2); each row has the two sites that a bond connects. ``parameters`` has the
    names that columns of parameters may have. A file without column names has two columns of sites.
    """
    table = _table(path)
    names = table.names or ENDS
    _expect_columns(table, names, parameters)
    bond_ends = table.rows[:, [names.index(end) for end in ENDS]]
    for is_wrong, problem in (
        (~np.isfinite(table.rows).all(axis=1), "not all its numbers are finite"),
        (
            (bond_ends != np.round(bond_ends)).any(axis=1) | (bond_ends < 0).any(axis=1),
            "sites are whole numbers, counted from 0",
        ),
        ((bond_ends >= limits.SITES).any(axis=1), f"a site beyond the limit of {limits.SITES} sites"),
        (bond_ends[:, 0] == bond_ends[:, 1], "a bond has two different ends"),
    ):
        if is_wrong.any():
            raise ValueError(f"{table.line(int(np.argmax(is_wrong)))}: {problem}")
    columns = {name: table.rows[:, k].copy() for k, name in enumerate(names) if name not in ENDS}
    return bond_ends.astype(np.int64), columns


def _expect_columns(table: NumberTable, names: Sequence[str], parameters: Collection[str]) -> None:
    if not table.names and table.rows.shape[1] != len(ENDS):
        width = counted(table.rows.shape[1], "column")
        raise ValueError(f"{width} without names; a first line a,b,… names the ends of bonds and their parameters")
    repeated = [name for k, name in enumerate(names) if name in names[:k]]
    if repeated:
        raise ValueError(f"two columns have the name {shown(repeated[0])}")
    missing_columns = [end for end in ENDS if end not in names]
    if missing_columns:
        raise ValueError(f"there is no column {missing_columns[0]!r}; a and b are the ends of bonds")
    unknown = [name for name in names if name not in (*ENDS, *parameters)]
    if unknown:
        hint = did_you_mean(unknown[0], parameters) or (one_of(parameters) if parameters else "")
        raise ValueError(f"the column {shown(unknown[0])} is no parameter at bonds{hint and '; '}{hint}")


def _table(path: Path) -> NumberTable:
    with opened_text(path) as stream:
        lines: Iterator[str] = (line for line in stream if line.split("#")[0].strip())
        first = next(lines, None)
        if first is None:
            raise ValueError("it is empty")
        names = tuple(name.strip().strip('"') for name in first.split(","))
        if all(map(_is_number, names)):
            names, lines = (), chain([first], lines)
        begin = next(lines, None)
        if begin is None:
            return NumberTable(path, names, np.zeros((0, len(names))))
        return NumberTable(path, names, np.loadtxt(chain([begin], lines), delimiter=",", ndmin=2))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _array(path: Path, shape: tuple[int, ...]) -> Floats:
    """Return the array of a ``.npy`` file. Its shape and type are checked in the header, before memory is allocated."""
    with opened(path) as file:
        try:
            file_shape, dtype = _header(file)
            _expect_shape(file_shape, shape)
            if dtype.kind not in "buif":
                description = "complex numbers" if dtype.kind == "c" else f"elements of the kind {dtype}"
                raise ValueError(f"{description}, not real numbers")
            file.seek(0)
            array = np.lib.format.read_array(file, allow_pickle=False)
            if file.read(1):
                raise ValueError("it holds more than one array")
        except (tokenize.TokenError, SyntaxError, EOFError) as error:
            raise ValueError(str(error)) from None
    array = np.asarray(array, dtype=np.float64)
    if not np.isfinite(array).all():
        index = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
        raise ValueError(f"the value at {list(index)} is not finite")
    return array


def _header(file: BinaryIO) -> tuple[tuple[int, ...], np.dtype]:
    """Return the shape and the element type that the header of a ``.npy`` file states."""
    version = np.lib.format.read_magic(file)
    readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    if version not in readers:
        raise ValueError(f"version {version[0]}.{version[1]} of the format .npy is not known")
    shape, _, dtype = readers[version](file)
    return shape, dtype


def _expect_shape(file_shape: tuple[int, ...], shape: tuple[int, ...]) -> None:
    if file_shape != shape:
        actual, expected = ("×".join(map(str, s)) or "1" for s in (file_shape, shape))
        raise ValueError(f"{actual} values, not {expected}")
