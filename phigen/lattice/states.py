"""Runs of lattices as arrays: the initial state, the parameters at sites and bonds, and the list of bonds."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phigen.errors import SpecError
from phigen.lattice.array_files import bonds_in, values_in
from phigen.memory import expect_room
from phigen.spec.model import LatticeRunSettings, MatrixForm, Parameter, Run, Spec, Values
from phigen.symbolic.arrays import evaluate
from phigen.symbolic.expression import symbols_of

Floats = NDArray[np.float64]
Bonds = NDArray[np.int64]


@dataclass(frozen=True)
class Start:
    """The data of a run of a lattice before its first step.

    ``sizes`` are the numbers of sites along the axes of a grid; for graphs and pairs, the only size is the number of
    sites. ``state`` has the shape (fields, *sizes). ``parameters`` maps names to a number, or to an array over sites or
    bonds. Each row of ``bonds`` has the two sites that a bond connects. ``graph`` is true if the lattice is a graph.
    """

    sizes: tuple[int, ...]
    state: Floats
    parameters: Mapping[str, float | Floats]
    bonds: Bonds
    graph: bool = False

    @property
    def arguments(self) -> dict[str, Any]:
        """The arguments of a solver by name: the parameters and, for a graph, ``bonds``."""
        return {**self.parameters, **({"bonds": self.bonds} if self.graph else {})}


def start_of(spec: Spec, run: Run) -> Start:
    """Return the initial state, parameters and bonds of a run of a lattice.

    Raises `SpecError`, with the place in the spec, for files that cannot be read and arrays that do not fit the sizes.
    """
    return _Reader(spec, run).start()


def defaults_at(spec: Spec, names: Collection[str], sizes: tuple[int, ...], bonds: int) -> dict[str, Floats]:
    """Return arrays with the default values of the parameters ``names`` at all sites or bonds of a lattice.

    A parameter is left out if its default is one number for all sites or bonds. ``bonds`` is the number of bonds of a
    graph. Raises `SpecError` if the default is an array of the wrong length.
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
            raise ValueError(f"{spec.name} is not a lattice")
        self.spec, self.run, self.lattice, self.lattice_run = spec, run, spec.lattice, run.lattice

    def start(self) -> Start:
        bonds, columns = self._bonds(self.lattice_run)
        sizes = self.lattice_run.sizes or (self._sites(bonds),)
        if len(bonds) and bonds.max() >= sizes[0]:
            raise self._error(
                "bonds", f"a bond ends at site {bonds.max()}, but sites have the numbers 0 to {sizes[0] - 1}"
            )
        if (names := self.lattice_run.names) and len(names) != sizes[0]:
            raise self._error("names", f"names: {len(names)} names for {sizes[0]} sites")
        self._expect_room(sizes)
        self.arrays = _Arrays(self.spec, sizes, self.run.name)
        parameters: dict[str, float | Floats] = dict(self.spec.parameters_of(self.run))
        for p in self.spec.parameters:
            if p.at != "all":
                shape = sizes if p.at == "sites" else (len(bonds),)
                values = self.lattice_run.arrays.get(p.name)
                if values is None and p.at == "bonds" and p.name in columns:
                    parameters[p.name] = columns[p.name]
                else:
                    values = values or p.values
                    default = np.full(shape, float(p.value))
                    parameters[p.name] = default if values is None else self.arrays.read(values, shape, p.name)
                self._expect_in_bound(p, np.asarray(parameters[p.name]))
        return Start(sizes, self._state(sizes), parameters, bonds, bool(self.lattice.graph))

    def _expect_in_bound(self, p: Parameter, values: Floats) -> None:
        """Raise `SpecError` if values at sites or bonds are outside the declared bound of a parameter."""
        if values.size and p.refuses(float(np.min(values))):
            raise self._out_of_bound(p, values, f"the parameter is {p.bound} by declaration")
        if self.spec.coordinates_from and p.at == "sites":
            # This parameter is the mass, since `relative_bodies` refuses other parameters at sites.
            self._expect_masses(p, values)

    def _expect_masses(self, p: Parameter, values: Floats) -> None:
        """Raise `SpecError` if relative coordinates do not allow the masses. For instance, the first body must have a
        positive mass.
        """
        begin, form = f"with coordinates_from: {self.spec.coordinates_from},", self.spec.poisson
        if not values.flat[0] > 0:
            message = f"{begin} the first body needs a positive mass, not {values.flat[0]:g}"
            raise self.arrays.refused(p.name, message)
        entries = [e for row in form.entries for e in row] if isinstance(form, MatrixForm) else []
        if (least := np.min(values)) < 0:
            raise self._out_of_bound(p, values, f"{begin} masses must be nonnegative")
        if least == 0 and p.name not in symbols_of(*entries):  # if m is not in π, the fields are momenta
            raise self._out_of_bound(p, values, f"{begin} bodies with momenta must have positive masses")

    def _out_of_bound(self, p: Parameter, values: Floats, rule: str) -> SpecError:
        """Return the error for values of a parameter that break the ``rule``; the message names the least value and its
        place.
        """
        worst = np.unravel_index(np.argmin(values), values.shape)
        place, noun = ", ".join(map(str, worst)), p.at.removesuffix("s")
        where = f"{float(values[worst]):g} at {noun} {place if len(worst) == 1 else f'({place})'}"
        return self.arrays.refused(p.name, f"{rule}, but {where}")

    def _expect_room(self, sizes: Sequence[int]) -> None:
        """Raise `SpecError` if the memory is too small for the arrays over all sites."""
        arrays = len(self.lattice.indices) + len(self.spec.coordinates)
        arrays += sum(p.at == "sites" for p in self.spec.parameters)
        place = self.spec.diagnostic(("runs", self.run.name, "sizes"), "").location
        expect_room(f"{' × '.join(map(str, sizes))} sites", 8 * arrays * math.prod(sizes), place)

    def _error(self, key: str, message: str, hint: str = "") -> SpecError:
        return SpecError([self.spec.diagnostic(("runs", self.run.name, key), message, hint)])

    def _sites(self, bonds: Bonds) -> int:
        """Return the number of sites of a run that does not state ``sizes``.

        This number is the greater of two numbers: the length of the longest list in the initial state, and 1 plus the
        largest number of a site at the end of a bond. Sites are counted from 0.
        """
        lengths = [len(v.listed) for v in self.lattice_run.state.values() if v.listed]
        if not lengths and not len(bonds):
            raise self._error("initial", "the number of sites is not known", "sizes: [N]")
        return max([*lengths, int(bonds.max()) + 1 if len(bonds) else 0])

    def _state(self, sizes: tuple[int, ...]) -> Floats:
        fields, values_by_field = self.spec.coordinates, self.lattice_run.state
        shape = (len(fields), *sizes)
        if "" not in values_by_field:
            return np.stack([self.arrays.read(values_by_field[f], sizes, f) for f in fields])
        values = values_by_field[""]
        if values.random != "sphere":
            return self.arrays.read(values, shape, "initial")
        random_vectors = np.random.default_rng(values.seed).normal(size=shape)
        return np.asarray(float(values.scale) * random_vectors / np.sqrt((random_vectors**2).sum(axis=0)))

    def _bonds(self, lattice_run: LatticeRunSettings) -> tuple[Bonds, dict[str, Floats]]:
        if not isinstance(lattice_run.bonds, str):
            return np.array(lattice_run.bonds, dtype=np.int64).reshape(-1, 2), {}
        if not lattice_run.bonds:
            return np.zeros((0, 2), dtype=np.int64), {}
        at_bonds = [p.name for p in self.spec.parameters if p.at == "bonds"]
        try:
            return bonds_in(Path(self.spec.file).parent / lattice_run.bonds, at_bonds)
        except (OSError, ValueError) as error:
            raise self._error("bonds", f"bonds: cannot read {lattice_run.bonds!r}: {_reason(error)}") from None


