"""Construction of the `Cell` from a spec with the key ``lattice``. All checks on such a spec are made here."""

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
    """A number of sites that is not a multiple of the period of the colours.

    ``size`` is the number of sites along an axis in a run. ``fitting`` is a multiple of ``period`` near ``size``.
    """

    run: str
    axis: str
    size: int
    period: int
    fitting: int

    def __str__(self) -> str:
        return f"{self.size} along {self.axis} is not a multiple of {self.period}"


class MisfitError(SpecError):
    """Error for runs in which the number of sites along an axis is not a multiple of the period of the colours.

    ``reason`` names these numbers in one line.
    """

    def __init__(self, diagnostics: list[Diagnostic], reason: str = "") -> None:
        super().__init__(diagnostics)
        self.reason = reason


def cell_from_spec(spec: Spec) -> Cell:
    """Return the cell of a lattice spec: the fields, brackets and energy densities of one site.

    Raises `SpecError` if lattices do not offer the kind of brackets, forces or noise that the spec has, or if a run has
    fewer sites along an axis than a term spans.
    """
    lattice = spec.lattice
    if lattice is None:
        raise ValueError(f"{spec.name} is not a lattice")
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
    diagnostics = [
        *_not_along_bonds(spec, cell),
        *_noise_beyond(spec, cell),
        *(d for run in spec.runs.values() for d in _too_small(spec, cell, run)),
    ]
    if diagnostics:
        raise SpecError(diagnostics)
    return cell


def least_sizes(cell: Cell) -> tuple[int, ...]:
    """Return the least number of sites along each axis of a grid.

    On a grid of these sizes no site is its own neighbour, and each term of H, π and the observables fits between open
    ends.
    """
    reaches = zip(cell.hamiltonian_reach, cell.poisson_reach, cell.observed_reach, strict=True)
    return tuple(1 + max(reach) for reach in reaches)


def expect_coloured(spec: Spec, cell: Cell, periods: Sequence[int]) -> None:
    """Raise `MisfitError` if a size of a run is not a multiple of the period of the colours. ``periods`` has the period
    along each axis.
    """
    if wrong_sizes := misfits(spec, cell, periods):
        raise MisfitError(misfit_diagnostics(spec, wrong_sizes))


def misfits(spec: Spec, cell: Cell, periods: Sequence[int]) -> list[Misfit]:
    """Return the sizes in all runs that are not multiples of the period of the colours. ``periods`` has the period
    along each axis.
    """
    return [
        Misfit(run.name, axis, size, period, max(size // period, -(-least // period)) * period)
        for run in spec.runs.values()
        for axis, size, period, least in zip(
            cell.axes, run.lattice.sizes if run.lattice else (), periods, least_sizes(cell), strict=False
        )
        if size % period
    ]


def misfit_diagnostics(spec: Spec, wrong_sizes: Sequence[Misfit]) -> list[Diagnostic]:
    """Return an error for each size that is not a multiple of the period of the colours. The error points to the size
    in the spec.
    """
    return [
        spec.diagnostic(
            ("runs", m.run, "sizes"),
            f"sizes: {m}, as the splitting of this lattice requires",
            f"for example {m.fitting}; scheme: series works for every size",
        )
        for m in wrong_sizes
    ]


def misfit_reason(wrong_sizes: Sequence[Misfit], colours: int) -> str:
    """Return one line for the header of generated files: which sizes do not fit the colours of sites, and which sizes
    near them fit.

    ``colours`` is the number of colours of the splitting. The result is "" if there are no ``wrong_sizes``.
    """
    distinct = {str(m): str(m.fitting) for m in wrong_sizes}
    requirement = f"as a splitting with {colours} colours needs; {' and '.join(distinct.values())} would do"
    return f"{' and '.join(distinct)}, {requirement}" if wrong_sizes else ""


def seam_reason(wrong_sizes: Sequence[Misfit]) -> str:
    """Return one line for the header of generated files. It names all sizes that need a boundary seam.

    A seam is needed if a size is not a multiple of the period of the colours. For each size, the line also has a
    multiple of the period near the size.
    """
    distinct = {str(m): str(m.fitting) for m in wrong_sizes}
    return f"{' and '.join(distinct)}; {' and '.join(distinct.values())} would need no seam"


def _local(spec: Spec) -> dict[tuple[str, str], Expression]:
    matrix = poisson_matrix(spec.poisson, spec.coordinates, algebra_of_form(spec.poisson, spec.coordinates))
    rows = zip(spec.coordinates, matrix, strict=True)
    return {(f, g): e for f, row in rows for g, e in zip(spec.coordinates, row, strict=True) if not e.is_zero}


def _completed(spec: Spec, lattice: Lattice) -> dict[tuple[str, str], Expression]:
    """Return the brackets between different sites in both orders; a spec states each of them in one order only."""
    at_sites = (p.name for p in spec.parameters if p.at == "sites")
    neighbours = Neighbours((*spec.coordinates, *at_sites), lattice.axes)
    brackets: dict[tuple[str, str], Expression] = {}
    for (f, g), value in lattice.brackets.items():
        brackets[f, g] = value
        if lattice.axes:
            base, offset = neighbours.place(g)
            mirrored = neighbours.shifted([neg(value)], minus(offset))[0]
            brackets[base, neighbours.at(f, minus(offset))] = mirrored
        else:
            brackets[g, f] = neg(value)
    return {pair: e for pair, e in brackets.items() if not e.is_zero}


def _not_along_bonds(spec: Spec, cell: Cell) -> Iterator[Diagnostic]:
    """Yield an error for forces and noise that a spec with brackets along bonds cannot have.

    With brackets along bonds, the motion πp that a force p causes at a site is a sum over bonds. phigen does not
    compute this sum for covector forces, damping and noise.
    """
    declared = {("damping",): spec.forces.damping is not None, ("forces", "covector"): bool(spec.forces.covector)}
    for path, is_declared in {**declared, ("noise",): bool(spec.noise)}.items():
        if is_declared and cell.bond_bracket:
            message = f"{path[-1]}: not offered together with poisson: bonds"
            yield spec.diagnostic(path, message, "use forces: {vector: …}, which can be combined with poisson: bonds")


def _noise_beyond(spec: Spec, cell: Cell) -> Iterator[Diagnostic]:
    """Yield an error for each source of noise whose Hamiltonian depends on neighbouring sites."""
    for name, source in spec.noise.items():
        if any(offset != cell.origin for _, offset in cell.places(source.hamiltonian).values()):
            message = f"noise: {name} acts at single sites, so its Hamiltonian must not name neighbours"
            hint = "write a function of the coordinates of one site; each site receives increments of its own"
            yield spec.diagnostic(("noise", name, "hamiltonian"), message, hint)


def _too_small(spec: Spec, cell: Cell, run: Run) -> Iterator[Diagnostic]:
    """Yield an error for each size of a run that is smaller than the least size (see `least_sizes`)."""
    sizes = run.lattice.sizes if run.lattice else ()
    for axis, size, least in zip(cell.axes, sizes, least_sizes(cell), strict=False):
        if size < least:
            message = f"sizes: {size} along {axis} is too small: neighbours are up to {least - 1} sites away"
            yield spec.diagnostic(("runs", run.name, "sizes"), message, f"sizes along {axis} are at least {least}")
