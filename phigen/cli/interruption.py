"""Ctrl-C in the middle of a long run: the work stops at a good place, and what was computed is kept."""

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
    """A run was stopped by the user or the system."""

    exit_code = interrupts.CODE


@dataclass
class Stop:
    """Whether somebody asked for an end."""

    requested: bool = False


@contextmanager
def interruptible() -> Iterator[Stop]:
    """While it lasts, SIGINT and SIGTERM are requests to stop at a good place; a second one is obeyed at once."""
    stop = Stop()
    if threading.current_thread() is not threading.main_thread():
        yield stop  # signals are the affair of the main thread
        return

    def handle(number: int, frame: FrameType | None) -> None:
        if stop.requested:
            raise KeyboardInterrupt
        stop.requested = True

    before = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
