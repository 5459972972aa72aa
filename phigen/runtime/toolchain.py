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
import sys
import tempfile
import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import BinaryIO

from phigen import progress
from phigen.errors import ToolchainError

#: Every C99 compiler of interest takes these.
BASE_FLAGS = ("-std=c99", "-O3", "-fPIC", "-shared")

#: Tuning for this processor, each used if the compiler takes it. Fused products change results by round-off only:
#: the compensated sums of the generated code contain no product that could be fused. Nobody asks which exceptions were
#: raised: so gcc may divide by 0 in a lane whose value is not taken, and pairs go in vectors without AVX-512 too.
TUNING_FLAGS = ("-march=native", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math")

#: For threads, which only lattices use.
OPENMP = "-fopenmp"

#: Seconds after which a compilation is given up.
TIMEOUT = 300.0

_CANDIDATES = ("cc", "gcc", "clang")
#: A C compiler that comes as a Python package, and how its trial may take longer: it first builds its own runtime.
_PACKAGE, _FIRST_TRIAL = "ziglang", 120.0
_HINT = (
    "install gcc or clang, or the compiler of the package ziglang (pip install ziglang), or name one in the "
    "environment variable CC; the numpy target needs none"
)
_MESSAGE_LINES = 8
_MESSAGE_BYTES = 1 << 16
_TRIAL_TIMEOUT = 20.0  # for --version, and for a library of one line
_GRACE = 1.0  # for what a compiler started, to end after it
_TRIAL = "#include <math.h>\ndouble trial(double x);\ndouble trial(double x) { return sin(x); }\n"
_TRIAL_OF_THREADS = "#include <omp.h>\nint trial(void);\nint trial(void) { return omp_get_max_threads(); }\n"

#: How files of shared libraries begin: ELF, Mach-O of both byte orders and universal, PE.
_ELF = b"\x7fELF"
_LIBRARIES = (_ELF, b"\xfe\xed\xfa", b"\xce\xfa\xed\xfe", b"\xcf\xfa\xed\xfe", b"\xca\xfe\xba\xbe", b"MZ")
_ELF_SHARED = 3


@dataclass(frozen=True)
class Compiler:
    """A C compiler that works: its command, the first line of its ``--version``, and further flags that it takes."""

    command: tuple[str, ...]
    version: str
    tuning: tuple[str, ...] = ()

    @property
    def flags(self) -> tuple[str, ...]:
        """The flags for a library that is used on this machine only."""
        return BASE_FLAGS + self.tuning

    def __str__(self) -> str:
        return f"{shlex.join(self.command)} ({self.version})"


class NoCompilerError(ToolchainError):
    """None is named in CC, and none of the usual ones works."""


def find() -> Compiler:
    """The compiler named in CC, else the first of cc, gcc, clang and zig that works: that makes a library of one line.

    zig is that of the Python package ziglang.

    Raises `ToolchainError` saying what is wrong with the one that is named, else `NoCompilerError` about all.
    """
    named = os.environ.get("CC", "").strip()
    if named:
        found = _examined(_command(named))
        if isinstance(found, str):
            raise ToolchainError(f"the C compiler named in CC, {named}, {found}\n  hint: {_HINT}")
        return found
    reasons = []
    for candidate in _CANDIDATES:
        found = _examined((candidate,))
        if isinstance(found, Compiler):
            return found
        reasons.append(f"{candidate} {found}")
    if find_spec(_PACKAGE):
        found = _answering((sys.executable, "-m", _PACKAGE, "cc"))
        if isinstance(found, Compiler):
            return found
        reasons.append(f"{_PACKAGE} {found}")
    if set(reasons) == {f"{c} {_NOT_FOUND}" for c in _CANDIDATES}:
        reasons = [f"none of {', '.join(_CANDIDATES)} was found"]
    apart = "\n  " if any("\n" in reason for reason in reasons) else " "
    raise NoCompilerError(f"no C compiler works:{apart}{f';{apart}'.join(reasons)}\n  hint: {_HINT}")


def available() -> bool:
    """Whether there is a C compiler. Raises `ToolchainError` if one is named that does not work."""
    try:
        find()
    except NoCompilerError:
        return False
    return True


@cache
def threaded(compiler: Compiler) -> Compiler:
    """The compiler with OpenMP, if it has that."""
    with tempfile.TemporaryDirectory(prefix="phigen-") as folder:
        source, library = Path(folder) / "trial.c", Path(folder) / "trial.so"
        source.write_text(_TRIAL_OF_THREADS, encoding="utf-8")
        flags = (*BASE_FLAGS, "-Werror", OPENMP)
        try:
            found = not _made(compiler.command, flags, [source], library, _TRIAL_TIMEOUT)
        except (OSError, subprocess.TimeoutExpired):
            found = False
    return replace(compiler, tuning=(*compiler.tuning, OPENMP)) if found else compiler


def compile_library(
    sources: Sequence[Path], output: Path, compiler: Compiler | None = None, timeout: float = TIMEOUT
) -> None:
    """Compile C files into one shared library; headers are looked for beside the sources.

    Raises `ToolchainError` with the first lines the compiler said, or if ``timeout`` seconds were not enough, or if
    there is no library although the compiler says so.
    """
    compiler = compiler or find()
    output.unlink(missing_ok=True)
    try:
        with progress.stage(f"{sources[0].stem}: C compiler"):
            failure = _made(compiler.command, compiler.flags, sources, output, timeout)
    except subprocess.TimeoutExpired as error:
        raise ToolchainError(
            f"{compiler} did not finish within {timeout:g} s\n"
            "  hint: a lower order makes smaller code; `phigen show` prints the operation counts"
        ) from error
    if failure:
        hint = "the code is C99 and should compile everywhere; try another compiler by CC=gcc or CC=clang"
        raise ToolchainError(f"{compiler} {failure}\n  hint: {hint}")


_NOT_FOUND = "was not found"


def _command(named: str) -> tuple[str, ...]:
    try:
        return tuple(shlex.split(named))
    except ValueError as error:
        raise ToolchainError(
            f"CC={named} cannot be read as a command: {error}\n  hint: quote it as for a shell, e.g. CC='gcc -O2'"
        ) from error


def _examined(command: tuple[str, ...]) -> Compiler | str:
    """The compiler behind a command, or why it is none: the end of a sentence about it."""
    path = shutil.which(command[0])
    if path is None:
        return "is not a program" if shutil.which(command[0], os.F_OK) else _NOT_FOUND
    return _answering((path, *command[1:]))


@cache
def _answering(command: tuple[str, ...]) -> Compiler | str:
    try:
        code, said = _run([*command, "--version"], _TRIAL_TIMEOUT, errors=False)
        version = next((line.strip() for line in said.splitlines() if line.strip()), "")
        if code or not version:
            return f"does not report its version: --version {_ended(code, said) if code else 'printed nothing'}"
        with tempfile.TemporaryDirectory(prefix="phigen-") as folder:
            return _tried(command, version, Path(folder))
    except subprocess.TimeoutExpired as error:
        return f"did not answer within {error.timeout:g} s"
    except OSError as error:
        return f"cannot be tried: {error.filename}: {error.strerror}"


def _tried(command: tuple[str, ...], version: str, folder: Path) -> Compiler | str:
    """The compiler with those flags that it takes; all are tried at once, one by one only if that fails."""
    patience = _FIRST_TRIAL if _PACKAGE in command else _TRIAL_TIMEOUT
    source, library = folder / "trial.c", folder / "trial.so"
    source.write_text(_TRIAL, encoding="utf-8")

    def failure(*more: str) -> str:
        library.unlink(missing_ok=True)
        return _made(command, (*BASE_FLAGS, *more), [source], library, patience)

    # -Werror turns clang's warning about an unused flag into a refusal.
    if not failure("-Werror", *TUNING_FLAGS):
        return Compiler(command, version, TUNING_FLAGS)
    reason = failure()
    if reason:
        return reason
    return Compiler(command, version, tuple(flag for flag in TUNING_FLAGS if not failure("-Werror", flag)))


def _made(command: Sequence[str], flags: Sequence[str], sources: Sequence[Path], output: Path, timeout: float) -> str:
    """Make a library; why there is none, the end of a sentence about the compiler, or nothing."""
    code, said = _run([*command, *flags, *map(str, sources), "-o", str(output), "-lm"], timeout)
    if code:
        return _ended(code, said)
    head = _head(output)
    if head is None:
        return "reported success, but wrote no library"
    if not head.startswith(_LIBRARIES):
        return f"reported success, but wrote {'a file that is not a library' if head else 'an empty file'}"
    if head.startswith(_ELF) and int.from_bytes(head[16:18], "little" if head[5] == 1 else "big") != _ELF_SHARED:
        return "reported success, but its output is not a shared library"
    return ""


def _head(path: Path) -> bytes | None:
    try:
        with path.open("rb") as file:
            return file.read(18)
    except (FileNotFoundError, IsADirectoryError):
        return None


def _ended(code: int, said: str) -> str:
    """How a compiler failed, with the first lines of what it said."""
    how = f"failed with exit code {code}" if code > 0 else f"was ended by {signal.Signals(-code).name}"
    lines = said.strip().splitlines()
    if not lines:
        return f"{how} without a message"
    shown = "\n".join(f"    {line}" for line in lines[:_MESSAGE_LINES])
    more = f"\n    … {len(lines) - _MESSAGE_LINES} more lines" if len(lines) > _MESSAGE_LINES else ""
    return f"{how}:\n{shown}{more}"


def _run(command: Sequence[str], timeout: float, *, errors: bool = True) -> tuple[int, str]:
    """The exit code of a compiler, and the beginning of what it said, on stderr too if ``errors``.

    Giving up ends the compiler proper as well, not only the driver that started it.
    """
    heard = bytearray()

    def listen(stream: BinaryIO) -> None:
        while chunk := stream.read1(_MESSAGE_BYTES):  # type: ignore[attr-defined]
            heard.extend(chunk[: _MESSAGE_BYTES - len(heard)])

    try:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, start_new_session=True,
            stderr=subprocess.STDOUT if errors else subprocess.DEVNULL,
        )  # fmt: skip
    except OSError as error:
        return 126, f"it could not be started: {error.strerror or error}"
    with process:
        listener = threading.Thread(target=listen, args=(process.stdout,), daemon=True)
        listener.start()
        try:
            code = process.wait(timeout)
            listener.join(_GRACE)
        finally:  # a keyboard interrupt too: the new session does not hear the terminal's
            if process.returncode is None or listener.is_alive():
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
            listener.join()
    return code, heard.decode("utf-8", "replace")
