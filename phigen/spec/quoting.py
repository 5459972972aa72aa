"""Repair of lines of YAML in which an expression with an index, such as ``x[i+1]``, lacks quotes inside { } or [ ]."""

from __future__ import annotations


def needs_quotes(line: str, column: int) -> bool:
    """Whether the character at this column (from 0) is a ``[`` directly after a name, where the YAML parser fails."""
    return column < len(line) and line[column] == "[" and (column > 0) and _ends_name(line[:column])


def quoted(line: str) -> str:
    """Return the line with quotes around each key and value that contains an index, such as ``x[i+1]``."""
    written, part, depth, index, quote = "", "", 0, False, ""
    for position, character in enumerate(line + "\n"):
        following = line[position + 1 : position + 2]
        if quote:
            quote = "" if character == quote else quote
        elif character in "\"'" and not part.strip():
            quote = character
        elif index or (character == "[" and _ends_name(part)):
            index = character != "]"
        elif character in "()":
            depth += 1 if character == "(" else -1
        elif character == "\n" or (depth <= 0 and (character in "{}[]," or (character == ":" and following in " \n"))):
            written, part = written + _finished(part) + character, ""
            continue
        part += character
    return written.rstrip("\n")


def _ends_name(text: str) -> bool:
    return text[-1:].isalnum() or text[-1:] == "_"


def _finished(part: str) -> str:
    """Return a key or a value. If it contains an index such as ``[i+1]`` and has no quotes, quotes are added."""
    inner = part.strip()
    if "[" not in inner or inner[:1] in "\"'":
        return part
    return part.replace(inner, f'"{inner}"')
