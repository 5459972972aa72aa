"""The memory layout of a lattice in C, and the switches of the runtime for lattices."""

from __future__ import annotations

from dataclasses import dataclass, replace

from phigen.ir.lattice_loops import LatticeLoops
from phigen.ir.passes.by_rows import RowLayout
from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.steps import Gather, Partners, Sweeps
from phigen.scheme.sweep_facts import (
    band,
    givers,
    handed_apart,
    shares,
    site_blocks,
    starts_are_read,
    takes,
    waves,
    wide,
)
from phigen.scheme.sweep_inverse import can_recompute_fields
from phigen.targets import lattice_values
from phigen.targets.c.language import members

#: Largest number of backward differences that the predictors of all stages store together. Further differences gain
#: little, and each needs an array over all sites.
MOST_REMEMBERED = 14


@dataclass(frozen=True)
class Layout(RowLayout):
    """The layout of the rows of a lattice in memory. ``halo`` is the number of copied sites that are stored beyond each
    end of a row.
    """

    halo: int = 0
    # whether the code has kernels of derivatives along variations (tangent vectors of the fields); if not, these
    # derivatives are computed as difference quotients of sweeps
    slopes: bool = True

    @property
    def program(self) -> Program:
        """The program of the lattice: its kernels, and the stages of a step."""
        return self.lattice.program

    @property
    def step(self) -> Sweeps:
        """The record of the step, with its kernels and its schedule."""
        return self.lattice.step

    def bar(self, array: str) -> int:
        """Return the number of the array of cotangents that belongs to a field, or to a parameter at sites or bonds."""
        return [*self.lattice.arrays, *self.step.sites.at_bonds].index(array)

    @property
    def partners(self) -> Partners:
        """The kernels of sums over bonds or pairs. If ``slopes`` is false, the kernels that differentiate sums along
        variations are left out.
        """
        partners = self.step.others
        return partners if self.slopes else replace(partners, varied=Gather((), ()))

    def gathered(self, kernel: Kernel) -> Gather:
        """Return the sums over bonds or pairs that a kernel of a stage reads."""
        return self.partners.varied if kernel.reads_variations else self.partners.field

    @property
    def graph(self) -> bool:
        """Whether sites are connected by bonds that are given at run time."""
        return self.partners.graph

    @property
    def sums_up(self) -> bool:
        """Whether observables compute sums over bonds in inner loops of their own.

        This is so on graphs if no stage needs the sums. The sums are then not stored for all sites.
        """
        return self.graph and self.step.equation is None


def layout_of(program: Program, step: Sweeps) -> Layout:
    """Return the memory layout of a lattice."""
    lattice, sites = LatticeLoops(program, step), step.sites
    offsets = [offset for _, offset in sites.places.values()]
    offsets += [tuple(map(int, s.key[1:])) for s in lattice.seams]
    offsets += [tuple(-o for o in offset) for offset in offsets] if step.adjoint else []
    lines = dict.fromkeys([(0,) * (len(sites.axes) - 1), *sorted({o[:-1] for o in offsets})])
    halo = max((abs(o[-1]) for o in offsets), default=0)
    slopes = program.profile == "fast" or program.extras.tangent or _banded(program, step) or bool(step.adjoint)
    return Layout(lattice, tuple(lines), members(program), halo, slopes)


def _banded(program: Program, step: Sweeps) -> bool:
    return band(step) > 0 and program.offers("recurrences")


def switches(layout: Layout) -> dict[str, bool]:
    """Return the switches of the C runtime for lattices, by name."""
    program, step = layout.program, layout.step
    banded, weights = _banded(program, step), layout.lattice.weights
    return lattice_values.switches(step) | {
        "CASIMIRS": bool(program.casimirs),
        "KICKED": program.offers("kicks") and program.profile == "fast",
        "OPEN": bool(weights),
        "SPREAD": program.profile == "fast",
        "BESIDE": bool(weights) and program.profile == "fast",
        "BETWEEN": (bool(weights) and program.profile == "fast")
        or any(wide(step.sites, sweep) for part in step.parts for sweep in part)
        or bool(step.sites.seams),
        "OPEN_ROWS": step.sites.open_axes[-1],
        "HALO": layout.halo > 0,
        "PERIODIC_COLOURS": max(step.sites.periods, default=1) > 1,
        "SWEPT": program.profile != "fast",
        "PAIRS": step.partners is not None and not layout.graph,
        "BOND_PARAMETERS": bool(step.sites.at_bonds),
        "DEFAULTS": all(p.values is None for p in program.parameters),
        "NUMBERED": any(p.at == "all" for p in program.parameters),
        "HANDS": any(handed_apart(program, step)),
        "TAKES": takes(program, step),
        "SHARES": shares(step),
        "STARTS": starts_are_read(step),
        "RECOMPUTED": can_recompute_fields(program, step),
        "APART": (program.profile != "fast" or step.sites.colours > 1) and shares(step),
        "GIVERS": givers(step) and (takes(program, step) or any(handed_apart(program, step))),
        "SITE_PARAMETERS": bool(step.sites.parameters),
        "SERIES": step.equation is not None,
        "BANDED": banded,
        "KRYLOV": step.equation is not None and (not banded or program.extras.tangent),
        "SITE_BLOCKS": site_blocks(program, step),
        "BY_HAND": step.is_by_hand and program.offers("by-hand") and not program.compensated,
        "WAVES": waves(program, step),
        "COMPENSATED": program.compensated,
        "SLOPES": layout.slopes,
        "SHARED": bool(step.adjoint)
        or (step.equation is None and (program.profile == "fast" or program.extras.tangent))
        or step.rates is not None,
        "ONE_ROW": len(step.sites.axes) == 1,
        "SWEEP_PREDICTORS": step.equation is not None and program.offers("recurrences"),
    }
