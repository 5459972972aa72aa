"""Collection of all errors in a spec, so that one run reports all of them."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from types import MappingProxyType

from phigen.errors import Diagnostic, LimitError, Location, SpecError
from phigen.spec import limits


def shown(value: object, length: int = 60) -> str:
    """Return a value as text for a message: quoted, on one line, shortened, with invisible characters escaped."""
    text = str(value)
    if len(text) > length:
        text = text[: length - 1] + "…"
    return repr(text)


def did_you_mean(word: str, candidates: Iterable[str], others: Mapping[str, str] = MappingProxyType({})) -> str:
    """Return the hint ``did you mean 'x1'?``, with the candidate that `intended` chooses; "" if there is none."""
    candidate = intended(word, candidates, others)
    return f"did you mean {candidate!r}?" if candidate else ""


def intended(word: str, candidates: Iterable[str], others: Mapping[str, str] = MappingProxyType({})) -> str:
    """Return the candidate that a word probably stands for; "" if there is none.

    ``others`` maps words to candidates. For a word that is not in ``others``, a candidate with a similar name is
    chosen.
    """
    if len(word) > limits.NAME_LENGTH:
        return ""
    choices = list(candidates)
    if others.get(word) in choices:
        return others[word]
    close = (
        [c for c in choices if c.lower() == word.lower()]
        or [c for c in choices if c.startswith(f"{word}_")]
        or _numbered(word, choices)
        or sorted((c for c in choices if len(c) > 2 and word.startswith(c)), key=len, reverse=True)  # cos for cosine
        or difflib.get_close_matches(word, choices, n=1)
    )
    return close[0] if close else ""


def _numbered(word: str, choices: Iterable[str]) -> list[str]:
    """Return the choices that differ from the word only in the number at its end, such as x1 for x5.

    The choices with the nearest numbers come first.
    """
    stem = word.rstrip("0123456789")
    row = [c for c in choices if c != stem and c[len(stem) :].isdecimal()] if stem and stem != word else []
    return sorted(
        (c for c in row if c.startswith(stem)), key=lambda c: abs(int(c[len(stem) :]) - int(word[len(stem) :]))
    )


def one_of(choices: Iterable[str]) -> str:
    """Return the hint ``one of a, b, c``, or ``write a`` if there is only one choice."""
    choice_list = list(choices)
    return f"write {choice_list[0]}" if len(choice_list) == 1 else "one of " + ", ".join(choice_list)


def counted(number: int, noun: str, plural: str = "") -> str:
    """Return a number with its noun, as ``1 row`` or ``2 rows``."""
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


class Problems:
    """The errors of one file; `finish` raises one exception with all of them, in the order of the file."""

    def __init__(self, file: str, source: str = "") -> None:
        self.file = file
        self.lines = source.split("\n")
        self.found: dict[tuple[Location, str], Diagnostic] = {}
        self.only_limits = True

    def add(self, message: str, location: Location, hint: str = "", *, limit: bool = False) -> None:
        """Record an error; a repeated message at the same place is ignored.

        ``limit`` says that the error is an exceeded limit. When the number of errors reaches `limits.ERRORS`, the
        exception with all errors is raised.
        """
        line = self.lines[location.line - 1] if location.line <= len(self.lines) else ""
        self.found.setdefault((location, message), Diagnostic(message, location, hint, line))
        self.only_limits &= limit
        if len(self.found) >= limits.ERRORS:
            raise self.error()

    def copy(self) -> Problems:
        """Return a copy of the errors so far, for `restore`."""
        twin = Problems(self.file)
        twin.found, twin.only_limits = dict(self.found), self.only_limits
        return twin

    def restore(self, before: Problems) -> None:
        """Drop the errors that were recorded since `copy` returned ``before``."""
        self.found, self.only_limits = dict(before.found), before.only_limits

    def forget(self, line: int) -> None:
        """Drop the errors of a line, because they are consequences of another error that is reported instead."""
        self.found = {position: d for position, d in self.found.items() if position[0].line != line}

    def stop(self, message: str, location: Location, hint: str = "", *, limit: bool = False) -> SpecError:
        """Record an error after which reading cannot continue, and return the exception to raise."""
        self.add(message, location, hint, limit=limit)
        return self.error()

    def error(self) -> SpecError:
        """Return the exception with all errors. It is a `LimitError` if each error is an exceeded limit, else a
        `SpecError`.
        """
        ordered = [self.found[key] for key in sorted(self.found, key=lambda key: key[0])]
        if len(ordered) >= limits.ERRORS:
            ordered.append(Diagnostic(f"there may be more: only {limits.ERRORS} errors are listed"))
        return (LimitError if self.only_limits else SpecError)(ordered)

    def finish(self) -> None:
        """Raise the exception with all errors, if there are any."""
        if self.found:
            raise self.error()
