"""Upper bound for the stack that generated C uses, from the call graph that gcc writes with ``-fcallgraph-info=su``."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from phigen.errors import ToolchainError
from phigen.scheme.program import StackBound
from phigen.targets.header import plain

_NODE = re.compile(r'node: \{ title: "([^"]+)" label: "[^"]*?\\n[^"]*?(?:\\n(\d+) bytes \((\w+(?:,\w+)?)\))?"')
_EDGE = re.compile(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"')
_HINT = "gcc of version 10 or later, or one named in the environment variable CC, such as CC=arm-none-eabi-gcc"
#: Beginnings of names in gcc's call graph that stand for calls through pointers: gcc's name for a call through a
#: pointer, and the prefix of OpenMP's functions, which call functions through pointers.
_BY_POINTER = ("__indirect_call", "GOMP_")
_TIMEOUT = 300.0  # time limit of a command of the compiler, in seconds


@dataclass(frozen=True)
class CallGraph:
    """Call graph of a solver. ``stack`` is the size of each function's stack in bytes, ``calls`` the names of the
    functions that it calls.

    The stack of library functions is unknown. ``kinds`` has gcc's word for each function: ``static`` if the number of
    bytes is exact, ``dynamic,bounded`` if it is an upper bound, and ``dynamic`` if there is no bound.
    """

    stack: Mapping[str, int]
    calls: Mapping[str, set[str]]
    kinds: Mapping[str, str]

    def deepest(self, function: str, above: tuple[str, ...] = ()) -> int:
        """Return the largest stack, in bytes, that ``function`` and the functions called by it need together.

        Library functions are not counted. ``above`` are the functions whose calls led to this call. Raises
        `ToolchainError` if a function can call itself.
        """
        if function in above:
            raise ToolchainError(f"{function} can call itself: {' → '.join((*above, function))}")
        below = (self.deepest(callee, (*above, function)) for callee in self.calls.get(function, ()))
        return self.stack.get(function, 0) + max(below, default=0)

    @property
    def external(self) -> set[str]:
        """Names of functions that the solver calls and does not define, such as those of libm."""
        return {callee for callees in self.calls.values() for callee in callees} - self.stack.keys()


def stack_bound(files: Mapping[str, str], name: str, flags: str) -> StackBound:
    """Return a bound for the stack of a solver in C.

    The solver is compiled with ``flags`` by the compiler named in CC, or else by gcc. Raises `ToolchainError` if the
    compiler writes no call graph, or if the stack has no bound.
    """
    words = tuple(shlex.split(flags))
    graph = call_graph(files, name, words)
    if unbounded := sorted(function for function, kind in graph.kinds.items() if kind == "dynamic"):
        raise ToolchainError(f"{name}: the stack of {', '.join(unbounded)} depends on arguments, without a bound")
    by_pointer = sorted(f for f in graph.external if f.startswith(_BY_POINTER))
    if by_pointer:
        raise ToolchainError(f"{name}: {', '.join(by_pointer)} calls functions that the graph of calls does not show")
    init, step = (graph.deepest(f"{name}_{function}") for function in ("init", "step"))
    version = _output([*_command(), "--version"]).split("\n")[0]
    machine = _output([*_command(), "-dumpmachine"]).strip()
    compiler = plain(f"{version} for {machine} with {shlex.join(words)}")
    return StackBound(compiler, init, step, max(map(graph.deepest, graph.stack)))


def call_graph(files: Mapping[str, str], name: str, flags: Sequence[str]) -> CallGraph:
    """Compile the C of a solver with these flags, and return its call graph."""
    with tempfile.TemporaryDirectory(prefix="phigen-") as scratch:
        folder = Path(scratch)
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8")
        command = [*_command(), "-std=c99", *flags, "-fcallgraph-info=su", "-c", f"{name}.c", "-o", "a.o"]
        _output(command, folder)
        graphs = [*folder.glob("*.ci")]
        if not graphs:
            raise ToolchainError(f"{command[0]} cannot report how much stack each function uses\n  hint: use {_HINT}")
        text = graphs[0].read_text(encoding="utf-8")
    sizes = {_plain(title): (int(size), kind) for title, size, kind in _NODE.findall(text) if size}
    stack = {function: size for function, (size, _) in sizes.items()}
    kinds = {function: kind for function, (_, kind) in sizes.items()}
    calls: dict[str, set[str]] = {}
    for caller, callee in _EDGE.findall(text):
        calls.setdefault(_plain(caller), set()).add(_plain(callee))
    return CallGraph(stack, calls, kinds)


def _command() -> list[str]:
    return shlex.split(os.environ.get("CC", "")) or ["gcc"]


def _output(command: Sequence[str], folder: Path | None = None) -> str:
    """Return the output of a command. If the command fails, raises `ToolchainError` with the messages of the
    command."""
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=_TIMEOUT, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ToolchainError(f"{command[0]} did not run: {error}\n  hint: {_HINT}") from error
    if done.returncode:
        said = "\n  ".join(done.stderr.strip().split("\n")[:4])
        raise ToolchainError(f"{shlex.join(command)} failed:\n  {said}\n  hint: the stack is measured by {_HINT}")
    return done.stdout


def _plain(title: str) -> str:
    """Return the name of a function from its title in gcc's call graph, without the file name before static
    functions.

    Names such as ``f.part.0``, which gcc gives to parts and copies of a function f, remain.
    """
    return title.rpartition(":")[2]
