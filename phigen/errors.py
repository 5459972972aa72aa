"""Every error a user can meet, each class with its exit code.

========== =====================================================================
exit code  meaning
========== =====================================================================
0          ok
1          the spec is wrong (`SpecError`)
2          the command line is wrong (click's own), a file cannot be read or written,
           or a Python package for what is asked is missing (`MissingPackageError`)
3          a limit is exceeded (`LimitError`)
4          internal error: a bug of phigen
5          a check failed: mathematics refuted, stale or edited output (`CheckError`)
6          no usable C toolchain, or it failed (`ToolchainError`)
7          an integration failed (`StepError`)
========== =====================================================================
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, order=True)
class Location:
    """A place in a source file; line and column count from 1."""

    line: int
    column: int
    file: str = "<spec>"

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


@dataclass(frozen=True)
class Diagnostic:
    """One message about a spec: the place, the error (with the value), and how to correct it."""

    message: str
    location: Location | None = None
    hint: str = ""
    source_line: str = ""
    severity: str = "error"

    def __str__(self) -> str:
        head = (
            f"{self.location}: {self.severity}: {self.message}" if self.location else f"{self.severity}: {self.message}"
        )
        lines = [head]
        if self.location and self.source_line:
            line, column = _excerpt(self.source_line, self.location.column - 1)
            lines += [f"    {line}", "    " + " " * column + "^"]
        if self.hint:
            lines.append(f"  hint: {self.hint}")
        return "\n".join(lines)


def _excerpt(line: str, column: int, width: int = 100) -> tuple[str, int]:
    """Return the part of a long line around a column (from 0), and the column in it.

    Characters that a terminal would not show as one character are replaced, so that the caret is below its
    character.
    """
    start = 0 if len(line) <= width else max(0, min(column - width // 2, len(line) - width))
    part = "".join(c if c.isprintable() else " " if c == "\t" else "�" for c in line[start : start + width])
    if start + width < len(line):
        part += "…"
    return ("…" + part, column - start + 1) if start else (part, column)


def missing_attribute(owner: object, name: str) -> AttributeError:
    """Return the error of an attribute that a system does not have; runs belong to solvers."""
    hint = f"; solver = phigen.compile(system) has {name}" if name in ("run", "runs", "integrate") else ""
    return AttributeError(f"{type(owner).__name__!r} object has no attribute {name!r}{hint}")


class PhigenError(Exception):
    """Base class of all errors that the user can correct; any other exception is a bug of phigen."""

    exit_code = 4

    def __reduce__(self) -> tuple[Any, ...]:
        # By default, an exception is made anew from its message: not those with further arguments.
        return _restored, (type(self), self.args, self.__dict__)


class PhigenWarning(RuntimeWarning):
    """A warning: work continues; the command line shows it like its own warnings."""


class SpecError(PhigenError):
    """The spec is wrong; holds all diagnostics of the run, in the order of the file."""

    exit_code = 1

    def __init__(self, diagnostics: list[Diagnostic]) -> None:
        self.diagnostics = diagnostics
        super().__init__("\n".join(str(d) for d in diagnostics))


class LimitError(SpecError):
    """The spec, or the program that it would compile to, exceeds a limit."""

    exit_code = 3


class CheckError(PhigenError):
    """A check failed: a refuted statement, or generated files that are stale or were edited."""

    exit_code = 5


class ToolchainError(PhigenError):
    """There is no usable C compiler, or it refused the generated code."""

    exit_code = 6


class DeviceError(ToolchainError):
    """There is no usable device, or the device failed; ``trajectory`` has the results so far, NaN if missing."""

    trajectory: Any = None


class MissingPackageError(PhigenError):
    """A Python package that a request needs is not installed."""

    exit_code = 2


class FileError(PhigenError):
    """A file cannot be written, and there is more to say than which, and why."""

    exit_code = 2


class StepError(PhigenError):
    """A step failed; the state is that before it.

    Attributes: ``step`` (number of the failing step, from 0), ``status`` (the name of the solver's status,
    e.g. ``NO_CONVERGENCE``), ``trajectory`` (what was computed before it, or ``None``), ``members``
    (indices of the members of an ensemble that failed).
    """

    exit_code = 7

    def __init__(
        self, message: str, *, step: int, status: str, trajectory: Any = None, members: tuple[int, ...] = ()
    ) -> None:
        super().__init__(message)
        self.step, self.status, self.trajectory, self.members = step, status, trajectory, members


class ParameterError(StepError, ValueError):
    """Parameters with which no step is possible: values computed from them alone are not finite."""


def _restored(kind: type[PhigenError], args: tuple[Any, ...], parts: dict[str, Any]) -> PhigenError:
    error = kind.__new__(kind, *args)
    error.args = args
    error.__dict__.update(parts)
    return error
