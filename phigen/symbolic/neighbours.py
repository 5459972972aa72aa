"""Symbols of values at sites of a lattice, with an offset: ``x[i+1]``, ``x[i-1,j+2]``, ``x[a]``.

On a grid the brackets contain the nonzero steps along the axes, in the order of the axes; ``x`` without brackets is the
value at the site itself. On lattices without axes the brackets contain an end, a or b, of a bond or a pair. The whole
text is the name of an ordinary symbol. Names that a spec declares contain no brackets, so they differ from the texts
with brackets.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from phigen.symbolic.expression import Expression, substitute, symbol, symbols_of
from phigen.symbolic.symbols import Symbol

#: Offset of a site from another site. On a grid it consists of the steps along the axes. On lattices without axes it is
#: ``("a",)`` or ``("b",)``, an end of a bond or a pair, or ``()``, the site itself.
Offset = tuple[int, ...] | tuple[str, ...]
#: The name of a field, or of another quantity with a value at every site, and the offset of the site.
Place = tuple[str, Offset]
ENDS = ("a", "b")

_NEIGHBOUR = re.compile(r"(?P<name>[^\[\]]+)\[(?P<index>[^\[\]]+)\]")
_STEP = re.compile(r"(?P<axis>.+?)(?P<step>[+-][0-9]+)")


@dataclass(frozen=True)
class Neighbours:
    """The symbols of values at sites of a lattice.

    ``names`` are the quantities with a value at every site. ``axes`` are the axes of a grid, or () for other lattices.
    """

    names: tuple[str, ...]
    axes: tuple[str, ...] = ()

    @property
    def origin(self) -> Offset:
        """Offset of the site itself: zero steps along all axes."""
        return (0,) * len(self.axes)

    def at(self, name: str, offset: Offset) -> str:
        """Return the name of the symbol for the quantity ``name`` at an offset, such as ``x[i+1]``."""
        if self.axes:
            index = [f"{a}{o:+d}" for a, o in zip(self.axes, steps(offset), strict=True) if o]
        else:
            index = [str(o) for o in offset]
        if not index:
            return name
        if isinstance(name, Symbol):
            return Symbol(name.kind, *name.key[:-1], f"{name.key[-1]}[{','.join(index)}]")
        return f"{name}[{','.join(index)}]"

    def place(self, symbol_name: str) -> Place:
        """Split a symbol such as ``x[i+1]`` into the name ``x`` of the quantity and the offset of the site. Raises
        `KeyError` for a symbol without a value at sites.
        """
        match = _NEIGHBOUR.fullmatch(symbol_name)
        base = match["name"] if match else symbol_name
        if base not in self.names:
            raise KeyError(f"{symbol_name!r} has no value at sites")
        base = self.names[self.names.index(base)]
        if match is None:
            return base, self.origin
        if not self.axes:
            return base, (match["index"],)
        offsets = dict.fromkeys(self.axes, 0)
        for part in match["index"].split(","):
            step = _STEP.fullmatch(part)
            if step is None or step["axis"] not in offsets:
                raise KeyError(f"{symbol_name!r}: {part} is not an axis ({', '.join(self.axes)}) plus a whole number")
            offsets[step["axis"]] = int(step["step"])
        return base, tuple(offsets.values())

    def places(self, *expressions: Expression) -> dict[str, Place]:
        """Return those symbols in the expressions that stand for values at sites: symbol → name and offset."""
        return {n: self.place(n) for n in symbols_of(*expressions) if n.partition("[")[0] in self.names}

    def shifted(self, expressions: Sequence[Expression], offset: Offset) -> list[Expression]:
        """Return the expressions of one site, written for another site of the grid: for the offset 1, x[i+1] becomes
        x[i+2].
        """
        if not any(offset):
            return list(expressions)
        shifted_symbols = {
            name: symbol(self.at(base, plus(o, offset))) for name, (base, o) in self.places(*expressions).items()
        }
        return substitute(expressions, shifted_symbols)

    def on(self, expression: Expression, end: str) -> Expression:
        """Return an expression of one site, written for the site at an ``end`` of a bond or a pair: x becomes x[a]."""
        symbols_at_end = {name: symbol(self.at(base, (end,))) for name, (base, _) in self.places(expression).items()}
        return substitute([expression], symbols_at_end)[0]


def steps(offset: Offset) -> tuple[int, ...]:
    """Return an offset on a grid as a tuple of integers, one for each axis."""
    return tuple(int(o) for o in offset)


def plus(a: Offset, b: Offset) -> tuple[int, ...]:
    """Return the sum of two offsets on a grid."""
    return tuple(x + y for x, y in zip(steps(a), steps(b), strict=True))


def minus(a: Offset) -> tuple[int, ...]:
    """Return the opposite −a of an offset on a grid."""
    return tuple(-o for o in steps(a))
