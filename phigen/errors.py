"""The errors that a user can meet, each class with its exit code.

========== =====================================================================
exit code  meaning
========== =====================================================================
0          ok
1          the spec is wrong (`SpecError`)
2          the command line is wrong (errors of click), a file cannot be read or
           written, or a Python package is missing (`MissingPackageError`)
3          a limit is exceeded (`LimitError`)
4          internal error: a bug of phigen
5          a check failed: a statement is refuted, or output is stale or edited
           (`CheckError`)
6          a C compiler or a device is missing, or it failed
           (`ToolchainError`, `DeviceError`)
7          an integration failed (`StepError`)
========== =====================================================================
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, order=True)
class Location:
    """Position in a source file; line and column count from 1."""

    line: int
    column: int
    file: str = "<spec>"

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


@dataclass(frozen=True)
class Diagnostic:
    """Message about a spec. It says what is wrong or doubtful, and where in the spec; a hint says how to correct it."""

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
    """Return at most ``width`` characters of a line around ``column``, and the number of the column within these
    characters.

    Columns count from 0. Characters that a terminal would not display as one character are replaced. So a caret below
    the text points at the right character.
    """
    start = 0 if len(line) <= width else max(0, min(column - width // 2, len(line) - width))
    part = "".join(c if c.isprintable() else " " if c == "\t" else "�" for c in line[start : start + width])
    if start + width < len(line):
        part += "…"
    return ("…" + part, column - start + 1) if start else (part, column)


def missing_attribute(owner: object, name: str) -> AttributeError:
    """Return the `AttributeError` for an attribute that a system lacks.

    For attributes that only solvers have, such as ``run``, the message has a hint.
    """
    hint = f"; solver = phigen.compile(system) has {name}" if name in ("run", "runs", "integrate") else ""
    return AttributeError(f"{type(owner).__name__!r} object has no attribute {name!r}{hint}")


class PhigenError(Exception):
    """Base class of all errors that the user can correct; any other exception is a bug of phigen."""

    exit_code = 4

    def __reduce__(self) -> tuple[Any, ...]:
        # By default, pickle restores an exception by calling its class with the message alone. This fails for classes
        # with further arguments.
        return _restored, (type(self), self.args, self.__dict__)


class PhigenWarning(RuntimeWarning):
    """A warning: the work continues. The command line prints it in the form of its own warnings."""


class SpecError(PhigenError):
    """The spec is wrong; ``diagnostics`` has all errors found, in the order of the file."""

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
    """There is no usable C compiler, or the compiler refused the generated code."""

    exit_code = 6


class DeviceError(ToolchainError):
    """There is no usable device (such as a graphics card), or the device failed.

    ``trajectory`` has the results so far, with NaN for results that are missing.
    """

    trajectory: Any = None


class MissingPackageError(PhigenError):
    """A Python package that a request needs is not installed."""

    exit_code = 2


class FileError(PhigenError):
    """A file that the user named cannot be written, or lacks the contents that are needed."""

    exit_code = 2


class StepError(PhigenError):
    """A step failed; the solver has the state before this step.

    Attributes: ``step`` (number of the failing step, from 0), ``status`` (the name of the solver's status, e.g.
    ``NO_CONVERGENCE``), ``trajectory`` (the results before the failing step, or ``None``), ``members`` (for an
    ensemble, the indices of the failed members).
    """

    exit_code = 7

    def __init__(
        self, message: str, *, step: int, status: str, trajectory: Any = None, members: tuple[int, ...] = ()
    ) -> None:
        super().__init__(message)
        self.step, self.status, self.trajectory, self.members = step, status, trajectory, members


class ParameterError(StepError, ValueError):
    """No step is possible with the given parameters: a value that is computed from parameters alone is not finite."""


def _restored(kind: type[PhigenError], args: tuple[Any, ...], parts: dict[str, Any]) -> PhigenError:
    error = kind.__new__(kind, *args)
    error.args = args
    error.__dict__.update(parts)
    return error
