"""Protocol of devices: graphics cards, and processors with an OpenCL driver."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from phigen.errors import DeviceError

#: Environment variable that selects a device, by its number or by a part of its name.
CHOICE = "PHIGEN_DEVICE"

#: Beginning of error messages about a device that cannot be used again in this process.
LOST = "the device was lost, or its driver failed"


class OutOfMemoryError(Exception):
    """A device has too little memory for an array, or for a kernel."""


class Device(Protocol):
    """Protocol of a device with its own memory: a graphics card, or a processor that an OpenCL driver serves.

    All methods except ``read`` may return before their work is done. Arguments of kernels are NumPy scalars, buffers,
    and None for absent arrays. Methods raise `OutOfMemoryError`, or `DeviceError` if a driver fails.
    """

    target: str
    name: str
    memory: int  # bytes of device memory
    largest: int  # bytes of the largest possible array
    shared: int  # bytes of shared memory of a work group
    group: int  # largest number of work items in a group
    units: int  # compute units, each of which runs many work items
    double: bool  # whether double precision is supported
    is_card: bool  # whether the device is a graphics card: values that do not fit into registers are slow there

    def compiled(self, text: str, defined: Mapping[str, int]) -> Any:
        """Return the program compiled from a source text; ``defined`` are preprocessor macros and their values.

        Raises `DeviceError` with the messages of the compiler.
        """
        ...

    def kernel(self, program: Any, name: str) -> Any:
        """Return the kernel with this name in a compiled program."""
        ...

    def empty(self, size: int) -> Any:
        """Return a new buffer of the given number of bytes."""
        ...

    def local_bytes(self, kernel: Any) -> int:
        """Return the number of bytes of device memory that each work item uses because registers do not suffice."""
        ...

    def constants(self, array: Any) -> Any:
        """Return a kernel argument for an array of constants that all work items read."""
        ...

    def write(self, buffer: Any, array: Any) -> None:
        """Copy a contiguous array into a buffer."""
        ...

    def read(self, buffer: Any, array: Any) -> None:
        """Wait for all launched kernels, and copy a buffer into a contiguous array."""
        ...

    def launch(self, kernel: Any, items: int, arguments: Sequence[Any]) -> None:
        """Run a kernel for at least ``items`` work items. The size of their groups was fixed when the kernel was
        compiled.
        """
        ...


#: Open devices, by process number and device index (None for the default). A forked process opens devices of its own,
#: since driver contexts do not survive a fork.
Opened = dict[tuple[int, int | None], Any]


def choose(names: Sequence[str], target: str, index: int | None) -> int:
    """Return the number of the device to use: ``index`` or, if ``index`` is None, the user's choice.

    The user chooses a device by its number, or by a part of its name, in the environment variable PHIGEN_DEVICE. If the
    variable is not set, the choice is device 0. ``names`` are the names of all devices. Raises `DeviceError` if no
    device has the chosen number or name.
    """
    if index is not None and not hasattr(index, "__index__"):
        raise TypeError(f"device is {index!r}, but must be a number; the devices of {target} are {_listed(names)}")
    if index is not None and not 0 <= index < len(names):
        raise DeviceError(f"device is {index}, but {target} has the devices {_listed(names)}")
    requested_device = os.environ.get(CHOICE, "")
    if index is not None or not requested_device:
        return index or 0
    if requested_device.isdecimal() and int(requested_device) < len(names):
        return int(requested_device)
    for index, name in enumerate(names):
        if requested_device.lower() in name.lower():
            return index
    raise DeviceError(f"{CHOICE} is {requested_device!r}, but {target} has the devices {_listed(names)}")


def _listed(names: Sequence[str]) -> str:
    return "; ".join(f"{index}: {name}" for index, name in enumerate(names))
