"""Kernels: the functions of a program without loops or branches, as expression graphs.

`phigen.scheme.lowering` turns a kernel into a list of assignments.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, auto

from phigen.symbolic.expression import Expression

#: Names of those arguments of kernels whose values are numbers, not arrays: h is the step size or the duration of a
#: flow, t the time.
SCALARS = ("h", "t")

#: Input of a transposed kernel. If coefficients are entries of matrix exponentials exp(tA), this input has the
#: cotangents of the entries of the matrices tA.
EXPONENTS = "exponents_bar"


class Role(Enum):
    """Purpose of a kernel in the step of a lattice. The purpose determines the arrays that the loops around the kernel
    use.
    """

    OTHER = auto()
    SWEEP = auto()  # the increment of a state by a flow
    SWEEP_TANGENT = auto()  # the derivative of SWEEP: the increment of a tangent vector
    RELAX = auto()  # the right-hand side of the implicit equation y = … of a stage
    ADVANCE = auto()  # the increment of the state, from the solution y of a stage
    SLOPE = auto()  # the derivative of RELAX in the direction of a variation of y
    OWN_SLOPE = auto()  # the derivatives of RELAX with respect to y at the same site, as a matrix
    SIDE = auto()  # the derivative of RELAX in the direction of a variation of the start x
    FOLLOW = auto()  # the derivative of ADVANCE in the direction of a variation of y
    GATHER = auto()  # the terms of the sums over the bonds or pairs of a site
    ENERGY = auto()  # the Hamiltonian or a part of it; on lattices, its density at a site
    ENERGY_SLOPE = auto()  # the derivative, along a variation, of the density of a part of H
    CASIMIRS = auto()
    VECTOR_FIELD = auto()
    OBSERVABLES = auto()  # observables that are single numbers; on lattices, their density at a site
    SITE_OBSERVABLES = auto()  # observables that have a value at each site
    TRANSPOSED_SWEEP = auto()
    TRANSPOSED_RELAX = auto()
    TRANSPOSED_ADVANCE = auto()
    TRANSPOSED_GATHER = auto()

    @property
    def is_sweep(self) -> bool:
        """Whether the kernel computes the increment of the fields, or of a tangent vector, by a flow."""
        return self in (Role.SWEEP, Role.SWEEP_TANGENT)

    @property
    def is_stage(self) -> bool:
        """Whether the kernel belongs to a stage on a lattice."""
        is_sweep_or_observable = self.is_sweep or self.is_observable
        return (
            self in (Role.RELAX, Role.ADVANCE, Role.OWN_SLOPE, *_OF_STARTS, *_OF_VARIATIONS)
            and not is_sweep_or_observable
        )

    @property
    def is_observable(self) -> bool:
        """Whether the kernel computes observables, which are not part of a step."""
        fields = (Role.CASIMIRS, Role.VECTOR_FIELD, Role.OBSERVABLES, Role.SITE_OBSERVABLES)
        return self.is_energy or self in fields

    @property
    def is_energy(self) -> bool:
        """Whether the kernel computes the density of an energy, or the derivative of this density."""
        return self in (Role.ENERGY, Role.ENERGY_SLOPE)

    @property
    def is_transposed_stage(self) -> bool:
        """Whether the kernel is the transpose of a kernel of a stage on a lattice."""
        return self in (Role.TRANSPOSED_RELAX, Role.TRANSPOSED_ADVANCE)

    @property
    def transposed(self) -> Role:
        """The role of the transposed kernel. Raises `KeyError` for roles that have no transpose."""
        return Role[f"TRANSPOSED_{self.name}"]


#: Two sets of roles: of kernels that read the state at the start of a stage, and of kernels that read a variation. A
#: variation is a tangent vector of the state.
_OF_STARTS = frozenset({Role.RELAX, Role.SLOPE, Role.SIDE})
_OF_VARIATIONS = frozenset({Role.SWEEP_TANGENT, Role.SLOPE, Role.SIDE, Role.FOLLOW, Role.ENERGY_SLOPE})


@dataclass(frozen=True)
class Output:
    """An array that a kernel fills: ``values`` in row-major order."""

    name: str
    values: tuple[Expression, ...]


@dataclass(frozen=True)
class Kernel:
    """A pure function from named arrays of symbols to named arrays of expressions.

    ``inputs`` maps the name of an argument to the symbols of its entries. ``named`` has sub-expressions that get a name
    in the generated code, such as momenta and second derivatives. ``purpose`` is the comment in generated code.

    The first output may contain matrices A; the generated function then returns exp(A) − 1 in place of A.
    ``exponentials`` has two numbers for each A: the index of its first entry in the output, and its number of rows. The
    transpose of a kernel with exponentials has two inputs for cotangents. ``coef_bar`` has the cotangents of exp(A) −
    1, and `EXPONENTS` the cotangents of the matrices A. The generated code computes `EXPONENTS` from ``coef_bar`` and
    from the matrices A, which the kernel ``exponents`` computes.
    """

    name: str
    purpose: str
    inputs: Mapping[str, tuple[str, ...]]
    outputs: tuple[Output, ...]
    named: tuple[tuple[str, Expression], ...] = ()
    role: Role = Role.OTHER
    exponentials: tuple[tuple[int, int], ...] = ()
    exponents: Kernel | None = None

    @property
    def reads_start(self) -> bool:
        """Whether the kernel reads the state at the start of a stage."""
        return self.role in _OF_STARTS

    @property
    def reads_variations(self) -> bool:
        """Whether the kernel reads a variation, that is, a tangent vector of the state."""
        return self.role in _OF_VARIATIONS

    @property
    def roots(self) -> list[Expression]:
        """The expressions of all outputs as one list, in the order of the outputs."""
        return [v for o in self.outputs for v in o.values]

    def along(self, array: str) -> list[tuple[str, Expression]]:
        """Return pairs of a symbol of the input ``array`` and the cotangent that a transposed kernel computes
        for it.

        The list is empty if the kernel computes no cotangents of this array.
        """
        values = next((o.values for o in self.outputs if o.name == f"{array}_bar"), ())
        return list(zip(self.inputs[array] if values else (), values, strict=True))
