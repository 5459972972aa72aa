"""The C compiler of this machine: the search for it, and the compilation of generated code into shared libraries.

The compiler flags suit libraries that run on this machine only. The generated code itself needs only C99 and libm.
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

#: Flags that gcc, clang and zig all accept.
BASE_FLAGS = ("-std=c99", "-O3", "-fPIC", "-shared")

#: Flags for this processor; a flag that the compiler does not accept is left out. Fused multiply-adds change results by
#: round-off only: the compensated sums of the generated code contain no product that could be fused. The generated code
#: does not read floating-point exceptions, so traps are off. A SIMD lane whose value is not used may therefore divide
#: by 0. With traps, gcc would not vectorise loops over pairs on processors without AVX-512.
TUNING_FLAGS = ("-march=native", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math")

#: Flag of compilers for code with OpenMP threads, which only solvers of lattices use.
OPENMP = "-fopenmp"

#: Time limit of a compilation in seconds.
TIMEOUT = 300.0

_CANDIDATES = ("cc", "gcc", "clang")
#: Python package with a C compiler, and the time limit of its first use in seconds. In its first use the package
#: compiles its runtime.
_PACKAGE, _FIRST_TRIAL = "ziglang", 120.0
_HINT = (
    "install gcc or clang, or the compiler of the package ziglang (pip install ziglang), or name a compiler in the "
    "environment variable CC; the target numpy needs no compiler"
)
_MESSAGE_LINES = 8
_MESSAGE_BYTES = 1 << 16
_TRIAL_TIMEOUT = 20.0  # seconds for --version, and for the compilation of a one-line library
_GRACE = 1.0  # seconds that child processes of a compiler may run after the compiler has ended
_TRIAL = "#include <math.h>\ndouble trial(double x);\ndouble trial(double x) { return sin(x); }\n"
_TRIAL_OF_THREADS = "#include <omp.h>\nint trial(void);\nint trial(void) { return omp_get_max_threads(); }\n"

#: First bytes of shared libraries: of ELF, of Mach-O (both byte orders, and universal), and of PE.
_ELF = b"\x7fELF"
_LIBRARIES = (_ELF, b"\xfe\xed\xfa", b"\xce\xfa\xed\xfe", b"\xcf\xfa\xed\xfe", b"\xca\xfe\xba\xbe", b"MZ")
_ELF_SHARED = 3


@dataclass(frozen=True)
class Compiler:
    """A working C compiler: its command, the first line of its ``--version``, and those of `TUNING_FLAGS` that it
    accepts."""

    command: tuple[str, ...]
    version: str
    tuning: tuple[str, ...] = ()

    @property
    def flags(self) -> tuple[str, ...]:
        """All flags for compiling a library that is used on this machine only."""
        return BASE_FLAGS + self.tuning

    def __str__(self) -> str:
        return f"{shlex.join(self.command)} ({self.version})"


class NoCompilerError(ToolchainError):
    """No C compiler was found: the variable CC is not set, and none of the usual compilers works."""


def find() -> Compiler:
    """Return the compiler named in CC, or else the first of cc, gcc, clang and zig that compiles a one-line library.

    zig is called through the Python package ziglang. Raises `ToolchainError` if the compiler named in CC does not work,
    and `NoCompilerError` if CC is not set and no compiler works; the messages give the reasons.
    """
    configured = os.environ.get("CC", "").strip()
    if configured:
        compiler = _examined(_command(configured))
        if isinstance(compiler, str):
            raise ToolchainError(f"the C compiler named in CC, {configured}, {compiler}\n  hint: {_HINT}")
        return compiler
    reasons = []
    for candidate in _CANDIDATES:
        compiler = _examined((candidate,))
        if isinstance(compiler, Compiler):
            return compiler
        reasons.append(f"{candidate} {compiler}")
    if find_spec(_PACKAGE):
        compiler = _responding_compilers((sys.executable, "-m", _PACKAGE, "cc"))
        if isinstance(compiler, Compiler):
            return compiler
        reasons.append(f"{_PACKAGE} {compiler}")
    if set(reasons) == {f"{c} {_NOT_FOUND}" for c in _CANDIDATES}:
        reasons = [f"none of {', '.join(_CANDIDATES)} was found"]
    apart = "\n  " if any("\n" in reason for reason in reasons) else " "
    raise NoCompilerError(f"no C compiler works:{apart}{f';{apart}'.join(reasons)}\n  hint: {_HINT}")


def available() -> bool:
    """Whether there is a C compiler. Raises `ToolchainError` if CC names one that does not work."""
    try:
        find()
    except NoCompilerError:
        return False
    return True


@cache
def threaded(compiler: Compiler) -> Compiler:
    """Return the compiler with the flag ``-fopenmp`` added, if it has OpenMP; else the compiler unchanged."""
    with tempfile.TemporaryDirectory(prefix="phigen-") as folder:
        source, library = Path(folder) / "trial.c", Path(folder) / "trial.so"
        source.write_text(_TRIAL_OF_THREADS, encoding="utf-8")
        flags = (*BASE_FLAGS, "-Werror", OPENMP)
        try:
            has_openmp = not _compile_library(compiler.command, flags, [source], library, _TRIAL_TIMEOUT)
        except (OSError, subprocess.TimeoutExpired):
            has_openmp = False
    return replace(compiler, tuning=(*compiler.tuning, OPENMP)) if has_openmp else compiler


def compile_library(
    sources: Sequence[Path], output: Path, compiler: Compiler | None = None, timeout: float = TIMEOUT
) -> None:
    """Compile C files into one shared library; the headers must be in the folders of the C files.

    Raises `ToolchainError` with the first lines of the compiler's messages if the compiler fails, if it takes more than
    ``timeout`` seconds, or if it reports success but wrote no library.
    """
    compiler = compiler or find()
    output.unlink(missing_ok=True)
    try:
        with progress.stage(f"{sources[0].stem}: C compiler"):
            failure = _compile_library(compiler.command, compiler.flags, sources, output, timeout)
    except subprocess.TimeoutExpired as error:
        raise ToolchainError(
            f"{compiler} did not finish within {timeout:g} s\n"
            "  hint: a lower order makes smaller code; `phigen show` prints the operation counts"
        ) from error
    if failure:
        hint = "the code is C99 and should compile everywhere; try another compiler by CC=gcc or CC=clang"
        raise ToolchainError(f"{compiler} {failure}\n  hint: {hint}")


_NOT_FOUND = "was not found"


def _command(configured: str) -> tuple[str, ...]:
    try:
        return tuple(shlex.split(configured))
    except ValueError as error:
        raise ToolchainError(
            f"CC={configured} cannot be read as a command: {error}\n  hint: quote it as for a shell, e.g. CC='gcc -O2'"
        ) from error


def _examined(command: tuple[str, ...]) -> Compiler | str:
    """Return the compiler that a command names, or the reason why it does not work.

    The reason is the end of a sentence about the compiler, such as "is not a program".
    """
    path = shutil.which(command[0])
    if path is None:
        return "is not a program" if shutil.which(command[0], os.F_OK) else _NOT_FOUND
    return _responding_compilers((path, *command[1:]))


@cache
def _responding_compilers(command: tuple[str, ...]) -> Compiler | str:
    try:
        code, output = _run([*command, "--version"], _TRIAL_TIMEOUT, errors=False)
        version = next((line.strip() for line in output.splitlines() if line.strip()), "")
        if code or not version:
            return (
                f"does not report its version: --version {_failure_text(code, output) if code else 'printed nothing'}"
            )
        with tempfile.TemporaryDirectory(prefix="phigen-") as folder:
            return _with_tuning_flags(command, version, Path(folder))
    except subprocess.TimeoutExpired as error:
        return f"did not answer within {error.timeout:g} s"
    except OSError as error:
        return f"cannot be tried: {error.filename}: {error.strerror}"


def _with_tuning_flags(command: tuple[str, ...], version: str, folder: Path) -> Compiler | str:
    """Return the compiler with those tuning flags that it accepts, or the reason why it compiles no library.

    All flags are tried together first and, if the compiler refuses them, one by one.
    """
    patience = _FIRST_TRIAL if _PACKAGE in command else _TRIAL_TIMEOUT
    source, library = folder / "trial.c", folder / "trial.so"
    source.write_text(_TRIAL, encoding="utf-8")

    def failure(*by_keyword: str) -> str:
        library.unlink(missing_ok=True)
        return _compile_library(command, (*BASE_FLAGS, *by_keyword), [source], library, patience)

    # clang only warns about flags that it does not use; -Werror makes it refuse them.
    if not failure("-Werror", *TUNING_FLAGS):
        return Compiler(command, version, TUNING_FLAGS)
    reason = failure()
    if reason:
        return reason
    return Compiler(command, version, tuple(flag for flag in TUNING_FLAGS if not failure("-Werror", flag)))


def _compile_library(
    command: Sequence[str], flags: Sequence[str], sources: Sequence[Path], output: Path, timeout: float
) -> str:
    """Compile a library. Return "" or, if the compilation fails, the reason as the end of a sentence about the
    compiler.
    """
    code, messages = _run([*command, *flags, *map(str, sources), "-o", str(output), "-lm"], timeout)
    if code:
        return _failure_text(code, messages)
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


def _failure_text(code: int, messages: str) -> str:
    """Return the end of a sentence about a compiler that failed, with the first lines of its output."""
    ending = f"failed with exit code {code}" if code > 0 else f"was ended by {signal.Signals(-code).name}"
    lines = messages.strip().splitlines()
    if not lines:
        return f"{ending} without a message"
    first_lines = "\n".join(f"    {line}" for line in lines[:_MESSAGE_LINES])
    remaining_note = f"\n    … {len(lines) - _MESSAGE_LINES} more lines" if len(lines) > _MESSAGE_LINES else ""
    return f"{ending}:\n{first_lines}{remaining_note}"


def _run(command: Sequence[str], timeout: float, *, errors: bool = True) -> tuple[int, str]:
    """Run a compiler, and return its exit code and the beginning of its output, with stderr if ``errors``.

    At the time limit, all processes that the compiler started are killed, and `subprocess.TimeoutExpired` is raised.
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
        # A thread waits for the process, since join(timeout) returns as soon as the thread ends.
        # `process.wait(timeout)` would poll the process every twentieth of a second.
        waiter = threading.Thread(target=process.wait, daemon=True)
        listener.start()
        waiter.start()
        try:
            waiter.join(timeout)
            if waiter.is_alive():
                raise subprocess.TimeoutExpired(command, timeout)
            listener.join(_GRACE)
        # Processes are killed after Ctrl-C too. They do not receive its signal, since they run in a session of their
        # own.
        finally:
            if waiter.is_alive() or listener.is_alive():
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
            listener.join()
            waiter.join()
    return process.returncode, heard.decode("utf-8", "replace")
