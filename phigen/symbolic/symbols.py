"""The names of symbols: plain text for symbols of a spec, `Symbol` for the symbols that phigen adds."""

from __future__ import annotations

from typing import Any

#: Kinds of symbols that several modules distinguish. A kind without keys has only one symbol, such as the step size.
MOMENTUM, VARIATION, COTANGENT, INITIAL, GAUGE = "p", "v", "bar", "x0", "gauge"
COEFFICIENT, RENEWED, SERIES, FIXED = "c", "n", "s", "f"
#: Kind of the entries of exp(tA) − 1, by the matrix and the place; they are coefficients.
EXPONENTIAL = "exponential"
TEMPORARY, WORK, PART = "t", "w", "part"
#: Kinds for lattices. GATHERED: contribution of bonds or pairs to a component of the gradient at a site. PRESENT: 1 if
#: a term reaches beyond no open end, else 0. CHOSEN: 1 at sites of the colour that a part of a graph belongs to, else
#: 0. BEGINS: 1 if the site at an offset has a colour, and lies on the side of a seam that a sweep is for, else 0.
GATHERED, PRESENT, CHOSEN, BEGINS = "gathered", "present", "chosen", "begins"
#: Inputs of transposed kernels of lattices: cotangents of the changes of fields at a neighbour, by the number of the
#: field and the offset; cotangents of sums over bonds or pairs, at the site and at the partner.
AROUND, HERE, THERE = "change_bar_around", "sums_bar", "sums_bar_there"


class Symbol(str):
    """A name that phigen adds, of a kind and with a key that distinguishes it from others of the kind.

    Its text, such as ``p:x1``, ``c:3`` or ``h:``, is for sorting and display; it is never parsed. Names of a spec
    cannot contain a colon, so they never clash with it.
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


#: Symbols: STEP, the size of a step or the duration of a flow; ELAPSED, the time of an exact solution; MATRIX, a matrix
#: Σ p_i E_i.
STEP, ELAPSED, MATRIX = Symbol("h"), Symbol("time"), Symbol("P")

#: Kind of the increments of the Wiener processes in a step, by the number of the source.
INCREMENT = "dw"

#: Symbol of the energy level e = −H(x₀), which a monitored step holds fixed.
LEVEL = Symbol("e")


def momentum(name: str) -> Symbol:
    """Return the symbol of the covector component that belongs to a coordinate."""
    return Symbol(MOMENTUM, name)


def increment(k: int) -> Symbol:
    """Return the symbol of the increment of noise source ``k`` in a step."""
    return Symbol(INCREMENT, k)


def initial(name: str) -> Symbol:
    """Return the symbol of the initial value of a coordinate."""
    return Symbol(INITIAL, name)


def variation(name: str) -> Symbol:
    """Return the symbol of the variation of a coordinate."""
    return Symbol(VARIATION, name)


def cotangent(name: str) -> Symbol:
    """Return the symbol of a cotangent: the derivative of the final result with respect to a value."""
    return Symbol(COTANGENT, name)


def coefficient(k: int) -> Symbol:
    """Return the symbol of a value that does not depend on the state."""
    return Symbol(COEFFICIENT, k)


def kind_of(name: str) -> str | None:
    """Return the kind of a symbol that phigen added; None for a name of the user."""
    return name.kind if isinstance(name, Symbol) else None


def plain(name: str) -> str:
    """Return a name for display: ``p_x1`` for the momentum of x1, as in specs, λ_C for the gauge of C, ``h`` for the
    step.

    Shared sub-expressions are called σ_1, σ_2, …
    """
    if not isinstance(name, Symbol):
        return name
    kind = {GAUGE: "λ", PART: "σ"}.get(name.kind, name.kind)
    return "_".join([kind, *(plain(k) if isinstance(k, str) else str(k) for k in name.key)])
