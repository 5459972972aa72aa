"""Hints for errors of the YAML parser, such as a bracket that is not closed or a key without a colon."""

from __future__ import annotations

import re

#: Hint for errors without a hint of their own: most of them are in a value that YAML does not read as one text.
QUOTES = "put expressions and texts with special characters between quotes"

_COLON = "a key and its value are written NAME: VALUE, with a blank after the colon"
_INDENTATION = "indent all keys of one mapping by the same number of spaces"
_CLOSING = {"{": "}", "[": "]"}


def syntax_hint(
    context: str, problem: str, opening: tuple[int, int] | None, place: tuple[int, int], lines: list[str]
) -> str:
    """Return the hint for an error of the YAML parser.

    ``context`` and ``problem`` are the two parts of the parser's message. ``opening`` is the place where the context
    starts, ``place`` that of the error; places are a line and a column, counted from 1.
    """
    line = lines[place[0] - 1] if place[0] <= len(lines) else ""
    if "'\\t'" in problem or "'\t'" in problem:
        return "indent with spaces, not with tabs"
    if "quoted scalar" in context and "end of stream" in problem:
        return "close the quotes"
    if "simple key" in context:
        return f"{_COLON}; further lines are indented"
    if opening and "while parsing a flow" in context:
        return _closing_hint(problem, opening, place, lines)
    if "found ']'" in problem or "found '}'" in problem:
        return "it closes no bracket: remove it"
    if "block mapping" in context and "found '-'" in problem:
        return "entries of a mapping begin with NAME:, and entries of a list with -; a mapping has no entries with -"
    if "block mapping start" in problem:
        return _INDENTATION
    if "mapping values" in problem and re.fullmatch(r"\s*[\w-]+\s*", line[: place[1] - 1]):
        # The parser joins a line without a colon with the next line, and fails at the colon of the next line.
        before = [number for number in range(place[0] - 1) if lines[number].strip()]
        if before and _depth(lines[before[-1]]) == _depth(line) and not re.search(r":(\s|$)", lines[before[-1]]):
            return f"line {before[-1] + 1} has no key with a colon: {_COLON}"
        return _INDENTATION
    return QUOTES


def _depth(line: str) -> int:
    """Return the number of blanks at the beginning of a line."""
    return len(line) - len(line.lstrip(" "))


def _closing_hint(problem: str, opening: tuple[int, int], place: tuple[int, int], lines: list[str]) -> str:
    """Return the hint for an error between { } or [ ], whose opening bracket is at the place ``opening``."""
    bracket = lines[opening[0] - 1][opening[1] - 1 : opening[1]]
    if bracket not in _CLOSING:
        return QUOTES
    where = f"the {bracket} in line {opening[0]}, column {opening[1]}"
    if "got ']'" in problem or "got '}'" in problem:
        return f"close {where} with {_CLOSING[bracket]}"
    if place[0] > opening[0] or "end" in problem:
        return f"close {where} with {_CLOSING[bracket]}, or write the comma that is missing"
    return QUOTES
