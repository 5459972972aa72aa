"""Parallel builds of candidate methods, each in a separate process, so that builds that take too long can be ended.

A process generates the code and compiles it. The library goes into the cache of solvers, from which the calling process
loads it.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from phigen.api import backend_of, chosen_target, interface_of
from phigen.compilation import Compilation
from phigen.compiler import compile_spec, emit
from phigen.errors import PhigenError, SpecError
from phigen.geometry.system import System
from phigen.runtime import cache
from phigen.runtime.backend import Backend
from phigen.runtime.interface import Interface
from phigen.spec.model import Spec
from phigen.targets.header import split
from phigen.tuning.settings import Setting

#: Reason that is reported for candidates that were not built before the deadline.
LATE = "there was no time to build it"
#: Largest number of builds at a time, each in a process.
WORKERS = 4
#: Seconds after which a process that was asked to end is killed.
_GRACE = 2.0


@dataclass(frozen=True)
class Built:
    """A compiled candidate, with its generated files and the properties of its method.

    ``kind`` is the chosen kind of bi-realisation or scheme. ``order`` may be larger than the order of the setting,
    since symmetric methods have even order. ``exact`` says that a step is a Poisson map to round-off. ``gauged`` says
    that the solver subtracts multiples of Casimirs from H. ``stages`` is the number of maps of which a step is
    composed, ``seconds`` the time of the build.
    """

    setting: Setting
    files: Mapping[str, str]
    interface: Interface
    kind: str
    order: int
    exact: bool
    symmetric: bool
    gauged: bool
    stages: int
    composition: str
    seconds: float

    @property
    def fingerprint(self) -> str:
        """Hash of the code without the headers of files; two settings with the same code have the same fingerprint."""
        bodies = [split(text)[1] for _, text in sorted(self.files.items())]
        return hashlib.sha256("\0".join(bodies).encode()).hexdigest()

    def solver(self) -> Backend:
        """Return the back end of the solver. For C it is loaded from the cache, where the build has put the library."""
        return backend_of(self.files, self.interface)


@dataclass(frozen=True)
class Refusal:
    """The reason why a candidate cannot be built.

    ``inapplicable`` says that the method does not apply to the system. If it is False, the code would be too large, or
    the build would take too long. ``seconds`` is the time that the attempt took.
    """

    reason: str
    inapplicable: bool = False
    seconds: float = 0.0


Outcome = Built | Refusal


def build(spec: Spec, system: System | None, setting: Setting) -> Built:
    """Generate and compile the candidate with a setting. Raises the errors of `compile_spec` and of the C compiler."""
    start = time.perf_counter()
    return built(compile_spec(setting.applied(spec), system=system), setting, start)


def built(compilation: Compilation, setting: Setting, start: float) -> Built:
    """Generate the code of a compilation, C if there is a compiler, else NumPy, and compile the C.

    ``start`` is the value of `time.perf_counter` at which the build began.
    """
    program, target = compilation.program, chosen_target("auto")
    files = emit(program, target, f"phigen build {program.name}.yaml")
    step = program.step
    if target == "c":
        cache.build(files, threads=step.kind.sites)
    is_sequence = step.flow_schedule and not (step.swept and step.swept.equation)
    stages = step.flow_schedule.stages if step.flow_schedule and is_sequence else len(program.fractions)
    return Built(
        setting, files, interface_of(program), compilation.label, program.order, compilation.exact,
        compilation.symmetric, bool(program.gauge), stages, step.method_name,
        time.perf_counter() - start,
    )  # fmt: skip


def build_all(
    spec: Spec, system: System | None, settings: Sequence[Setting], deadline: float
) -> Iterator[tuple[Setting, Outcome]]:
    """Build several settings, and yield each with its outcome as soon as it is known.

    Builds that are not finished at the ``deadline``, a value of `time.perf_counter`, are ended and refused.
    """
    waiting, running = list(settings), dict[Connection, tuple[Setting, Any, float]]()
    context: Any = multiprocessing.get_context("fork" if sys.platform != "win32" else "spawn")
    try:
        while waiting or running:
            while waiting and len(running) < min(WORKERS, os.cpu_count() or 1) and time.perf_counter() < deadline:
                setting = waiting.pop(0)
                ours, theirs = context.Pipe(duplex=False)
                process = context.Process(target=_work, args=(spec, system, setting, theirs), daemon=True)
                process.start()
                theirs.close()
                running[ours] = (setting, process, time.perf_counter())
            if time.perf_counter() >= deadline:
                unfinished = [*waiting, *(setting for setting, _, _ in running.values())]
                yield from ((setting, Refusal(LATE)) for setting in unfinished)
                return
            for connection in wait(list(running), max(0.0, deadline - time.perf_counter())):
                assert isinstance(connection, Connection)
                setting, process, start = running.pop(connection)
                outcome = _received(connection, time.perf_counter() - start)
                process.join(_GRACE)
                yield setting, outcome
    finally:
        for connection, (_, process, _) in running.items():
            _end(process)
            connection.close()


def _received(pipe: Connection, seconds: float) -> Outcome:
    try:
        outcome: Outcome = pipe.recv()
    except EOFError:
        return Refusal("building it failed", seconds=seconds)
    finally:
        pipe.close()
    return outcome


def _work(spec: Spec, system: System | None, setting: Setting, pipe: Connection) -> None:
    """Build one candidate, and send the outcome through the pipe: the main function of a process.

    If the process is terminated, it also ends its C compiler.
    """

    def leave(*_: Any) -> None:
        raise SystemExit(1)

    for name in (signal.SIGTERM, signal.SIGINT):
        signal.signal(name, leave)
    # stderr is discarded, since a terminated interpreter would print a traceback there.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    start, outcome = time.perf_counter(), Refusal("building it failed")
    try:
        pipe.send(build(spec, system, setting))
        return
    except SpecError as error:
        inapplicable = error.exit_code == SpecError.exit_code
        outcome = Refusal(error.diagnostics[0].message, inapplicable)
    except PhigenError as error:
        outcome = Refusal(str(error).split("\n")[0])
    except (ArithmeticError, MemoryError, RecursionError) as error:
        outcome = Refusal(f"{type(error).__name__}: {error}")
    pipe.send(Refusal(outcome.reason, outcome.inapplicable, time.perf_counter() - start))


def _end(process: Any) -> None:
    process.terminate()
    process.join(_GRACE)
    if process.is_alive():
        process.kill()
        process.join()
