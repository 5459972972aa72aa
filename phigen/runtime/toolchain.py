"""The C compiler of this machine: finding it, and making a shared library of generated code.

The flags are for libraries that stay on this machine. Code that is shipped needs C99 and libm, nothing else.
"""

from __future__ import annotations

import contextlib
import os
import shlex
import shutil
import signal
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from phigen.errors import ToolchainError

#: Every C99 compiler of interest takes these.
BASE_FLAGS = ("-std=c99", "-O3", "-fPIC", "-shared")

#: Tuning for this processor, each used if the compiler takes it. Fused products change results by round-off only:
#: the compensated sums of the generated code contain no product that could be fused.
TUNING_FLAGS = ("-march=native", "-ffp-contract=fast", "-fno-math-errno")

#: Seconds after which a compilation is given up.
TIMEOUT = 300.0

_CANDIDATES = ("cc", "gcc", "clang")
_HINT = "install gcc or clang, or name a compiler in the environment variable CC; the numpy target needs none"
_MESSAGE_LINES = 8
_QUESTION_TIMEOUT = 10.0  # for --version and the like


@dataclass(frozen=True)
class Compiler:
    """A C compiler that answered: its command, and the first line of its ``--version``."""

    command: tuple[str, ...]
    version: str

    def __str__(self) -> str:
        return f"{shlex.join(self.command)} ({self.version})"


def find() -> Compiler:
    """The compiler named by CC, else the first of cc, gcc and clang that answers.

    Raises `ToolchainError`, saying what was tried.
    """
    named = os.environ.get("CC", "").strip()
    commands = [tuple(shlex.split(named))] if named else [(c,) for c in _CANDIDATES]
    for command in commands:
        path = shutil.which(command[0])
        version = _version((path, *command[1:])) if path else None
        if path and version:
            return Compiler((path, *command[1:]), version)
    tried = f"CC={named}" if named else ", ".join(_CANDIDATES)
    raise ToolchainError(f"no C compiler found (tried {tried})\n  hint: {_HINT}")


def available() -> bool:
    """Whether there is a C compiler."""
    try:
        find()
    except ToolchainError:
        return False
    return True


def flags(compiler: Compiler) -> tuple[str, ...]:
    """The flags for a library that is used on this machine only."""
    return BASE_FLAGS + tuple(flag for flag in TUNING_FLAGS if _takes(compiler.command, flag))


def compile_library(
    sources: Sequence[Path], output: Path, compiler: Compiler | None = None, timeout: float = TIMEOUT
) -> None:
    """Compile C files into one shared library; headers are looked for beside the sources.

    Raises `ToolchainError` with the first lines the compiler said, or if ``timeout`` seconds were not enough.
    """
    compiler = compiler or find()
    command = [*compiler.command, *flags(compiler), *map(str, sources), "-o", str(output), "-lm"]
    try:
        done = _run(command, timeout)
    except subprocess.TimeoutExpired as error:
        raise ToolchainError(
            f"{compiler} did not finish within {timeout:g} s\n"
            "  hint: a lower order makes smaller code; `phigen show` tells its operation counts"
        ) from error
    except OSError as error:
        raise ToolchainError(f"{compiler} could not be started: {error}\n  hint: {_HINT}") from error
    if done.returncode != 0:
        raise ToolchainError(_refusal(compiler, done.returncode, done.stderr or done.stdout))


def _refusal(compiler: Compiler, code: int, said: str) -> str:
    lines = said.strip().splitlines()
    shown = "\n".join(f"    {line}" for line in lines[:_MESSAGE_LINES])
    more = f"\n    … {len(lines) - _MESSAGE_LINES} more lines" if len(lines) > _MESSAGE_LINES else ""
    hint = "the code is C99 and should compile everywhere; try another compiler by CC=gcc or CC=clang"
    return f"{compiler} failed with exit code {code}:\n{shown}{more}\n  hint: {hint}"


@cache
def _version(command: tuple[str, ...]) -> str | None:
    try:
        done = _run([*command, "--version"], _QUESTION_TIMEOUT)
    except (OSError, subprocess.TimeoutExpired):
        return None
    lines = done.stdout.strip().splitlines()
    return lines[0].strip() if done.returncode == 0 and lines else None


@cache
def _takes(command: tuple[str, ...], flag: str) -> bool:
    # -Werror turns clang's warning about an unused flag into a refusal.
    probe = [*command, "-Werror", flag, "-x", "c", "-fsyntax-only", "-"]
    try:
        return _run(probe, _QUESTION_TIMEOUT, "int unused;\n").returncode == 0
    except (OSError, subprocess.TimeoutExpired):
        return False


def _run(command: Sequence[str], timeout: float, text: str = "") -> subprocess.CompletedProcess[str]:
    """`subprocess.run`, but giving up ends the compiler proper as well, not only the driver that started it."""
    pipe = subprocess.PIPE
    with subprocess.Popen(
        command, stdin=pipe, stdout=pipe, stderr=pipe, text=True, errors="replace", start_new_session=True
    ) as process:
        try:
            out, err = process.communicate(text, timeout)
        except BaseException:  # a keyboard interrupt too: the new session does not hear the terminal's
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            raise
    return subprocess.CompletedProcess(command, process.returncode, out, err)
