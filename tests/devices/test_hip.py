"""Generated code compiled as HIP by clang to the assembly of a graphics card, without the libraries of ROCm."""

from pathlib import Path

import pytest
from support import COMMAND, run, tool, write

from phigen.api import compilation_of
from phigen.compiler import emit

HEADERS = Path(__file__).parent / "hip_without_rocm.h"


@pytest.mark.parametrize(
    "name",
    [
        "pendulum_euler",
        *(pytest.param(n, marks=pytest.mark.slow) for n in ("rigid_body", "kepler_eccentric", "kdv")),
    ],
)
def test_code_compiles_for_a_card(name, tmp_path):
    write(tmp_path, emit(compilation_of(name, profile="small").program, "device", COMMAND))
    write(tmp_path, {"kernels.hip": f'#include "{HEADERS}"\n#include "{name}_device.h"\n'})
    options = ["-x", "hip", "--cuda-device-only", "--offload-arch=gfx90a", "-nogpuinc", "-nogpulib", "-O1", "-S"]
    run([tool("clang"), *options, "kernels.hip", "-o", "kernels.s"], tmp_path)
    assert ".amdhsa_kernel" in (tmp_path / "kernels.s").read_text()
