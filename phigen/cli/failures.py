"""Exceptions of commands: the message that is printed on stderr, and the exit code."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import click

from phigen import interrupts
from phigen._version import __version__
from phigen.cli.console import Console
from phigen.cli.interruption import InterruptedRunError
from phigen.errors import LimitError, PhigenError, SpecError

#: The exit code that shells report for a process ended by SIGPIPE.
BROKEN_PIPE = 141
USAGE = 2


class SeveralError(PhigenError):
    """Errors of several specs in one command. The exit code of the command is the smallest exit code of the errors."""

    def __init__(self, errors: Sequence[PhigenError]) -> None:
        super().__init__(f"{len(errors)} errors")
        self.errors = tuple(errors)
        self.exit_code = min(e.exit_code for e in errors)


class Collector:
    """Collector of the errors of several specs, so that a command reports all of them; `finish` raises them."""

    def __init__(self) -> None:
        self.errors: list[PhigenError] = []

    @contextmanager
    def collecting(self) -> Iterator[None]:
        """Context in which an error of phigen is collected instead of raised."""
        try:
            yield
        except PhigenError as error:
            self.errors.append(error)

    def finish(self) -> None:
        """Raise the collected errors, if there are any."""
        if len(self.errors) == 1:
            raise self.errors[0]
        if self.errors:
            raise SeveralError(self.errors)


def report(error: BaseException, console: Console) -> int:
    """Print the message of an exception, and return the exit code."""
    if isinstance(error, click.exceptions.Abort) or _is_interrupt(error):
        console.error("interrupted")
        return interrupts.CODE
    match error:
        case click.ClickException():
            with suppress(OSError):
                error.show()
            return error.exit_code if isinstance(error, click.UsageError) else USAGE
        case BrokenPipeError():
            return BROKEN_PIPE  # the reader of stdout has closed it
        case SeveralError():
            for part in error.errors:
                report(part, console)
            return error.exit_code
        case PhigenError():
            console.error(_described(error))
            if console.verbose and error.__cause__:
                _show_traceback(error, console)
            return error.exit_code
        case OSError() if error.errno is not None:
            location = _place(error)
            console.error(f"error: {location + ': ' if location else ''}{error.strerror}")
            return USAGE
        case MemoryError():
            console.error("error: out of memory\n  hint: take fewer sites or members, or store fewer states")
            return LimitError.exit_code
    return _internal(error, console)


def drop_unprinted() -> None:
    """Discard output that stdout and stderr did not accept.

    The failure was reported already. If the output were not discarded, Python would report the failure again at exit,
    and end with exit code 120.
    """
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:
                stream.flush()
        except (OSError, ValueError):
            with suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _place(error: OSError) -> str:
    """Return the name of the file in an OSError.

    For an error without a name, the result is "the working directory" if the working directory was removed. Otherwise
    the result is "".
    """
    if error.filename is not None:
        return os.fsdecode(error.filename) if isinstance(error.filename, str | bytes) else str(error.filename)
    try:
        Path.cwd()
    except OSError:
        return "the working directory"
    return ""


def _is_interrupt(error: BaseException | None) -> bool:
    """Whether Ctrl-C caused the exception, so that the message is only "interrupted".

    Libraries may convert an interrupt to an error of their own, for instance during an import. An `InterruptedRunError`
    does not count, since it has a message of its own.
    """
    while error is not None and not isinstance(error, InterruptedRunError):
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__ or error.__context__
    return False


def _described(error: PhigenError) -> str:
    text = str(error)
    # Messages about specs already contain "error:", after the location.
    return text if isinstance(error, SpecError) or ": error:" in text.split("\n")[0] else f"error: {text}"


def _internal(error: BaseException, console: Console) -> int:
    summary = "".join(traceback.format_exception_only(error)).strip()
    console.error(f"internal error: {summary}")
    if console.verbose:
        _show_traceback(error, console)
    request = "" if console.verbose else ", and what the same command prints with -v"
    console.error(
        f"  This is a bug of phigen {__version__}, not of your spec. Please report it with the spec{request}."
    )
    return PhigenError.exit_code


def _show_traceback(error: BaseException, console: Console) -> None:
    console.error("".join(traceback.format_exception(error)).rstrip())
