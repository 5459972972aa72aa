"""Ctrl-C in the middle of a long run: the work stops at a consistent state, and results are kept."""

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
    """Whether the user or the system has requested an end."""

    requested: bool = False


@contextmanager
def interruptible() -> Iterator[Stop]:
    """Within this context, SIGINT and SIGTERM request a stop at a consistent state; a second signal ends the process
    at once."""
    stop = Stop()
    if threading.current_thread() is not threading.main_thread():
        yield stop  # only the main thread receives signals
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
