"""Square-zero ideals of star algebras (associative algebras with an involution *). They reduce the number of unknowns
of a step.

Let A = B ⊕ N with a subalgebra B and an ideal N such that N² = 0, B* = B and N* = N. Write group elements as G = g + n,
with g in B and n in N. Let x̃ be the functional of `phigen.gauss.star_algebra`. For b in B and c in N, the momenta are
x̃(G(b + c)G*) = λ(bg*) + κ(cg*), since x̃(gbn*) = x̃(nbg*). Here λ(b) = x̃(gb) + 2x̃(nb) is a functional on B, and κ(c)
= x̃(gc) is a functional on N. So n enters only through λ.

If Ġ = G(e + v) with e in B and v in N, then ġ = ge and λ̇(b) = λ(eb) + 2κ(vb). So the derivatives of g and λ depend on
g and λ alone, and λ is a linear function of G. Gauss methods commute with linear maps, so a method with the unknowns g
and λ makes the same step as with the unknown G. The number of these unknowns is 2 dim B. For the motion of a body, N
has the translations, or the directions of several force fields. Then (g, λ) is a point of T*B.
"""

from __future__ import annotations

from collections.abc import Iterable

from phigen.gauss.star_algebra import StarAlgebra


def square_zero_ideal(algebra: StarAlgebra) -> tuple[int, ...]:
    """Return the basis elements of a square-zero ideal N of a star algebra A.

    The ideal reduces the number of unknowns of a step. A = N ⊕ B with a subalgebra B, and 2 dim B ≤ dim A. N is the
    radical of the bilinear form tr ab. Returns () if there is no ideal with these properties, or if N and B are not
    spanned by basis elements. The result is also () if one of the elements in ``algebra.frame``, by which momenta are
    computed, is neither in N nor in B.
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
