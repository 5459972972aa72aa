"""Ctrl-C in a long run: the run stops at a consistent state, and its results are kept."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

from phigen import interrupts
from phigen.errors import PhigenError


class InterruptedRunError(PhigenError):
    """Error raised after the user or the operating system has stopped a run."""

    exit_code = interrupts.CODE


@dataclass
class Stop:
    """Flag: whether the user or the operating system has requested the end of a run."""

    requested: bool = False


@contextmanager
def interruptible() -> Iterator[Stop]:
    """Context in which SIGINT and SIGTERM set the flag of a `Stop`; a second signal raises `KeyboardInterrupt`."""
    stop = Stop()
    if threading.current_thread() is not threading.main_thread():
        yield stop  # Python handles signals in the main thread only, so no handler is installed here
        return

    def handle(number: int, frame: FrameType | None) -> None:
        if stop.requested:
            raise KeyboardInterrupt
        stop.requested = True

    previous_handlers = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, handler in previous_handlers.items():
            signal.signal(number, handler)
