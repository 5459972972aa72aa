"""A disk that is full, for whoever has no disk to fill."""

import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

#: What is said of it, in place of "No space left on device".
FULL = "File too large"


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Files of this process and those it starts cannot grow beyond so many bytes.

    Python 3.11 keeps what it could write of a compiled module, and fails to load that ever after: it may write none.
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
