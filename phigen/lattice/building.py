"""From a spec with ``lattice:`` to its `Cell`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from phigen.errors import Diagnostic, SpecError
from phigen.geometry.forms import algebra_of_form, poisson_matrix
from phigen.lattice.cell import Cell
from phigen.spec.model import Lattice, Run, Spec
from phigen.symbolic.expression import ZERO, Expression, neg
from phigen.symbolic.neighbours import Neighbours, minus


@dataclass(frozen=True)
class Misfit:
    """A size of a run that is no multiple of the period of the colours along an axis; ``fitting`` is one near it."""

    run: str
    axis: str
    size: int
    period: int
    fitting: int

    def __str__(self) -> str:
        return f"{self.size} along {self.axis} is no multiple of {self.period}"


class MisfitError(SpecError):
    """Sizes of runs are no multiples of the periods of colours; ``since`` says it in one line, as `since_of` does."""

    def __init__(self, diagnostics: list[Diagnostic], since: str = "") -> None:
        super().__init__(diagnostics)
        self.since = since


def cell_from_spec(spec: Spec) -> Cell:
    """The cell of a spec. Raises `SpecError` where a form of π does not fit, or a run is too small for the stencil."""
    lattice = spec.lattice
    if lattice is None:
        raise ValueError(f"{spec.name} is no lattice")
    brackets = _completed(spec, lattice)
    cell = Cell(
        spec.name,
        spec.coordinates,
        spec.hamiltonian,
        _local(spec) | (brackets if lattice.axes else {}),
        lattice.relation,
        lattice.axes,
        lattice.boundary,
        spec.parameters,
        ZERO if lattice.pairs else lattice.bonds,
        lattice.bonds if lattice.pairs else ZERO,
        {} if lattice.axes else brackets,
        {name: (density, lattice.kinds[name]) for name, density in spec.casimirs.items()},
        spec.invariants,
        spec.time,
        spec.forces,
        spec.noise,
        spec.observables,
        lattice.reductions,
    )
    problems = [
        *_not_along_bonds(spec, cell),
        *_noise_beyond(spec, cell),
        *(d for run in spec.runs.values() for d in _too_small(spec, cell, run)),
    ]
    if problems:
        raise SpecError(problems)
    return cell


def least_sizes(cell: Cell) -> tuple[int, ...]:
    """The sizes that a grid has at least: no site is its own neighbour, and an open one has room for all of H and π.

    There is room for what is observed, too.
    """
    reaches = zip(cell.hamiltonian_reach, cell.poisson_reach, cell.observed_reach, strict=True)
    return tuple(1 + max(reach) for reach in reaches)


def expect_coloured(spec: Spec, cell: Cell, periods: Sequence[int]) -> None:
    """Raises `MisfitError` for runs whose sizes are no multiples of the periods of the colours of a splitting."""
    if found := misfits(spec, cell, periods):
        raise MisfitError(told_at(spec, found))


def misfits(spec: Spec, cell: Cell, periods: Sequence[int]) -> list[Misfit]:
    """The sizes of runs that are no multiples of the periods."""
    return [
        Misfit(run.name, axis, size, period, max(size // period, -(-least // period)) * period)
        for run in spec.runs.values()
        for axis, size, period, least in zip(
            cell.axes, run.lattice.sizes if run.lattice else (), periods, least_sizes(cell), strict=False
        )
        if size % period
    ]


def told_at(spec: Spec, found: Sequence[Misfit]) -> list[Diagnostic]:
    """What is said of each of them at its place."""
    return [
        spec.diagnostic(
            ("runs", m.run, "sizes"),
            f"sizes: {m}, as the colours of the splitting need",
            f"for example {m.fitting}; scheme: series takes every size",
        )
        for m in found
    ]


def since_of(found: Sequence[Misfit], colours: int) -> str:
    """All of them in one line, with sizes for a splitting with so many ``colours``; nothing if there are none."""
    distinct = {str(m): str(m.fitting) for m in found}
    needed = f"as a splitting with {colours} colours needs; {' and '.join(distinct.values())} would do"
    return f"{' and '.join(distinct)}, {needed}" if found else ""


def since_seam(found: Sequence[Misfit]) -> str:
    """All of them in one line, where colours take them by a seam."""
    distinct = {str(m): str(m.fitting) for m in found}
    return f"{' and '.join(distinct)}; {' and '.join(distinct.values())} would do without"


def _local(spec: Spec) -> dict[tuple[str, str], Expression]:
    matrix = poisson_matrix(spec.poisson, spec.coordinates, algebra_of_form(spec.poisson, spec.coordinates))
    rows = zip(spec.coordinates, matrix, strict=True)
    return {(f, g): e for f, row in rows for g, e in zip(spec.coordinates, row, strict=True) if not e.is_zero}


def _completed(spec: Spec, lattice: Lattice) -> dict[tuple[str, str], Expression]:
    """The brackets of different sites in both orders."""
    at_sites = (p.name for p in spec.parameters if p.at == "sites")
    neighbours = Neighbours((*spec.coordinates, *at_sites), lattice.axes)
    both: dict[tuple[str, str], Expression] = {}
    for (f, g), value in lattice.brackets.items():
        both[f, g] = value
        if lattice.axes:
            base, offset = neighbours.place(g)
            mirrored = neighbours.shifted([neg(value)], minus(offset))[0]
            both[base, neighbours.at(f, minus(offset))] = mirrored
        else:
            both[g, f] = neg(value)
    return {pair: e for pair, e in both.items() if not e.is_zero}


def _not_along_bonds(spec: Spec, cell: Cell) -> Iterator[Diagnostic]:
    """What would have to be gathered along the bonds that brackets run along."""
    given = {("damping",): spec.forces.damping is not None, ("forces", "covector"): bool(spec.forces.covector)}
    for path, there in {**given, ("noise",): bool(spec.noise)}.items():
        if there and cell.bond_bracket:
            message = f"{path[-1]}: not with brackets along bonds"
            yield spec.diagnostic(path, message, "forces: {vector: …} moves sites by themselves")


def _noise_beyond(spec: Spec, cell: Cell) -> Iterator[Diagnostic]:
    """Sources of noise that are not those of one site."""
    for name, source in spec.noise.items():
        if any(offset != cell.origin for _, offset in cell.places(source.hamiltonian).values()):
            message = f"noise: {name} is that of a site, so its Hamiltonian names no neighbours"
            hint = "each site has increments of its own, for a function of its own coordinates"
            yield spec.diagnostic(("noise", name, "hamiltonian"), message, hint)


def _too_small(spec: Spec, cell: Cell, run: Run) -> Iterator[Diagnostic]:
    """The sizes of a run that the stencil does not fit in."""
    sizes = run.lattice.sizes if run.lattice else ()
    for axis, size, least in zip(cell.axes, sizes, least_sizes(cell), strict=False):
        if size < least:
            message = f"sizes: {size} along {axis} is too small: neighbours are up to {least - 1} sites away"
            yield spec.diagnostic(("runs", run.name, "sizes"), message, f"sizes along {axis} are at least {least}")
