"""Kernels: the straight-line functions that a program consists of, as expression graphs.

`phigen.scheme.lowering` turns one into a list of assignments.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from phigen.symbolic.expression import Expression

#: Arguments of kernels that are numbers, not arrays: the step, or the time of a flow; the time.
SCALARS = ("h", "t")


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
    """

    name: str
    purpose: str
    inputs: Mapping[str, tuple[str, ...]]
    outputs: tuple[Output, ...]
    named: tuple[tuple[str, Expression], ...] = ()

    @property
    def roots(self) -> list[Expression]:
        """The expressions of all outputs, in order."""
        return [v for o in self.outputs for v in o.values]

    def along(self, array: str) -> list[tuple[str, Expression]]:
        """Of a transpose: the symbols of an input with their cotangents."""
        values = next((o.values for o in self.outputs if o.name == f"{array}_bar"), ())
        return list(zip(self.inputs[array] if values else (), values, strict=True))
