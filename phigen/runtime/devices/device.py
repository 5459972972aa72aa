"""Protocol of devices: graphics cards, and processors with an OpenCL driver."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from phigen.errors import DeviceError

#: Environment variable that chooses a device: its number, or a part of its name.
CHOICE = "PHIGEN_DEVICE"


class OutOfMemoryError(Exception):
    """A device has too little memory for an array, or for a kernel."""


class Device(Protocol):
    """A device with its own memory. All methods but ``read`` may return before they are done.

    Kernels receive numbers as NumPy scalars, buffers, and None for absent arrays. Methods raise `OutOfMemoryError`, or
    `DeviceError` where a driver fails.
    """

    target: str
    name: str
    memory: int  # bytes of its memory
    largest: int  # bytes of the largest array
    units: int  # compute units, each of which runs many work items
    double: bool  # whether it has numbers in double precision

    def compiled(self, text: str, defined: Mapping[str, int]) -> Any:
        """Return the program of a source text, with macros that are ``defined``.

        Raises `DeviceError` with the messages of the compiler.
        """
        ...

    def kernel(self, program: Any, name: str) -> Any:
        """Return a kernel of a program."""
        ...

    def empty(self, size: int) -> Any:
        """Return a new buffer of a number of bytes."""
        ...

    def write(self, buffer: Any, array: Any) -> None:
        """Copy a contiguous array into a buffer."""
        ...

    def read(self, buffer: Any, array: Any) -> None:
        """Wait for all that was launched, and copy a buffer into a contiguous array."""
        ...

    def launch(self, kernel: Any, items: int, arguments: Sequence[Any]) -> None:
        """Run a kernel for at least a number of work items, in groups of the size that it is compiled for."""
        ...


def choose(names: Sequence[str], target: str) -> int:
    """Return the index of the device that `CHOICE` names, by default of the first. Raises `DeviceError`."""
    requested_device = os.environ.get(CHOICE, "")
    if not requested_device:
        return 0
    if requested_device.isdecimal() and int(requested_device) < len(names):
        return int(requested_device)
    for index, name in enumerate(names):
        if requested_device.lower() in name.lower():
            return index
    listed = "; ".join(f"{index}: {name}" for index, name in enumerate(names))
    raise DeviceError(f"{CHOICE} is {requested_device!r}, but {target} has the devices {listed}")
