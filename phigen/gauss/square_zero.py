"""Square-zero ideals of star algebras: their part of a group element acts on momenta through a functional only.

Let A = B ⊕ N with N² = 0, N an ideal, B a subalgebra, and N* = N, B* = B. For G = g + n the momenta of a = b + c are
x̃(GaG*) = λ(bg*) + κ(cg*), with the functionals λ(b) = x̃(gb) + 2x̃(nb) of B and κ(c) = x̃(gc) of N, since x̃(gbn*) =
x̃(nbg*). If Ġ = G(e + v), then ġ = ge and λ̇(b) = λ(eb) + 2κ(vb). So g and λ are a closed set of unknowns, linear in G,
and Gauss methods, which commute with linear maps, make the same step with them. There are 2 dim B of them; for motions
of a body N are translations, or the directions of several fields, and g, λ are those of T*B.
"""

from __future__ import annotations

from collections.abc import Iterable

from phigen.gauss.star_algebra import StarAlgebra


def square_zero_ideal(algebra: StarAlgebra) -> tuple[int, ...]:
    """Return the basis elements of an ideal N as above, where 2 dim B does not exceed the dimension of A; else none.

    N is the radical of the form tr ab; basis elements must span N and B, and elements of the frame lie in N or in B.
    """
    n, zero = range(algebra.dimension), algebra.field.zero
    products = {at: row for at, row in algebra.table.items() if row}
    traces = [sum((row[j] for (i, j), row in products.items() if i == k and j in row), zero) for k in n]
    pairs = {(i, j) for (i, j), row in products.items() if sum((v * traces[k] for k, v in row.items()), zero) != 0}
    ideal = set(n) - {i for i, _ in pairs}
    if not ideal or 2 * len(ideal) < algebra.dimension:
        return ()
    vanishing = not any(i in ideal and j in ideal for i, j in products)
    closed = all(_lies(row, ideal, i in ideal or j in ideal) for (i, j), row in products.items())
    starred = all(_lies(algebra.star[i], ideal, i in ideal) for i in n)
    framed = all(_lies(f, ideal, True) or _lies(f, ideal, False) for f in algebra.frame)
    return tuple(sorted(ideal)) if vanishing and closed and starred and framed else ()


def _lies(row: Iterable[int], ideal: set[int], inside: bool) -> bool:
    return all((k in ideal) == inside for k in row)
