"""The monitor of lattices in which all pairs of sites interact: steps of equal size in a rescaled time τ.

The Hamiltonian for τ is K = log(A + e) − log(−B), where H = A + B and e = −H(x₀). A and B are sums over all sites and
pairs. A is constant along the flow of A, and B along the flow of B. Therefore the flow of each part of K is the flow of
A or B over another duration; see `phigen.scheme.logarithmic`. The steps in the time t vary, but each step is the same
for all sites.
"""

from __future__ import annotations

from collections.abc import Sequence

from phigen.errors import SpecError
from phigen.geometry.positivity import POSITIVE, sign_of
from phigen.lattice.cell import PAIRS, Cell
from phigen.lattice.site_kernels import site_kernel
from phigen.lattice.site_parts import BondSum, CellFlow
from phigen.lattice.variations import along, varied_sum
from phigen.scheme.kernel import Kernel, Role
from phigen.scheme.logarithmic import fact_of
from phigen.scheme.steps import PartRates
from phigen.spec.model import Spec
from phigen.spec.names import LOGARITHMIC
from phigen.splitting.ring import TIME
from phigen.symbolic.expression import Expression, gradient, symbol, total
from phigen.symbolic.neighbours import ENDS
from phigen.symbolic.readable import shortened
from phigen.symbolic.symbols import GATHERED, Symbol

#: Symbol in kernels of the tangent map: the derivative, along a tangent vector, of the duration of a flow.
LATE = Symbol("late")


def expect_applicable(cell: Cell, spec: Spec) -> None:
    """Raise `SpecError` for a monitor that the spec requests and lattices do not offer."""
    if spec.monitor is None:
        return
    message, hint = "", "remove monitor; then all steps have the same size in time"
    if cell.relation != PAIRS:
        message = (
            "monitor: on lattices it is offered for pairs only; here the fastest site would determine the steps of all"
        )
    elif spec.monitor != LOGARITHMIC:
        message, hint = "monitor: with an expression g, K = g (H + e) has no splitting on lattices", "monitor: log"
    elif spec.scheme == "series":
        message, hint = "monitor: log needs H = A + B split in two", "scheme: splitting"
    elif cell.time or cell.forces or cell.noise:
        feature = "time" if cell.time else "forces" if cell.forces else "noise"
        message = f"monitor: log is not offered with {feature}: e = -H(x0) would not be constant"
    elif spec.extras.adjoint:
        message = "monitor: on lattices, gradients (adjoint) are not offered together with a monitor"
        hint = "phigen show --expand 3 prints an ordinary spec of three sites, which offers gradients"
    if message:
        raise SpecError([spec.diagnostic(("monitor",), message, hint)])


def negative_part(cell: Cell, flows: Sequence[CellFlow], spec: Spec) -> int:
    """Return the index of the negative part B of H = A + B. The monitor contains log(−B).

    A part that is negative at all states is preferred. If there is none, a part that is negative at the initial states
    of all runs is returned. Raises `SpecError` unless there are two parts, one of them negative.
    """
    if len(flows) != 2:
        message = f"monitor: log needs H = A + B of two parts with elementary flows; here there are {len(flows)}"
        raise SpecError(
            [spec.diagnostic(("monitor",), message, "remove monitor; then all steps have the same size in time")]
        )
    for k, flow in enumerate(flows):
        if all(sign_of(-s.expression, _positive(cell, s.expression)) == POSITIVE for s, _ in flow.summands):
            return k
    for k, flow in enumerate(flows):
        energies = [_at_start(cell, flow, spec, name) for name in spec.runs]
        if energies and all(e < 0 for e in energies):
            return k
    parts = ", ".join(f"the sum of {shortened(flow.hamiltonian)}" for flow in flows)
    message = f"monitor: log needs a part that is negative, at least where runs start; the parts are {parts}"
    hint = "write positive: true at parameters that are positive, or subtract a constant from a part in hamiltonian"
    raise SpecError([spec.diagnostic(("monitor",), message, hint)])


def _positive(cell: Cell, e: Expression) -> set[str]:
    """Return the symbols of an expression that are positive by declaration."""
    names = {p.name for p in cell.parameters if p.positive}
    return names | {n for n, (base, _) in cell.places(e).items() if base in names}


def _at_start(cell: Cell, flow: CellFlow, spec: Spec, run: str) -> float:
    """Return the energy of a part of H at the initial state of a run; ``flow`` is the flow of this part."""
    import numpy as np  # numpy is imported here: its import takes as long as the compilation of a small system

    from phigen.lattice.states import start_of
    from phigen.symbolic.arrays import evaluate

    start = start_of(spec, spec.runs[run])
    arrays = {**start.parameters, **dict(zip(cell.fields, start.state, strict=True))}
    first, second = np.triu_indices(start.sizes[0], 1)
    energy = 0.0
    for summand, _ in flow.summands:
        values = dict(arrays)
        for name, (base, offset) in cell.places(summand.expression).items():
            array = np.broadcast_to(arrays[base], start.sizes)
            values[name] = array[(first, second)[ENDS.index(str(offset[0]))]] if summand.bond else array
        count = len(first) if summand.bond else start.sizes[0]
        energy += float(np.broadcast_to(evaluate([summand.expression], values)[0], count).sum())
    return energy


def rates_of(
    cell: Cell, flows: Sequence[CellFlow], negative: int, *, tangent: bool
) -> tuple[PartRates, list[tuple[str, BondSum]]]:
    """Return the kernels that compute the energies A and B of the two parts of H, and the sums over pairs in these
    energies.

    Each sum comes with the name of its kernel. If ``tangent``, kernels and sums for the derivatives of the energies
    along a tangent vector are added.
    """
    energies, slopes, sums = list[Kernel](), list[Kernel](), list[tuple[str, BondSum]]()
    sum_symbol = Symbol(GATHERED, "energy")
    for k, flow in enumerate(flows, 1):
        at_site, of_pair = (total(s.expression for s, _ in flow.summands if s.bond == bond) for bond in (False, True))
        name, purpose = f"part{k}", f"the density of H_{k}"
        energies.append(site_kernel(cell, name, purpose, [at_site], "out", role=Role.ENERGY))
        sums.append((name, BondSum({sum_symbol: of_pair})))
        if tangent:
            name, purpose = f"part{k}_slope", f"{purpose}, along a variation"
            slopes.append(site_kernel(cell, name, purpose, along(cell, [at_site]), "out", role=Role.ENERGY_SLOPE))
            (slope,) = along(cell, [of_pair])
            sums.append((name, BondSum({varied_sum(sum_symbol): slope})))
    first, second = energies
    return PartRates((first, second), negative, tuple(slopes)), sums


def fact(flows: Sequence[CellFlow], negative: int) -> str:
    """Return the line that describes the monitor in the header of generated files."""
    return fact_of(f"the sum of {shortened(flows[negative].hamiltonian)}")


def delayed(increments: Sequence[Expression], slopes: Sequence[Expression]) -> list[Expression]:
    """Return the derivatives, along a tangent vector, of the increments of a flow whose duration depends on the state.

    ``slopes`` are the derivatives at a fixed duration. The symbol `LATE` stands for the derivative of the duration.
    """
    rates = (gradient(e, [TIME])[0] for e in increments)
    return [slope + rate * symbol(LATE) for slope, rate in zip(slopes, rates, strict=True)]
