"""Descriptions of the kernels of a solver on a device, as plain data from which the runtime launches them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class EnsembleLaunch:
    """The kernel of an ensemble, with the default number of work items in a ``group`` and the sizes of its data.

    ``predictors`` is the number of values of a member in shared memory, or 0. ``coefficients`` is the number of values
    that members with the same parameters, step and gauge can share, or 0. ``gauges`` is the number of factors of a
    gauge.
    """

    group: int = 0
    predictors: int = 0
    coefficients: int = 0
    gauges: int = 0


@dataclass(frozen=True)
class SumLaunch:
    """The kernel of sums over the bonds of each site, or over pairs; ``end`` and ``chosen`` are as in
    `phigen.scheme.steps.Ends`.

    ``values`` is the number of sums at a site. ``of_parameters`` says that the kernel reads parameters, not
    coefficients.
    """

    kernel: str
    end: str = ""
    chosen: str = ""
    values: int = 1
    of_parameters: bool = False


@dataclass(frozen=True)
class SiteLaunch:
    """A kernel over sites, launched after the kernels of the ``sums`` that it reads; ``outputs`` is its number of
    outputs per site.

    ``colour``, ``inside`` and ``window`` select sites as in `phigen.ir.nodes.Selection`.
    """

    kernel: str
    sums: tuple[SumLaunch, ...] = ()
    outputs: int = 0
    colour: int | None = None
    inside: bool = False
    window: int | None = None


@dataclass(frozen=True)
class LatticeLaunches:
    """All kernels of a lattice: the sweeps of each of the ``parts`` of H, and other kernels by name.

    ``arrays`` are the arguments of all kernels after the first five, in order. ``seams`` are the conditions on boundary
    seams, each a colour and an offset. ``numbers`` are the parameters with one value, in the order of kernels.
    """

    parts: tuple[tuple[SiteLaunch, ...], ...] = ()
    others: Mapping[str, SiteLaunch] = field(default_factory=dict)
    arrays: tuple[str, ...] = ()
    neighbours: tuple[tuple[int, ...], ...] = ()  # offsets of the sites whose fields kernels read
    # for each weight at open ends, the least and largest offset of its term along each axis
    bounds: tuple[tuple[tuple[int, int], ...], ...] = ()
    seams: tuple[tuple[int, tuple[int, ...]], ...] = ()
    numbers: tuple[str, ...] = ()
    # for each observable, its reduction, and whether it is over sites, bonds or pairs
    reductions: tuple[tuple[str, str], ...] = ()
