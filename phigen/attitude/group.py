"""The group of a step: the rotations of so(3), the motions of se(3), or the matrices of a representation.

On the dual of a Lie algebra a step x₀ → x₁ is the coadjoint action of one group element, τ of the covector p. Its
product along a trajectory is the attitude g. Two conventions, by the sign of the bracket:

- minus, x the momenta in the body: ġ = g·Ω with Ω = ∇H, g takes body to space, the momentum in space is constant
- plus, x the momenta in space: ġ = Ω·g, g takes body to space, the momentum in the body is constant
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

#: The values of ``reconstruct``.
QUATERNION, MATRIX = "quaternion", "matrix"

Triple = tuple[int, int, int]
Dense = tuple[tuple[Expression, ...], ...]


@dataclass(frozen=True)
class Group:
    """A group and its algebra, with covectors of ``dimension`` components.

    ``spatial`` says that x are momenta in space: elements are multiplied from the left. ``matrices``, one for each
    component, exist if the attitude is a matrix; otherwise the components of ``rotation`` make quaternions, and
    ``vectors`` are the vectors that they rotate.
    """

    spatial: bool
    rotation: Triple = (0, 1, 2)
    vectors: tuple[Triple, ...] = ()
    dimension: int = 3
    matrices: tuple[Dense, ...] = ()

    @property
    def translation(self) -> tuple[int, ...]:
        """The components that translate, if the algebra is se(3)."""
        return self.vectors[0] if self.dimension == 6 and len(self.vectors) == 1 else ()

    @property
    def kind(self) -> str:
        """``quaternion``, ``pose`` (quaternion and position) or ``matrix``."""
        return MATRIX if self.matrices else "pose" if self.translation else QUATERNION

    @property
    def rows(self) -> int:
        """Number of rows of a matrix; 0 for quaternions."""
        return len(self.matrices[0]) if self.matrices else 0

    @property
    def size(self) -> int:
        """Number of entries of an element: 4, 4 + 3, or those of a square matrix."""
        return self.rows**2 or (7 if self.translation else 4)

    @property
    def orthogonal(self) -> bool:
        """Whether elements are quaternions or orthogonal matrices, those of skew ones."""
        return all((m[i][j] + m[j][i]).is_zero for m in self.matrices for i in range(len(m)) for j in range(len(m)))

    def generator(self, p: Sequence[Expression]) -> list[Expression]:
        """Σ p_i E_i, the entries row by row."""
        size = range(self.rows)
        return [
            total(pi * m[i][j] for pi, m in zip(p, self.matrices, strict=True) if not (pi.is_zero or m[i][j].is_zero))
            for i in size
            for j in size
        ]


def group_of(system: System, requested: str, kind: str) -> Group:
    """The group of a Lie–Poisson π; ``kind`` is that of the bi-realisation. Raises `SpecError` where there is none."""
    algebra = system.lie_algebra
    if algebra is None:
        hint = "attitudes need a Lie–Poisson structure, as that of a rigid body or a top"
        raise refused(system, f"reconstruct: {requested} needs a linear π, the dual of a Lie algebra; this π is "
                      f"{system.shape}", hint)  # fmt: skip
    return _rotations(system, algebra) if requested == QUATERNION else _matrices(system, algebra, kind)


def refused(system: System, message: str, hint: str = "") -> SpecError:
    """The error at the key of the spec."""
    return SpecError([Diagnostic(message, system.locations.get(("reconstruct",)), hint)])


def _rotations(system: System, algebra: LieAlgebra) -> Group:
    """Three coordinates of so(3); with three of its vectors, and nothing else, se(3)."""
    triples = [(r, s) for r in combinations(range(algebra.dimension), 3) if (s := _sign(algebra, r))]
    if len(triples) != 1:
        count_text = "there are several" if triples else "there are none"
        raise refused(
            system,
            f"reconstruct: quaternion needs three coordinates with the brackets of so(3), {{a, b}} = ±c and cyclic, "
            f"and all others together an ideal; {count_text} in {algebra.name}",
            "reconstruct: matrix works for every algebra with known matrices, with scheme: series or splitting",
        )
    rotation, sign = triples[0]
    return Group(sign > 0, rotation, _vectors(algebra, rotation, sign), algebra.dimension)


def _sign(algebra: LieAlgebra, triple: tuple[int, ...]) -> int:
    """±1 if x ↦ (x_i, x_j, x_k) is a homomorphism to so(3) with [L_1, L_2] = ±L_3, else 0."""
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
    """The components of [E_i, E_j] along a triple."""
    row = algebra.bracket(i, j)
    return _numbers({k: c for k, c in row.items() if k in triple}, triple)


def _numbers(row: Mapping[int, Expression], triple: Sequence[int]) -> dict[int, object]:
    """The entries of a row by their positions in a triple, or −1; numbers unchanged."""
    return {_place(triple, k): c.value if c.is_number else c for k, c in row.items()}


def _vectors(algebra: LieAlgebra, rotation: Triple, sign: int) -> tuple[Triple, ...]:
    """The coordinates of the vectors that are rotated."""
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
            if _numbers(algebra.bracket(rotation[a], translation[b]), translation) != expected:
                return False
    return True


def _matrices(system: System, algebra: LieAlgebra, kind: str) -> Group:
    """The matrices of the named algebra, with its sign; for so(3) in any notation, rotations with its sign."""
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
    """Whether momenta are in space: by the sign in the spec; without one, by brackets of so(3), else in the body."""
    if isinstance(system.form, LieAlgebraForm):
        return system.form.sign > 0
    return algebra.dimension == 3 and _sign(algebra, (0, 1, 2)) > 0


def _signed(e: Expression, spatial: bool) -> Expression:
    """Matrices represent the bracket; where elements are multiplied from the right, it takes the negative ones."""
    return e if spatial else -ONE * e
