"""Runs of lattices as arrays: initial states, parameters at sites and bonds, bonds."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phigen.errors import SpecError
from phigen.lattice.files import bonds_in, values_in
from phigen.runtime.memory import expect_room
from phigen.spec.model import LatticeRun, Run, Spec, Values
from phigen.symbolic.arrays import evaluate

Floats = NDArray[np.float64]
Bonds = NDArray[np.int64]


@dataclass(frozen=True)
class Start:
    """A run before its first step.

    ``sizes`` are those of the axes, of graphs and pairs the number of sites. ``state`` has the shape (fields, *sizes).
    ``parameters`` are numbers, and arrays over sites or bonds. ``bonds`` has the shape (bonds, 2), ``graph`` tells
    whether there are any.
    """

    sizes: tuple[int, ...]
    state: Floats
    parameters: Mapping[str, float | Floats]
    bonds: Bonds
    graph: bool = False

    @property
    def arguments(self) -> dict[str, Any]:
        """The parameters of a solver, with the bonds of a graph."""
        return {**self.parameters, **({"bonds": self.bonds} if self.graph else {})}


def start_of(spec: Spec, run: Run) -> Start:
    """What a run of a lattice starts from.

    Raises `SpecError` for files that cannot be read and arrays that do not fit, with the place in the spec.
    """
    return _Reader(spec, run).start()


def defaults_at(spec: Spec, names: Collection[str], sizes: tuple[int, ...], bonds: int) -> dict[str, Floats]:
    """Return the defaults of parameters that are formulas, lists, files or random, at the given sizes.

    ``bonds`` is the number of bonds of a graph. Raises `SpecError` for those that do not fit, with their place.
    """
    arrays = {}
    for p in spec.parameters:
        if p.name in names and p.values is not None:
            shape = sizes if p.at == "sites" else (bonds,)
            hint = f"give {p.name}=, an array of shape {shape}, or one number"
            arrays[p.name] = _Arrays(spec, sizes, hint=hint).read(p.values, shape, p.name)
    return arrays


class _Reader:
    def __init__(self, spec: Spec, run: Run) -> None:
        if spec.lattice is None or run.lattice is None:
            raise ValueError(f"{spec.name} is no lattice")
        self.spec, self.run, self.lattice, self.given = spec, run, spec.lattice, run.lattice

    def start(self) -> Start:
        bonds, columns = self._bonds(self.given)
        sizes = self.given.sizes or (self._sites(bonds),)
        if len(bonds) and bonds.max() >= sizes[0]:
            raise self._error("bonds", f"a bond ends at site {bonds.max()}, but there are {sizes[0]} sites")
        self._expect_room(sizes)
        self.arrays = _Arrays(self.spec, sizes, self.run.name)
        parameters: dict[str, float | Floats] = dict(self.spec.parameters_of(self.run))
        for p in self.spec.parameters:
            if p.at != "all":
                shape = sizes if p.at == "sites" else (len(bonds),)
                found = self.given.arrays.get(p.name)
                if found is None and p.at == "bonds" and p.name in columns:
                    parameters[p.name] = columns[p.name]
                else:
                    found = found or p.values
                    whole = np.full(shape, float(p.value))
                    parameters[p.name] = whole if found is None else self.arrays.read(found, shape, p.name)
                if p.positive and np.any(np.asarray(parameters[p.name]) <= 0):
                    message = f"the parameter {p.name!r} is positive by declaration, but not all its values are"
                    raise self._error("parameters", message)
        return Start(sizes, self._state(sizes), parameters, bonds, bool(self.lattice.graph))

    def _expect_room(self, sizes: Sequence[int]) -> None:
        """The indices of sites, the state, and parameters at sites are arrays at once."""
        arrays = len(self.lattice.indices) + len(self.spec.coordinates)
        arrays += sum(p.at == "sites" for p in self.spec.parameters)
        place = self.spec.diagnostic(("runs", self.run.name, "sizes"), "").location
        expect_room(f"{' × '.join(map(str, sizes))} sites", 8 * arrays * math.prod(sizes), place)

    def _error(self, key: str, message: str, hint: str = "") -> SpecError:
        return SpecError([self.spec.diagnostic(("runs", self.run.name, key), message, hint)])

    def _sites(self, bonds: Bonds) -> int:
        """The number of sites where the run does not say it: what bonds or lists of initial values have."""
        lengths = [len(v.listed) for v in self.given.state.values() if v.listed]
        if not lengths and not len(bonds):
            raise self._error("initial", "the number of sites is not known", "sizes: [N]")
        return max([*lengths, int(bonds.max()) + 1 if len(bonds) else 0])

    def _state(self, sizes: tuple[int, ...]) -> Floats:
        fields, given = self.spec.coordinates, self.given.state
        shape = (len(fields), *sizes)
        if "" not in given:
            return np.stack([self.arrays.read(given[f], sizes, f) for f in fields])
        values = given[""]
        if values.random != "sphere":
            return self.arrays.read(values, shape, "initial")
        drawn = np.random.default_rng(values.seed).normal(size=shape)
        return np.asarray(float(values.scale) * drawn / np.sqrt((drawn**2).sum(axis=0)))

    def _bonds(self, given: LatticeRun) -> tuple[Bonds, dict[str, Floats]]:
        if not isinstance(given.bonds, str):
            return np.array(given.bonds, dtype=np.int64).reshape(-1, 2), {}
        if not given.bonds:
            return np.zeros((0, 2), dtype=np.int64), {}
        at_bonds = [p.name for p in self.spec.parameters if p.at == "bonds"]
        try:
            return bonds_in(Path(self.spec.file).parent / given.bonds, at_bonds)
        except (OSError, ValueError) as error:
            raise self._error("bonds", f"bonds: cannot read {given.bonds!r}: {_reason(error)}") from None


class _Arrays:
    """Values of a spec as arrays over the sites or bonds of a lattice of given sizes.

    ``run`` is the name of the run whose values they may be, and ``hint`` that of errors.
    """

    def __init__(self, spec: Spec, sizes: Sequence[int], run: str = "", hint: str = "") -> None:
        assert spec.lattice is not None
        grids = np.meshgrid(*(np.arange(n, dtype=np.float64) for n in sizes), indexing="ij")
        indices: dict[str, Any] = dict(zip(spec.lattice.indices, grids, strict=True))
        self.indices = indices | {f"N_{i}": float(n) for i, n in zip(spec.lattice.indices, sizes, strict=True)}
        self.spec, self.run, self.hint = spec, run, hint
        self.folder = Path(spec.file).parent

    def read(self, values: Values, shape: tuple[int, ...], name: str) -> Floats:
        """Return values as an array of that shape. Raises `SpecError` if they do not fit."""
        if values.file:
            try:
                return values_in(self.folder / values.file, name, shape)
            except (OSError, ValueError) as error:
                raise self._refused(name, f"cannot read {values.file!r}: {_reason(error)}") from None
        elif values.listed:
            found = np.array([float(v) for v in values.listed])
            if found.size == np.prod(shape):
                found = found.reshape(shape)
        elif values.random:
            random = np.random.default_rng(values.seed)
            drawn = random.normal(size=shape) if values.random == "normal" else random.uniform(-1, 1, size=shape)
            found = float(values.scale) * drawn
        else:
            found = np.zeros(shape)
        if values.formula is not None:
            found += evaluate([values.formula], self.indices)[0]
        if found.shape != shape:
            wanted, has = "×".join(map(str, shape)), "×".join(map(str, found.shape))
            raise self._refused(name, f"{has} values, not {wanted}")
        if not np.all(np.isfinite(found)):
            raise self._refused(name, "not all values are finite")
        return found

    def _refused(self, name: str, message: str) -> SpecError:
        """The error of the values of a field, of a parameter, or of the whole state, at the place of these."""
        here = ("runs", self.run)
        paths = [(*here, "parameters", name), ("parameters", name, "value"), (*here, "initial", name)]
        path = next((p for p in paths if p in self.spec.locations), (*here, "initial"))
        return SpecError([self.spec.diagnostic(path, f"{name}: {message}", self.hint)])


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error).split("\n")[0]
