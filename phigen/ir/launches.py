"""Launches of the kernels of a solver on a device, as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class EnsembleLaunch:
    """The kernel of an ensemble: the usual number of work items in a ``group``, and numbers of values.

    ``predictors`` are the values of a member in shared memory, ``coefficients`` those that members with the same
    parameters, step and gauge can share; 0 if there are none. ``gauges`` are the factors of a gauge.
    """

    group: int = 0
    predictors: int = 0
    coefficients: int = 0
    gauges: int = 0


@dataclass(frozen=True)
class SumLaunch:
    """Sums over the bonds of each site, or over pairs; ``end`` and ``chosen`` are those of `phigen.scheme.steps.Ends`.

    ``values`` is the number of sums of a site. Those ``of_parameters`` read parameters in place of coefficients.
    """

    kernel: str
    end: str = ""
    chosen: str = ""
    values: int = 1
    of_parameters: bool = False


@dataclass(frozen=True)
class SiteLaunch:
    """A kernel over sites, after the ``sums`` that it reads; ``outputs`` is the number of its outputs at a site.

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
    """All kernels of a lattice: the sweeps of each of the ``parts`` of H, and others by their names.

    ``arrays`` are the arguments of all kernels after the first five, in order. ``seams`` are the conditions on
    boundary seams, each a colour and an offset; ``numbers`` the parameters with one value, in the order of kernels.
    """

    parts: tuple[tuple[SiteLaunch, ...], ...] = ()
    others: Mapping[str, SiteLaunch] = field(default_factory=dict)
    arrays: tuple[str, ...] = ()
    neighbours: tuple[tuple[int, ...], ...] = ()  # offsets of the sites whose fields kernels read
    bounds: tuple[tuple[tuple[int, int], ...], ...] = ()  # of each weight of a term at open ends, along each axis
    seams: tuple[tuple[int, tuple[int, ...]], ...] = ()
    numbers: tuple[str, ...] = ()
    reductions: tuple[tuple[str, str], ...] = ()  # of each observable, over sites, bonds or pairs
