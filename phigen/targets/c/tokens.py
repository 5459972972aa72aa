"""Tokens of C: names, numbers, comments, operators. Other modules use them to rewrite the runtime and printed code."""

from __future__ import annotations

import re
from collections.abc import Container, Iterator
from enum import StrEnum
from typing import NamedTuple


class TokenKind(StrEnum):
    """The kinds of tokens.

    ``MARK`` is a bracket or an operator. An operator of several characters is one token in `lexemes`, but several
    tokens in `tokens`. ``SPACE`` is any white space. ``DIRECTIVE``, from `lexemes` only, is a line of the preprocessor.
    """

    COMMENT = "comment"
    STRING = "string"
    REAL = "real"
    WHOLE = "whole"
    NAME = "name"
    SPACE = "space"
    MARK = "mark"
    DIRECTIVE = "directive"


class CToken(NamedTuple):
    """Token of C. The texts of all tokens, joined, are the original text."""

    kind: TokenKind
    text: str


_COMMENT, _STRING, _NAME = r"/\*.*?\*/", r'"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])*\'', r"[A-Za-z_]\w*"
_TOKEN = re.compile(
    rf"(?P<name>{_NAME})|(?P<space>\s+)|(?P<comment>{_COMMENT})|(?P<string>{_STRING})"
    r"|(?P<real>(?:0x[0-9a-fA-F.]+p[-+]?[0-9]+|(?:[0-9]+\.[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|[0-9]+[eE][-+]?[0-9]+)f?)"
    r"|(?P<whole>[0-9]\w*)|(?P<mark>.)",
    re.DOTALL,
)
_KINDS = {kind.value: kind for kind in TokenKind}


def tokens(text: str) -> Iterator[CToken]:
    """Yield the tokens of a text. Operators of several characters are divided into single characters."""
    for match in _TOKEN.finditer(text):
        yield CToken(_KINDS[match.lastgroup or ""], match[0])


#: Operators of several characters. C has no operator "..", but `lexemes` appends one character at a time, and ".." is
#: part of "...".
_OPERATORS = {
    "<<=", ">>=", "...", "..", "->", "++", "--", "<<", ">>", "<=", ">=", "==", "!=", "&&", "||", "*=", "/=", "%=", "+=",
    "-=", "&=", "^=", "|=",
}  # fmt: skip


def lexemes(text: str) -> Iterator[CToken]:
    """Yield the tokens of a text, in which each operator and each directive is one token. A directive does not include
    the end of its line.
    """
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


_DIRECTIVE = rf"^[^\S\n]*\#(?:\\\n|{_COMMENT}|[^\n])*"
_NUMBER = r"\.?[0-9](?:[eEpP][-+]|[\w.])*"
_MODES = re.DOTALL | re.MULTILINE
_CODE = re.compile(rf"(?P<skipped>{_DIRECTIVE}|{_COMMENT})|{_STRING}|{_NUMBER}|{_NAME}|[=!<>]=|\S", _MODES)
_BRACES = re.compile(rf"{_DIRECTIVE}|{_COMMENT}|{_STRING}|[{{}}]", _MODES)
_MEMBER = rf"\.\.\.|(?:\.|->)(?:\s|{_COMMENT})*{_NAME}"
_RUNTIME_WORD = re.compile(rf"{_COMMENT}|{_STRING}|\b(PHI_\w*)", re.DOTALL)
_USED = re.compile(rf"{_DIRECTIVE}|{_COMMENT}|{_STRING}|{_NUMBER}|{_MEMBER}|({_NAME})", _MODES)


def next_token(text: str, at: int) -> re.Match[str] | None:
    """Return the match of the first word, literal or mark from position ``at`` on, outside comments and directives."""
    while (match := _CODE.search(text, at)) and match["skipped"]:
        at = match.end()
    return match


def closing_brace(text: str, begin: int) -> int:
    """Return the position of the brace that closes the brace at position ``begin``; the length of the text if no brace
    does.
    """
    depth = 0
    for match in _BRACES.finditer(text, begin):
        depth += (match[0] == "{") - (match[0] == "}")
        if depth == 0 and match[0] == "}":
            return match.start()
    return len(text)


def used_names(text: str) -> set[str]:
    """Return the identifiers that a text uses. Identifiers in comments, strings and directives do not count, nor do
    names of members.
    """
    return {*_USED.findall(text)} - {""}


def names(text: str) -> set[str]:
    """Return the identifiers and keywords in a text, without those in comments and strings."""
    return {match[0] for match in _TOKEN.finditer(text) if match.lastgroup == "name"}


def lines_with(text: str, words: Container[str]) -> set[int]:
    """Return the indices of the lines of a text that contain one of ``words`` outside comments and strings."""
    numbers, number, at = set[int](), 0, 0
    for match in _RUNTIME_WORD.finditer(text):
        number, at = number + text.count("\n", at, match.start()), match.start()
        if match[1] in words:
            numbers.add(number)
    return numbers


def without_word(text: str, word: str) -> str:
    """Return a text without the word ``word`` and without the space after it."""
    return re.sub(
        rf"{_COMMENT}|{_STRING}|\b{word}\b ?", lambda m: "" if m[0].rstrip(" ") == word else m[0], text, flags=re.DOTALL
    )
