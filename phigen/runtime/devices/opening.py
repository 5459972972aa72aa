"""Opening of a device for a target (``opencl`` or ``cuda``) in the present process."""

from __future__ import annotations

from importlib import import_module

from phigen.runtime.devices.device import Device

#: Target → name of the module that opens its devices.
DEVICES = {"opencl": "phigen.runtime.devices.opencl", "cuda": "phigen.runtime.devices.cuda"}


def device_of(target: str, index: int | None = None) -> Device:
    """Return a device of a target, opened in this process; ``index`` is its number, None for the default device.

    Raises `DeviceError` or `MissingPackageError`.
    """
    device: Device = import_module(DEVICES[target]).device(index)
    return device


def devices_of(target: str) -> int:
    """Return the number of devices of a target among which the workers of a sweep are distributed.

    Raises `DeviceError` or `MissingPackageError`.
    """
    number: int = import_module(DEVICES[target]).count()
    return number
