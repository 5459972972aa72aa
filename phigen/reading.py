"""Opening of files for reading; everything other than a regular file is refused.

A pipe or a terminal would block the reader, and devices such as /dev/zero have no end.
"""

from __future__ import annotations

import errno
import os
import stat
from io import TextIOWrapper
from pathlib import Path
from typing import BinaryIO


def opened(path: str | Path) -> BinaryIO:
    """Open a regular file for reading bytes.

    Raises `OSError` with the path for everything other than a regular file, and `ValueError` for a path with a null
    character.
    """
    # The type is checked after the file was opened, so that nobody can replace the file in between. Opening with
    # O_NONBLOCK does not wait at pipes, so they can be refused too.
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    mode = os.fstat(descriptor).st_mode
    if stat.S_ISREG(mode):
        return os.fdopen(descriptor, "rb")
    os.close(descriptor)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    raise OSError(errno.EINVAL, "it is not a regular file", str(path))


def opened_text(path: str | Path) -> TextIOWrapper:
    """Open a regular file of UTF-8 text, with or without a byte order mark. Raises the errors of `opened`."""
    return TextIOWrapper(opened(path), encoding="utf-8-sig")
