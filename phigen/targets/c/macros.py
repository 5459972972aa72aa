"""Expansion of macros of the C runtime, so that generated files do not contain these macros.

The macros follow the rules of C, with two differences. First, a macro and its arguments must be on one line. Second,
the text of a macro may be the head of a loop, and is empty in solvers where this loop runs once. If a line begins with
a macro whose text is empty, the macro is removed, and the body of the loop loses its indentation.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

_NAME = re.compile(r"\bPHI_\w+")
_DEFINITION = re.compile(r"#define (\w+)(?:\(([^)]*)\))?(?: (.*))?$")


@dataclass(frozen=True)
class Macro:
    """A macro with its replacement ``text``; ``parameters`` is None for a macro that takes no arguments."""

    parameters: tuple[str, ...] | None
    text: str

    def of(self, arguments: Sequence[str]) -> str:
        """Return the replacement text for these arguments. Raises `ValueError` if the number of arguments is wrong."""
        values = dict(zip(self.parameters or (), arguments, strict=True))
        return re.sub(r"\b\w+\b", lambda word: values.get(word[0], word[0]), self.text) if values else self.text


@dataclass
class Macros:
    """The macros of the runtime by name. They are expanded here, without a C preprocessor."""

    _known: dict[str, Macro] = field(default_factory=dict)
    _heads: re.Pattern[str] | None = None  # pattern of empty macros at the beginning of a line

    def define(self, line: str) -> None:
        """Record the macro that a line defines; other lines are ignored."""
        if match := _DEFINITION.match(line):
            self._known[match[1]] = Macro(tuple(match[2].split(", ")) if match[2] else None, match[3] or "")
            self._heads = None

    def expanded(self, lines: Sequence[str]) -> list[str]:
        """Return lines with macros expanded. Raises `ValueError` if a macro lacks arguments."""
        self._heads = self._heads or _pattern_of_heads(
            n for n, macro in self._known.items() if macro == Macro(None, "")
        )
        lines = _without_heads(lines, self._heads)
        expanded = [(line, self._line(line) if "PHI_" in line else line) for line in lines]
        # A line is removed if it consists of a macro with an empty text.
        return [text for line, text in expanded if text or not line]

    def _line(self, line: str) -> str:
        """Return a line with macros expanded. Spaces before a macro are removed if its text is empty or begins with a
        comma.
        """
        at = 0
        while match := _NAME.search(line, at):
            macro = self._known.get(match[0])
            at = match.end()
            if macro is None:
                continue
            arguments, after = ([], at) if macro.parameters is None else _arguments(line, at)
            text, at = macro.of(arguments), match.start()
            before = line[:at].rstrip(" ") if text[:1] in ("", ",") else line[:at]
            line, at = before + text + line[after:], len(before)
        return line


def _arguments(line: str, at: int) -> tuple[list[str], int]:
    """Return the arguments of the macro whose opening parenthesis is at column ``at``, and the column after the closing
    parenthesis.

    Raises `ValueError` if there are no arguments, or if they do not end on the line.
    """
    if line[at : at + 1] != "(":
        raise ValueError(f"a macro without its arguments: {line.strip()}")
    arguments, depth, begin = [], 0, at + 1
    for k in range(at, len(line)):
        depth += (line[k] in "([") - (line[k] in ")]")
        if depth == 0 or (depth == 1 and line[k] == ","):
            arguments.append(line[begin:k].strip())
            begin = k + 1
        if depth == 0:
            return arguments, k + 1
    raise ValueError(f"a macro whose arguments do not end on its line: {line.strip()}")


def _pattern_of_heads(names: Iterable[str]) -> re.Pattern[str]:
    """Return the pattern of lines that begin with one of the ``names``, the names of empty macros."""
    return re.compile(rf"^( *)(?:{'|'.join(names) or '(?!)'})(?: (.*))?$")


def _without_heads(lines: Sequence[str], heads: re.Pattern[str]) -> list[str]:
    """Return lines without the empty macros that stand in place of heads of loops.

    The body of each loop, with or without braces, is dedented.
    """
    remaining: list[str] = []
    ends: list[tuple[str, str]] = []  # for each removed head: its indentation, and the line that ends its loop
    for line in lines:
        named = "PHI_" in line
        if not ends and not named:
            remaining.append(line)
            continue
        while ends and ends[-1][1] == "" and not line.startswith(ends[-1][0] + " "):
            ends.pop()
        if ends and line == ends[-1][1]:
            ends.pop()
            continue
        shift = 4 * len(ends)
        match = heads.match(line) if named else None
        if match is None:
            remaining.append(line[shift:] if line.startswith(" " * shift) else line)
        elif match[2] in (None, "{"):
            ends.append((match[1], f"{match[1]}}}" if match[2] else ""))
        else:
            remaining.append(f"{match[1]}{match[2]}"[shift:])
    return remaining
