"""Where the values of a lattice are in memory, and what of the runtime it needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from phigen.ir.lattice_loops import LatticeLoops, begins, weights
from phigen.ir.passes.by_rows import RowLayout
from phigen.scheme.kernel import Kernel, Role
from phigen.scheme.program import Program
from phigen.scheme.staging import TABLE
from phigen.scheme.steps import Gather, Partners, Sweep, Sweeps
from phigen.scheme.sweep_inverse import can_recompute_fields, once, transposes
from phigen.symbolic.expression import symbols_of
from phigen.symbolic.symbols import AROUND, Symbol
from phigen.targets import lattice
from phigen.targets.c.kernels import members

#: Differences that predictions of all stages are extrapolated from: more gain little and are arrays over sites.
MOST_REMEMBERED = 14

#: Diagonals of a matrix beside its own that elimination is for.
MOST_BAND = 64


@dataclass(frozen=True)
class Layout:
    """Where things are: lines are rows beside a row, by their offsets; halo the sites that are copied beside it."""

    step: Sweeps
    lines: tuple[tuple[int, ...], ...]
    halo: int
    weights: tuple[Symbol, ...]
    arrays: tuple[str, ...]
    slopes: bool = True  # whether code has how sweeps follow variations, or takes differences of them

    def loops(self, program: Program) -> LatticeLoops:
        """Return the builder of the loops."""
        return LatticeLoops(program, self.step)

    def rows(self, program: Program) -> RowLayout:
        """Return the rows that loops read."""
        return RowLayout(self.loops(program), self.lines, members(program))

    def reserved(self, program: Program, stores: int) -> set[str]:
        """Return the numbered identifiers that a loop with some stores uses."""
        shares = {f"share{k}" for k in range(self.step.row + len(program.parameters))}
        shares |= {f"{word}{k}" for word in ("add", "own") for k in range(stores)}
        return shares | {f"there{k}" for k in range(len(self.weights))}

    def line(self, offset: Sequence[int]) -> int:
        """The line of a neighbour."""
        return self.lines.index(tuple(offset[:-1]))

    def at(self, line: int, row: str = "row->") -> str:
        """Return the term that leads from the beginning of an array to a line beside a row; empty with one axis."""
        return f" + {row}at[{line}]" if len(self.step.sites.axes) > 1 else ""

    def swept(self, piece: str = "row.from, row.to") -> str:
        """The bounds of the sites that were swept, as the copies of ends beside a row need them: of many rows all."""
        return "0, s->length" if len(self.step.sites.axes) > 1 else piece

    def place(self, line: int) -> str:
        """Where a line is, beside the row that is worked at."""
        axes = zip(self.step.sites.axes, self.lines[line], strict=False)
        return ", ".join(f"{axis} {offset:+d}".replace("+", "+ ").replace("-", "- ") for axis, offset in axes if offset)

    def bar(self, array: str) -> int:
        """The number of the cotangents of a field, or of a parameter at sites or bonds."""
        return [*self.arrays, *self.step.sites.at_bonds].index(array)

    def leaves_out(self, colour: int | None) -> bool:
        """Whether what is done at sites of a colour, or without one at all of them, leaves out others."""
        return self.step.sites.colours > 1 and colour is not None

    @property
    def colour_step(self) -> int:
        """The distance in a row from a site to the next of its colour."""
        sites = self.step.sites
        return next(k for k in range(1, sites.colours + 1) if k * sites.weights[-1] % sites.colours == 0)

    @property
    def reach(self) -> int:
        """Distance of the farthest neighbour in the equation of a stage, of a lattice with one axis."""
        relax = self.step.equation.relax if self.step.equation else None
        places = [self.step.sites.places[s] for s in relax.inputs["site"]] if relax else []
        return max((abs(offset[-1]) for f, offset in places if f not in self.step.sites.parameters), default=0)

    @property
    def band(self) -> int:
        """Diagonals beside that of its matrix, site by site; 0 where it is not solved by elimination."""
        equation, sites = self.step.equation, self.step.sites
        if not equation or self.step.partners or len(sites.axes) > 1:
            return 0
        band = (self.reach + 1) * len(equation.relax.roots) - 1
        return band if band <= MOST_BAND else 0

    @property
    def partners(self) -> Partners:
        """Bonds or pairs, with their variations where these are followed; nothing where there are none."""
        partners = self.step.others
        return partners if self.slopes else replace(partners, varied=Gather((), ()))

    def gathered(self, kernel: Kernel) -> Gather:
        """Return the sums over bonds or pairs that a kernel of the equation of a stage reads."""
        return self.partners.varied if kernel.reads_variations else self.partners.field

    @property
    def graph(self) -> bool:
        """Whether bonds are given at run time."""
        return self.partners.graph

    @property
    def sums_up(self) -> bool:
        """Whether what is seen at a site adds up what bonds add to it by itself: where no stage needs these sums."""
        return self.graph and self.step.equation is None


def layout_of(program: Program, step: Sweeps) -> Layout:
    """The layout of a lattice."""
    sites = step.sites
    offsets = [offset for _, offset in sites.places.values()]
    offsets += [tuple(map(int, s.key[1:])) for s in begins(step)]
    offsets += [tuple(-o for o in offset) for offset in offsets] if step.adjoint else []
    lines = dict.fromkeys([(0,) * (len(sites.axes) - 1), *sorted({o[:-1] for o in offsets})])
    halo = max((abs(o[-1]) for o in offsets), default=0)
    arrays = (*program.coordinates, *sites.parameters, *sites.increments)
    layout = Layout(step, tuple(lines), halo, weights(program, step), arrays)
    banded = layout.band > 0 and program.offers("recurrences")
    return replace(layout, slopes=program.profile == "fast" or program.extras.tangent or banded or bool(step.adjoint))


def switches(program: Program, step: Sweeps, layout: Layout) -> dict[str, bool]:
    """The switches of the runtime for lattices."""
    banded = layout.band > 0 and program.offers("recurrences")
    return lattice.switches(step) | {
        "CASIMIRS": bool(program.casimirs),
        "KICKED": program.offers("kicks") and program.profile == "fast",
        "OPEN": bool(layout.weights),
        "SPREAD": program.profile == "fast",
        "BESIDE": bool(layout.weights) and program.profile == "fast",
        "BETWEEN": (bool(layout.weights) and program.profile == "fast")
        or any(wide(layout, sweep) for part in step.parts for sweep in part)
        or bool(step.sites.seams),
        "OPEN_ROWS": step.sites.open[-1],
        "HALO": layout.halo > 0,
        "PERIODIC_COLOURS": max(step.sites.periods, default=1) > 1,
        "SWEPT": program.profile == "small",
        "PAIRS": step.partners is not None and not layout.graph,
        "BOND_PARAMETERS": bool(step.sites.at_bonds),
        "NUMBERED": any(p.at == "all" for p in program.parameters),
        "HANDS": any(handed_apart(program, step)),
        "TAKES": takes(program, step),
        "SHARES": shares(step),
        "STARTS": starts_are_read(step),
        "UNDONE": can_recompute_fields(program, step),
        "APART": (program.profile == "small" or step.sites.colours > 1) and shares(step),
        "GIVERS": givers(step) and (takes(program, step) or any(handed_apart(program, step))),
        "SITE_PARAMETERS": bool(step.sites.parameters),
        "SERIES": step.equation is not None,
        "BANDED": banded,
        "KRYLOV": step.equation is not None and (not banded or program.extras.tangent),
        "SITE_BLOCKS": site_blocks(program, step, layout),
        "BY_HAND": step.is_by_hand and program.offers("by-hand") and not program.compensated,
        "WAVES": waves(program, step),
        "COMPENSATED": program.compensated,
        "SLOPES": layout.slopes,
        "SHARED": bool(step.adjoint)
        or (step.equation is None and (program.profile == "fast" or program.extras.tangent)),
        "ONE_ROW": len(step.sites.axes) == 1,
        "GUESSES": step.equation is not None and program.offers("recurrences"),
    }


def wide(layout: Layout, sweep: Sweep) -> bool:
    """Whether a sweep over a row may go on to the end of its last vector, since what lies beside is copied afresh."""
    sites = layout.step.sites
    return len(sites.axes) > 1 and sites.colours == 1 and not sweep.gather and not sweep.is_tangent


def chosen_ends(step: Sweeps) -> set[str]:
    """At which ends of the bonds that sweeps add up there may be the sites of a colour."""
    gathers = (sweep.gather for part in step.parts for sweep in part if sweep.gather)
    return {ends.chosen for gather in gathers for ends in gather.ends}


def site_blocks(program: Program, step: Sweeps, layout: Layout) -> bool:
    """Whether Krylov spaces are those of the matrix times the inverses of its blocks at sites: for grids."""
    return step.equation is not None and step.partners is None and not layout.band and program.profile == "fast"


def waves(program: Program, step: Sweeps) -> bool:
    """Whether several flows are made at once: of grids, where what a flow reads lies beside."""
    split = step.equation is None and step.partners is None and not step.sites.seams
    return split and len(step.schedule.flows) > 1 and program.noise is None and program.profile == "fast"


@once
def hands(program: Program, step: Sweeps) -> list[bool]:
    """Tell for each part of H whether its transpose passes cotangents to other sites."""
    passes: list[bool] = []
    if step.equation and step.adjoint:
        kernels = [kernel for kernel in step.adjoint.steps if "sums_bar" not in kernel.inputs]
        read = [pair for kernel in kernels for pair in kernel.along("site")]
        summed = any(kernel.inputs["gathered"] for kernel in kernels)
        return [summed or any(any(step.sites.places[s][1]) and not e.is_zero for s, e in read)]
    for part, kernels in zip(step.parts, transposes(program, step), strict=False):
        read = [(s, e) for kernel in kernels for s, e in kernel.along("site")]
        beside = any(any(step.sites.places[s][1]) and not e.is_zero for s, e in read)
        passes.append(beside or any(sweep.gather for sweep in part))
    return passes


def takes(program: Program, step: Sweeps) -> bool:
    """Whether what a flow hands to sites of a grid on the way back is taken by the loop of the next: in long code."""
    if program.profile == "small" or step.partners or step.sites.colours > 1 or not can_recompute_fields(program, step):
        return False
    kernels = [kernel for part in transposes(program, step) for kernel in part]
    alone = all(len(part) == 1 for part in step.parts) and not any(kernel.inputs.get(AROUND) for kernel in kernels)
    return alone and any(hands(program, step))


def handed_apart(program: Program, step: Sweeps) -> list[bool]:
    """Tell for each part of H whether separate loops add the cotangents that its sweeps pass to other sites.

    Where the loop of the next flow adds them, that is the first flow only, which is the last in the reverse pass."""
    first = step.schedule.flows[0][0] if takes(program, step) else None
    return [passes and first in (None, k) for k, passes in enumerate(hands(program, step))]


def ways(step: Sweeps) -> list[tuple[int, int]]:
    """List for each flow of a step its part and the part of the flow after it.

    The first flow is listed once more, for where it is merged with the last flow of the step before."""
    parts = [part for part, _ in step.schedule.flows]
    after = [*parts[1:], parts[1 % len(parts)]]
    return [*zip(parts, after, strict=True), (parts[0], parts[1 % len(parts)])]


def shares(step: Sweeps) -> bool:
    """Whether loops over sites have shares in sums over all of them: the cotangents of coefficients, or parameters."""
    kernels = step.adjoint.steps if step.adjoint else ()
    kernels = tuple(kernel for kernel in kernels if "sums_bar" not in kernel.inputs)
    summed = [kernel.along(array) for kernel in kernels for array in (TABLE, "params") if array in kernel.inputs]
    return any(not e.is_zero for along in summed for _, e in along)


def givers(step: Sweeps) -> bool:
    """Whether rows that hand something to a row are not those that it reads, since beyond open ends there are none."""
    return any(step.sites.open[:-1])


def starts_are_read(step: Sweeps) -> bool:
    """Whether the transpose of a stage reads x at its start, beside y."""
    relax = next((k for k in step.adjoint.steps if k.role is Role.TRANSPOSED_RELAX), None) if step.adjoint else None
    return relax is not None and not {*relax.inputs.get("start", ())}.isdisjoint(symbols_of(*relax.roots))
