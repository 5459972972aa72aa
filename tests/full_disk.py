"""A disk that is full, for whoever has no disk to fill."""

import resource
from collections.abc import Iterator
from contextlib import contextmanager

#: What is said of it, in place of "No space left on device".
FULL = "File too large"


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Files of this process and those it starts cannot grow beyond so many bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
