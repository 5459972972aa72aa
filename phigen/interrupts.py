"""Ctrl-C of the command line, from the first import to the end: exit code 130, one word, no traceback.

While a command runs, Ctrl-C is a `KeyboardInterrupt`, so that the command can clean up. A second Ctrl-C, and one
before or after the command, ends the process at once. This module is imported before everything else, so it imports
next to nothing.
"""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType

CODE = 130

#: Whether a command is running that cleans up after an interrupt.
working = False


def obey() -> None:
    """Handle SIGINT, unless the process ignores it, as background jobs do."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _handle)
        sys.unraisablehook = _unraisable


def _handle(number: int, frame: FrameType | None) -> None:
    global working
    if working and not _imports(frame):
        working = False
        raise KeyboardInterrupt
    _end()


def _imports(frame: FrameType | None) -> bool:
    """Whether a module is being imported: compiled modules convert an interrupt into errors of their own."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def _unraisable(unraisable: sys.UnraisableHookArgs) -> None:
    """An interrupt may occur in a callback of a weak reference, from which Python cannot propagate it."""
    if issubclass(unraisable.exc_type, KeyboardInterrupt):
        _end()
    sys.__unraisablehook__(unraisable)


def _end() -> None:
    os.write(2, b"interrupted\n")
    os._exit(CODE)
