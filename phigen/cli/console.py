"""Messages on stderr, filtered by -q and -v, in colour on terminals; data on stdout."""

from __future__ import annotations

import codecs
import errno
import json
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from typing import Any, TypeVar

import click

from phigen.cli.display import Display
from phigen.errors import PhigenWarning

F = TypeVar("F", bound=Callable[..., Any])


@dataclass
class Console:
    """Messages of one command, on stderr. Data goes to stdout, by `out`, `out_json` and `out_document`."""

    quiet: bool = False
    verbose: bool = False

    def __post_init__(self) -> None:
        self._display = Display(lambda: not self.quiet and sys.stderr.isatty(), self.detail)

    def _write_line(self, message: str) -> None:
        # An error of writing to stderr is suppressed, since there is no other place for its message.
        with self._display.room(), suppress(OSError):
            click.echo(message, err=True, color=_colour())

    def error(self, message: str) -> None:
        """Print an error message, even with -q."""
        self._write_line(_coloured(message))

    def warn(self, message: str) -> None:
        """Print a warning, unless -q was given. The command continues afterwards."""
        if not self.quiet:
            self._write_line(_coloured(f"warning: {message}"))

    def note(self, message: str) -> None:
        """Print a message, unless -q was given."""
        if not self.quiet:
            self._write_line(message)

    def detail(self, message: str) -> None:
        """Print a message if -v was given."""
        if self.verbose:
            self._write_line(message)

    @contextmanager
    def heeding(self) -> Iterator[None]:
        """Context in which warnings of phigen's Python functions are printed like the warnings of commands."""
        with warnings.catch_warnings():
            library_function = warnings.showwarning

            def show(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
                if not issubclass(category, PhigenWarning):
                    library_function(message, category, *place, **more)
                elif not self.quiet:
                    text = str(message)
                    self._write_line(_coloured(text if ": warning:" in text.split("\n")[0] else f"warning: {text}"))

            warnings.showwarning = show
            warnings.simplefilter("always", PhigenWarning)
            yield

    def watching(self) -> AbstractContextManager[None]:
        """Context in which the tasks of the compiler are shown.

        On a terminal they appear as a status line, unless -q is given; with -v they are printed as messages.
        """
        return self._display.watching()

    @contextmanager
    def progress(self, label: str, length: int) -> Iterator[Callable[[int], None] | None]:
        """Context with a progress bar on stderr.

        The value of the context is a function. The caller passes the number of steps done so far to this function. If
        stderr is no terminal, or with -q, there is no progress bar, and the value is None.
        """
        if self.quiet or not sys.stderr.isatty():
            yield None
            return
        done = 0
        with click.progressbar(length=length, label=label, file=sys.stderr) as bar:

            def advance(steps: int) -> None:
                nonlocal done
                bar.update(steps - done)
                done = steps

            yield advance


pass_console = click.make_pass_decorator(Console, ensure=True)


def verbosity(command: F) -> F:
    """Add the options -q and -v to a command."""

    def store(name: str) -> Callable[[click.Context, click.Parameter, bool], None]:
        def callback(ctx: click.Context, parameter: click.Parameter, value: bool) -> None:
            if value:
                setattr(ctx.ensure_object(Console), name, True)

        return callback

    for short_option, name, text in (
        ("-v", "verbose", "Print more: the stages with their seconds; tracebacks of internal errors."),
        ("-q", "quiet", "Print results and errors only."),
    ):
        command = click.option(
            short_option, f"--{name}", is_flag=True, expose_value=False, callback=store(name), help=text
        )(command)
    return command


def table(rows: Sequence[Sequence[str]], *, right: Sequence[int] = ()) -> list[str]:
    """Return the rows as lines with aligned columns. Columns with an index in ``right`` are aligned at the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = [c.rjust(w) if i in right else c.ljust(w) for i, (c, w) in enumerate(zip(row, widths, strict=True))]
        lines.append("  ".join(cells).rstrip())
    return lines


def indented(lines: Sequence[str]) -> list[str]:
    """Return the lines with an indent of two spaces, as in the second and later lines of a message."""
    return [f"  {line}" for line in lines]


def mend(commands: Sequence[str]) -> list[str]:
    """Return the last lines of a message: the commands that correct the problem."""
    return ["to mend it:", *indented(commands)]


def counted(number: int, noun: str) -> str:
    """Return a number with a noun in singular or plural, such as "3 files"."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def heading(text: str) -> str:
    """Return a heading, which terminals print in bold."""
    return click.style(text, bold=True)


def out(text: str) -> None:
    """Write a line, or several, to stdout, in colour on a terminal."""
    with _stdout():
        click.echo(text, color=_colour())


def out_json(value: Any) -> None:
    """Write JSON to stdout, in ASCII if the encoding of stdout is not UTF-8."""
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    ascii_only = codecs.lookup(encoding).name != "utf-8"
    out(json.dumps(value, indent=2, ensure_ascii=ascii_only))


def out_document(text: str) -> None:
    """Write a whole document to stdout, always in UTF-8, without a final line break or colour."""
    with _stdout():
        click.echo(text.encode("utf-8", "backslashreplace"), nl=False)


@contextmanager
def _stdout() -> Iterator[None]:
    """Context in which an `OSError` gets the file name "stdout", except a `BrokenPipeError`, which is unchanged."""
    if sys.stdout is None:
        raise OSError(errno.EBADF, os.strerror(errno.EBADF), "stdout")
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, "stdout") from error


def _colour() -> bool | None:
    """Return False, for no colour, if NO_COLOR is set (see https://no-color.org). Otherwise return None.

    For None, click decides: it uses colour on terminals only.
    """
    return False if os.environ.get("NO_COLOR") else None


def _coloured(message: str) -> str:
    lines = message.split("\n")
    for i, line in enumerate(lines):
        for word, colour in (("error:", "red"), ("warning:", "yellow"), ("refuted", "red")):
            start = line.find(word)
            if start >= 0 and not line.startswith("    "):
                styled = click.style(word, fg=colour, bold=True)
                lines[i] = line[:start] + styled + line[start + len(word) :]
                break
    return "\n".join(lines)
