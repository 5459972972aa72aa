"""Rewriting of C for the profile ``certified``, which follows three rules of MISRA C:2012.

The result is an equivalent program:

- 12.1: operators of different precedence in one expression have parentheses.
- 15.6: the bodies of loops and conditionals have braces.
- 17.7: results that are not used are cast to void.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from phigen.targets.c.tokens import TokenKind, lexemes

#: Kinds of tokens that are not part of the grammar of C.
_TRIVIA = (TokenKind.SPACE, TokenKind.COMMENT, TokenKind.DIRECTIVE)

#: Precedence of binary operators, as in C.
_PRECEDENCE = {
    "*": 12, "/": 12, "%": 12, "+": 11, "-": 11, "<<": 10, ">>": 10, "<": 9, ">": 9, "<=": 9, ">=": 9, "==": 8,
    "!=": 8, "&": 7, "^": 6, "|": 5, "&&": 4, "||": 3,
}  # fmt: skip
_CONDITIONAL = 2

#: Tokens that separate expressions from one another.
_SEPARATORS = {
    ";", ",", "{", "}", "=", "+=", "-=", "*=", "/=", "%=", "&=", "|=", "^=", "<<=", ">>=", "return", "else", "case",
    "do", "goto",
}  # fmt: skip
_CLOSING = {"(": ")", "[": "]", "{": "}"}
_CONTROLS = {"if", "for", "while", "switch"}
_UNUSED = {"memcpy", "memmove", "memset"}


def compliant(code: str) -> str:
    """Return C that complies with the rules at the head of this file; ``code`` must be C that compiles."""
    return _Text(_with_void(_Text(code).braced())).parenthesised()


@dataclass
class _Text:
    """The tokens of a C file, and text that is to be inserted before and after each token."""

    code: str
    tokens: list[str] = field(default_factory=list)
    significant: list[int] = field(default_factory=list)
    before: dict[int, str] = field(default_factory=dict)
    after: dict[int, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for token in lexemes(self.code):
            if token.kind not in _TRIVIA:
                self.significant.append(len(self.tokens))
            self.tokens.append(token.text)

    def __getitem__(self, place: int) -> str:
        return self.tokens[self.significant[place]] if place < len(self.significant) else ""

    def text(self) -> str:
        """Return the code with all insertions."""
        places = {token: place for place, token in enumerate(self.significant)}
        return "".join(
            self.before.get(places[k], "") + token + self.after.get(places[k], "") if k in places else token
            for k, token in enumerate(self.tokens)
        )

    def closing(self, place: int) -> int:
        """Return the index of the bracket that closes the bracket at ``place``."""
        opening, depth = self[place], 0
        for at in range(place, len(self.significant)):
            depth += (self[at] == opening) - (self[at] == _CLOSING[opening])
            if depth == 0:
                return at
        raise ValueError(f"no bracket closes {opening}")

    def braced(self) -> str:
        """Return the code with braces around the bodies of all loops and conditionals."""
        for place in range(len(self.significant)):
            if self[place] in _CONTROLS and self[place + 1] == "(":
                self._brace(self.closing(place + 1))
            elif self[place] == "else" and self[place + 1] != "if":
                self._brace(place)
        return self.text()

    def _brace(self, head: int) -> None:
        """Insert braces around the statement that follows the token ``head``.

        Nothing is inserted if the statement has braces, or if it is empty.
        """
        if self[head + 1] not in ("{", ";"):
            last = self._end(head + 1)
            self.after[head] = self.after.get(head, "") + " {"
            self.after[last] = " }" + self.after.get(last, "")

    def _end(self, place: int) -> int:
        """Return the index of the last token of the statement that begins at ``place``."""
        if self[place] in _CONTROLS:
            last = self._end(self.closing(place + 1) + 1)
            while self[place] == "if" and self[last + 1] == "else":
                last = self._end(last + 2)
            return last
        if self[place] == "{":
            return self.closing(place)
        while self[place] != ";":
            place = self.closing(place) + 1 if self[place] in _CLOSING else place + 1
        return place

    def parenthesised(self) -> str:
        """Return the code with parentheses around each operand that is itself an expression with an operator of another
        precedence.
        """
        self._within(0, len(self.significant))
        return self.text()

    def _within(self, begin: int, end: int) -> None:
        """Insert parentheses in the expressions between two tokens, including expressions in brackets."""
        operand, operands, operators = begin, list[tuple[int, int]](), list[str]()
        place = begin
        while place < end:
            token, first = self[place], place == operand
            if token in ("(", "["):
                closing = self.closing(place)
                self._within(place + 1, closing)
                place = closing
            elif token in _SEPARATORS:
                self._combine(operands, operators, (operand, place))
                operand, operands, operators = place + 1, [], []
            elif not first and (token in _PRECEDENCE or token in "?:") and self._may_end_operand(place - 1):
                operands.append((operand, place))
                operators.append(token)
                operand = place + 1
            place += 1
        self._combine(operands, operators, (operand, end))

    def _may_end_operand(self, place: int) -> bool:
        """Whether the token at ``place`` can end an operand, so that an operator after it is binary."""
        token = self[place]
        return token in (")", "]", "++", "--") or token[0].isalnum() or token[0] in "_\"'."

    def _combine(self, operands: list[tuple[int, int]], operators: list[str], last: tuple[int, int]) -> None:
        """Insert parentheses in an expression. The expression is given by the token ranges of its operands, and by the
        operators between the operands.
        """
        if len(operators) > 1:
            reader = _Operators([*operands, last], operators)
            tree = reader.conditional()
            if reader.at == len(operators):  # false for labels, in which a colon ends the statement
                self._wrap(tree)

    def _wrap(self, tree: _Tree) -> None:
        for part in tree.parts:
            if tree.precedence < part.precedence < _OPERAND:
                begin, end = part.span
                self.before[begin] = self.before.get(begin, "") + "("
                self.after[end - 1] = ")" + self.after.get(end - 1, "")
            self._wrap(part)


_OPERAND = 99


@dataclass(frozen=True)
class _Tree:
    """An expression: the range of its tokens, the precedence of its operator, and its operands."""

    span: tuple[int, int]
    precedence: int = _OPERAND
    parts: tuple[_Tree, ...] = ()


class _Operators:
    """Parser that builds a tree from a sequence of operands and the operators between them."""

    def __init__(self, operands: list[tuple[int, int]], operators: list[str]) -> None:
        self.operands, self.operators, self.at = operands, operators, 0

    def _next(self) -> str:
        return self.operators[self.at] if self.at < len(self.operators) else ""

    def conditional(self) -> _Tree:
        """Return the tree of the next expression, which may be a conditional expression."""
        condition = self.binary(_CONDITIONAL + 1)
        if self._next() != "?":
            return condition
        self.at += 1
        then = self.conditional()
        if self._next() != ":":
            return condition
        self.at += 1
        otherwise = self.conditional()
        return _Tree((condition.span[0], otherwise.span[1]), _CONDITIONAL, (condition, then, otherwise))

    def binary(self, least: int) -> _Tree:
        """Return the tree of the next operands that are joined by operators of precedence ``least`` or higher."""
        left = _Tree(self.operands[self.at])
        while _PRECEDENCE.get(self._next(), 0) >= least:
            precedence = _PRECEDENCE[self._next()]
            self.at += 1
            right = self.binary(precedence + 1)
            left = _Tree((left.span[0], right.span[1]), precedence, (left, right))
        return left


def _with_void(code: str) -> str:
    """Return code with a cast to void before each statement that calls a function of `_UNUSED`."""
    return "".join(_cast(code))


def _cast(code: str) -> Iterator[str]:
    before = ""
    for token in lexemes(code):
        if token.text in _UNUSED and before in (";", "{", "}"):
            yield "(void)"
        if token.kind not in _TRIVIA:
            before = token.text
        yield token.text
