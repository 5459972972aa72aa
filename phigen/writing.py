"""Atomic writing of files: one file, or several files together, are replaced completely or not at all.

Contents are first written to temporary files, each in the folder of the file that it will replace. When all contents
are on the disk, the temporary files replace the files. So readers never see incomplete files, and a full disk leaves
the old files unchanged. Errors name the file.
"""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

#: Folders of devices and of open file descriptors. Files in these folders are written directly, since they cannot be
#: replaced.
_DEVICES = ("/dev/", "/proc/")


@contextmanager
def naming(path: str | Path) -> Iterator[None]:
    """Context in which errors of the operating system name ``path`` as the file.

    Otherwise errors of a full disk would name no file, and errors of a temporary file would name a file that users do
    not know.
    """
    try:
        yield
    except OSError as error:
        raise OSError(error.errno or errno.EIO, error.strerror or str(error), str(path)) from error


def write(path: Path, content: str | bytes) -> None:
    """Replace a file atomically; devices and pipes are written directly. Raises `OSError` with the name of the file."""
    if str(path).startswith(_DEVICES) or (path.exists() and not path.is_file()):
        with naming(path):
            path.write_bytes(_encoded(content))
        return
    # If the path is a symbolic link, its target is replaced, so that the link remains.
    write_all({path.resolve() if path.is_symlink() else path: content})


def write_all(contents: Mapping[Path, str | bytes]) -> None:
    """Replace all files or none, and create missing folders.

    Raises `OSError` with the name of the file that failed.
    """
    pending: list[_Pending] = []
    with ExitStack() as cleanup:
        for path, content in contents.items():
            _make_folder(path.parent, cleanup)
            pending.append(_Pending(path))
            cleanup.callback(pending[-1].abandon)
            with naming(path):
                pending[-1].file.write(_encoded(content))
                pending[-1].settle()
        for p in pending:
            p.take_place()
        cleanup.pop_all()


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """Context with a binary file for writing. The file replaces ``path`` at the end.

    If the body of the context raises an exception, ``path`` remains unchanged. Raises `OSError` with this path.
    """
    pending = _Pending(path)
    try:
        with naming(path):
            yield pending.file
            pending.settle()
        pending.take_place()
    except BaseException:
        pending.abandon()
        raise


class _Pending:
    """Temporary file that will replace the file at ``path``."""

    def __init__(self, path: Path) -> None:
        self.path = path
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        with naming(path):
            handle, temporary = tempfile.mkstemp(prefix=".phigen-", dir=path.parent)
        self.file: BinaryIO = os.fdopen(handle, "wb")
        self._temporary = Path(temporary)

    def settle(self) -> None:
        """Write buffered contents to the disk. If the disk is full, the error is raised now."""
        self.file.flush()
        os.fsync(self.file.fileno())
        self.file.close()
        self._temporary.chmod(_mode(self.path))

    def take_place(self) -> None:
        """Replace the file at ``path`` by the temporary file, atomically."""
        with naming(self.path):
            self._temporary.replace(self.path)

    def abandon(self) -> None:
        """Remove the temporary file."""
        with suppress(OSError):
            self.file.close()
        with suppress(OSError):
            self._temporary.unlink()


def _make_folder(folder: Path, cleanup: ExitStack) -> None:
    missing_folders = []
    while not folder.exists() and folder != folder.parent:
        missing_folders.append(folder)
        folder = folder.parent
    for new_folder in reversed(missing_folders):
        new_folder.mkdir(exist_ok=True)
        cleanup.callback(_remove_folder, new_folder)


def _remove_folder(folder: Path) -> None:
    with suppress(OSError):  # another process may have created a file in the folder
        folder.rmdir()


def _mode(path: Path) -> int:
    """Return the permissions of the file that is replaced or, if there is none, those that a new file would
    get.

    Permissions must be set explicitly, since mkstemp creates temporary files that only their owner can read.
    """
    try:
        return path.stat().st_mode & 0o777
    except OSError:
        mask = os.umask(0)
        os.umask(mask)
        return 0o666 & ~mask


def _encoded(content: str | bytes) -> bytes:
    # A text may contain file names that are not valid UTF-8. Python represents such bytes by surrogates, which are
    # written as escapes.
    return content if isinstance(content, bytes) else content.encode("utf-8", "backslashreplace")
