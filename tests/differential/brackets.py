"""Random Poisson structures: their form in a spec, and the matrix π, computed without phigen."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import sympy
from differential.formulas import Expr, Symbol, small, symbols, text
from random_structures import KINDS

Matrix = sympy.Matrix


@dataclass(frozen=True)
class Structure:
    """A Poisson structure: its ``form`` in a spec, the matrix π, and known properties.

    ``kind`` names the function that drew the structure. ``casimirs`` are some of its Casimirs, and ``pairs`` its pairs
    of canonical positions and momenta. If ``positive``, the structure is regular at positive coordinates. ``body`` is
    the sign of the bracket if the structure is so(3)*, where tests compute the attitude, and otherwise 0.
    """

    kind: str
    coordinates: tuple[Symbol, ...]
    form: Mapping[str, Any]
    pi: Matrix
    casimirs: tuple[Expr, ...] = ()
    pairs: tuple[tuple[Symbol, Symbol], ...] = ()
    positive: bool = False
    body: int = 0


def draw_structure(source: random.Random) -> Structure:
    """Draw a structure of a random kind."""
    kinds, weights = zip(*DRAWN, strict=True)
    return source.choices(kinds, weights)[0](source)


def canonical(source: random.Random, most: int = 3) -> Structure:
    """Draw canonical pairs with {q, p} = 1, sometimes with a further coordinate that is a Casimir."""
    n = source.randint(1, most)
    q, p = symbols(f"q{k}" for k in range(n)), symbols(f"p{k}" for k in range(n))
    spare = symbols(["z"]) if source.random() < 0.1 else ()
    coordinates = (
        (*q, *p, *spare) if source.random() < 0.7 else (*spare, *(v for pair in zip(p, q, strict=True) for v in pair))
    )
    pi = sympy.zeros(len(coordinates))
    for a, b in zip(q, p, strict=True):
        i, j = coordinates.index(a), coordinates.index(b)
        pi[i, j], pi[j, i] = sympy.Integer(1), sympy.Integer(-1)
    form = {"canonical": {"q": [str(v) for v in q], "p": [str(v) for v in p]}}
    return Structure("canonical", coordinates, form, pi, spare, tuple(zip(q, p, strict=True)))


def paired(pairs: Sequence[tuple[str, str]]) -> Structure:
    """Return the canonical structure of named pairs, positions first."""
    n = len(pairs)
    q, p = (symbols(names) for names in zip(*pairs, strict=True))
    pi = sympy.Matrix(sympy.BlockMatrix([[sympy.zeros(n), sympy.eye(n)], [-sympy.eye(n), sympy.zeros(n)]]))
    form = {"canonical": {"q": [str(v) for v in q], "p": [str(v) for v in p]}}
    return Structure("canonical", (*q, *p), form, pi, (), tuple(zip(q, p, strict=True)))


def constant(source: random.Random) -> Structure:
    """Draw a constant structure: a skew matrix, which may be singular."""
    n = source.randint(2, 5)
    x = symbols(f"x{k}" for k in range(n))
    pi = skew(n, lambda i, j: small(source) if source.random() < 0.7 else sympy.Integer(0))
    return Structure("constant", x, written(source, x, pi), pi)


def log_canonical(source: random.Random) -> Structure:
    """Draw a log-canonical structure {x_i, x_j} = a_ij x_i x_j."""
    n = source.randint(2, 4)
    x = symbols(f"y{k}" for k in range(n))
    a = skew(n, lambda i, j: small(source) if source.random() < 0.8 else sympy.Integer(0))
    pi = skew(n, lambda i, j: a[i, j] * x[i] * x[j])
    form = {"log_canonical": rows(a)} if source.random() < 0.6 else written(source, x, pi)
    return Structure("log-canonical", x, form, pi, positive=True)


def gauged(source: random.Random) -> Structure:
    """Draw a structure π_ij = g_i(x_i) A_ij g_j(x_j) with a constant skew matrix A."""
    n = source.randint(2, 3)
    x = symbols(f"x{k}" for k in range(n))
    g = [source.choice([v, v + 2, 1 + v**2, sympy.Integer(1)]) for v in x]
    pi = skew(n, lambda i, j: small(source) * g[i] * g[j] if source.random() < 0.8 else sympy.Integer(0))
    return Structure("gauged", x, written(source, x, pi), pi, positive=True)


def algebra(source: random.Random) -> Structure:
    """Draw a named Lie algebra and the sign of its bracket."""
    name = source.choices(list(ALGEBRAS), [10, 3, 4, 1, 3, 3, 2, 3, 3, 2])[0]
    basis = ALGEBRAS[name]()
    sign = source.choice([1, -1])
    x = symbols(f"m{k + 1}" for k in range(len(basis)))
    pi = lie_poisson(basis, x) * sign
    form = {"lie_algebra": {"name": name, "sign": "plus" if sign > 0 else "minus"}}
    known = (sum((v**2 for v in x), sympy.Integer(0)),) if name == "so(3)" else ()
    return Structure(f"algebra {name}", x, form, pi, known, body=sign if name == "so(3)" else 0)


def moved_algebra(source: random.Random) -> Structure:
    """Draw a Lie algebra in a random basis, given by matrices, structure constants or brackets."""
    name = source.choice(["so(3)", "se(2)", "sl(2)", "heisenberg(1)", "aff(1)", "gl(2)"])
    basis = ALGEBRAS[name]()
    n = len(basis)
    change = sympy.eye(n)
    for _ in range(3):
        i, j = source.sample(range(n), 2)
        shear = sympy.eye(n)
        shear[i, j] = source.choice([-1, 1, 2])
        change = shear * change
    moved = [sum((change[i, j] * basis[j] for j in range(n)), basis[0] * 0) for i in range(n)]
    x = symbols(f"m{k + 1}" for k in range(n))
    pi = lie_poisson(moved, x)
    forms = {
        "matrices": lambda: {"lie_algebra": {"matrices": [rows(m) for m in moved]}},
        "constants": lambda: {"lie_algebra": {"structure_constants": constants(pi, x)}},
        "brackets": lambda: written(source, x, pi),
    }
    said = source.choice(sorted(forms))
    return Structure(f"algebra {name} in another basis, by {said}", x, forms[said](), pi)


def affine(source: random.Random) -> Structure:
    """Draw a Lie–Poisson structure in shifted coordinates, so that π has constant terms."""
    basis = ALGEBRAS[source.choice(["so(3)", "sl(2)", "se(2)", "heisenberg(1)"])]()
    x = symbols(f"m{k + 1}" for k in range(len(basis)))
    shift = {v: v + small(source) for v in x}
    pi = lie_poisson(basis, x).xreplace(shift)
    return Structure("affine", x, written(source, x, pi.applyfunc(sympy.expand)), pi)


def general(source: random.Random) -> Structure:
    """Draw one of the structures of `random_structures`, most of which have no closed form."""
    kind = source.choice(["nambu3", "nambu3", "nambu4", "lie", "pull-back"])
    pi, casimirs = KINDS[kind](source, source.randint(0, 7))
    x = symbols(f"x{k + 1}" for k in range(pi.shape[0]))
    return Structure(kind, x, written(source, x, pi), pi, tuple(casimirs), positive=True)


def product(source: random.Random) -> Structure:
    """Draw the product of a named Lie algebra and canonical pairs, with no brackets between the two."""
    left, right = algebra(source), canonical(source, 2)
    n, m = len(left.coordinates), len(right.coordinates)
    pi = sympy.zeros(n + m)
    pi[:n, :n], pi[n:, n:] = left.pi, right.pi
    blocks = [{"coordinates": [str(v) for v in s.coordinates], **s.form} for s in (left, right)]
    coordinates = (*left.coordinates, *right.coordinates)
    return Structure("product", coordinates, {"product": blocks}, pi, (*left.casimirs, *right.casimirs))


def nothing(source: random.Random) -> Structure:
    """Draw the structure whose brackets are all 0."""
    x = symbols(f"x{k}" for k in range(source.randint(1, 3)))
    n = len(x)
    forms: list[dict[str, Any]] = [{"brackets": {"x0": {}}}, {"matrix": rows(sympy.zeros(n))}]
    return Structure("zero", x, source.choice(forms), sympy.zeros(n), x)


def chain(source: random.Random) -> Structure:
    """Draw canonical brackets of 8 to 24 pairs; the C of the largest systems has no SIMD lanes."""
    n = source.choice([8, 17, 19, 20, 21, 22, 24])
    q, p = symbols(f"q{k}" for k in range(n)), symbols(f"p{k}" for k in range(n))
    pi = sympy.zeros(2 * n)
    for k in range(n):
        pi[k, n + k], pi[n + k, k] = sympy.Integer(1), sympy.Integer(-1)
    form = {"canonical": {"q": [str(v) for v in q], "p": [str(v) for v in p]}}
    return Structure("chain", (*q, *p), form, pi, (), tuple(zip(q, p, strict=True)))


DRAWN: Sequence[tuple[Callable[[random.Random], Structure], float]] = (
    (canonical, 24),
    (algebra, 20),
    (moved_algebra, 10),
    (log_canonical, 10),
    (constant, 8),
    (gauged, 6),
    (affine, 6),
    (general, 10),
    (product, 5),
    (nothing, 1),
    (chain, 3),
)


# --- matrices and brackets


def skew(n: int, entry: Callable[[int, int], Expr]) -> Matrix:
    """Return the skew matrix with given entries above the diagonal."""
    pi = sympy.zeros(n)
    for i, j in combinations(range(n), 2):
        pi[i, j] = entry(i, j)
        pi[j, i] = -pi[i, j]
    return pi


def rows(matrix: Matrix) -> list[list[str]]:
    """Return the entries of a matrix as texts for a spec."""
    return [[text(v) for v in matrix.row(i)] for i in range(matrix.shape[0])]


def written(source: random.Random, x: Sequence[Symbol], pi: Matrix) -> dict[str, Any]:
    """Return a structure in the form for a spec: as a matrix, or as brackets {a, b}, some of them written as {b, a}."""
    if source.random() < 0.2:
        return {"matrix": rows(pi)}
    brackets: dict[str, dict[str, str]] = {}
    for i, j in combinations(range(len(x)), 2):
        if pi[i, j] != 0:
            a, b = (i, j) if source.random() < 0.8 else (j, i)
            brackets.setdefault(str(x[a]), {})[str(x[b])] = text(pi[a, b])
    return {"brackets": brackets or {str(x[0]): {}}}


def lie_poisson(basis: Sequence[Matrix], x: Sequence[Symbol]) -> Matrix:
    """Return the Lie–Poisson brackets {x_i, x_j} = Σ c_ij^k x_k of the Lie algebra that the matrices span."""
    columns = Matrix.hstack(*(Matrix(list(m)) for m in basis))
    normal = (columns.T * columns).inv() * columns.T
    pi = sympy.zeros(len(x))
    for i, j in combinations(range(len(x)), 2):
        commutator = basis[i] * basis[j] - basis[j] * basis[i]
        c = normal * Matrix(list(commutator))
        pi[i, j] = sum((c[k] * x[k] for k in range(len(x))), sympy.Integer(0))
        pi[j, i] = -pi[i, j]
    return pi


def constants(pi: Matrix, x: Sequence[Symbol]) -> dict[str, Any]:
    """Return the structure constants of a linear structure in the form for a spec."""
    structure_constants: dict[str, Any] = {}
    for i, j in combinations(range(len(x)), 2):
        parts = {f"E{k + 1}": text(sympy.diff(pi[i, j], v)) for k, v in enumerate(x) if sympy.diff(pi[i, j], v) != 0}
        if parts:
            structure_constants.setdefault(f"E{i + 1}", {})[f"E{j + 1}"] = parts
    return structure_constants


def unit(n: int, i: int, j: int) -> Matrix:
    """Return the n×n matrix with a 1 at (i, j) and zeros elsewhere."""
    m = sympy.zeros(n)
    m[i, j] = 1
    return m


def _rotations(n: int) -> list[Matrix]:
    return [unit(n, i, j) - unit(n, j, i) for i, j in combinations(range(n), 2)]


def _so3() -> list[Matrix]:
    """Return the basis of so(3) with [L_1, L_2] = L_3 and its cyclic permutations."""
    return [unit(3, k - 1, k - 2) - unit(3, k - 2, k - 1) for k in range(3)]


def _grown(matrices: Sequence[Matrix]) -> list[Matrix]:
    """Return the basis of a semidirect product: the matrices with a row and a column of zeros added, and the
    translations.
    """
    n = matrices[0].shape[0]
    return [sympy.diag(m, 0) for m in matrices] + [unit(n + 1, k, n) for k in range(n)]


def _se2() -> list[Matrix]:
    return _grown([unit(2, 1, 0) - unit(2, 0, 1)])


def _sl2() -> list[Matrix]:
    return [unit(2, 0, 0) - unit(2, 1, 1), unit(2, 0, 1), unit(2, 1, 0)]


def _gl(n: int) -> list[Matrix]:
    return [unit(n, i, j) for i in range(n) for j in range(n)]


def _heisenberg() -> list[Matrix]:
    return [unit(3, 0, 1), unit(3, 1, 2), unit(3, 0, 2)]


#: Bases of matrices for the Lie algebras of docs/spec.md, by name.
ALGEBRAS: Mapping[str, Callable[[], list[Matrix]]] = {
    "so(3)": _so3,
    "se(2)": _se2,
    "se(3)": lambda: _grown(_so3()),
    "so(4)": lambda: _rotations(4),
    "sl(2)": _sl2,
    "heisenberg(1)": _heisenberg,
    "gl(2)": lambda: _gl(2),
    "aff(1)": lambda: _grown(_gl(1)),
    "su(2)": _so3,
    "sp(2)": _sl2,
}
