"""Versions of elementary functions for loops over SIMD lanes. A loop that calls other functions is not vectorised by
compilers.
"""

from __future__ import annotations

from collections.abc import Iterable, Set
from fractions import Fraction

from phigen.scheme.kernel import Kernel
from phigen.scheme.lowering import expand_powers
from phigen.symbolic.expression import Expression, topological
from phigen.symbolic.functions import FUNCTIONS

#: LANE_FUNCTIONS have a vector version. LANE_FORMULAS maps other functions to formulas that call LANE_FUNCTIONS.
LANE_FUNCTIONS = tuple(f.name for f in FUNCTIONS.values() if f.lanes == f.name)
LANE_FORMULAS = {f.name: f.lanes for f in FUNCTIONS.values() if f.lanes not in ("", f.name)}

#: Functions for which flows have a polynomial for small arguments: first those that phigen defines, then those of
#: libraries.
SMALL_ARGUMENT_FUNCTIONS = tuple(
    f.name for f in sorted(FUNCTIONS.values(), key=lambda f: (f.written and f.name) or "") if f.near
)

#: Functions whose vector version, if there is one, is called for arguments of any size. The vector versions of sin and
#: cos return NaN beyond 10⁸, since the reduction of larger arguments modulo π is not exact. The list omits exp and log:
#: the vector version of exp fails beyond 700, and that of log at 0.
FULL_RANGE_FUNCTIONS = (*SMALL_ARGUMENT_FUNCTIONS, "cos")

#: Exponents of the powers that need no library function: squares, reciprocals and square roots.
_ARITHMETIC = (Fraction(2), Fraction(-1), Fraction(1, 2))


def operations(kernels: Iterable[Kernel]) -> set[str]:
    """Return the names of all operations in kernels: arithmetic operations and functions."""
    return {e.op for e in topological(roots_of(kernels))}


def roots_of(kernels: Iterable[Kernel]) -> list[Expression]:
    """Return the expressions of all outputs of kernels."""
    return [e for kernel in kernels for e in kernel.roots]


def with_formulas(ops: Set[str]) -> frozenset[str]:
    """Return the operations ``ops``, together with the vector functions that their formulas call."""
    called = (f for f in LANE_FUNCTIONS for op in ops & set(LANE_FORMULAS) if f"{{{f}}}" in LANE_FORMULAS[op])
    return frozenset({*ops, *called})


def library_calls(ops: Set[str]) -> set[str]:
    """Return the operations that are library functions without a vector version. They are called for each lane
    separately.
    """
    known = {*LANE_FUNCTIONS, *LANE_FORMULAS}
    return {f.name for f in FUNCTIONS.values() if f.name in ops and f.written and not f.inline} - known


def library_powers(kernels: Iterable[Kernel]) -> bool:
    """Whether a power in the kernels needs a library function."""
    return any(e.op == "pow" and e.value not in _ARITHMETIC for e in topological(expand_powers(roots_of(kernels))))
