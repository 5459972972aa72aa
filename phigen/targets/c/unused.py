"""Removal of unused code from the runtime: static functions that nothing calls, and declarations of missing
functions.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate

from phigen.targets.c.tokens import closing_brace, names, next_token, used_names

#: First words of declarations that declare no function.
_TYPES = ("typedef", "enum", "struct", "union")
_NO_FUNCTIONS = ("extern", *_TYPES)


@dataclass(frozen=True)
class Function:
    """The lines from ``begin`` to ``end`` that declare or define a function, without the comment above them."""

    name: str
    begin: int
    end: int
    static: bool
    defined: bool


def without_unused(lines: Sequence[str], prefix: str) -> list[str]:
    """Return the lines without unused static functions, and without declarations of functions that are not
    defined.

    A static function is unused if nothing but unused functions calls it. ``prefix`` is the prefix of the names of the
    solver. Only functions with this prefix are removed.
    """
    declarations = [*declarations_of(lines)]
    functions = [f for f in declarations if f.name.startswith(prefix)]
    static = [f for f in functions if f.static]
    inside = {k for f in static for k in range(f.begin, f.end)} | _declared(functions) | _types(lines, declarations)
    reached = _reached(_names_used("\n".join(line for k, line in enumerate(lines) if k not in inside)), static, lines)
    defined = {f.name for f in functions if f.defined}
    unused = [f for f in functions if (f.name not in reached if f.static else f.name not in defined)]
    return _without(lines, unused)


def _declared(functions: Iterable[Function]) -> set[int]:
    return {k for f in functions if not f.defined for k in range(f.begin, f.end)}


def _types(lines: Sequence[str], declarations: Iterable[Function]) -> set[int]:
    """Return the indices of the lines that declare types. On these lines, names of members may equal names of
    functions.
    """
    types = (d for d in declarations if lines[d.begin].startswith(_TYPES))
    return {k for d in types for k in range(d.begin, d.end)}


def _names_used(text: str) -> set[str]:
    """Return the names that C code uses, without the names of struct members. In preprocessor directives, all names
    count.
    """
    return used_names(text).union(*map(names, _directives(text)))


def _directives(text: str) -> Iterator[str]:
    """Yield the lines of preprocessor directives, including lines continued by a backslash."""
    continued = False
    for line in text.splitlines():
        if continued or line.startswith("#"):
            yield line
            continued = line.endswith("\\")


def _reached(called: set[str], static: Iterable[Function], lines: Sequence[str]) -> set[str]:
    """Return the static functions that are used: other code calls them, directly or through other static functions."""
    words: dict[str, set[str]] = {}
    for f in static:
        words.setdefault(f.name, set()).update(_names_used("\n".join(lines[f.begin : f.end])) if f.defined else ())
    reached, open_ = set[str](), [name for name in words if name in called]
    while open_:
        name = open_.pop()
        if name not in reached:
            reached.add(name)
            open_ += words[name] & words.keys() - reached
    return reached


def functions_of(lines: Sequence[str]) -> Iterator[Function]:
    """Yield the functions that the lines declare or define."""
    return (f for f in declarations_of(lines) if f.name)


def declarations_of(lines: Sequence[str]) -> Iterator[Function]:
    """Yield all declarations and definitions outside functions. A declaration of anything but a function has the name
    "".
    """
    text, declaration, at = "\n".join(lines), _Declaration(), 0
    line_ends = [*accumulate(len(line) + 1 for line in lines)]
    while token := next_token(text, at):
        at = token.end()
        if token[0] == "}":
            continue  # the brace that ends extern "C"
        declaration.take(token[0], token.start())
        if declaration.is_linkage:
            declaration = _Declaration()
            continue
        if token[0] == "{":
            at = closing_brace(text, token.start()) + 1
            declaration.last = "}"
        if declaration.last in declaration.ends:
            begin, last = (bisect_right(line_ends, place) for place in (declaration.begin, at - 1))
            is_definition = declaration.last == "}"
            yield Function(declaration.name, begin, last + 1, declaration.first == "static", is_definition)
            declaration = _Declaration()


@dataclass
class _Declaration:
    """A declaration or definition while it is read: its ``first`` word, and the name of the function that it declares,
    if any.
    """

    first: str = ""
    begin: int = 0
    name: str = ""
    last: str = ""
    is_plain: bool = False  # whether it certainly declares no function
    in_size: bool = False  # whether the last token was inside the size of an array
    has_body: bool = False

    def take(self, token: str, place: int) -> None:
        """Process the next token, which begins at ``place`` in the text. The caller skips all tokens inside braces, but
        not the opening brace.
        """
        if not self.first:
            self.first, self.begin = token, place
            self.is_plain = token in _NO_FUNCTIONS or not token[:1].islower()
        self.in_size = token == "[" or (self.in_size and token != "]")
        if not self.name and not self.is_plain and not self.in_size:
            if token == "(":
                self.name = self.last
            self.is_plain = token in ("=", "{")
        self.has_body = self.has_body or (token == "{" and bool(self.name))
        self.last = token

    @property
    def ends(self) -> tuple[str, ...]:
        """The characters that end the declaration: a semicolon or a brace."""
        return ("}",) if self.has_body else (";",)

    @property
    def is_linkage(self) -> bool:
        """Whether the declaration is the head of a block ``extern "C"``."""
        return self.first == "extern" and self.last == "{"


def _without(lines: Sequence[str], functions: Iterable[Function]) -> list[str]:
    """Return the lines without the given functions, and without the comments directly above the functions."""
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
    """Whether a comment of whole lines ends on line ``last``. Titles such as /* ---- steps ---- */ do not count."""
    if not lines[last].endswith("*/") or lines[last].startswith("/* ---- "):
        return False
    return lines[_beginning(lines, last)].startswith("/*")


def _beginning(lines: Sequence[str], last: int) -> int:
    """Return the index of the first line of the comment that ends on line ``last``."""
    return next(k for k in range(last, -1, -1) if "/*" in lines[k])
