"""The host programs of docs/devices: the program for OpenCL runs on the processor, and those for CUDA and HIP are
compiled.
"""

from pathlib import Path

import numpy as np
import pytest
from support import COMMAND, run, tool, write

import phigen
from phigen.api import compilation_of
from phigen.compiler import emit

HEADERS = Path(__file__).parent / "headers"
EXAMPLES = Path(__file__).parents[2] / "docs/devices"


@pytest.fixture(scope="module")
def header(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rigid_body")
    write(folder, emit(compilation_of("rigid_body", profile="small").program, "device", COMMAND))
    return folder


@pytest.mark.slow
def test_program_for_opencl_computes_the_members_of_c(header, tmp_path):
    """The program for OpenCL computes the same members as C. It uses the OpenCL loader and driver of the Python wheels.
    The loader needs the environment variable PYOPENCL_HOME, which may be empty.
    """
    folder = Path(pytest.importorskip("pyopencl").__file__).parent / ".libs"
    loaders = list(folder.glob("libOpenCL-*"))
    if not loaders:
        pytest.skip("the wheel of pyopencl has no OpenCL loader")
    warnings = ["-std=c99", "-Wall", "-Wextra", "-Werror"]
    linked = [*loaders, f"-Wl,-rpath,{folder}", "-o", "opencl"]
    run([tool("gcc"), *warnings, "-I", HEADERS, "-I", header, EXAMPLES / "opencl.c", *linked], tmp_path)
    variables = {"PYOPENCL_HOME": "", "OCL_ICD_VENDORS": str(folder), "LD_LIBRARY_PATH": str(folder)}
    command = ["env", *(f"{name}={value}" for name, value in variables.items())]
    printed = run([*command, tmp_path / "opencl", header / "rigid_body_device.h"], tmp_path).splitlines()
    solver = phigen.compile("rigid_body", "c", profile="small")
    for m, line in zip(range(0, 1000, 333), printed, strict=True):
        shown, status, *x = line.replace(":", "").replace(" status", "").replace(",", "").split()
        assert (shown, status) == (str(m), "0")
        end = solver.ensemble([[0.01 + 1e-5 * m, 1.0, 0.01]], 0.1, 200)[0]
        np.testing.assert_allclose([float(v) for v in x], end, rtol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("language", "options"), [("cuda", ["-nocudainc", "-nocudalib"]), ("hip", ["-nogpuinc", "-nogpulib"])]
)
def test_program_for_cuda_and_hip_compiles(language, options, header, tmp_path):
    """Clang compiles the host part of the program; test_cuda.py and test_hip.py compile the kernels."""
    options = [
        *options,
        "--cuda-host-only",
        "-std=c++17",
        "-fsyntax-only",
        "-Wall",
        "-Werror",
        "-Wno-unknown-cuda-version",
    ]
    folders = ["-I", HEADERS, "-I", header]
    run([tool("clang++"), "-x", language, *options, *folders, EXAMPLES / "cuda.cu"], tmp_path)
