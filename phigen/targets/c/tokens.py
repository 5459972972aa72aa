"""Tokens of C, for the passes over the runtime and the text that is printed for it: names, numbers, comments, marks."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum


class TokenKind(StrEnum):
    """The kinds of tokens.

    ``MARK`` is one character of an operator or a bracket, or the whole operator in `lexemes`; ``SPACE`` is any white
    space, and ``DIRECTIVE`` a line of the preprocessor in `lexemes`.
    """

    COMMENT = "comment"
    STRING = "string"
    REAL = "real"
    WHOLE = "whole"
    NAME = "name"
    SPACE = "space"
    MARK = "mark"
    DIRECTIVE = "directive"


@dataclass(frozen=True, slots=True)
class CToken:
    """A piece of C; the texts of all tokens, joined, are the original text."""

    kind: TokenKind
    text: str


_TOKEN = re.compile(
    r'(?P<comment>/\*.*?\*/)|(?P<string>"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])*\')'
    r"|(?P<real>(?:0x[0-9a-fA-F.]+p[-+]?[0-9]+|(?:[0-9]+\.[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|[0-9]+[eE][-+]?[0-9]+)f?)"
    r"|(?P<whole>[0-9]\w*)|(?P<name>[A-Za-z_]\w*)|(?P<space>\s+)|(?P<mark>.)",
    re.DOTALL,
)


def tokens(text: str) -> Iterator[CToken]:
    """Yield the tokens of a text."""
    for match in _TOKEN.finditer(text):
        yield CToken(TokenKind(match.lastgroup or ""), match[0])


#: Operators of several characters; "..", which is none, begins "...".
_OPERATORS = {
    "<<=", ">>=", "...", "..", "->", "++", "--", "<<", ">>", "<=", ">=", "==", "!=", "&&", "||", "*=", "/=", "%=", "+=",
    "-=", "&=", "^=", "|=",
}  # fmt: skip


def lexemes(text: str) -> Iterator[CToken]:
    """Yield the tokens of a text with whole operators, and with whole directives, without the ends of their lines."""
    directive, mark, fresh = "", "", True
    for token in tokens(text):
        if directive and token.kind is TokenKind.SPACE and "\n" in token.text and not directive.endswith("\\"):
            yield CToken(TokenKind.DIRECTIVE, directive)
            directive = ""
        if directive or (fresh and token.text == "#"):
            directive += token.text
            continue
        if mark and not (token.kind is TokenKind.MARK and mark + token.text in _OPERATORS):
            yield CToken(TokenKind.MARK, mark)
            mark = ""
        if token.kind is TokenKind.MARK:
            mark += token.text
        else:
            yield token
        fresh = token.kind is TokenKind.SPACE and (fresh or "\n" in token.text)
    if mark or directive:
        yield CToken(TokenKind.DIRECTIVE, directive) if directive else CToken(TokenKind.MARK, mark)


def names(text: str) -> set[str]:
    """Return the identifiers and key words in a text, outside comments and strings."""
    return {match[0] for match in _TOKEN.finditer(text) if match.lastgroup == "name"}


def without_word(text: str, word: str) -> str:
    """Return a text without a word and the space after it."""
    pieces: list[str] = []
    dropped = False
    for token in tokens(text):
        behind, dropped = dropped, token.text == word
        if not dropped:
            pieces.append(token.text[1:] if behind and token.text.startswith(" ") else token.text)
    return "".join(pieces)
