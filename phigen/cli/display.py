"""Display of the compiler's tasks on stderr. On a terminal, one line shows the active tasks; with -v, each task has a
line.
"""

from __future__ import annotations

import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from phigen import progress
from phigen.progress import Stage

#: Seconds until the status line appears, and seconds between two of its updates.
DELAY, PERIOD = 1.0, 0.2


class Display:
    """Status line of the active tasks of the compiler.

    The line is drawn if ``shows`` returns true. When a task starts, ``began`` is called with its name.
    """

    def __init__(self, shows: Callable[[], bool], began: Callable[[str], None]) -> None:
        self._shows, self._began = shows, began
        self._stages: tuple[Stage, ...] = ()
        self._start, self._visible, self._lock = time.perf_counter(), False, threading.Lock()
        self._over = threading.Event()
        self._painter: threading.Thread | None = None

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Context in which the tasks of the compiler that run in this thread are shown."""
        try:
            with progress.watched(self._receive_stages):
                yield
        finally:
            self._over.set()
            self.erase()

    def erase(self) -> None:
        """Clear the status line on the terminal."""
        with self.room():
            pass

    @contextmanager
    def room(self) -> Iterator[None]:
        """Clear the status line, and return a context in which it is not drawn, so that messages can be written."""
        with self._lock:
            if self._visible:
                sys.stderr.write("\r\x1b[K")
                sys.stderr.flush()
                self._visible = False
            yield

    def _receive_stages(self, stages: tuple[Stage, ...]) -> None:
        is_new_stage, self._stages = len(stages) > len(self._stages), stages
        if is_new_stage:
            self._began(_path(stages))
        if not stages:
            self.erase()
        elif self._painter is None and self._shows():
            self._painter = threading.Thread(target=self._paint, daemon=True)
            self._painter.start()

    def _paint(self) -> None:
        while not self._over.wait(PERIOD):
            with self._lock:
                stages, time_now = self._stages, time.perf_counter()
                if stages and time_now - self._start > DELAY and not self._over.is_set():
                    self._draw(f"{_path(stages)}, {time_now - stages[0].began:.0f} s")

    def _draw(self, line: str) -> None:
        width = shutil.get_terminal_size().columns - 1
        sys.stderr.write(f"\r{line if len(line) <= width else line[: width - 1] + '…'}\x1b[K")
        sys.stderr.flush()
        self._visible = True


def _path(stages: tuple[Stage, ...]) -> str:
    return ": ".join(map(str, stages))
