"""Removal of runtime functions that a solver does not use: uncalled static functions, and declarations of undefined
functions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from phigen.targets.c.tokens import CToken, TokenKind, lexemes, names

#: First words of declarations that declare no function, or a function of the library.
_TYPES = ("typedef", "enum", "struct", "union")
_NO_FUNCTIONS = ("extern", *_TYPES)


@dataclass(frozen=True)
class Function:
    """Lines from ``begin`` to ``end`` that declare or define a function, without the comment above them."""

    name: str
    begin: int
    end: int
    static: bool
    defined: bool


def without_unused(lines: Sequence[str], prefix: str) -> list[str]:
    """Return the lines without static functions that no other code calls, directly or through such functions, and
    without declarations of functions that are not defined in the lines, if their names have the prefix of the
    solver."""
    functions = [f for f in functions_of(lines) if f.name.startswith(prefix)]
    static = [f for f in functions if f.static]
    inside = {k for f in static for k in range(f.begin, f.end)} | _declared(functions) | _types(lines)
    reached = _reached(_used("\n".join(line for k, line in enumerate(lines) if k not in inside)), static, lines)
    defined = {f.name for f in functions if f.defined}
    unused = [f for f in functions if (f.name not in reached if f.static else f.name not in defined)]
    return _without(lines, unused)


def _declared(functions: Iterable[Function]) -> set[int]:
    return {k for f in functions if not f.defined for k in range(f.begin, f.end)}


def _types(lines: Sequence[str]) -> set[int]:
    """The lines that declare types, whose members may have the names of functions."""
    types = (d for d in declarations_of(lines) if lines[d.begin].startswith(_TYPES))
    return {k for d in types for k in range(d.begin, d.end)}


def _used(text: str) -> set[str]:
    """The names in a text, without names of members, which follow a point or an arrow."""
    used, before = set[str](), ""
    for _, token in _code(text):
        if token.kind is TokenKind.NAME and before not in (".", "->"):
            used.add(token.text)
        before = token.text
    return used | {name for line in text.splitlines() if line.startswith("#") for name in names(line)}


def _reached(called: set[str], static: Iterable[Function], lines: Sequence[str]) -> set[str]:
    """The static functions that other code calls, directly or through each other."""
    words: dict[str, set[str]] = {}
    for f in static:
        words.setdefault(f.name, set()).update(_used("\n".join(lines[f.begin : f.end])) if f.defined else ())
    reached, open_ = set[str](), [name for name in words if name in called]
    while open_:
        name = open_.pop()
        if name not in reached:
            reached.add(name)
            open_ += words[name] & words.keys() - reached
    return reached


def functions_of(lines: Sequence[str]) -> Iterator[Function]:
    """Yield the functions that lines declare or define."""
    return (f for f in declarations_of(lines) if f.name)


def declarations_of(lines: Sequence[str]) -> Iterator[Function]:
    """Yield the declarations and definitions outside of functions; the name is empty if it is not a function."""
    declaration, opened = _Declaration(), 0
    for line, token in _code("\n".join(lines)):
        if token.text == "}" and not opened:
            declaration = _Declaration()  # the end of extern "C"
            continue
        declaration.take(token, line, outside=not opened)
        opened += (token.text == "{") - (token.text == "}")
        if declaration.is_linkage:
            declaration, opened = _Declaration(), 0
        elif not opened and token.text in declaration.ends:
            static = declaration.first == "static"
            yield Function(declaration.name, declaration.begin, line + 1, static, token.text == "}")
            declaration = _Declaration()


def _code(text: str) -> Iterator[tuple[int, CToken]]:
    """Yield the tokens of a text without white space, comments and directives, each after the number of its line."""
    line = 0
    for token in lexemes(text):
        if token.kind not in (TokenKind.SPACE, TokenKind.COMMENT, TokenKind.DIRECTIVE):
            yield line, token
        line += token.text.count("\n")


@dataclass
class _Declaration:
    """A declaration or definition that is being read: its ``first`` word, and the name if it is a function."""

    first: str = ""
    begin: int = 0
    name: str = ""
    last: str = ""
    is_plain: bool = False  # whether it is certainly not a function
    in_size: bool = False  # whether the last token was in the size of an array
    has_body: bool = False

    def take(self, token: CToken, line: int, *, outside: bool) -> None:
        """Read the next token, which is ``outside`` of braces or not."""
        if not self.first:
            self.first, self.begin = token.text, line
            self.is_plain = token.text in _NO_FUNCTIONS or not token.text[:1].islower()
        self.in_size = token.text == "[" or (self.in_size and token.text != "]")
        if outside and not self.name and not self.is_plain and not self.in_size:
            if token.text == "(":
                self.name = self.last
            self.is_plain = token.text in ("=", "{")
        self.has_body = self.has_body or (outside and token.text == "{" and bool(self.name))
        self.last = token.text

    @property
    def ends(self) -> tuple[str, ...]:
        """The marks outside of braces that end it."""
        return ("}",) if self.has_body else (";",)

    @property
    def is_linkage(self) -> bool:
        """Whether it is the start of ``extern "C"``."""
        return self.first == "extern" and self.last == "{"


def _without(lines: Sequence[str], functions: Iterable[Function]) -> list[str]:
    """Return the lines without functions, and without comments directly above these."""
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
    """Whether a comment on lines of its own ends on this line, and is not the title of a chapter."""
    if not lines[last].endswith("*/") or lines[last].startswith("/* ---- "):
        return False
    return lines[_beginning(lines, last)].startswith("/*")


def _beginning(lines: Sequence[str], last: int) -> int:
    """Return the first line of the comment that ends on this line."""
    return next(k for k in range(last, -1, -1) if "/*" in lines[k])
