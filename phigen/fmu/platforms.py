"""Platforms for which binaries of an FMU are compiled, and their compilers."""

from __future__ import annotations

import platform
import sys
from dataclasses import dataclass, replace
from importlib.util import find_spec

from phigen.runtime import toolchain
from phigen.runtime.toolchain import Compiler


@dataclass(frozen=True)
class Platform:
    """Platform of an FMU: its names in FMI and for the compiler zig, and the suffix of its libraries.

    ``folder`` and ``folder_2`` are the names of its folder in FMUs of FMI 3.0 and FMI 2.0. ``folder_2`` is "" for
    platforms that FMI 2.0 does not define. ``zig`` is the name that the compiler zig has for the platform.
    """

    folder: str
    folder_2: str
    zig: str
    suffix: str


#: Platforms for which the compiler zig needs no further packages. Libraries for Linux are linked with the old glibc
#: 2.17, so that they load on older machines.
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

#: Compiler flags. Fused multiply-adds are off, so results differ between platforms only if functions of libm differ.
#: The library exports only the functions of FMI, and has no debugging symbols.
FLAGS = ("-ffp-contract=off", "-fvisibility=hidden", "-s")

#: Time limit of a compilation in seconds. When zig first compiles for a platform, it also builds the libraries of this
#: platform within the limit.
TIMEOUT = 1200.0

_PACKAGE = "ziglang"
_MACHINES = {"amd64": "x86_64", "arm64": "aarch64"}


def host() -> Platform | None:
    """Return the platform of this machine, or None if it is not one of `PLATFORMS`."""
    machine = platform.machine().lower()
    return PLATFORMS.get(f"{_MACHINES.get(machine, machine)}-{platform.system().lower()}")


def compilers() -> dict[str, Compiler]:
    """Return the compilers by platform: zig for all platforms if it is installed, or else the C compiler of this
    machine.

    Raises `ToolchainError` if the compiler named in CC does not work.
    """
    if find_spec(_PACKAGE):
        zig = (sys.executable, "-m", _PACKAGE, "cc")
        return {p.folder: Compiler((*zig, "-target", p.zig), f"zig for {p.zig}", FLAGS) for p in PLATFORMS.values()}
    this_platform = host()
    if this_platform is None or not toolchain.available():
        return {}
    return {this_platform.folder: replace(toolchain.find(), tuning=FLAGS)}
