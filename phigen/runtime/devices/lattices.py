"""Lattices that split on devices: fields stay there from step to step; what is observed is computed on the host."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from itertools import chain
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phigen.errors import DeviceError
from phigen.runtime.devices.device import Device, OutOfMemoryError
from phigen.runtime.devices.opening import device_of
from phigen.runtime.interface import FIRST_DRAWS, BackendError, Draws, Floats, LatticeInterface
from phigen.runtime.numpy_lattice import NumpyLattice, NumpyLatticeSession

#: Steps after which it is looked at whether all fields are finite; those of a failing step are made again one by one.
_STEPS_PER_LOOK = 64


class DeviceLatticeSession(NumpyLatticeSession):
    """A session whose state is on a device, and comes back where it is read. The module is that of the host."""

    def __init__(self, backend: DeviceLattice, *arguments: Any, timed: bool) -> None:
        self._device, self._kernels = backend.device, backend.kernels
        self._host: Floats | None = None
        self._shape: tuple[int, ...] = arguments[1].shape
        self._on_device = False
        super().__init__(*arguments, timed=timed)
        self._tables = backend.tables(self._sites, self._shape[1:])
        self._fields, self._before = (self._device.empty(8 * int(np.prod(self._shape))) for _ in range(2))
        self._flag = self._device.empty(4)

    @property
    def _x(self) -> Floats:
        """The state on the host."""
        if self._host is None:
            self._host = np.empty(self._shape)
            self._device.read(self._fields, self._host)
        return self._host

    @_x.setter
    def _x(self, value: Floats) -> None:
        self._host, self._on_device = np.ascontiguousarray(value), False

    def advance(self, h: float, steps: int) -> None:
        """See `phigen.runtime.lattice.LatticeSession`. Raises `DeviceError` if the device fails; the state stays."""
        self.prepare(h)
        if not self._on_device:
            self._device.write(self._fields, self._x)
            self._on_device = True
        left = steps
        while left:
            count = min(left, _STEPS_PER_LOOK)
            begun = self.steps
            try:
                self._copy(self._fields, self._before)
                self._make(count)
                if self._failed():
                    self.steps = begun
                    self._copy(self._before, self._fields)
                    self._make_until_failure()
            except (DeviceError, OutOfMemoryError) as error:
                hint = "with checkpoints=, integrate stores the state at each frame, and resumes from there"
                raise DeviceError(f"after step {begun}: {error}\n  hint: {hint}") from error
            left -= count

    def _make_until_failure(self) -> None:
        """Make steps one by one until one fails. Raises `BackendError` with the state before it."""
        while True:
            self._copy(self._fields, self._before)
            self._make(1)
            if self._failed():
                self.steps -= 1
                self._tell_time()
                self._copy(self._before, self._fields)
                raise BackendError("NOT_FINITE", self.steps, self._x[None].copy())

    def _make(self, steps: int) -> None:
        """Make steps without a look at the results."""
        self._host = None
        module, rows = self._module, self._rows
        constant = not (hasattr(module, "_renewed") or hasattr(module, "_draw"))
        if constant:
            self._tables.write_coefficients(rows)
        for _ in range(steps):
            self._tell_time()
            if hasattr(module, "_renewed"):
                rows = module._renewed(self._sites, self._rows)
            if not constant:
                self._tables.write_coefficients(rows)
            for number, (part, row) in enumerate(module.SCHEDULE):
                if hasattr(module, "_draw") and number in (0, len(module.SCHEDULE) - len(module.SOURCES)):
                    self._tables.write_increments(module._draw(self._sites, int(number > 0)))
                for kernel, sites, items in self._kernels.of_part(part, self._tables):
                    self._device.launch(kernel, items, self._tables.arguments(items, sites, row, self._fields))
            self.steps += 1
        self._tell_time()

    def _copy(self, source: Any, target: Any) -> None:
        size = int(np.prod(self._shape))
        self._device.launch(self._kernels.copy, size, [np.int32(size), source, target])
        if target is self._fields:
            self._host = None

    def _failed(self) -> bool:
        size, flag = int(np.prod(self._shape)), np.zeros(1, dtype=np.int32)
        self._device.write(self._flag, flag)
        self._device.launch(self._kernels.failed, size, [np.int32(size), self._fields, self._flag])
        self._device.read(self._flag, flag)
        return bool(flag[0])


class Kernels:
    """The kernels of the sweeps of each part of H, with the colours of their sites; None for all sites."""

    def __init__(
        self,
        device: Device,
        text: str,
        name: str,
        parts: Sequence[Sequence[tuple[str, int | None]]],
        defined: Mapping[str, int],
    ) -> None:
        program = device.compiled(text, defined)
        self.copy, self.failed = (device.kernel(program, f"{name}_{kind}_kernel") for kind in ("copy", "failed"))
        self._parts = [[(device.kernel(program, f"{name}_{k}_kernel"), c) for k, c in part] for part in parts]

    def of_part(self, part: int, tables: Tables) -> list[tuple[Any, Any, int]]:
        """Return the kernels of a part, each with the numbers of its sites and their number."""
        return [(kernel, *tables.sites_of(colour)) for kernel, colour in self._parts[part]]


class Tables:
    """The arrays of a lattice on a device, beside its fields."""

    def __init__(self, device: Device, sites: Any, sizes: tuple[int, ...], interface: LatticeInterface) -> None:
        self._device, self._count = device, int(np.prod(sizes))
        numbers = np.arange(self._count, dtype=np.int32).reshape(sizes)
        neighbours = [sites.shifted(numbers, *offset).ravel() for offset in interface.neighbours]
        weights = [np.broadcast_to(sites.present(*chain.from_iterable(b)), sizes).ravel() for b in interface.bounds]
        at_sites = [np.broadcast_to(sites.parameters[name], sizes).ravel() for name in interface.at_sites]
        self._neighbours, self._weights = self._written(neighbours, np.int32), self._written(weights, np.float64)
        self._at_sites = self._written(at_sites, np.float64)
        self._increments = device.empty(8 * self._count * max(1, len(interface.noise)))
        self._coefficients: Any = None
        self._row = 0
        total = sum(w * p for w, p in zip(interface.colour_weights, np.indices(sizes), strict=True))
        self._colours: dict[int | None, tuple[Any, int]] = {None: (None, self._count)}
        for colour in range(interface.colours if interface.colours > 1 else 0):
            chosen = numbers.ravel()[(np.asarray(total) % interface.colours).ravel() == colour]
            self._colours[colour] = self._written([chosen], np.int32), len(chosen)

    def sites_of(self, colour: int | None) -> tuple[Any, int]:
        """Return the numbers of the sites of a colour, None for all sites, and their number."""
        return self._colours[colour if len(self._colours) > 1 else None]

    def write_coefficients(self, rows: Sequence[Sequence[Any]]) -> None:
        """Copy the coefficients of all flows of a step to the device."""
        values = np.ascontiguousarray(rows, dtype=np.float64).reshape(len(rows), -1)
        self._row = values.shape[1]
        if self._coefficients is None:
            self._coefficients = self._device.empty(values.nbytes)
        self._device.write(self._coefficients, values)

    def write_increments(self, increments: Any) -> None:
        """Copy the increments of the noise (sources, *sizes) to the device."""
        self._device.write(self._increments, np.ascontiguousarray(increments, dtype=np.float64))

    def arguments(self, items: int, sites: Any, row: int, fields: Any) -> list[Any]:
        """Return the arguments of the kernel of a sweep."""
        tables = [self._neighbours, self._weights, self._at_sites, self._increments]
        return [
            np.int32(items),
            np.int32(self._count),
            sites,
            self._coefficients,
            np.int32(row * self._row),
            *tables,
            fields,
        ]

    def _written(self, arrays: Sequence[NDArray[Any]], kind: Any) -> Any:
        values = np.ascontiguousarray(np.concatenate([*arrays, np.zeros(1)]), dtype=kind)
        buffer = self._device.empty(values.nbytes)
        self._device.write(buffer, values)
        return buffer


class DeviceLattice(NumpyLattice):
    """Back end over a generated header for devices, and over a NumPy module for what is computed on the host.

    ``defined`` are macros of the generated code, see `phigen.runtime.devices.ensembles.DeviceSolver`.
    """

    def __init__(
        self,
        files: Mapping[str, str],
        interface: LatticeInterface,
        target: str,
        defined: Mapping[str, int] = MappingProxyType({}),
    ) -> None:
        super().__init__(files, interface)
        self.target, self._defined = target, defined
        self._header = files[f"{interface.name}_device.h"]
        self.kernels = Kernels(self.device, self._header, interface.name, interface.sweeps, defined)

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        return DeviceLattice, (self._files, self.interface, self.target, dict(self._defined))

    @property
    def device(self) -> Device:
        """The device of this process."""
        return device_of(self.target)

    @property
    def identity(self) -> str:
        """See `phigen.runtime.lattice.LatticeBackend`."""
        return hashlib.sha256(f"{self._header}\n{self.device.name}\n{super().identity}".encode()).hexdigest()[:40]

    def tables(self, sites: Any, sizes: tuple[int, ...]) -> Tables:
        """Return the arrays of a lattice of some size on the device."""
        largest = np.iinfo(np.int32).max // max(self.interface.dimension, len(self.interface.neighbours))
        if np.prod(sizes, dtype=float) > largest:
            name = self.interface.name
            raise DeviceError(f"{name}: {sizes} are more than {largest} sites, the most that 32 bits can number")
        try:
            return Tables(self.device, sites, sizes, self.interface)
        except OutOfMemoryError as error:
            name = self.interface.name
            raise DeviceError(f"{name}: too little memory for {sizes} sites: {error}\n  hint: take fewer") from error

    def start(
        self, x0: Floats, parameters: Mapping[str, Any], t0: float = 0.0, draws: Draws = FIRST_DRAWS
    ) -> NumpyLatticeSession:
        """Return a session at x0 (coordinates, *sizes), at the time t0."""
        timed = bool(self.interface.time)
        return DeviceLatticeSession(self, self._module, x0, parameters, t0, draws, timed=timed)
