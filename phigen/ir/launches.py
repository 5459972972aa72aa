"""Descriptions of the kernels of a solver on a device, such as a graphics card: plain data with which the runtime
launches them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class EnsembleLaunch:
    """Data for launching the kernel of an ensemble on a device.

    ``group`` is the default number of work items in a work group. ``predictors`` is the number of values that a member
    has in shared memory for its predictor; 0 without a predictor. ``coefficients`` is the number of coefficients that
    members with the same parameters, step and gauge can share; 0 if they share none. ``gauges`` is the number of
    values that are constant for each member: multiples of Casimirs, or the energy level.
    """

    group: int = 0
    predictors: int = 0
    coefficients: int = 0
    gauges: int = 0


@dataclass(frozen=True)
class SumLaunch:
    """Data for launching a kernel that computes sums at each site: over its bonds or, for pairs, over other sites.

    ``values`` is the number of sums at a site. ``of_parameters`` says that the kernel reads parameters in place of
    coefficients. ``end`` and ``chosen`` select bonds of a site, see `phigen.scheme.steps.Ends`.
    """

    kernel: str
    end: str = ""
    chosen: str = ""
    values: int = 1
    of_parameters: bool = False


@dataclass(frozen=True)
class SiteLaunch:
    """Data for launching a kernel over the sites of a lattice. The kernels ``sums`` are launched first: they compute
    the sums that this kernel reads.

    ``outputs`` is the number of outputs of the kernel per site. ``colour``, ``inside`` and ``window`` select sites as
    in `phigen.ir.nodes.Selection`.
    """

    kernel: str
    sums: tuple[SumLaunch, ...] = ()
    outputs: int = 0
    colour: int | None = None
    inside: bool = False
    window: int | None = None


@dataclass(frozen=True)
class LatticeLaunches:
    """Data for launching the kernels of a lattice. ``parts`` has the sweeps of each part of H, and ``others`` has all
    other kernels by name.

    ``arrays`` are the names of the array arguments, which follow the first five arguments of all kernels. ``seams`` has
    the pair (colour, offset) of each `phigen.ir.nodes.OnSeam` that kernels read. ``numbers`` are the parameters with
    one value for all sites, in the order in which kernels receive the values.
    """

    parts: tuple[tuple[SiteLaunch, ...], ...] = ()
    others: Mapping[str, SiteLaunch] = field(default_factory=dict)
    arrays: tuple[str, ...] = ()
    neighbours: tuple[tuple[int, ...], ...] = ()  # offsets of the sites whose fields kernels read
    # for each weight (see `phigen.ir.passes.open_ends`), and each axis: the least and the largest offset at which the
    # term with this weight reads values
    bounds: tuple[tuple[tuple[int, int], ...], ...] = ()
    seams: tuple[tuple[int, tuple[int, ...]], ...] = ()
    numbers: tuple[str, ...] = ()
    # for each observable: its reduction, such as "sum" or "max", and what it runs over: "sites", "bonds" or "pairs"
    reductions: tuple[tuple[str, str], ...] = ()
