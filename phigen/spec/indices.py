"""Names with an index in expressions of a lattice: ``x[i+1]``, ``q[i-1, j+2]`` on a grid, ``x[a]`` on a bond.

::

    indexed  = name "[" step ("," step)* "]"
    step     = axis [("+" | "-") integer] | "a" | "b"
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from phigen.spec import limits
from phigen.spec.problems import did_you_mean, shown
from phigen.symbolic.expression import Expression
from phigen.symbolic.neighbours import Neighbours

if TYPE_CHECKING:
    from phigen.spec.grammar import Parser, Token


@dataclass(frozen=True)
class Indices:
    """Names that may have an index, and the form of the index.

    ``names`` maps each name that has a value at every site to its expression at the site itself. ``refused`` has the
    messages and hints for names without values at sites. On a grid an index is an offset from the site; on a bond it is
    one of ``ends``.
    """

    neighbours: Neighbours
    names: Mapping[str, Expression]
    refused: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    ends: tuple[str, ...] = ()

    def read(self, parser: Parser, token: Token) -> Expression:
        """Read the index after a name. Return the expression that the name with this index stands for: its value at a
        neighbour, or at an end of a bond.

        ``token`` is the name; the current token of the parser is ``[``.
        """
        opening = parser.advance()
        if not (self.ends or self.neighbours.axes):
            message = f"{token.text}[…]: sites of this lattice have no neighbours by index"
            couples = "in hamiltonian: {bonds: …} or {pairs: …}, write x[a] and x[b] for x at the two sites"
            raise parser.abandon(message, opening.index, couples)
        if self.ends:
            end = self._end(parser, opening)
        else:
            offset = self._offset(parser, opening)
        value = self.names.get(token.text)
        if value is None:
            message, hint = self.refused.get(token.text) or parser.scope.unknown(token.text)
            parser.report(message, token.index, hint)
            return parser.scope.lookup(token.text) or parser.nothing
        return self.neighbours.on(value, end) if self.ends else self.neighbours.shifted([value], offset)[0]

    def _end(self, parser: Parser, opening: Token) -> str:
        token = parser.advance()
        if token.text not in self.ends:
            message = f"the index {shown(token.text)} is not an end of a bond or pair"
            raise parser.abandon(message, token.index, "write [a] or [b]")
        self._closed(parser, opening)
        return token.text

    def _offset(self, parser: Parser, opening: Token) -> tuple[int, ...]:
        axes, steps = self.neighbours.axes, dict[str, int]()
        while True:
            token = parser.advance()
            if token.text not in axes:
                raise parser.abandon(*self._no_axis(token))
            if token.text in steps:
                raise parser.abandon(f"the axis {token.text!r} is in this index twice", token.index)
            steps[token.text] = self._step(parser)
            if not parser.accept(","):
                self._closed(parser, opening)
                return tuple(steps.get(axis, 0) for axis in axes)

    def _no_axis(self, token: Token) -> tuple[str, int, str]:
        axes = self.neighbours.axes
        example = f"write an axis, then + or - and a whole number: [{axes[0]}+1]"
        if token.kind == "name":
            axes_text = f"{'axes are' if len(axes) > 1 else 'the axis is'} {', '.join(axes)}"
            return f"{shown(token.text)} is not an axis", token.index, did_you_mean(token.text, axes) or axes_text
        if token.kind == "end":
            return "this index is never closed", token.index, example
        return f"the index begins with {shown(token.text)}, not with an axis", token.index, example

    def _step(self, parser: Parser) -> int:
        sign = parser.accept("+", "-")
        if sign is None:
            return 0
        token = parser.advance()
        if token.kind != "number" or not token.text.isdigit():
            token_text = shown(token.text) if token.text else "nothing"
            raise parser.abandon(f"the offset {token_text} is not a whole number", token.index, "offsets are 1, 2, …")
        if len(token.text) > 4 or int(token.text) > limits.OFFSET:
            message = f"the offset {token.text[:20]} is larger than the limit of {limits.OFFSET}"
            raise parser.abandon(message, token.index, limit=True)
        return int(token.text) if sign.text == "+" else -int(token.text)

    def _closed(self, parser: Parser, opening: Token) -> None:
        if parser.accept("]"):
            return
        if parser.here.kind == "end":
            raise parser.abandon("this [ is never closed", opening.index)
        message = f"unexpected {shown(parser.here.text)} in an index"
        raise parser.abandon(
            message, parser.here.index, "write an axis, then + or - and a whole number" * (not self.ends)
        )
