"""Kernels: the straight-line functions of a program, as expression graphs.

`phigen.scheme.lowering` turns a kernel into a list of assignments.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, auto

from phigen.symbolic.expression import Expression

#: Arguments of kernels that are numbers, not arrays: h is the step or the duration of a flow, t the time.
SCALARS = ("h", "t")

#: Input of a transposed kernel: the cotangents of matrices whose exponentials are taken.
EXPONENTS = "exponents_bar"


class Role(Enum):
    """Purpose of a kernel and of the function that contains its loops; loops derive from it the arrays that they
    use."""

    OTHER = auto()
    SWEEP = auto()  # the increment of a state by a flow
    SWEEP_TANGENT = auto()  # the derivative of SWEEP: the increment of a variation
    RELAX = auto()  # the right-hand side of the equation of a stage
    ADVANCE = auto()  # the increment of the state by a stage
    SLOPE = auto()  # the derivative of RELAX along a variation of y
    OWN_SLOPE = auto()  # the part of SLOPE from the same site, as a matrix
    SIDE = auto()  # the derivative of RELAX along a variation of x
    FOLLOW = auto()  # the derivative of ADVANCE along a variation of y
    GATHER = auto()  # terms of sums over bonds or pairs
    ENERGY = auto()  # the Hamiltonian or a part of it, or its density
    ENERGY_SLOPE = auto()  # the derivative of the density of a part along a variation
    CASIMIRS = auto()
    VECTOR_FIELD = auto()
    OBSERVABLES = auto()  # observables that are numbers, or their densities
    SITE_OBSERVABLES = auto()  # observables that are fields
    TRANSPOSED_SWEEP = auto()
    TRANSPOSED_RELAX = auto()
    TRANSPOSED_ADVANCE = auto()
    TRANSPOSED_GATHER = auto()

    @property
    def is_sweep(self) -> bool:
        """Whether the kernel computes the increments of a state or of a variation."""
        return self in (Role.SWEEP, Role.SWEEP_TANGENT)

    @property
    def is_stage(self) -> bool:
        """Whether the kernel belongs to the equation of a stage."""
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
        """Whether the kernel computes the density of an energy, or its derivative; bonds and pairs add to such
        densities."""
        return self in (Role.ENERGY, Role.ENERGY_SLOPE)

    @property
    def is_transposed_stage(self) -> bool:
        """Whether the kernel is the transpose of a kernel of the equation of a stage."""
        return self in (Role.TRANSPOSED_RELAX, Role.TRANSPOSED_ADVANCE)

    @property
    def transposed(self) -> Role:
        """The role of the transpose. Raises `KeyError` for roles without one."""
        return Role[f"TRANSPOSED_{self.name}"]


#: Roles of kernels that read the start of a stage, and of those that read variations.
_OF_STARTS = frozenset({Role.RELAX, Role.SLOPE, Role.SIDE})
_OF_VARIATIONS = frozenset({Role.SWEEP_TANGENT, Role.SLOPE, Role.SIDE, Role.FOLLOW, Role.ENERGY_SLOPE})


@dataclass(frozen=True)
class Output:
    """An array that a kernel fills: ``values`` in row-major order."""

    name: str
    values: tuple[Expression, ...]


@dataclass(frozen=True)
class Kernel:
    """A pure function from named vectors of symbols to named arrays.

    ``inputs`` maps the name of an argument to the symbols of its entries. ``named`` are values that get a name in the
    generated code (momenta, second derivatives).

    ``exponentials`` are parts of the first output, given by start and number of rows, that hold a matrix A; the
    generated function returns exp(A) − 1 in its place. In the transpose of such a kernel, ``exponents`` computes the
    matrices A one after the other. The input `EXPONENTS` has the cotangents of the A, which follow from those of exp(A)
    − 1 in the input ``coef_bar``.
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
        """Whether the kernel reads the start of a stage."""
        return self.role in _OF_STARTS

    @property
    def reads_variations(self) -> bool:
        """Whether the kernel reads a variation."""
        return self.role in _OF_VARIATIONS

    @property
    def roots(self) -> list[Expression]:
        """The expressions of all outputs, in order."""
        return [v for o in self.outputs for v in o.values]

    def along(self, array: str) -> list[tuple[str, Expression]]:
        """Return, for a transposed kernel, the symbols of the input ``array``, each with its cotangent."""
        values = next((o.values for o in self.outputs if o.name == f"{array}_bar"), ())
        return list(zip(self.inputs[array] if values else (), values, strict=True))
