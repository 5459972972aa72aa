"""Programs that tests start. A test without its program is skipped, and the end of the output lists the missing
programs with the packages that contain them.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import pytest

#: Warnings of gcc and clang that are errors for generated C.
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
    """Return the path of a program. If it is not installed, skip the test, or let it fail if PHIGEN_ALL_TOOLS
    is set.
    """
    path = shutil.which(name)
    if path is None:
        if os.environ.get("PHIGEN_ALL_TOOLS"):
            pytest.fail(name + _LACK)
        pytest.skip(name + _LACK)
    return path


def run(command: Sequence[str | Path], folder: Path, **environment: str) -> str:
    """Run a command and return its standard output; the test fails if the exit status is not 0."""
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
    """Write files into a folder; ``texts`` maps their names to their contents."""
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")


def not_tested(reasons: Iterable[str]) -> list[str]:
    """Return lines about skipped tests: the missing programs with the numbers of tests, and the command that installs
    them. ``reasons`` has the reason of each skipped test.
    """
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
