"""Compilation of device code without a graphics card, with NVIDIA's runtime compiler NVRTC and assembler ptxas from
Python wheels.
"""

import ctypes
import re
import subprocess
import sysconfig
from dataclasses import dataclass
from pathlib import Path

#: Compute capabilities of two generations of cards, Ampere and Hopper.
ARCHITECTURES = ("sm_80", "sm_90")

_REPORT = re.compile(r"Compiling entry function '(\w+)'.*?\n(.*?Used .*?)$", re.DOTALL | re.MULTILINE)
_WHEELS = Path(sysconfig.get_path("purelib")) / "nvidia"


@dataclass(frozen=True)
class Kernel:
    """Resources of a compiled kernel: registers, and bytes of stack, spills (stores and loads), code and PTX."""

    registers: int
    stack: int
    spilled: int
    shared: int


def is_installed() -> bool:
    return any(_WHEELS.glob("cuda_nvrtc/lib/libnvrtc.so.*")) and (_WHEELS / "cuda_nvcc/bin/ptxas").exists()


def ptx(text: str, architecture: str, *options: str) -> str:
    """Return the PTX of CUDA C++. Raises `ValueError` with the messages of the compiler."""
    library = next(_WHEELS.glob("cuda_nvrtc/lib/libnvrtc.so.*"))
    nvrtc = ctypes.CDLL(str(library))
    program = ctypes.c_void_p()
    _expect(nvrtc.nvrtcCreateProgram(ctypes.byref(program), text.encode(), b"kernel.cu", 0, None, None))
    flags = [f"--gpu-architecture={architecture.replace('sm', 'compute')}", "--fmad=false", *options]
    arguments = (ctypes.c_char_p * len(flags))(*(f.encode() for f in flags))
    failed = nvrtc.nvrtcCompileProgram(program, len(flags), arguments)
    log = _text(nvrtc.nvrtcGetProgramLogSize, nvrtc.nvrtcGetProgramLog, program)
    if failed:
        raise ValueError(log)
    compiled = _text(nvrtc.nvrtcGetPTXSize, nvrtc.nvrtcGetPTX, program)
    _expect(nvrtc.nvrtcDestroyProgram(ctypes.byref(program)))
    return compiled


def assembled(text: str, architecture: str, folder: Path, *options: str) -> dict[str, Kernel]:
    """Return the resources of the kernels of PTX, by name, as ``ptxas -v`` prints them."""
    source = folder / "kernel.ptx"
    source.write_text(text)
    command = [_WHEELS / "cuda_nvcc/bin/ptxas", "-v", f"-arch={architecture}", *options, source, "-o", "/dev/null"]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    kernels = {}
    for name, report in _REPORT.findall(printed):
        stack, stores, loads = map(int, re.findall(r"(\d+) bytes (?:stack frame|spill)", report))
        registers = int(re.search(r"Used (\d+) registers", report)[1])
        shared = re.search(r"(\d+) bytes smem", report)
        kernels[name] = Kernel(registers, stack, stores + loads, int(shared[1]) if shared else 0)
    return kernels


def _expect(status: int) -> None:
    if status:
        raise RuntimeError(f"NVRTC failed with status {status}")


def _text(size_of, fill, program) -> str:
    size = ctypes.c_size_t()
    _expect(size_of(program, ctypes.byref(size)))
    text = ctypes.create_string_buffer(size.value)
    _expect(fill(program, text))
    return text.value.decode()
