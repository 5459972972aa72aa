"""The names of symbols: plain text for the symbols of a spec, `Symbol` for the symbols that phigen adds."""

from __future__ import annotations

from typing import Any

#: Kinds that several modules distinguish. A kind without keys has one symbol only, such as the step size.
MOMENTUM, VARIATION, COTANGENT, INITIAL, GAUGE = "p", "v", "bar", "x0", "gauge"
COEFFICIENT, RENEWED, SERIES, FIXED = "c", "n", "s", "f"
#: Entries of exp(tA) − 1, by the matrix and the place: coefficients of their own.
EXPONENTIAL = "exponential"
TEMPORARY, WORK, PART = "t", "w", "part"
#: Of lattices: what bonds or pairs add to a component of the gradient at a site; 1 where a term reaches beyond no open
#: end, else 0; 1 at sites of the colour that a part of a graph belongs to, else 0; 1 where the site at an offset has a
#: colour, and lies on the side of a seam that a sweep is for, else 0.
GATHERED, PRESENT, CHOSEN, BEGINS = "gathered", "present", "chosen", "begins"
#: Of transposed lattices: the cotangents of the changes of fields at a neighbour, by the number of the field and the
#: offset; those of sums over bonds or pairs, at the site and at the other end.
AROUND, HERE, THERE = "change_bar_around", "sums_bar", "sums_bar_there"


class Symbol(str):
    """A name of phigen's own: a kind, and a key that tells it from others of that kind.

    Its text, such as ``p:x1``, ``c:3`` or ``h:``, orders symbols and shows them; nothing reads it back. The colon,
    which no name of a spec can hold, keeps it apart from the names of the user.
    """

    __slots__ = ("key", "kind")

    kind: str
    key: tuple[str | int, ...]

    def __new__(cls, kind: str, *key: str | int) -> Symbol:
        name = super().__new__(cls, f"{kind}:{':'.join(map(str, key))}")
        name.kind, name.key = kind, key
        return name

    def __getnewargs__(self) -> tuple[Any, ...]:
        return (self.kind, *self.key)


#: The size of a step, or the time of a flow; the time of an exact solution; a matrix Σ p_i E_i.
STEP, ELAPSED, MATRIX = Symbol("h"), Symbol("time"), Symbol("P")

#: Increments of the Wiener processes in a step, by the number of the source.
INCREMENT = "dw"

#: e = −H(x₀), which a monitored step holds fixed.
LEVEL = Symbol("e")


def momentum(name: str) -> Symbol:
    """The symbol of the covector component that belongs to a coordinate."""
    return Symbol(MOMENTUM, name)


def increment(k: int) -> Symbol:
    """The symbol of the increment of a source of noise in a step."""
    return Symbol(INCREMENT, k)


def initial(name: str) -> Symbol:
    """The symbol of the value of a coordinate at the start."""
    return Symbol(INITIAL, name)


def variation(name: str) -> Symbol:
    """The symbol of the variation of a coordinate."""
    return Symbol(VARIATION, name)


def cotangent(name: str) -> Symbol:
    """The symbol of a cotangent: the derivative of the final result by a value."""
    return Symbol(COTANGENT, name)


def coefficient(k: int) -> Symbol:
    """The symbol of a value that does not depend on the state."""
    return Symbol(COEFFICIENT, k)


def kind_of(name: str) -> str | None:
    """The kind of a symbol of phigen's own; None for a name of the user."""
    return name.kind if isinstance(name, Symbol) else None


def plain(name: str) -> str:
    """A name for readers: ``p_x1`` for the momentum of x1, as in specs, λ_C for the gauge of C, ``h`` for the step.

    Shared sub-expressions are named σ_1, σ_2, …
    """
    if not isinstance(name, Symbol):
        return name
    kind = {GAUGE: "λ", PART: "σ"}.get(name.kind, name.kind)
    return "_".join([kind, *(plain(k) if isinstance(k, str) else str(k) for k in name.key)])
