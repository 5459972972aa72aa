"""Functions in lanes: which of them loops over lanes can call without leaving vector instructions."""

from __future__ import annotations

from collections.abc import Iterable, Set
from fractions import Fraction

from phigen.scheme.kernel import Kernel
from phigen.scheme.lowering import expand_powers
from phigen.symbolic.expression import Expression, topological
from phigen.symbolic.functions import FUNCTIONS

#: Functions with a version of their own for the loops over lanes, and those that are formulas of these.
LANE_FUNCTIONS = tuple(f.name for f in FUNCTIONS.values() if f.lanes == f.name)
LANE_FORMULAS = {f.name: f.lanes for f in FUNCTIONS.values() if f.lanes not in ("", f.name)}

#: Those that are polynomials where their arguments are small, as in flows: phigen's own, then those of libraries.
NEAR_FUNCTIONS = tuple(f.name for f in sorted(FUNCTIONS.values(), key=lambda f: (f.written and f.name) or "") if f.near)

#: Those whose versions for lanes have values wherever there is use for them. exp has not, beyond 700, nor has log of 0.
REACHING = (*NEAR_FUNCTIONS, "cos")

#: Powers that are left after lowering and call no function.
_ARITHMETIC = (Fraction(2), Fraction(-1), Fraction(1, 2))


def operations(kernels: Iterable[Kernel]) -> set[str]:
    """What kernels call, arithmetic included."""
    return {e.op for e in topological(roots_of(kernels))}


def roots_of(kernels: Iterable[Kernel]) -> list[Expression]:
    """The expressions of all outputs."""
    return [e for kernel in kernels for e in kernel.roots]


def with_formulas(ops: Set[str]) -> frozenset[str]:
    """These operations, and the functions in lanes that formulas for them call."""
    called = (f for f in LANE_FUNCTIONS for op in ops & set(LANE_FORMULAS) if f"{{{f}}}" in LANE_FORMULAS[op])
    return frozenset({*ops, *called})


def library_calls(ops: Set[str]) -> set[str]:
    """The operations that can only be made by calls to functions of the library, one lane after the other."""
    known = {*LANE_FUNCTIONS, *LANE_FORMULAS}
    return {f.name for f in FUNCTIONS.values() if f.name in ops and f.written and not f.inline} - known


def library_powers(kernels: Iterable[Kernel]) -> bool:
    """Whether there are powers that only the library can compute."""
    return any(e.op == "pow" and e.value not in _ARITHMETIC for e in topological(expand_powers(roots_of(kernels))))
