"""Kernels: the straight-line functions that a program consists of, as expression graphs.

`phigen.scheme.lowering` turns one into a list of assignments.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, auto

from phigen.symbolic.expression import Expression

#: Arguments of kernels that are numbers, not arrays: the step, or the time of a flow; the time.
SCALARS = ("h", "t")

#: The input of a transpose that holds the cotangents of matrices whose exponentials are taken.
EXPONENTS = "exponents_bar"


class Role(Enum):
    """Purpose of a kernel at a site of a lattice, by which loops choose the arrays that they read and write."""

    OTHER = auto()
    SWEEP = auto()  # the change of a state by a flow
    SWEEP_TANGENT = auto()  # its derivative, the change of a variation
    RELAX = auto()  # the right-hand side of the equation of a stage
    ADVANCE = auto()  # what the stage adds to the state
    SLOPE = auto()  # the derivative of RELAX along a variation of y
    OWN_SLOPE = auto()  # its part at the site itself, as a matrix
    SIDE = auto()  # the derivative of RELAX along a variation of x
    FOLLOW = auto()  # the derivative of ADVANCE along a variation of y


#: Kernels that read the start of a stage, and those that read variations.
_OF_STARTS = frozenset({Role.RELAX, Role.SLOPE, Role.SIDE})
_OF_VARIATIONS = frozenset({Role.SWEEP_TANGENT, Role.SLOPE, Role.SIDE, Role.FOLLOW})


@dataclass(frozen=True)
class Output:
    """An array that a kernel fills: ``values`` in row-major order."""

    name: str
    values: tuple[Expression, ...]


@dataclass(frozen=True)
class Kernel:
    """A pure function from named vectors of symbols to named arrays.

    ``inputs`` maps the name of an argument to the symbols that its entries stand for. ``named`` are values
    worth a name of their own in the output (momenta, second derivatives).

    ``exponentials`` are the parts of the first output, by start and number of rows, that hold a matrix A, in whose
    place exp(A) − 1 is returned. Of the transpose of such a kernel, ``exponents`` computes these A one after the other;
    their cotangents, from those of exp(A) − 1 in the input ``coef_bar``, are the input `EXPONENTS`.
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
        """Whether the loop of the kernel has the start of a stage at hand."""
        return self.role in _OF_STARTS

    @property
    def reads_variations(self) -> bool:
        """Whether the loop of the kernel has a variation at hand."""
        return self.role in _OF_VARIATIONS

    @property
    def roots(self) -> list[Expression]:
        """The expressions of all outputs, in order."""
        return [v for o in self.outputs for v in o.values]

    def along(self, array: str) -> list[tuple[str, Expression]]:
        """Of a transpose: the symbols of an input with their cotangents."""
        values = next((o.values for o in self.outputs if o.name == f"{array}_bar"), ())
        return list(zip(self.inputs[array] if values else (), values, strict=True))
