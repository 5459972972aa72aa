"""Handling of Ctrl-C in the command line: exit code 130 and the word "interrupted", without a traceback.

While a command runs, Ctrl-C raises `KeyboardInterrupt`, so that the command can clean up. A second Ctrl-C, or one
before or after the command, ends the process at once. This module is imported before all others, so it imports few
modules itself.
"""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType

CODE = 130

#: Whether a command is running. If so, Ctrl-C raises `KeyboardInterrupt`, so that the command can clean up.
working = False


def obey() -> None:
    """Install the handler of Ctrl-C. A process that ignores Ctrl-C, such as a background job, remains unchanged."""
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
    """Whether the code at ``frame``, or one of its callers, is importing a module.

    During imports Ctrl-C ends the process at once, since compiled modules would convert `KeyboardInterrupt` to another
    error.
    """
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def _unraisable(unraisable: sys.UnraisableHookArgs) -> None:
    """End the process if `KeyboardInterrupt` was raised where Python drops exceptions, such as in a destructor."""
    if issubclass(unraisable.exc_type, KeyboardInterrupt):
        _end()
    sys.__unraisablehook__(unraisable)


def _end() -> None:
    os.write(2, b"interrupted\n")
    os._exit(CODE)
