"""Construction of solvers on devices. A solver on a device contains a solver for the host."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from phigen import registry
from phigen.errors import DeviceError
from phigen.runtime.devices.opening import device_of
from phigen.runtime.interface import Interface, LatticeInterface


def backend(files: Mapping[str, str], interface: Interface, target: str, index: int | None = None) -> Any:
    """Return the solver that runs generated code on a device.

    The files also contain code for the host (C or NumPy), which does the computations that do not run on the device.
    """
    from phigen.runtime.devices.ensembles import DeviceSolver
    from phigen.runtime.devices.lattices import DeviceLattice

    host = registry.target_of([file for file in files if not file.endswith("_device.h")], interface.name)
    device = device_of(target, index)
    if not (device.double or interface.single):
        hint = "write real: float in the spec, or set PHIGEN_DEVICE to another device"
        raise DeviceError(f"{device.name} does not support double precision; {hint}")
    if isinstance(interface, LatticeInterface):
        return DeviceLattice(files, interface, target, index=index)
    return DeviceSolver(files, interface, target, host.load(files, interface), index=index)
