"""A content-addressed cache of compiled solvers.

An entry is one file, ``KEY-DIGEST.so``. KEY is a hash of everything that decides the library: sources, compiler,
flags, machine. DIGEST is a hash of the library itself, so that an entry is verified with nothing but itself, and one
atomic rename publishes it. Processes may share the directory: nobody ever changes a file in place, and whoever finds
none, or a damaged one, builds his own and puts it there.
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

#: Bytes beyond which the entries that were not used for longest are removed.
MAXIMUM_SIZE = 512 * 2**20

_SUFFIX = ".so"
_SCRATCH = "building-"
_SCRATCH_LIFETIME = 3600.0  # seconds; what is older was left by a process that died


def directory() -> Path:
    """The cache: PHIGEN_CACHE_DIR, else the platform's folder for caches. It need not exist yet."""
    named = os.environ.get("PHIGEN_CACHE_DIR")
    if named:
        return Path(named)
    if xdg := os.environ.get("XDG_CACHE_HOME"):
        return Path(xdg) / "phigen"
    try:
        home = Path.home()
    except RuntimeError:  # no home at all: a bare container user
        return _private_directory()
    return home / ("Library/Caches" if sys.platform == "darwin" else ".cache") / "phigen"


def load(files: Mapping[str, str], *, threads: bool = False) -> ctypes.CDLL:
    """The shared library compiled from C files (name → text), built unless the cache has it.

    Every name that ends in ``.c`` is compiled, the others are headers; with OpenMP if ``threads`` and the compiler has
    it. Raises `ToolchainError`.
    """
    path = build(files, threads=threads)
    try:
        return ctypes.CDLL(str(path))
    except OSError:
        # Either somebody cleared the cache this very moment, or its folder does not let libraries be loaded
        # (mounted noexec): both are cured by a library of our own.
        path = build(files, _private_directory(), threads=threads)
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        hint = "set PHIGEN_CACHE_DIR to a folder whose libraries may be loaded, or CC to a compiler for this machine"
        raise ToolchainError(f"the compiled solver cannot be loaded: {error}\n  hint: {hint}") from error


def build(files: Mapping[str, str], folder: Path | None = None, *, threads: bool = False) -> Path:
    """The path of the library compiled from C files, verified, in ``folder`` or else in the cache.

    Where the cache cannot be written, the library goes to a private temporary folder, with a warning.
    """
    compiler = toolchain.threaded(toolchain.find()) if threads else toolchain.find()
    name = _key(files, compiler)
    folder = folder or directory()
    found = _look_up(folder, name)
    if found:
        return found
    try:
        return _compile_into(folder, name, files, compiler)
    except OSError as error:
        fallback = _private_directory()
        found = _look_up(fallback, name)
        if found:
            return found
        warnings.warn(
            f"the cache {folder} cannot be written ({error.strerror or error}); compiled solvers are lost "
            "when this process ends. Set PHIGEN_CACHE_DIR to a folder that can be written",
            PhigenWarning,
            stacklevel=2,
        )
        return _compile_into(fallback, name, files, compiler)


def key_of(library: ctypes.CDLL) -> str:
    """The hash of everything that decided a library from `load`."""
    return Path(library._name).stem.rpartition("-")[0]


def clear() -> int:
    """Remove all entries; returns how many there were. Libraries that are loaded stay usable."""
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
                    os.utime(entry)  # the mark of use that _trim goes by
                return entry
    except OSError:  # unreadable, or removed under our hands
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
    """What -march=native looks at: a cache in a home shared by several machines must tell them apart."""
    known = ("model name", "flags", "Features", "CPU implementer", "CPU part", "isa")
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    facts = sorted({line for line in lines if line.split(":")[0].strip() in known})
    return "\n".join([platform.system(), platform.machine(), *(facts or [platform.processor(), platform.node()])])


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:32]


def _entries(folder: Path) -> Iterator[Path]:
    try:
        yield from folder.glob(f"*-*{_SUFFIX}")
    except OSError:
        return


def _trim(folder: Path, keep: Path) -> None:
    """Keep the cache below its size, and sweep out what dead processes left; best effort."""
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
    """A folder of this process alone, removed at its end; a predictable name would let others plant libraries."""
    folder = Path(tempfile.mkdtemp(prefix="phigen-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder
