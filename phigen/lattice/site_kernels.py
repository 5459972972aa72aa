"""Kernels that are evaluated at every site of a lattice."""

from __future__ import annotations

from collections.abc import Sequence

from phigen.lattice.cancelling import cancelled
from phigen.lattice.cell import Cell
from phigen.scheme.kernel import Kernel, Output, Role
from phigen.scheme.staging import Coefficients
from phigen.symbolic.expression import Expression, symbols_of
from phigen.symbolic.symbols import BEGINS, CHOSEN, GATHERED, INITIAL, PRESENT, VARIATION, kind_of


def site_kernel(
    cell: Cell,
    name: str,
    purpose: str,
    values: Sequence[Expression],
    output: str,
    coefficients: Coefficients | None = None,
    role: Role = Role.OTHER,
) -> Kernel:
    """Return a kernel at a site.

    The inputs are coefficients or parameters, then the values that the kernel reads at sites, then the weights of
    terms, which are 0 beyond open ends. Powers of a parameter m that may be 0 are combined, so that m/m is 1.
    """
    if cell.vanishing:
        values = cancelled(values, [name for name, (base, _) in cell.places(*values).items() if base in cell.vanishing])
    used_symbols = symbols_of(*values)
    places = cell.places(*values)

    def of_kind(*kinds: str) -> tuple[str, ...]:
        return tuple(n for n in used_symbols if kind_of(n) in kinds)

    common_parameters = tuple(p.name for p in cell.parameters if p.at == "all")
    first = {"coef": coefficients.slots} if coefficients else {"params": common_parameters}
    first |= {"t": cell.times} if cell.time in used_symbols else {}
    weights = of_kind(PRESENT, CHOSEN, BEGINS)
    inputs = {**first, "site": tuple(places), "present": weights, "gathered": of_kind(GATHERED)}
    bonds = tuple(p.name for p in cell.parameters if p.at == "bonds" and p.name in used_symbols)
    inputs |= {"bonds": bonds} if bonds else {}
    inputs |= {"varied": of_kind(VARIATION)} if of_kind(VARIATION) else {}
    inputs |= {"start": of_kind(INITIAL)} if of_kind(INITIAL) else {}
    return Kernel(name, purpose, inputs, (Output(output, tuple(values)),), role=role)
