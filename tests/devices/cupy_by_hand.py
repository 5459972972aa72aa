"""Imitation of the part of CuPy that phigen calls, for machines without a graphics card: g++ compiles the CUDA kernels,
and the processor runs them.

Arguments are checked as by CuPy 14: `set` and `get` need arrays of the same type and shape, and kernels take arrays of
the device, scalars of NumPy, and structs (arrays of size one) by value. Beyond CuPy, the number and sizes of arguments
are compared with those of the kernel, and arrays must belong to the current device. As on a card, kernels and copies to
the device are executed in order, but only when a `get` waits for them. If NVRTC is installed, it compiles the code too.
"""

import ctypes
import re
import subprocess
import tempfile
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import ClassVar

import numpy as np
import nvrtc

WORDS = """
#define __CUDACC__ 1
#define __device__
#define __global__
#define __forceinline__ inline
#define __constant__
#define __shared__ static
#define __launch_bounds__(...)
#define __grid_constant__
struct Place { unsigned x; };
static Place blockIdx, blockDim, threadIdx;
"""

LAUNCH = """
#include <utility>
template <class... A, std::size_t... K>
static void with(void (*kernel)(A...), void **passed, std::index_sequence<K...>) { kernel(*(A *)passed[K]...); }
template <class... A> static int misfit(void (*)(A...), int count, const unsigned long *sizes)
{
    const unsigned long expected[] = { sizeof(A)... };
    if (count != sizeof...(A)) return -1;
    for (int k = 0; k < count; ++k)
        if (sizes[k] != expected[k]) return k + 1;
    return 0;
}
template <class... A> static void launch(void (*kernel)(A...), unsigned grid, unsigned block, void **passed)
{
    blockDim.x = block;
    for (blockIdx.x = 0; blockIdx.x < grid; ++blockIdx.x)
        for (threadIdx.x = 0; threadIdx.x < block; ++threadIdx.x)
            with(kernel, passed, std::index_sequence_for<A...>());
}
"""


class CUDARuntimeError(RuntimeError):
    pass


class CUDADriverError(RuntimeError):
    pass


class OutOfMemoryError(MemoryError):
    pass


class CompileException(Exception):  # noqa: N818  (its name in CuPy)
    pass


class Device:
    """Context manager that selects a device. ``current`` is the stack of the numbers of the selected devices."""

    current = (0,)

    def __init__(self, device=None):
        self.id = device

    def __enter__(self):
        Device.current = (*Device.current, self.id)
        return self

    def __exit__(self, *args):
        Device.current = Device.current[:-1]


#: Queue of copies and kernels that are not executed yet, as functions without arguments.
_STREAM = []


def _finish():
    while _STREAM:
        _STREAM.pop(0)()


class ndarray:  # noqa: N801  (its name in CuPy)
    """Array on the device; data are copied only by `set` and `get`."""

    def __init__(self, host, device):
        self.host, self.dtype, self.shape, self.device = host, host.dtype, host.shape, device

    def __getitem__(self, part):
        return ndarray(self.host[part], self.device)

    def set(self, arr, stream=None):
        self._expect(arr)
        staged = arr.copy()
        _STREAM.append(lambda: self.host.__setitem__(..., staged))

    def get(self, stream=None, order="C", out=None, blocking=True):
        self._expect(out)
        if not out.flags.c_contiguous:
            raise RuntimeError("`out` cannot be specified when copying to non-contiguous ndarray")
        _finish()
        out[...] = self.host
        return out

    def _expect(self, arr):
        assert self.device == Device.current[-1], "an array of another device"
        if not isinstance(arr, np.ndarray) or arr.dtype != self.dtype:
            raise TypeError(f"{arr!r} cannot be copied")
        if arr.shape != self.shape:
            raise ValueError(f"Shape mismatch: {self.shape}, {arr.shape}")


def empty(shape, dtype=float, order="C"):
    host = np.empty(shape, dtype)
    host.view(np.uint8)[...] = 0xAA  # memory of a device is not zero at first
    return ndarray(host, Device.current[-1])


