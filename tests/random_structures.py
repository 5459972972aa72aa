"""Random Poisson systems as specs, by kind and seed. Their brackets are computed with sympy, not with phigen."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

import sympy

Matrix = sympy.Matrix
X = sympy.symbols("x1:6")


@dataclass(frozen=True)
class Drawn:
    """A random system: its spec without the first two keys, its Casimirs as text, and a state at which the system is
    regular.
    """

    text: str
    casimirs: tuple[str, ...]
    start: tuple[float, ...]


def draw(kind: str, seed: int) -> Drawn:
    """Return the random system of a kind and a seed; it is the same on every machine and Python version."""
    source = random.Random(f"{kind} {seed}")
    pi, casimirs = KINDS[kind](source, seed)
    while pi.is_zero_matrix:
        pi, casimirs = KINDS[kind](source, seed)
    n = pi.shape[0]
    x = X[:n]
    brackets = {
        f"{x[i]}": {f"{x[j]}": _text(pi[i, j]) for j in range(i + 1, n) if pi[i, j] != 0}
        for i in range(n)
        if any(pi[i, j] != 0 for j in range(i + 1, n))
    }
    rows = "".join(
        f"    {a}: {{" + ", ".join(f'{b}: "{value}"' for b, value in row.items()) + "}\n" for a, row in brackets.items()
    )
    stated = "".join(f'  C{k}: "{_text(c)}"\n' for k, c in enumerate(casimirs))
    text = f"coordinates: [{', '.join(map(str, x))}]\npoisson:\n  brackets:\n{rows}"
    text += f'hamiltonian: "{_text(_hamiltonian(source, x))}"\n' + (f"casimirs:\n{stated}" if stated else "")
    start = tuple(round(source.uniform(0.4, 1.1), 3) for _ in x)
    return Drawn(text, tuple(map(_text, casimirs)), start)


def _text(expression: sympy.Expr) -> str:
    return sympy.sstr(expression)


def _small(source: random.Random) -> sympy.Rational:
    return sympy.Rational(source.choice([-3, -2, -1, 1, 2, 3]), source.choice([1, 2, 3]))


def _polynomial(source: random.Random, x: Sequence[sympy.Symbol], degree: int, terms: int) -> sympy.Expr:
    """Return the sum of random monomials of at most the given degree."""
    result = sympy.Integer(0)
    for _ in range(terms):
        monomial = sympy.Integer(1)
        for _ in range(source.randint(1, degree)):
            monomial *= source.choice(list(x))
        result += _small(source) * monomial
    return result


def _hamiltonian(source: random.Random, x: Sequence[sympy.Symbol]) -> sympy.Expr:
    """Return a sum of squares with positive coefficients and a small random perturbation, polynomial or
    trigonometric.
    """
    squares = sum(sympy.Rational(source.randint(1, 4), 4) * v**2 for v in x)
    if source.random() < 0.5:
        return squares + _polynomial(source, x, 3, 2) / 4
    a, b = source.sample(list(x), 2)
    return squares + source.choice([sympy.sin, sympy.cos])(a + _small(source) * b) / 2


def _nambu(n: int) -> Callable[[random.Random, int], tuple[Matrix, list[sympy.Expr]]]:
    def structure(source: random.Random, seed: int) -> tuple[Matrix, list[sympy.Expr]]:
        """Return the brackets {x_i, x_j} = f · det ∂(x_i, x_j, C_1, …)/∂x with random Casimirs C and a random factor f,
        and the Casimirs.
        """
        x = X[:n]
        casimirs = [_polynomial(source, x, 3 if n == 3 else 2, 3) + v**2 for v in x[: n - 2]]
        factor = 1 + source.choice([0, sympy.Rational(1, 2), sympy.Rational(-1, 3)]) * source.choice(list(x))
        pi = sympy.zeros(n)
        slopes = [[sympy.diff(c, v) for v in x] for c in casimirs]
        for order in permutations(range(n)):
            sign = sympy.LeviCivita(*order)
            product = sympy.Integer(1)
            for row, k in zip(slopes, order[2:], strict=True):
                product *= row[k]
            pi[order[0], order[1]] += sign * product
        return (factor * pi).applyfunc(sympy.expand), casimirs

    return structure


#: Lie algebras by name: the dimension, and the structure constants {(i, j): {k: c}} of [E_i, E_j] = Σ c E_k.
ALGEBRAS: Mapping[str, tuple[int, Mapping[tuple[int, int], Mapping[int, int]]]] = {
    "so(3)": (3, {(0, 1): {2: 1}, (1, 2): {0: 1}, (0, 2): {1: -1}}),
    "sl(2)": (3, {(0, 1): {2: 1}, (0, 2): {0: 2}, (1, 2): {1: -2}}),
    "se(2)": (3, {(0, 1): {2: 1}, (0, 2): {1: -1}}),
    "heisenberg": (3, {(0, 1): {2: 1}}),
    "book": (3, {(0, 1): {1: 1}, (0, 2): {2: 1}}),
    "semidirect": (4, {(0, 1): {1: 1}, (0, 2): {1: 1, 2: 1}, (0, 3): {3: -2}}),
    "engel": (4, {(0, 1): {2: 1}, (0, 2): {3: 1}}),
    "oscillator": (4, {(0, 1): {2: 1}, (0, 2): {1: -1}, (1, 2): {3: 1}}),
}


def _lie(source: random.Random, seed: int) -> tuple[Matrix, list[sympy.Expr]]:
    """Return the Lie–Poisson brackets of a known algebra in a random basis, x' = A x with A a product of integer
    shears. The list of Casimirs is empty.
    """
    n, constants = ALGEBRAS[sorted(ALGEBRAS)[seed % len(ALGEBRAS)]]
    x = X[:n]
    pi = sympy.zeros(n)
    for (i, j), sums in constants.items():
        pi[i, j] = sum(c * x[k] for k, c in sums.items())
        pi[j, i] = -pi[i, j]
    change = sympy.eye(n)
    for _ in range(3):
        i, j = source.sample(range(n), 2)
        shear = sympy.eye(n)
        shear[i, j] = source.choice([-1, 1, 2])
        change = shear * change
    old = change.inv() * Matrix(x)
    moved = pi.subs(dict(zip(x, old, strict=True)), simultaneous=True)
    return (change * moved * change.T).applyfunc(sympy.expand), []


def _log_canonical(source: random.Random, seed: int) -> tuple[Matrix, list[sympy.Expr]]:
    """Return the brackets {x_i, x_j} = a_ij x_i x_j with random a_ij, in three to five dimensions. The list of Casimirs
    is empty.
    """
    n = 3 + seed % 3
    x, pi = X[:n], sympy.zeros(n)
    for i, j in combinations(range(n), 2):
        pi[i, j] = sympy.Rational(source.randint(-3, 3), 2) * x[i] * x[j]
        pi[j, i] = -pi[i, j]
    return pi, []


def _pulled_back(source: random.Random, seed: int) -> tuple[Matrix, list[sympy.Expr]]:
    """Return the brackets of a system of another kind in the coordinates y = ψ(x), y_i = x_i + q_i(x_{i+1}, …) with
    random polynomials q_i.
    """
    base, casimirs = (_lie, _log_canonical, _nambu(3))[seed % 3](source, 0)
    n = base.shape[0]
    x = X[:n]
    added = [_polynomial(source, x[i + 1 :], 2, 1) / 3 if i + 1 < n else sympy.Integer(0) for i in range(n)]
    forward = [v + q for v, q in zip(x, added, strict=True)]
    back: list[sympy.Expr] = []
    for i in reversed(range(n)):
        back.insert(0, x[i] - added[i].subs(dict(zip(x[i + 1 :], back, strict=True)), simultaneous=True))
    jacobian = Matrix(forward).jacobian(list(x))
    inverse = dict(zip(x, back, strict=True))
    pi = (jacobian * base * jacobian.T).subs(inverse, simultaneous=True)
    return pi.applyfunc(sympy.expand), [sympy.expand(c.subs(inverse, simultaneous=True)) for c in casimirs]


KINDS: Mapping[str, Callable[[random.Random, int], tuple[Matrix, list[sympy.Expr]]]] = {
    "nambu3": _nambu(3),
    "nambu4": _nambu(4),
    "lie": _lie,
    "log-canonical": _log_canonical,
    "pull-back": _pulled_back,
}
