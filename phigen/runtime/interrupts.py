"""Ctrl-C during long calls of C: the C calls a function from time to time, and returns early if the result is not 0."""

from __future__ import annotations

import ctypes
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

_QUESTION = ctypes.CFUNCTYPE(ctypes.c_int)


@contextmanager
def interruptible(ask: Callable[[int | None], Any]) -> Iterator[None]:
    """Return a context in which Ctrl-C ends a call of C early. `KeyboardInterrupt` is then raised at the end of the
    context.

    At the beginning, ``ask`` is called with the address of a C function that returns nonzero after Ctrl-C. The C must
    call this function from time to time. At the end, ``ask`` is called with None.

    Only the main thread receives signals. In other threads, or if the program has its own signal handler, ``ask`` is
    not called, and Ctrl-C acts as usual.
    """
    signals: list[int] = []
    first = threading.current_thread() is threading.main_thread()
    if not first or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    question = _QUESTION(lambda: len(signals))
    signal.signal(signal.SIGINT, lambda number, frame: signals.append(number))
    ask(ctypes.cast(question, ctypes.c_void_p).value)
    try:
        yield
    finally:
        ask(None)
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if signals:
        raise KeyboardInterrupt
