"""CUDA devices (NVIDIA), by CuPy."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from phigen.errors import DeviceError, MissingPackageError
from phigen.runtime.devices.device import LOST, Opened, OutOfMemoryError, choose
from phigen.runtime.interface import Interface

Result = TypeVar("Result")

#: Compiler options: without fused multiply-adds, results have the same bits as those of C.
_OPTIONS = ("--fmad=false",)

#: Words in a driver's message if an array or a launch needs more memory or registers than the card has.
_MEMORY = ("OUT_OF_MEMORY", "OUT_OF_RESOURCES", "MemoryAllocation")


class CUDADevice:
    """A graphics card of NVIDIA, used through CuPy: a `phigen.runtime.devices.device.Device`."""

    target = "cuda"
    double = is_card = True

    def __init__(self, cupy: Any, index: int) -> None:
        self._cupy, self._index = cupy, index
        facts = cupy.cuda.runtime.getDeviceProperties(index)
        self.name, self.units = facts["name"].decode(), facts["multiProcessorCount"]
        self.memory = self.largest = facts["totalGlobalMem"]
        self.shared, self.group = facts["sharedMemPerBlock"], facts["maxThreadsPerBlock"]

    def __repr__(self) -> str:
        return f"<CUDA device: {self.name}, {self.memory >> 20} MiB>"

    def compiled(self, text: str, defined: Mapping[str, int]) -> Any:
        options = (*_OPTIONS, *(f"-D{name}={value}" for name, value in defined.items()))

        def compile_module() -> Any:
            module = self._cupy.RawModule(code=text, options=options)
            module.compile()
            return module

        try:
            return self._checked_call(compile_module)
        except self._cupy.cuda.compiler.CompileException as error:
            raise DeviceError(f"{self.name}: NVRTC refuses the generated code\n{error}") from error
        except (RuntimeError, OSError) as error:  # raised if CuPy does not find the library of NVRTC
            message = f"NVRTC, the compiler of CUDA, cannot be loaded: {error}\n  hint: pip install 'phigen[cuda]'"
            raise MissingPackageError(f"{self.name}: {message}") from error

    def kernel(self, program: Any, name: str) -> Any:
        return self._checked_call(lambda: program.get_function(name))

    def local_bytes(self, kernel: Any) -> int:
        return self._checked_call(lambda: int(kernel.local_size_bytes))

    def empty(self, size: int) -> Any:
        return self._checked_call(lambda: self._cupy.empty(max(1, size), dtype=np.uint8))

    def constants(self, array: Any) -> Any:
        """Return an array of constants as a struct, since CuPy passes structs to kernels by value, in constant
        memory."""
        return array.reshape(-1).view(np.dtype([("values", array.dtype, (array.size,))]))

    def write(self, buffer: Any, array: Any) -> None:
        if array.nbytes:
            self._checked_call(lambda: buffer[: array.nbytes].set(array.view(np.uint8).reshape(-1)))

    def read(self, buffer: Any, array: Any) -> None:
        if array.nbytes:
            self._checked_call(lambda: buffer[: array.nbytes].get(out=array.view(np.uint8).reshape(-1)))

    def launch(self, kernel: Any, items: int, arguments: Sequence[Any]) -> None:
        group = self._checked_call(
            lambda: kernel.max_threads_per_block
        )  # at most the launch bound that the source of the kernel declares
        launch_arguments = tuple(
            np.uint64(0) if argument is None else argument for argument in arguments
        )  # 0 is a null pointer
        self._checked_call(lambda: kernel((-(-items // group),), (group,), launch_arguments))

    def _checked_call(self, call: Callable[[], Result]) -> Result:
        """Return the result of a call of CUDA; errors of CUDA are raised as `OutOfMemoryError` or `DeviceError`."""
        cuda = self._cupy.cuda
        try:
            with cuda.Device(self._index):
                return call()
        except cuda.memory.OutOfMemoryError as error:
            raise OutOfMemoryError(str(error)) from error
        except (cuda.driver.CUDADriverError, cuda.runtime.CUDARuntimeError) as error:
            if any(word in str(error) for word in _MEMORY):
                raise OutOfMemoryError(str(error)) from error
            raise DeviceError(f"{self.name}: {LOST}: {error}") from error


_OPENED: Opened = {}


def device(index: int | None = None) -> CUDADevice:
    """Return the card with the number ``index``, opened in this process; the default card if ``index`` is None.

    Raises `MissingPackageError` without CuPy, `DeviceError` without a driver or a card.
    """
    key = os.getpid(), index
    if key not in _OPENED:
        cupy, names = _cards()
        _OPENED[key] = CUDADevice(cupy, choose(names, "CUDA", index))
    card: CUDADevice = _OPENED[key]
    return card


def count() -> int:
    """Return the number of cards. Raises `MissingPackageError` without CuPy, `DeviceError` without a driver or a
    card."""
    return len(_cards()[1])


def _cards() -> tuple[Any, list[str]]:
    """Return the package CuPy, and the names of all cards.

    Raises `MissingPackageError` without CuPy, `DeviceError` without a driver or a card.
    """
    try:
        import cupy
    except ImportError as error:
        raise MissingPackageError("target cuda needs CuPy: pip install 'phigen[cuda]'") from error
    try:
        runtime = cupy.cuda.runtime
        names = [runtime.getDeviceProperties(k)["name"].decode() for k in range(runtime.getDeviceCount())]
    except cupy.cuda.runtime.CUDARuntimeError as error:
        raise DeviceError(f"CUDA has no driver, or its driver finds no card ({error}); {_HINT}") from error
    if not names:
        raise DeviceError(f"CUDA has no card; {_HINT}")
    return cupy, names


_HINT = "install NVIDIA's driver, or use target opencl, which also runs on CPUs"


def load(files: Mapping[str, str], interface: Interface, device: int | None = None) -> Any:
    """Return the solver that runs generated code on a card; ``files`` maps file names to texts."""
    from phigen.runtime.devices.loading import backend

    return backend(files, interface, "cuda", device)
