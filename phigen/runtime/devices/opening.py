"""The device of a target in this process."""

from __future__ import annotations

from importlib import import_module

from phigen.runtime.devices.device import Device

#: The modules of devices by target.
DEVICES = {"opencl": "phigen.runtime.devices.opencl", "cuda": "phigen.runtime.devices.cuda"}


def device_of(target: str) -> Device:
    """Return the device of a target in this process. Raises `DeviceError` or `MissingPackageError`."""
    opened: Device = import_module(DEVICES[target]).device()
    return opened
