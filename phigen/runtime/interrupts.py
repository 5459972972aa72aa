"""Keyboard interrupts during long calls of C, which poll a function and return early when it is not 0."""

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
    """Pass to ``ask`` the address of a C function that returns non-zero after Ctrl-C, and None at the end.

    After an interrupt `KeyboardInterrupt` is raised at the end. Nothing is passed outside of the main thread, which
    alone receives signals, or if the program has its own handler for them.
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
