"""Imitation of a full disk: the operating system limits the sizes of files."""

import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

#: Message of the operating system if a file would exceed the largest allowed size. A full disk gives "No space left on
#: device" instead.
FULL = "File too large"


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Let no file that this process or its children write grow beyond ``size`` bytes.

    Python writes no compiled modules meanwhile: Python 3.11 would leave truncated ones, and later fail to load them.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "dont_write_bytecode", True)
        patch.setenv("PYTHONDONTWRITEBYTECODE", "1")
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