class RawKernel:
    """Kernel of a module. ``launched`` lists the device number of each launch."""

    launched: ClassVar = []

    def __init__(self, function, misfit, group):
        self._function, self._misfit = function, misfit
        self.max_threads_per_block, self.local_size_bytes = group, 0

    def __call__(self, grid, block, args, *, shared_mem=0):
        assert all(type(size) is int and size > 0 for size in (*grid, *block))
        assert block[0] <= self.max_threads_per_block, "CUDA_ERROR_INVALID_VALUE"
        assert all(a.device == Device.current[-1] for a in args if isinstance(a, ndarray)), "an array of another device"
        RawKernel.launched.append(Device.current[-1])
        held = [_passed(a) for a in args]
        sizes = (ctypes.c_ulong * len(held))(*(h.nbytes for h in held))
        assert self._misfit(len(held), sizes) == 0, f"arguments of {[h.nbytes for h in held]} bytes"
        pointers = (ctypes.c_void_p * len(held))(*(h.ctypes.data for h in held))
        _STREAM.append(lambda: (self._function(*grid, *block, pointers), args, held)[0])


def _passed(argument):
    """Return an array with the bytes of an argument of a kernel."""
    if isinstance(argument, ndarray):
        return np.array([argument.host.ctypes.data], dtype=np.uintp)
    if isinstance(argument, np.ndarray) and argument.size != 1:
        raise TypeError(f"a numpy.ndarray of shape {argument.shape} is passed as a kernel parameter")
    if not isinstance(argument, np.ndarray | np.number):
        raise TypeError(f"Unsupported type {type(argument)}")
    return np.array(argument)


class RawModule:
    """Module compiled from CUDA code."""

    def __init__(self, code=None, *, path=None, options=(), backend="nvrtc", **others):
        assert not others
        assert isinstance(options, tuple)
        self.code, self.options, self._library = code, options, None

    def compile(self, log_stream=None):
        if nvrtc.is_installed():
            try:
                nvrtc.ptx(self.code, "sm_90", *(o for o in self.options if o != "--fmad=false"))
            except ValueError as error:
                raise CompileException(str(error)) from error
        assert "--fmad=false" in self.options
        kernels = re.findall(r"^\w+_KERNEL void (\w+)\(", self.code, re.MULTILINE)
        calls = [
            f'extern "C" void launch_{k}(unsigned g, unsigned b, void **p) {{ launch({k}, g, b, p); }}\n'
            f'extern "C" int misfit_{k}(int n, const unsigned long *s) {{ return misfit({k}, n, s); }}'
            for k in kernels
        ]
        text = "\n".join([WORDS, self.code, LAUNCH, *calls])
        with tempfile.TemporaryDirectory() as folder:
            source, built = Path(folder) / "kernels.cpp", Path(folder) / "kernels.so"
            source.write_text(text)
            flags = ["-O1", "-w", "-std=c++17", "-ffp-contract=off", "-shared", "-fPIC"]
            defined = [o for o in self.options if o.startswith("-D")]
            command = ["g++", *flags, *defined, source, "-o", built]
            process = subprocess.run(command, capture_output=True, text=True, check=False)
            if process.returncode:
                raise CompileException(process.stderr)
            self._library = ctypes.CDLL(str(built))

    def get_function(self, name):
        (group,) = {int(size) for size in re.findall(r"^#define \w+_GROUP (\d+)", self.code, re.MULTILINE)}
        group = next((int(o.split("=")[1]) for o in self.options if "_GROUP=" in o), group)
        return RawKernel(getattr(self._library, f"launch_{name}"), getattr(self._library, f"misfit_{name}"), group)


def module(cards=1):
    """Return the module that takes the place of the package cupy, on a machine with some cards."""
    _STREAM.clear()
    cupy = ModuleType("cupy")
    properties = {
        "name": b"Emulated card",
        "multiProcessorCount": 4,
        "totalGlobalMem": 1 << 30,
        "sharedMemPerBlock": 49_152,
        "maxThreadsPerBlock": 1024,
    }
    cupy.cuda = SimpleNamespace(
        runtime=SimpleNamespace(
            getDeviceCount=lambda: cards,
            getDeviceProperties=lambda device: properties,
            CUDARuntimeError=CUDARuntimeError,
        ),
        driver=SimpleNamespace(CUDADriverError=CUDADriverError),
        memory=SimpleNamespace(OutOfMemoryError=OutOfMemoryError),
        compiler=SimpleNamespace(CompileException=CompileException),
        Device=Device,
    )
    cupy.RawModule, cupy.empty = RawModule, empty
    return cupy