class _Arrays:
    """Reader that makes arrays over sites or bonds from the values that a spec states.

    ``sizes`` are the numbers of sites along the axes of the lattice.

    ``run`` is the name of the run whose values are read. Error messages end with ``hint``.
    """

    def __init__(self, spec: Spec, sizes: Sequence[int], run: str = "", hint: str = "") -> None:
        assert spec.lattice is not None
        grids = np.meshgrid(*(np.arange(n, dtype=np.float64) for n in sizes), indexing="ij")
        indices: dict[str, Any] = dict(zip(spec.lattice.indices, grids, strict=True))
        self.indices = indices | {f"N_{i}": float(n) for i, n in zip(spec.lattice.indices, sizes, strict=True)}
        self.spec, self.run, self.hint = spec, run, hint
        self.folder = Path(spec.file).parent

    def read(self, values: Values, shape: tuple[int, ...], name: str) -> Floats:
        """Return values of a spec as an array with the given shape. Raises `SpecError` if the values have another
        shape.
        """
        if values.file:
            try:
                return values_in(self.folder / values.file, name, shape)
            except (OSError, ValueError) as error:
                raise self.refused(name, f"cannot read {values.file!r}: {_reason(error)}") from None
        elif values.listed:
            array = np.array([float(v) for v in values.listed])
            if array.size == np.prod(shape):
                array = array.reshape(shape)
        elif values.random:
            random = np.random.default_rng(values.seed)
            random_values = (
                random.normal(size=shape) if values.random == "normal" else random.uniform(-1, 1, size=shape)
            )
            array = float(values.scale) * random_values
        else:
            array = np.zeros(shape)
        if values.formula is not None:
            array += evaluate([values.formula], self.indices)[0]
        if array.shape != shape:
            expected, actual = "×".join(map(str, shape)), "×".join(map(str, array.shape))
            raise self.refused(name, f"{actual} values, not {expected}")
        if not np.all(np.isfinite(array)):
            raise self.refused(name, "not all values are finite")
        return array

    def refused(self, name: str, message: str) -> SpecError:
        """Return an error that points to the place in the spec where the values of ``name`` are given.

        ``name`` is a field or a parameter, or "initial" for the whole state.
        """
        run_path = ("runs", self.run)
        paths = [(*run_path, "parameters", name), ("parameters", name, "value"), (*run_path, "initial", name)]
        path = next((p for p in paths if p in self.spec.locations), (*run_path, "initial"))
        return SpecError([self.spec.diagnostic(path, f"{name}: {message}", self.hint)])


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error).split("\n")[0]
