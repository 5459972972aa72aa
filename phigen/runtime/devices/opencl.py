"""OpenCL devices, used through pyopencl."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from phigen.errors import DeviceError, MissingPackageError
from phigen.runtime.devices.device import LOST, Opened, OutOfMemoryError, choose
from phigen.runtime.interface import Interface

Result = TypeVar("Result")

#: Options of the compiler. None of them allows inexact arithmetic, so results have the same bits as those of the C. -w
#: suppresses warnings of drivers about unrolled loops.
_OPTIONS = ["-w"]

_MEMORY = ("MEM_OBJECT_ALLOCATION_FAILURE", "OUT_OF_RESOURCES", "OUT_OF_HOST_MEMORY", "INVALID_BUFFER_SIZE")


class OpenCLDevice:
    """A device of OpenCL with a command queue: a `phigen.runtime.devices.device.Device`."""

    target = "opencl"

    def __init__(self, cl: Any, device: Any) -> None:
        self._cl = cl
        self._context = cl.Context([device])
        self._queue = cl.CommandQueue(self._context)
        self.name, self.units = f"{device.name.strip()}, {device.platform.name.strip()}", device.max_compute_units
        self.memory, self.largest = device.global_mem_size, device.max_mem_alloc_size
        self.shared, self.group = device.local_mem_size, device.max_work_group_size
        self.double = bool(device.double_fp_config)
        self.is_card = not device.type & cl.device_type.CPU

    def __repr__(self) -> str:
        return f"<OpenCL device: {self.name}, {self.memory >> 20} MiB>"

    def compiled(self, text: str, defined: Mapping[str, int]) -> Any:
        options = [*_OPTIONS, *(f"-D{name}={value}" for name, value in defined.items())]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # pyopencl warns if the compiler writes a log, even if it succeeds
            try:
                return self._cl.Program(self._context, text).build(options=options)
            except self._cl.Error as error:
                raise DeviceError(f"{self.name}: the driver refuses the generated code\n{error}") from error

    def kernel(self, program: Any, name: str) -> Any:
        return self._cl.Kernel(program, name)

    def empty(self, size: int) -> Any:
        return self._checked_call(lambda: self._cl.Buffer(self._context, self._cl.mem_flags.READ_WRITE, max(1, size)))

    def local_bytes(self, kernel: Any) -> int:
        """Return the bytes that each work item of a kernel uses beyond registers; 0 if the driver does not report
        them."""
        return int(kernel.get_work_group_info(self._cl.kernel_work_group_info.PRIVATE_MEM_SIZE, self._device))

    def constants(self, array: Any) -> Any:
        """Return an array of constants as a buffer, which a kernel reads in the constant address space."""
        buffer = self.empty(array.nbytes)
        self.write(buffer, array)
        return buffer

    def write(self, buffer: Any, array: Any) -> None:
        if array.nbytes:
            self._checked_call(lambda: self._cl.enqueue_copy(self._queue, buffer, array))

    def read(self, buffer: Any, array: Any) -> None:
        if array.nbytes:
            self._checked_call(lambda: self._cl.enqueue_copy(self._queue, array, buffer))

    def launch(self, kernel: Any, items: int, arguments: Sequence[Any]) -> None:
        size = kernel.get_work_group_info(self._cl.kernel_work_group_info.COMPILE_WORK_GROUP_SIZE, self._device)[0]
        self._checked_call(lambda: kernel(self._queue, (-(-items // size) * size,), (size,), *arguments))

    @property
    def _device(self) -> Any:
        return self._context.devices[0]

    def _checked_call(self, call: Callable[[], Result]) -> Result:
        """Return the result of a call of OpenCL; errors of OpenCL are raised as `OutOfMemoryError` or `DeviceError`."""
        try:
            return call()
        except self._cl.Error as error:
            if isinstance(error, self._cl.MemoryError) or any(word in str(error) for word in _MEMORY):
                raise OutOfMemoryError(str(error)) from error
            raise DeviceError(f"{self.name}: {LOST}: {error}") from error


_OPENED: Opened = {}


def device(index: int | None = None) -> OpenCLDevice:
    """Return the device with the number ``index``, opened in this process; the default device if ``index`` is None.

    Raises `MissingPackageError` without pyopencl, `DeviceError` without a driver or a device.
    """
    key = os.getpid(), index
    if key not in _OPENED:
        cl = _library()
        devices = _listed(cl)
        _OPENED[key] = OpenCLDevice(cl, devices[choose([d.name for d in devices], "OpenCL", index)])
    opencl_device: OpenCLDevice = _OPENED[key]
    return opencl_device


def count() -> int:
    """Return the number of devices of the same type (card, processor, …) as the first device.

    A sweep divides its work among these devices. Raises `MissingPackageError` without pyopencl, `DeviceError` without a
    driver or a device.
    """
    kinds = [d.type for d in _listed(_library())]
    return kinds.count(kinds[0])


def _library() -> Any:
    """Return the package pyopencl. Raises `MissingPackageError` if it is not installed."""
    try:
        import pyopencl as cl
    except ImportError as error:
        raise MissingPackageError("target opencl needs pyopencl: pip install 'phigen[opencl]'") from error
    return cl


def _listed(cl: Any) -> list[Any]:
    """Return all devices, graphics cards first. Raises `DeviceError` if there are none."""
    try:
        devices = [d for platform in cl.get_platforms() for d in platform.get_devices()]
    except cl.Error:
        devices = []
    if not devices:
        hint = "install the driver of the card, or the driver for the processor by pip install 'pyopencl[pocl]'"
        raise DeviceError(f"OpenCL has no driver, or its driver finds no device; {hint}")
    order = [cl.device_type.GPU, cl.device_type.ACCELERATOR]
    return sorted(devices, key=lambda d: next((k for k, kind in enumerate(order) if d.type & kind), len(order)))


def load(files: Mapping[str, str], interface: Interface, device: int | None = None) -> Any:
    """Return the solver that runs generated code on an OpenCL device; ``files`` maps file names to texts."""
    from phigen.runtime.devices.loading import backend

    return backend(files, interface, "opencl", device)
