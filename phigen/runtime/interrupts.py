"""Keyboard interrupts while a long call of C is under way, which asks now and then whether to stop."""

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
    """Give ``ask`` the address of a function of C that is not 0 after an interrupt, and None in the end.

    Then `KeyboardInterrupt` is raised. Where programs do something else with interrupts, nothing is asked, nor in
    threads but the first, which alone hears of them.
    """
    heard: list[int] = []
    first = threading.current_thread() is threading.main_thread()
    if not first or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    question = _QUESTION(lambda: len(heard))
    signal.signal(signal.SIGINT, lambda number, frame: heard.append(number))
    ask(ctypes.cast(question, ctypes.c_void_p).value)
    try:
        yield
    finally:
        ask(None)
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if heard:
        raise KeyboardInterrupt
