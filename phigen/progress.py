"""Progress of the compiler: named, nested tasks that an observer, such as the command line, can follow.

The compiler reports a task by ``with stage("Jacobi identity", total=n) as progress: … progress.done = k``. Without an
observer, a task costs a microsecond. `phigen.cli.display` shows the tasks.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Stage:
    """Context manager for a task of a compilation.

    The work of a task has ``total`` parts, of which ``done`` are completed; ``total`` is 0 if the number is unknown.
    ``began`` is the time at which the task started.
    """

    __slots__ = ("_end", "_stack", "began", "done", "name", "total")

    def __init__(self, name: str, total: int = 0) -> None:
        self.name, self.total, self.done = name, total, 0

    def __enter__(self) -> Stage:
        self.began = time.perf_counter()
        self._stack = _here.stages
        self._stack.append(self)
        if _here.watcher:
            _here.watcher(tuple(self._stack))
        return self

    def __exit__(self, *raised: object) -> None:
        self._end = time.perf_counter()
        self._stack.pop()
        if _here.watcher:
            _here.watcher(tuple(self._stack))

    @property
    def seconds(self) -> float:
        """Duration in seconds of a task that has ended."""
        return self._end - self.began

    def __str__(self) -> str:
        if self.total:
            return f"{self.name}, {self.done} of {self.total}"
        return f"{self.name}, {self.done}" if self.done else self.name


#: Observer of a compilation. It is called whenever a task starts or ends, with the active tasks, outermost first.
Watcher = Callable[[tuple[Stage, ...]], None]

stage = Stage


class _Here(threading.local):
    """The active tasks of one thread, and the observer of this thread."""

    def __init__(self) -> None:
        self.stages: list[Stage] = []
        self.watcher: Watcher | None = None


_here = _Here()


@contextmanager
def watched(watcher: Watcher) -> Iterator[None]:
    """Context in which ``watcher`` is called whenever a task of this thread starts or ends. Its argument is the tuple
    of the active tasks, outermost first.
    """
    previous_watcher, _here.watcher = _here.watcher, watcher
    try:
        yield
    finally:
        _here.watcher = previous_watcher
