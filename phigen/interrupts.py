"""Ctrl-C of the command line, from its first import to its last breath: exit code 130, one word, no traceback.

While a command works, Ctrl-C is a `KeyboardInterrupt`, so that the command tidies up. A second one, and one before or
after, ends the process at once. Imported before everything else, hence it imports next to nothing.
"""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType

CODE = 130

#: Whether a command works that tidies up after an interrupt.
working = False


def obey() -> None:
    """Take over SIGINT, unless the process was told to ignore it, as jobs in the background are."""
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
    """Whether a module is being imported: compiled ones turn an interrupt into errors of their own."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def _unraisable(unraisable: sys.UnraisableHookArgs) -> None:
    """An interrupt may fall into a callback of a weak reference, say, from which Python cannot pass it on."""
    if issubclass(unraisable.exc_type, KeyboardInterrupt):
        _end()
    sys.__unraisablehook__(unraisable)


def _end() -> None:
    os.write(2, b"interrupted\n")
    os._exit(CODE)
