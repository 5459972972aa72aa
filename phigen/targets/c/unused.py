"""Functions that the runtime in C has and a solver does not: static ones that nothing calls, and declarations of others
that are not defined."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

_HEAD = re.compile(r"(?!typedef|extern|enum|struct)[a-z][^=;{]*?\b(\w+)\(")
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_WORD = re.compile(r"\b[A-Za-z_]\w*\b")


@dataclass(frozen=True)
class Function:
    """The lines from ``begin`` to ``end``, the comment above not among them, that declare or define a function."""

    name: str
    begin: int
    end: int
    static: bool
    defined: bool


def without_unused(lines: Sequence[str], prefix: str) -> list[str]:
    """The lines without static functions that no other code calls, directly or through such functions, and without
    declarations of functions that are not among the lines, if their names have the prefix of the solver."""
    functions = [f for f in functions_of(lines) if f.name.startswith(prefix)]
    static = [f for f in functions if f.static]
    inside = {k for f in static for k in range(f.begin, f.end)} | _declared(functions)
    reached = _reached(_words(line for k, line in enumerate(lines) if k not in inside), static, lines)
    defined = {f.name for f in functions if f.defined}
    unused = [f for f in functions if (f.name not in reached if f.static else f.name not in defined)]
    return _without(lines, unused)


def _declared(functions: Iterable[Function]) -> set[int]:
    return {k for f in functions if not f.defined for k in range(f.begin, f.end)}


def _reached(called: set[str], static: Iterable[Function], lines: Sequence[str]) -> set[str]:
    """The static functions that are called, also by one another."""
    words: dict[str, set[str]] = {}
    for f in static:
        words.setdefault(f.name, set()).update(_words(lines[f.begin : f.end]) if f.defined else ())
    reached, open_ = set[str](), [name for name in words if name in called]
    while open_:
        name = open_.pop()
        if name not in reached:
            reached.add(name)
            open_ += words[name] & words.keys() - reached
    return reached


def functions_of(lines: Sequence[str]) -> Iterator[Function]:
    """Yield the functions that lines declare or define."""
    k = 0
    while k < len(lines):
        end = k
        while end < len(lines) and lines[k][:1].islower() and not lines[end].rstrip().endswith((";", "{", "}", "*/")):
            end += 1
        head = _HEAD.match(" ".join(lines[k : end + 1]))
        if head is None or end == len(lines):
            k += 1
            continue
        defined = "{" in lines[end]
        while defined and not _COMMENT.sub("", lines[end]).rstrip().endswith("}"):
            end = next(e for e in range(end + 1, len(lines)) if lines[e].startswith("}"))
        yield Function(head[1], k, end + 1, lines[k].startswith("static "), defined)
        k = end + 1


def _without(lines: Sequence[str], functions: Iterable[Function]) -> list[str]:
    """The lines without functions, and without comments right above them that are above no other."""
    gone = {k for f in functions for k in range(f.begin, f.end)}
    for begin in sorted({f.begin for f in functions}):
        first = begin - 1
        behind = next((k for k in range(begin, len(lines)) if k not in gone), len(lines))
        if behind < len(lines) and lines[behind] and not lines[behind].startswith(("/*", "#")):
            continue
        while _is_comment(lines, first):
            first = _beginning(lines, first) - 1
        gone |= set(range(first + 1, begin))
    return [line for k, line in enumerate(lines) if k not in gone]


def _is_comment(lines: Sequence[str], last: int) -> bool:
    """Whether a comment of lines of its own ends on this one, and is not the name of a chapter."""
    if not lines[last].endswith("*/") or lines[last].startswith("/* ---- "):
        return False
    return lines[_beginning(lines, last)].startswith("/*")


def _beginning(lines: Sequence[str], last: int) -> int:
    """The line on which the comment begins that ends on this one."""
    return next(k for k in range(last, -1, -1) if "/*" in lines[k])


def _words(lines: Iterable[str]) -> set[str]:
    return set(_WORD.findall(_COMMENT.sub("", "\n".join(lines))))
