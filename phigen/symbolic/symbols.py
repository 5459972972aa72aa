"""The names of symbols: plain text for symbols of a spec, `Symbol` for the symbols that phigen adds."""

from __future__ import annotations

from typing import Any

#: Kinds of symbols that phigen adds: momentum (covector), variation, cotangent, initial value, gauge of a Casimir.
#: Symbols of one kind differ by a key, such as the name of a coordinate.
MOMENTUM, VARIATION, COTANGENT, INITIAL, GAUGE = "p", "v", "bar", "x0", "gauge"
COEFFICIENT, RENEWED, SERIES, FIXED = "c", "n", "s", "f"
#: Kind of the symbols for the entries of exp(tA) − 1 with a constant matrix A. The key has two parts: a digest of A,
#: and the index of the entry in the list of all entries, row by row.
EXPONENTIAL = "exponential"
TEMPORARY, WORK, PART = "t", "w", "part"
#: Kinds of symbols for lattices. GATHERED: sum over the bonds or pairs of a site; the sum is a part of the gradient.
#: The symbols of the other kinds have the value 1 or 0. PRESENT: 0 if a term reads a site beyond an open end, else 1.
#: CHOSEN: 1 if a site of a graph has the colour whose flow is applied. BEGINS: 1 if the terms of H that begin at a
#: neighbour belong to the part of H whose flow is applied. In the equation of motion of a site, the symbol is a factor
#: of the contribution of these terms. The key is the colour of the part and the offset of the neighbour. The value
#: depends on the position of the site relative to boundary seams.
GATHERED, PRESENT, CHOSEN, BEGINS = "gathered", "present", "chosen", "begins"
#: Kinds of symbols that transposed kernels of lattices read. AROUND: cotangent of the change that a sweep makes to a
#: field at a neighbour. The key of such a symbol is the number of the field, and the offset of the neighbour. HERE and
#: THERE: cotangents of a sum over bonds or pairs, at the site itself and at the other site of the bond or pair.
AROUND, HERE, THERE = "change_bar_around", "sums_bar", "sums_bar_there"


class Symbol(str):
    """Name of a symbol that phigen adds. It has a kind, and a key that distinguishes symbols of the same kind.

    The text of a symbol, such as ``p:x1``, ``c:3`` or ``h:``, is for sorting and display; it is never parsed. Names in
    a spec contain no colon, so that they cannot clash with symbols of phigen.
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


#: STEP: size of a step, or duration of a flow. ELAPSED: time in a formula of an exact solution. MATRIX: the matrix Σ
#: p_i E_i, where the E_i are the basis of a matrix Lie algebra and the p_i are momenta.
STEP, ELAPSED, MATRIX = Symbol("h"), Symbol("time"), Symbol("P")

#: Kind of the symbols for the increments of Wiener processes in a step. The key of a symbol is the number of its source
#: of noise.
INCREMENT = "dw"

#: Symbol of the energy level e = −H(x₀), a constant in the equations of systems with a monitor.
LEVEL = Symbol("e")


def momentum(name: str) -> Symbol:
    """Return the symbol of the momentum (component of a covector) that belongs to the coordinate ``name``."""
    return Symbol(MOMENTUM, name)


def increment(k: int) -> Symbol:
    """Return the symbol of the increment, in a step, of the Wiener process of noise source ``k``."""
    return Symbol(INCREMENT, k)


def initial(name: str) -> Symbol:
    """Return the symbol of the initial value of a coordinate."""
    return Symbol(INITIAL, name)


def variation(name: str) -> Symbol:
    """Return the symbol of the variation of a coordinate, a component of a tangent vector."""
    return Symbol(VARIATION, name)


def cotangent(name: str) -> Symbol:
    """Return the symbol of a cotangent: the derivative of the user's function with respect to the value ``name``."""
    return Symbol(COTANGENT, name)


def coefficient(k: int) -> Symbol:
    """Return the symbol of coefficient ``k``, a value that depends on parameters and step, but not on the state."""
    return Symbol(COEFFICIENT, k)


def kind_of(name: str) -> str | None:
    """Return the kind of a symbol that phigen added; None for a name that the spec declares."""
    return name.kind if isinstance(name, Symbol) else None


def plain(name: str) -> str:
    """Return the name of a symbol for display: ``p_x1`` for the momentum of x1, λ_C for the gauge of the Casimir C.

    Named parts of long expressions are called σ_1, σ_2, … Names that a spec declares are unchanged.
    """
    if not isinstance(name, Symbol):
        return name
    kind = {GAUGE: "λ", PART: "σ"}.get(name.kind, name.kind)
    return "_".join([kind, *(plain(k) if isinstance(k, str) else str(k) for k in name.key)])
