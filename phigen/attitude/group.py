"""The group of an attitude: rotations of so(3), rotations with translations of se(3), or matrices of a representation.

On the dual of a Lie algebra, a step x₀ → x₁ is the coadjoint action of the group element τ(p), where τ is exp or the
Cayley transform, and p is the covector of the step. The product of these elements along a trajectory is the attitude g,
which maps vectors in the body to vectors in space. The sign of the bracket decides between two conventions:

- minus: x are momenta in the body, ġ = g·Ω with Ω = ∇H, and the momentum in space is constant
- plus: x are momenta in space, ġ = Ω·g, and the momentum in the body is constant
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

from phigen.errors import Diagnostic, SpecError
from phigen.geometry.lie_algebra import LieAlgebra
from phigen.geometry.representations import known_representation
from phigen.geometry.system import System
from phigen.realisations.cayley import closed_representation
from phigen.spec.model import LieAlgebraForm
from phigen.symbolic.expression import ONE, ZERO, Expression, total

#: The values of the key ``reconstruct`` in specs: the form in which attitudes are computed.
QUATERNION, MATRIX = "quaternion", "matrix"

Triple = tuple[int, int, int]
Dense = tuple[tuple[Expression, ...], ...]


@dataclass(frozen=True)
class Group:
    """The group of an attitude, and its Lie algebra with ``dimension`` components.

    If ``spatial`` is true, x are momenta in space, and a step multiplies the attitude by the group element of the step
    from the left. Otherwise x are momenta in the body, and the step multiplies from the right. If attitudes are
    matrices, ``matrices`` has the matrix of each basis element of the algebra. Otherwise attitudes are quaternions:
    ``rotation`` has the indices of the components that form so(3), and ``vectors`` the indices of each vector that
    so(3) rotates.
    """

    spatial: bool
    rotation: Triple = (0, 1, 2)
    vectors: tuple[Triple, ...] = ()
    dimension: int = 3
    matrices: tuple[Dense, ...] = ()

    @property
    def translation(self) -> tuple[int, ...]:
        """The indices of the components that translate the body, if the algebra is se(3); else ()."""
        return self.vectors[0] if self.dimension == 6 and len(self.vectors) == 1 else ()

    @property
    def kind(self) -> str:
        """The form of attitudes: ``quaternion``, ``pose`` (a quaternion and a position) or ``matrix``."""
        return MATRIX if self.matrices else "pose" if self.translation else QUATERNION

    @property
    def rows(self) -> int:
        """Number of rows of the matrices of the group; 0 for quaternions."""
        return len(self.matrices[0]) if self.matrices else 0

    @property
    def size(self) -> int:
        """Number of entries of a group element: 4 for quaternions, 7 for poses, rows² for matrices."""
        return self.rows**2 or (7 if self.translation else 4)

    @property
    def orthogonal(self) -> bool:
        """Whether group elements are quaternions or orthogonal matrices. Matrices of the group are orthogonal if all
        basis matrices of its Lie algebra are skew.
        """
        return all((m[i][j] + m[j][i]).is_zero for m in self.matrices for i in range(len(m)) for j in range(len(m)))

    def generator(self, p: Sequence[Expression]) -> list[Expression]:
        """Return the matrix Σ p_i E_i of an element p of the algebra, row by row."""
        size = range(self.rows)
        return [
            total(pi * m[i][j] for pi, m in zip(p, self.matrices, strict=True) if not (pi.is_zero or m[i][j].is_zero))
            for i in size
            for j in size
        ]


def group_of(system: System, requested: str, kind: str) -> Group:
    """Return the group of attitudes of a system.

    ``requested`` is the value of the key ``reconstruct`` in the spec: quaternion or matrix. ``kind`` is the kind of the
    bi-realisation. Raises `SpecError` if π is not Lie–Poisson, or if phigen knows no group for its Lie algebra.
    """
    algebra = system.lie_algebra
    if algebra is None:
        hint = (
            "attitudes need a Lie–Poisson structure, as that of a rigid body or a top; "
            "for other structures, make a quaternion part of the coordinates, as the spec quaternion_top does"
        )
        raise refused(system, f"reconstruct: {requested} needs a linear π, the dual of a Lie algebra; this π is "
                      f"{system.shape}", hint)  # fmt: skip
    return _rotations(system, algebra) if requested == QUATERNION else _matrices(system, algebra, kind)


def refused(system: System, message: str, hint: str = "") -> SpecError:
    """Return a `SpecError` at the key ``reconstruct`` of the spec."""
    return SpecError([Diagnostic(message, system.locations.get(("reconstruct",)), hint)])


def _rotations(system: System, algebra: LieAlgebra) -> Group:
    """Return the group for quaternions: three coordinates that form so(3), and the triples of coordinates that so(3)
    rotates.

    If the algebra consists of so(3) and one vector, it is se(3). Raises `SpecError` unless exactly one triple of
    coordinates forms so(3).
    """
    triples = [(r, s) for r in combinations(range(algebra.dimension), 3) if (s := _sign(algebra, r))]
    if len(triples) != 1:
        count_text = "several such triples" if triples else "no such triple"
        raise refused(
            system,
            f"reconstruct: quaternion needs three coordinates with the brackets of so(3), {{a, b}} = ±c and cyclic, "
            f"such that the other coordinates form an ideal; {algebra.name} has {count_text}",
            "use `reconstruct: matrix`; it needs an algebra with known matrices, and `scheme: series` or `splitting`",
        )
    rotation, sign = triples[0]
    return Group(sign > 0, rotation, _vectors(algebra, rotation, sign), algebra.dimension)


def _sign(algebra: LieAlgebra, triple: tuple[int, ...]) -> int:
    """Return ±1 if the projection on three coordinates is a homomorphism to so(3) with [L_1, L_2] = ±L_3; 0 otherwise.

    The three coordinates have the indices ``triple``; the projection sets all other components to 0.
    """
    products = {(0, 1): 2, (1, 2): 0, (0, 2): 1}
    for sign in (1, -1):
        signs = {(0, 1): sign, (1, 2): sign, (0, 2): -sign}
        if all(
            _components(algebra, i, j, triple)
            == ({products[pair]: signs[pair]} if (pair := (_place(triple, i), _place(triple, j))) in products else {})
            for i, j in combinations(range(algebra.dimension), 2)
        ):
            return sign
    return 0


def _place(triple: Sequence[int], i: int) -> int:
    return triple.index(i) if i in triple else -1


def _components(algebra: LieAlgebra, i: int, j: int, triple: Sequence[int]) -> dict[int, object]:
    """Return the components of [E_i, E_j] along three basis elements, by their positions in ``triple``."""
    row = algebra.bracket(i, j)
    return _by_position({k: c for k, c in row.items() if k in triple}, triple)


def _by_position(row: Mapping[int, Expression], triple: Sequence[int]) -> dict[int, object]:
    """Return the entries of a row, with their indices replaced by positions. The position of an index is its place in
    ``triple``, or −1 if ``triple`` does not contain the index.

    Entries that are numbers become Python numbers.
    """
    return {_place(triple, k): c.value if c.is_number else c for k, c in row.items()}


def _vectors(algebra: LieAlgebra, rotation: Triple, sign: int) -> tuple[Triple, ...]:
    """Return the triples of basis elements that rotations transform as vectors.

    A triple consists of the indices of three basis elements. ``rotation`` is the triple that spans so(3).
    """
    left = [i for i in range(algebra.dimension) if i not in rotation]
    vectors: list[Triple] = []
    for a, b, c in permutations(left, 3):
        if {a, b, c} <= set(left) and _is_vector(algebra, rotation, (a, b, c), sign):
            vectors.append((a, b, c))
            left = [i for i in left if i not in (a, b, c)]
    return tuple(vectors)


def _is_vector(algebra: LieAlgebra, rotation: Triple, translation: Sequence[int], sign: int) -> bool:
    if any(algebra.bracket(i, j) for i, j in combinations(sorted(translation), 2)):
        return False
    if any(k in translation for i, j in combinations(rotation, 2) for k in algebra.bracket(i, j)):
        return False
    for a in range(3):
        for b in range(3):
            c = 3 - a - b
            expected = {} if a == b else {c: sign if (b - a) % 3 == 1 else -sign}
            if _by_position(algebra.bracket(rotation[a], translation[b]), translation) != expected:
                return False
    return True


def _matrices(system: System, algebra: LieAlgebra, kind: str) -> Group:
    """Return the group of matrices that represent the algebra. The sign of the matrices is explained at
    `_signed`.

    Raises `SpecError` if no faithful matrices are known that suit the ``kind`` of the bi-realisation.
    """
    representation = closed_representation(algebra) if kind == "cayley" else known_representation(algebra)
    if representation is None:
        raise refused(
            system,
            f"reconstruct: matrix: no faithful matrices of {algebra.name} are known" + " that are closed under the "
            "Cayley transform" * (kind == "cayley"),
            "give them as lie_algebra: {matrices: […]}, or choose birealisation: exponential",
        )
    size = range(representation.size)
    spatial = _is_spatial(system, algebra)
    matrices = tuple(
        tuple(tuple(_signed(m.get((i, j), ZERO), spatial) for j in size) for i in size) for m in representation.matrices
    )
    return Group(spatial, matrices=matrices)


def _is_spatial(system: System, algebra: LieAlgebra) -> bool:
    """Whether x are momenta in space, not in the body.

    If the spec states π as a Lie algebra, its key ``sign`` decides. Otherwise the signs of the brackets decide for
    so(3), and x of any other algebra count as momenta in the body.
    """
    if isinstance(system.form, LieAlgebraForm):
        return system.form.sign > 0
    return algebra.dimension == 3 and _sign(algebra, (0, 1, 2)) > 0


def _signed(e: Expression, spatial: bool) -> Expression:
    """Return the entry ``e`` of the matrix of a basis element, with the sign for momenta in space or in the
    body.

    The sign is + for momenta in space and − for momenta in the body, so that the matrices represent the bracket.
    """
    return e if spatial else -ONE * e
