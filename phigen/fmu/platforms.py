"""The machines that binaries of an FMU are made for, and the compilers that make them."""

from __future__ import annotations

import platform
import sys
from dataclasses import dataclass, replace
from importlib.util import find_spec

from phigen.runtime import toolchain
from phigen.runtime.toolchain import Compiler


@dataclass(frozen=True)
class Platform:
    """A machine by its folder in FMI 3.0 and in 2.0 (empty: 2.0 has none), and the target of zig."""

    folder: str
    folder_2: str
    zig: str
    suffix: str


#: Those that zig compiles for out of the box. Of glibc an old version, so that older machines load the binaries too.
PLATFORMS = {
    p.folder: p
    for p in (
        Platform("x86_64-linux", "linux64", "x86_64-linux-gnu.2.17", ".so"),
        Platform("aarch64-linux", "", "aarch64-linux-gnu.2.17", ".so"),
        Platform("x86_64-windows", "win64", "x86_64-windows-gnu", ".dll"),
        Platform("aarch64-windows", "", "aarch64-windows-gnu", ".dll"),
        Platform("x86_64-darwin", "darwin64", "x86_64-macos", ".dylib"),
        Platform("aarch64-darwin", "", "aarch64-macos", ".dylib"),
    )
}

#: Products are not fused, so that all platforms give the same bits, but for functions of their libraries; nothing is
#: visible but the functions of FMI; nothing for debuggers.
FLAGS = ("-ffp-contract=off", "-fvisibility=hidden", "-s")

#: Seconds that a compilation may take: the first for a platform builds the runtime of that too.
TIMEOUT = 1200.0

_PACKAGE = "ziglang"
_MACHINES = {"amd64": "x86_64", "arm64": "aarch64"}


def host() -> Platform | None:
    """Return the platform of this machine, None where FMI has no name for it that phigen knows."""
    machine = platform.machine().lower()
    return PLATFORMS.get(f"{_MACHINES.get(machine, machine)}-{platform.system().lower()}")


def compilers() -> dict[str, Compiler]:
    """Return a compiler for each platform that can be compiled for: by zig for all, else for this machine only.

    Raises `ToolchainError` if a compiler is named in CC that does not work.
    """
    if find_spec(_PACKAGE):
        zig = (sys.executable, "-m", _PACKAGE, "cc")
        return {p.folder: Compiler((*zig, "-target", p.zig), f"zig for {p.zig}", FLAGS) for p in PLATFORMS.values()}
    this = host()
    if this is None or not toolchain.available():
        return {}
    return {this.folder: replace(toolchain.find(), tuning=FLAGS)}
