"""A cache of compiled solvers in a folder, addressed by content.

An entry is one file, ``KEY-DIGEST.so``. KEY is a hash of everything that determines the library: sources, compiler,
flags, machine. DIGEST is a hash of the library file, by which damage is detected. An entry is written by an atomic
rename and never changed, so several processes may share the folder. A process that finds no entry, or a damaged one,
compiles the library and stores it as a new entry.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import hashlib
import json
import os
import platform
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

from phigen.errors import PhigenWarning, ToolchainError
from phigen.runtime import toolchain
from phigen.runtime.toolchain import Compiler

#: Largest size of the cache in bytes: about 10,000 solvers of small systems. Beyond this size, the least recently used
#: entries are removed.
MAXIMUM_SIZE = 512 * 2**20

_SUFFIX = ".so"
_SCRATCH = "building-"
_SCRATCH_LIFETIME = 3600.0  # seconds; compilations take minutes, so an older folder belongs to a process that died


def directory() -> Path:
    """Return the folder of the cache, which may not exist yet.

    The environment variable PHIGEN_CACHE_DIR names the folder. By default it is ``phigen`` in the user's cache folder.
    """
    configured = os.environ.get("PHIGEN_CACHE_DIR")
    if configured:
        return Path(configured)
    if xdg := os.environ.get("XDG_CACHE_HOME"):
        return Path(xdg) / "phigen"
    try:
        home = Path.home()
    except RuntimeError:  # raised for users without a home directory, as in some containers
        return _private_directory()
    return home / ("Library/Caches" if sys.platform == "darwin" else ".cache") / "phigen"


def load(files: Mapping[str, str], *, threads: bool = False) -> ctypes.CDLL:
    """Return the shared library of C files (name → text), from the cache or, if it is not there, compiled now.

    Files whose names end in ``.c`` are compiled, all others are headers. With ``threads``, the library uses OpenMP if
    the compiler has it. Raises `ToolchainError`.
    """
    path = build(files, threads=threads)
    try:
        return ctypes.CDLL(str(path))
    except OSError:
        # Either another process has just cleared the cache, or its folder is mounted with noexec. In both cases a
        # library in a private folder can be loaded.
        path = build(files, _private_directory(), threads=threads)
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        hint = "set PHIGEN_CACHE_DIR to a folder whose libraries may be loaded, or CC to a compiler for this machine"
        raise ToolchainError(f"the compiled solver cannot be loaded: {error}\n  hint: {hint}") from error


def build(files: Mapping[str, str], folder: Path | None = None, *, threads: bool = False) -> Path:
    """Return the path of the compiled library of C files, in ``folder`` or, by default, in the cache.

    If the folder cannot be written, the library goes to a private temporary folder, with a warning.
    """
    compiler = toolchain.threaded(toolchain.find()) if threads else toolchain.find()
    name = _key(files, compiler)
    folder = folder or directory()
    entry = _look_up(folder, name)
    if entry:
        return entry
    try:
        return _compile_into(folder, name, files, compiler)
    except OSError as error:
        fallback = _private_directory()
        entry = _look_up(fallback, name)
        if entry:
            return entry
        warnings.warn(
            f"the cache {folder} cannot be written ({error.strerror or error}); compiled solvers are lost "
            "when this process ends. Set PHIGEN_CACHE_DIR to a folder that can be written",
            PhigenWarning,
            stacklevel=2,
        )
        return _compile_into(fallback, name, files, compiler)


def key_of(library: ctypes.CDLL) -> str:
    """Return the key under which the cache has a library that `load` returned: a hash of sources, compiler, flags and
    machine.
    """
    return Path(library._name).stem.rpartition("-")[0]


def clear() -> int:
    """Remove all entries of the cache and return their number. Libraries that are loaded stay usable."""
    count = 0
    for entry in list(_entries(directory())):
        with contextlib.suppress(OSError):
            entry.unlink()
            count += 1
    return count


def _compile_into(folder: Path, name: str, files: Mapping[str, str], compiler: Compiler) -> Path:
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    with tempfile.TemporaryDirectory(prefix=_SCRATCH, dir=folder) as scratch:
        for file, text in files.items():
            (Path(scratch) / file).write_text(text, encoding="utf-8")
        library = Path(scratch) / f"library{_SUFFIX}"
        sources = [Path(scratch) / file for file in sorted(files) if file.endswith(".c")]
        toolchain.compile_library(sources, library, compiler)
        entry = folder / f"{name}-{_digest(library)}{_SUFFIX}"
        library.replace(entry)
    _trim(folder, keep=entry)
    return entry


def _look_up(folder: Path, name: str) -> Path | None:
    try:
        for entry in sorted(folder.glob(f"{name}-*{_SUFFIX}")):
            if entry.stem.rpartition("-")[2] == _digest(entry):
                with contextlib.suppress(OSError):
                    os.utime(entry)  # marks the entry as used now: _trim removes the least recently used entries
                return entry
    except OSError:  # the folder cannot be read, or another process has removed the entry
        pass
    return None


def _key(files: Mapping[str, str], compiler: Compiler) -> str:
    facts = {
        "files": dict(files),
        "compiler": [compiler.command, compiler.version],
        "flags": compiler.flags,
        "machine": _machine(),
    }
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:40]


@cache
def _machine() -> str:
    """Return those properties of the processor on which code compiled with -march=native depends.

    The key of a cache entry contains these properties, because machines with different processors may share a home
    folder.
    """
    relevant_keys = ("model name", "flags", "Features", "CPU implementer", "CPU part", "isa")
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    facts = sorted({line for line in lines if line.split(":")[0].strip() in relevant_keys})
    return "\n".join([platform.system(), platform.machine(), *(facts or [platform.processor(), platform.node()])])


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:32]


def _entries(folder: Path) -> Iterator[Path]:
    try:
        yield from folder.glob(f"*-*{_SUFFIX}")
    except OSError:
        return


def _trim(folder: Path, keep: Path) -> None:
    """Remove the least recently used entries until the cache has at most `MAXIMUM_SIZE` bytes.

    The entry ``keep`` is never removed. Folders of compilations whose processes died are removed as well. Errors are
    ignored.
    """
    sizes: list[tuple[float, int, Path]] = []
    with contextlib.suppress(OSError):
        for left in folder.glob(f"{_SCRATCH}*"):
            if time.time() - left.stat().st_mtime > _SCRATCH_LIFETIME:
                shutil.rmtree(left, ignore_errors=True)
        for entry in _entries(folder):
            status = entry.stat()
            sizes.append((status.st_mtime, status.st_size, entry))
        excess = sum(size for _, size, _ in sizes) - MAXIMUM_SIZE
        for _, size, entry in sorted(sizes):
            if excess <= 0:
                break
            if entry != keep:
                entry.unlink()
                excess -= size


@cache
def _private_directory() -> Path:
    """Return a temporary folder for this process only, which is removed when the process ends.

    The name of the folder is random: in a folder with a predictable name, other users could place libraries.
    """
    folder = Path(tempfile.mkdtemp(prefix="phigen-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder
