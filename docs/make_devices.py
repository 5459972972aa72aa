"""Compiles kernels for NVIDIA's cards and writes the table of docs/devices.md: python docs/make_devices.py

Needs the wheels nvidia-cuda-nvrtc-cu12 and nvidia-cuda-nvcc-cu12; no card.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from phigen.api import compilation_of
from phigen.compiler import emit

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import nvrtc

PAGE = Path(__file__).resolve().parent / "devices.md"
BEGIN, END = "<!-- registers -->\n", "<!-- end of registers -->\n"
#: Systems and orders; None is that of the spec.
KERNELS = (
    ("rigid_body", 2), ("rigid_body", 4), ("rigid_body", 6), ("rigid_body", 8), ("lotka_volterra", 4),
    ("henon_heiles", 4), ("kepler", 4), ("kepler", 6), ("toda3", 4), ("toda3", 6), ("lagrange_top", 2),
    ("kepler_eccentric", None), ("pendulum_euler", None), ("earth_moon", 4),
    ("so4_manakov", 4), ("satellite", None), ("nambu_pendulum", None),
    ("kowalevski_gauss", None), ("satellite_wheels", None), ("spin_chain5", None),
)  # fmt: skip


def kernels_of(text: str, name: str) -> list[nvrtc.Kernel]:
    """Return the kernels of ensembles for all architectures."""
    kernels = []
    with tempfile.TemporaryDirectory() as folder:
        for architecture in nvrtc.ARCHITECTURES:
            compiled = nvrtc.assembled(nvrtc.ptx(text, architecture), architecture, Path(folder))
            kernels.append(compiled[f"{name}_ensemble_kernel"])
    return kernels


def columns(kernels: list[nvrtc.Kernel]) -> list[str]:
    """Return the registers, stacks and spills."""
    return [" / ".join(str(getattr(k, part)) for k in kernels) for part in ("registers", "stack", "spilled")]


def rows() -> Iterator[str]:
    """Yield the rows of the table."""
    resources = "registers | stack, bytes | spills, bytes"
    common = "registers, common | stack, common | spills, common"
    yield f"| system | order | step | coordinates | {resources} | {common} | compilation, s |"
    yield "|---|---|---|---|---|---|---|---|---|---|---|"
    for name, order in KERNELS:
        program = compilation_of(name, order=order, profile="small").program
        (text,) = emit(program, "device", "phigen build").values()
        begin = time.perf_counter()
        kernels = kernels_of(text, name)
        seconds = (time.perf_counter() - begin) / len(kernels)
        shared = ["", "", ""]
        if f"{name}_COMMON" in text:
            shared = columns(kernels_of(f"#define {name}_COMMON\n{text}", name))
        values = [*columns(kernels), *shared, f"{seconds:.1f}"]
        yield f"| {name} | {program.order} | {program.step.kind.name} | {program.dimension} | {' | '.join(values)} |"


if __name__ == "__main__":
    page = PAGE.read_text(encoding="utf-8")
    before, rest = page.split(BEGIN)
    _, after = rest.split(END)
    PAGE.write_text(before + BEGIN + "\n" + "\n".join(rows()) + "\n\n" + END + after, encoding="utf-8")
