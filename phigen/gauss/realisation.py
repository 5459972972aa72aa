"""Realisations of systems for Gauss methods: choices of unknowns with which a step is a Poisson map.

Coordinates with constant brackets are unknowns themselves, since Gauss methods are symplectic. Coordinates with the
brackets of a Lie algebra are functions of a group element G (`phigen.gauss.star_algebra`). G is 1 at the start of each
step, and the method is applied to G. Coordinates whose logarithms have constant brackets are written as exponentials of
unknowns (`phigen.gauss.logarithms`). Gauss methods preserve quadratic first integrals and constant two-forms, and
commute with linear maps. The space of group elements has a constant two-form, so the step of G preserves this two-form.
Therefore the step of x is exactly a Poisson map, and preserves all Casimirs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from phigen.gauss.enveloping import enveloping
from phigen.gauss.lift import Copy, quaternion_copies
from phigen.gauss.logarithms import Rates, logarithmic
from phigen.gauss.matrices import of_matrices
from phigen.gauss.quaternionic import quaternionic
from phigen.gauss.square_zero import square_zero_ideal
from phigen.gauss.star_algebra import StarAlgebra, Vector
from phigen.geometry.blocks import blocks
from phigen.geometry.lie_algebra import LieAlgebra
from phigen.geometry.linear import kernel
from phigen.geometry.representations import indecomposable_parts, restricted
from phigen.geometry.shapes import Affine, Canonical, Constant, LiePoisson, Matrix, Shape, recognise
from phigen.geometry.system import System
from phigen.symbolic.expression import ONE, ZERO, Expression


@dataclass(frozen=True)
class Plain:
    """Part of a system: the coordinates ``indices``, which are themselves unknowns of the Gauss method.

    If their brackets are not constant, a step is a Poisson map only up to the order of the method.
    """

    indices: tuple[int, ...]


@dataclass(frozen=True)
class LogarithmicBlock:
    """Part of a system: the coordinates ``indices``, whose logarithms are unknowns of the Gauss method.

    Brackets of the logarithms with each other and with plain coordinates are constant. ``rates`` maps (i, j) to the
    bracket {log x_i, x_j}.
    """

    indices: tuple[int, ...]
    rates: Rates


@dataclass(frozen=True)
class AlgebraBlock:
    """Part of a system: the coordinates ``indices``, which have the brackets of the Lie algebra ``lie``. The unknown is
    a group element G.

    The functions x_i + ``shift``_i are a momentum map of the star algebra ``algebra`` (see
    `phigen.gauss.star_algebra`). If ``central`` is set, the last basis element of the Lie algebra has no coordinate:
    its value is the constant 1. ``ideal`` lists the basis elements of a square-zero ideal, or is () if there is none.
    Functionals replace the components of G along the ideal (`phigen.gauss.square_zero`). ``copies`` lists copies of the
    quaternions if G starts from a frame F in place of 1 (`phigen.gauss.lift`), else it is ().
    """

    indices: tuple[int, ...]
    algebra: StarAlgebra
    lie: LieAlgebra
    shift: tuple[Expression, ...]
    central: bool = False
    ideal: tuple[int, ...] = ()
    copies: tuple[Copy, ...] = ()

    @property
    def subalgebra(self) -> tuple[int, ...]:
        """The basis elements of the star algebra that are not in ``ideal``. The components of G along these elements
        are unknowns.
        """
        return tuple(i for i in range(self.algebra.dimension) if i not in self.ideal)

    @property
    def unknowns(self) -> int:
        """The number of unknowns at a stage."""
        return 2 * len(self.subalgebra) if self.ideal else self.algebra.dimension


Part = Plain | LogarithmicBlock | AlgebraBlock


@dataclass(frozen=True)
class Realisation:
    """The parts of a system, with their unknowns for a Gauss method.

    ``exact`` says whether the step is a Poisson map exactly, and not only up to the order of the method.
    """

    parts: tuple[Part, ...]
    exact: bool

    @property
    def groups(self) -> tuple[AlgebraBlock, ...]:
        """The parts whose unknowns are group elements."""
        return tuple(part for part in self.parts if isinstance(part, AlgebraBlock))

    @property
    def logarithms(self) -> tuple[LogarithmicBlock, ...]:
        """The parts whose unknowns are logarithms."""
        return tuple(part for part in self.parts if isinstance(part, LogarithmicBlock))

    @property
    def with_elements(self) -> Realisation:
        """The realisation in which all components of the group elements are unknowns. No functional λ replaces
        components (`phigen.gauss.square_zero`).
        """
        parts = (replace(part, ideal=()) if isinstance(part, AlgebraBlock) else part for part in self.parts)
        return Realisation(tuple(parts), self.exact)

    @property
    def lifted(self) -> Realisation | None:
        """The realisation with frames F for all group elements; see `phigen.gauss.lift`.

        None if the system has no group elements, or if a group element has no frame.
        """
        parts: list[Part] = []
        for part in self.parts:
            copies = quaternion_copies(part.algebra) if isinstance(part, AlgebraBlock) and not part.central else ()
            if isinstance(part, AlgebraBlock) and not copies:
                return None
            parts.append(replace(part, copies=copies) if isinstance(part, AlgebraBlock) else part)
        return Realisation(tuple(parts), self.exact) if self.groups else None

    @property
    def label(self) -> str:
        """The kind of the method as text for users."""
        if not self.exact:
            return "Gauss collocation, π preserved up to the truncation error"
        kinds = ["collective"] * bool(self.groups) + ["in logarithms"] * bool(self.logarithms)
        return ", ".join(["Gauss collocation", " and ".join(kinds)] if kinds else ["Gauss collocation"])


def direct(system: System) -> Realisation:
    """Return the realisation in which all coordinates are unknowns. The step of this realisation is exactly a Poisson
    map if π is constant.
    """
    constant = isinstance(system.shape, Constant | Canonical)
    return Realisation((Plain(tuple(range(system.dimension))),), constant)


def collective(system: System) -> Realisation | None:
    """Return a realisation with which a Gauss step is exactly a Poisson map; None if phigen knows none."""
    parts = _parts(system.coordinates, system.poisson, system.shape)
    return None if parts is None else Realisation(tuple(_merged_parts(parts)), True)


def _parts(coordinates: Sequence[str], poisson: Matrix, shape: Shape) -> list[Part] | None:
    """Divide the coordinates into parts with which a step is a Poisson map; None if phigen knows none.

    If the shape of π is unknown, the blocks of π are treated separately.
    """
    everything = tuple(range(len(coordinates)))
    if isinstance(shape, Constant | Canonical):
        return [Plain(everything)]
    rates = logarithmic(coordinates, poisson)
    if rates is not None:
        scaled = sorted({i for i, _ in rates})
        plain_indices = tuple(i for i in everything if i not in scaled)
        return [*([Plain(plain_indices)] if plain_indices else []), LogarithmicBlock(tuple(scaled), rates)]
    parts: list[Part] = []
    for indices, algebra, central in _components(shape):
        part = _part(indices, algebra, central=central)
        if part is None:
            return None
        parts.append(part)
    return parts or _parts_of_blocks(coordinates, poisson)


def _parts_of_blocks(coordinates: Sequence[str], poisson: Matrix) -> list[Part] | None:
    """Return the parts of all diagonal blocks of π. Coordinates of a block have no brackets with those of other
    blocks.

    Returns None if π is one block, or if phigen knows no parts for a block.
    """
    blocks_of_poisson = blocks(coordinates, poisson)
    if len(blocks_of_poisson) < 2:
        return None
    parts: list[Part] = []
    for block in blocks_of_poisson:
        names = [coordinates[i] for i in block]
        entries = tuple(tuple(poisson[i][j] for j in block) for i in block)
        block_parts = _parts(names, entries, recognise(names, entries))
        if block_parts is None:
            return None
        parts += [_with_global_indices(part, block) for part in block_parts]
    return parts


def _with_global_indices(part: Part, block: Sequence[int]) -> Part:
    """Return a part with indices among all coordinates of the system. In ``part``, indices count the coordinates of a
    block.

    ``block`` maps the old indices to the new ones.
    """
    indices = tuple(block[i] for i in part.indices)
    if isinstance(part, LogarithmicBlock):
        return LogarithmicBlock(indices, {(block[i], block[j]): rate for (i, j), rate in part.rates.items()})
    return replace(part, indices=indices)


def _merged_parts(parts: Sequence[Part]) -> Iterator[Part]:
    """Yield at most one `Plain` part, then at most one `LogarithmicBlock`, then each `AlgebraBlock`.

    All `Plain` parts are merged into one, and all `LogarithmicBlock` parts are merged into one.
    """
    plain_indices = [i for part in parts if isinstance(part, Plain) for i in part.indices]
    if plain_indices:
        yield Plain(tuple(sorted(plain_indices)))
    logarithms = [part for part in parts if isinstance(part, LogarithmicBlock)]
    if logarithms:
        indices = sorted(i for part in logarithms for i in part.indices)
        yield LogarithmicBlock(
            tuple(indices), {index: rate for part in logarithms for index, rate in part.rates.items()}
        )
    yield from (part for part in parts if isinstance(part, AlgebraBlock))


def _components(shape: Shape) -> Iterator[tuple[list[int], LieAlgebra, bool]]:
    """Yield the indecomposable parts of a linear or affine Poisson structure.

    Each part is a triple: the indices of its coordinates, its Lie algebra, and whether the last basis element of the
    Lie algebra stands for the constant 1.
    """
    if isinstance(shape, LiePoisson):
        for indices in indecomposable_parts(shape.algebra):
            yield indices, restricted(shape.algebra, indices), False
    if isinstance(shape, Affine):
        extension = shape.extension
        unit_index = extension.dimension - 1
        linear = {ij: {k: c for k, c in row.items() if k != unit_index} for ij, row in extension.constants.items()}
        # A constant bracket couples its two coordinates as well. So that `indecomposable_parts` sees this, a multiple
        # of the first coordinate takes the place of the constant.
        completed = {ij: row or {ij[0]: ONE} for ij, row in linear.items()}
        for indices in indecomposable_parts(LieAlgebra("", unit_index, completed)):
            pairs = [ij for ij in extension.constants if set(ij) <= set(indices)]
            if any(unit_index in extension.constants[ij] for ij in pairs):
                yield indices, restricted(extension, [*indices, unit_index]), True
            else:
                yield indices, restricted(extension, indices), False


def _part(indices: Sequence[int], lie: LieAlgebra, *, central: bool) -> Part | None:
    """Return the part for some coordinates with the brackets of a Lie algebra. Returns None if phigen knows no star
    algebra for the Lie algebra (see `phigen.gauss.star_algebra`).
    """
    last = len(indices)
    if all(set(row) <= {last} for row in lie.constants.values()):  # all brackets are constant
        return Plain(tuple(indices))
    shift = _shift(lie, last) if central else [ZERO] * last
    if shift is not None:
        lie, central = _without_constants(lie, last), False
    algebra = star_algebra(lie)
    if algebra is None:
        return None
    ideal = square_zero_ideal(algebra)
    return AlgebraBlock(tuple(indices), algebra, lie, tuple(shift or [ZERO] * last), central, ideal)


def star_algebra(lie: LieAlgebra) -> StarAlgebra | None:
    """Return a star algebra for a Lie algebra: an associative algebra with an involution *, whose skew elements (a* =
    −a) contain the Lie algebra. Returns None if phigen knows none.
    """
    return quaternionic(lie) or of_matrices(lie) or enveloping(lie)


def _without_constants(lie: LieAlgebra, last: int) -> LieAlgebra:
    constants = {ij: {k: c for k, c in row.items() if k != last} for ij, row in lie.constants.items() if last not in ij}
    return LieAlgebra(lie.name, last, {ij: row for ij, row in constants.items() if row}, None, lie.labels[:last])


def _shift(lie: LieAlgebra, last: int) -> list[Expression] | None:
    """Return constants s_k such that affine brackets of the coordinates x_k are linear in x_k + s_k.

    With the linear terms c_ij^k, the brackets are {x_i, x_j} = Σ_k c_ij^k (x_k + s_k). ``last`` is the index of the
    basis element that stands for the constant 1. Returns None if there are no such s_k.
    """
    field = lie.field
    rows: list[Vector] = []
    for row in lie.constants.values():
        equation = {k: field.convert(c) for k, c in row.items() if k != last}
        if last in row:
            equation[last] = -field.convert(row[last])
        rows.append(equation)
    solution = next((v for v in kernel(field, rows, last + 1) if last in v), None)
    return None if solution is None else [field.expression(solution.get(k, field.zero)) for k in range(last)]
