"""Opening of the devices of a target in the present process."""

from __future__ import annotations

from importlib import import_module

from phigen.runtime.devices.device import Device

#: The modules of devices by target.
DEVICES = {"opencl": "phigen.runtime.devices.opencl", "cuda": "phigen.runtime.devices.cuda"}


def device_of(target: str, index: int | None = None) -> Device:
    """Return a device of a target for this process. Raises `DeviceError` or `MissingPackageError`."""
    device: Device = import_module(DEVICES[target]).device(index)
    return device


def devices_of(target: str) -> int:
    """Return the number of devices of a target among which workers are distributed. Raises as `device_of`."""
    number: int = import_module(DEVICES[target]).count()
    return number
