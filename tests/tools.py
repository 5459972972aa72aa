"""Programs that tests start. What a machine lacks is skipped, and told once at the end with how to get it."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import pytest

#: What generated C compiles without, as gcc and clang call it.
WARNINGS = (
    "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Werror",
)  # fmt: skip

_DEBIAN = {
    "clang": "clang libclang-rt-dev",
    "clang++": "clang libclang-rt-dev",
    "mkoctfile": "octave-dev",
    "ninja": "ninja-build",
    "node": "nodejs",
    "octave-cli": "octave",
    "rustc": "rustc cargo",
    "qemu-aarch64-static": "qemu-user-static",
}
_LACK = " is not installed"


def tool(name: str) -> str:
    """The path of a program; without it the test is skipped, or fails where PHIGEN_ALL_TOOLS is set."""
    path = shutil.which(name)
    if path is None:
        if os.environ.get("PHIGEN_ALL_TOOLS"):
            pytest.fail(name + _LACK)
        pytest.skip(name + _LACK)
    return path


def run(command: Sequence[str | Path], folder: Path, **environment: str) -> str:
    """What a command prints; the test fails if it fails."""
    process = subprocess.run(
        [str(c) for c in command],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert process.returncode == 0, f"{shlex.join(map(str, command))}\n{process.stdout[-2000:]}{process.stderr[-4000:]}"
    return process.stdout


def write(folder: Path, texts: Mapping[str, str]) -> None:
    """Put files into a folder."""
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")


def not_tested(reasons: Iterable[str]) -> list[str]:
    """Lines about skipped tests, from the reasons of each: what was missing, for how many tests, how to get it."""
    counted = Counter(reason.removeprefix("Skipped: ") for reason in reasons)
    lines, packages = [], []
    for reason, count in sorted(counted.items()):
        lines.append(f"{reason}: {count} test{'s' if count > 1 else ''} skipped")
        if reason.endswith(_LACK):
            name = reason.removesuffix(_LACK)
            packages.append(_DEBIAN.get(name, name))
    if packages:
        lines.append(f"on Debian: apt-get install {' '.join(sorted(set(' '.join(packages).split())))}")
    return lines
