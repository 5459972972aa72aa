"""What an integration gives back."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from phigen.runtime.interface import Floats


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States of one integration: row 0 is the initial state, the last row always the final one.

    ``t`` (rows,), ``x`` (rows, DIM), ``energy`` (rows,): H of the rows, and ``casimirs``: name → (rows,).
    ``steps`` were made with step size ``h``; the rows are those of every stride-th step and of the last.
    """

    t: Floats
    x: Floats
    energy: Floats
    casimirs: Mapping[str, Floats]
    steps: int
    h: float
    parameters: Mapping[str, float]
    coordinates: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        names = ", ".join(self.coordinates)
        return f"<Trajectory of ({names}): {self.steps} steps of {self.h!r}, {len(self)} rows>"

    def column(self, coordinate: str) -> Floats:
        """The values (rows,) of one coordinate; raises `KeyError` for a name that is none."""
        if coordinate not in self.coordinates:
            raise KeyError(f"{coordinate!r} is not a coordinate; there are {', '.join(self.coordinates)}")
        return self.x[:, self.coordinates.index(coordinate)]

    def save(self, path: str | Path) -> None:
        """Write a ``.csv`` or ``.npz`` file, by the suffix of the path; raises `ValueError` for any other."""
        writers = {".csv": self.to_csv, ".npz": self.to_npz}
        suffix = Path(path).suffix.lower()
        if suffix not in writers:
            raise ValueError(f"cannot save a trajectory as {str(path)!r}: the suffix must be .csv or .npz")
        writers[suffix](path)

    def to_csv(self, path: str | Path) -> None:
        """Write ``t,x1,…,energy,C…``, one line per row; every float reads back as the same float."""
        table = np.column_stack([self.t, self.x, self.energy, *self.casimirs.values()])
        with Path(path).open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(["t", *self.coordinates, "energy", *self.casimirs])
            writer.writerows([repr(value) for value in row] for row in table.tolist())

    def to_npz(self, path: str | Path) -> None:
        """Write the arrays t, x, energy, casimir_NAME, coordinates, and steps, h, parameter_NAME as scalars."""
        arrays: dict[str, object] = {f"casimir_{name}": values for name, values in self.casimirs.items()}
        arrays |= {f"parameter_{name}": value for name, value in self.parameters.items()}
        arrays |= {"t": self.t, "x": self.x, "energy": self.energy, "coordinates": np.array(self.coordinates)}
        arrays |= {"steps": self.steps, "h": self.h}
        stored = {name: np.asarray(value) for name, value in arrays.items()}
        with Path(path).open("wb") as file:  # given a name, numpy would append a suffix of its own
            np.savez_compressed(file, allow_pickle=False, **stored)
