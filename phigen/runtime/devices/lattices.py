"""Solver of lattices on devices: it compiles the kernels, and starts sessions for each kind of step."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from phigen.errors import DeviceError
from phigen.runtime.devices.device import Device, OutOfMemoryError
from phigen.runtime.devices.implicit import ImplicitSession, stepping_module
from phigen.runtime.devices.lattice_sessions import DeviceLatticeSession
from phigen.runtime.devices.launching import Kernels, Launcher
from phigen.runtime.devices.monitored import MonitoredSession, monitoring_module
from phigen.runtime.devices.opening import device_of
from phigen.runtime.devices.site_tables import SiteTables
from phigen.runtime.interface import FIRST_DRAWS, Draws, Floats, LatticeInterface
from phigen.runtime.numpy_lattice import NumpyLattice, NumpyLatticeSession


class DeviceLattice(NumpyLattice):
    """Solver of a lattice on a device, with a generated NumPy module for computations on the host.

    The object is a `phigen.runtime.lattice.LatticeBackend`. ``files`` contain the generated header for devices.
    ``defined`` are macros for the header, such as NAME_GROUP, the number of work items in a group.
    """

    def __init__(
        self,
        files: Mapping[str, str],
        interface: LatticeInterface,
        target: str,
        defined: Mapping[str, int] = MappingProxyType({}),
        index: int | None = None,
    ) -> None:
        super().__init__(files, interface)
        self.target, self._defined, self._index = target, defined, index
        self._header = files[f"{interface.name}_device.h"]
        self.kernels = Kernels(self.device, self._header, interface.name, defined)
        self._of_sizes: tuple[tuple[int, ...], dict[Any, Any]] = (), {}

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        return DeviceLattice, (self._files, self.interface, self.target, dict(self._defined), self._index)

    @property
    def device(self) -> Device:
        """The device, opened in the present process on first use."""
        return device_of(self.target, self._index)

    @property
    def identity(self) -> str:
        return hashlib.sha256(f"{self._header}\n{self.device.name}\n{super().identity}".encode()).hexdigest()[:40]

    @cached_property
    def stepping(self) -> Any:
        """The generated NumPy module that makes implicit steps, with arrays on the device."""
        return stepping_module(self._text, self.interface.name, single=self.interface.single)

    @cached_property
    def monitoring(self) -> Any:
        """The generated NumPy module that computes the durations of flows, for a lattice with a monitor."""
        return monitoring_module(self._text, self.interface.name)

    def launcher(self, sites: Any, sizes: tuple[int, ...]) -> Launcher:
        """Return the object that launches kernels for a lattice of these sizes. Raises `DeviceError` for too many
        sites."""
        launches, interface = self.interface.launches, self.interface
        rows = [len(launches.neighbours), interface.dimension * (2 if interface.compensated else 1)]
        rows += [launch.outputs for launch in launches.others.values()]
        largest = np.iinfo(np.int32).max // max(rows)
        if np.prod(sizes, dtype=float) > largest:
            raise DeviceError(f"{interface.name}: {sizes} are too many sites for a device, the limit is {largest}")
        if self._of_sizes[0] != sizes:
            self._of_sizes = sizes, {}
        real = np.float32 if interface.single else np.float64
        return Launcher(self.kernels, SiteTables(self.device, sites, sizes, interface, real, self._of_sizes[1]))

    def start(
        self, x0: Floats, parameters: Mapping[str, Any], t0: float = 0.0, draws: Draws = FIRST_DRAWS
    ) -> NumpyLatticeSession:
        """Return a session at x0 (coordinates, *sizes), at the time t0.

        Raises `DeviceError` if the device fails or has too little memory.
        """
        implicit, monitored = hasattr(self._module, "_relax"), hasattr(self._module, "_rate")
        session = ImplicitSession if implicit else MonitoredSession if monitored else DeviceLatticeSession
        timed = bool(self.interface.time)
        try:
            return session(self, self._module, x0, parameters, t0, draws, timed=timed)
        except OutOfMemoryError as error:
            sites = f"{self.interface.name}: too little memory for {x0.shape[1:]} sites"
            raise DeviceError(f"{sites}: {error}\n  hint: take fewer sites") from error
