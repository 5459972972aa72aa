"""Interfaces of generated solvers: names, sizes and features that the runtime needs, and the errors of back ends."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phigen.ir.launches import EnsembleLaunch, LatticeLaunches

Floats = NDArray[np.float64]

#: Function that is called from time to time with the number of steps done so far.
Progress = Callable[[int], Any]


#: Names of NAME_status in C, by value, without the prefix.
STATUSES = ("OK", "NO_CONVERGENCE", "SINGULAR", "NOT_FINITE", "BAD_ARGUMENT")


def status_name(value: int) -> str:
    """Return the name of a status of the C, without its prefix."""
    return STATUSES[value] if value < len(STATUSES) else f"STATUS_{value}"


@dataclass(frozen=True)
class Draws:
    """Selection of a trajectory's random numbers: ``seed``, ``member``, and the number of its first ``step``."""

    seed: int = 0
    member: int = 0
    step: int = 0


#: The random numbers of a trajectory by default.
FIRST_DRAWS = Draws()


@dataclass(frozen=True)
class Interface:
    """Names, sizes and features of a generated solver; names are in the order of declaration."""

    name: str  # prefix of the symbols of the C code
    coordinates: tuple[str, ...]
    order: int
    parameters: Mapping[str, float]  # defaults
    positive: frozenset[str] = frozenset()  # the parameters that must be positive
    nonnegative: frozenset[str] = frozenset()  # the parameters that must be 0 or positive
    casimirs: tuple[str, ...] = ()
    time: str = ""  # the name of the time, "" if the Hamiltonian does not depend on it
    moving: frozenset[str] = frozenset()  # the names among energy and Casimirs whose values time or forces change
    monitored: bool = False  # whether steps are equal in τ, not in t
    attitude: tuple[int, ...] = ()  # the shape of the attitude, () if the spec reconstructs none
    position: bool = False  # whether the spec reconstructs a position too
    noise: tuple[str, ...] = ()  # names of the sources of noise
    draws: int = 0  # number of increments of the noise in a step
    single: bool = False  # whether the C computes in single precision
    observables: tuple[str, ...] = ()
    # launch parameters of the ensemble kernel on devices
    ensemble: EnsembleLaunch = field(default_factory=EnsembleLaunch)

    @property
    def dimension(self) -> int:
        """The number of coordinates."""
        return len(self.coordinates)

    @property
    def element(self) -> int:
        """The number of values of an attitude and a position together."""
        return math.prod(self.attitude) + 3 * self.position if self.attitude else 0


@dataclass(frozen=True)
class LatticeInterface(Interface):
    """Interface of the solver of a lattice, whose states have the shape (coordinates, *sizes).

    ``coordinates`` are those of one site. Parameters in ``at_sites`` have a value at each site, those in ``at_bonds``
    at each bond of a graph. An entry of ``casimir_kinds`` is ``sites`` for a Casimir of each site, ``sum`` or
    ``product`` for one over all sites. Sizes are multiples of ``periods``, and at least ``least``.
    """

    axes: tuple[str, ...] = ()
    at_sites: tuple[str, ...] = ()
    casimir_kinds: tuple[str, ...] = ()
    periods: tuple[int, ...] = ()
    least: tuple[int, ...] = ()
    required: frozenset[str] = frozenset()  # parameters at sites and bonds whose default is an array
    first_open: bool = False  # whether the first axis has open ends
    open_axes: tuple[bool, ...] = ()
    colour_period: int = 1  # number of planes of the first axis after which the colouring of sites repeats
    graph: bool = False
    pairs: bool = False  # whether every pair of sites interacts
    compensated: bool = False  # whether the C stores a compensation term for each field
    at_bonds: tuple[str, ...] = ()
    masses: str = ""  # parameter with the masses of bodies in relative coordinates, the first of which is positive
    observed_fields: tuple[str, ...] = ()  # observables with a value at each site
    colours: int = 1
    # colour of a site: the sum of weights times position, modulo the number of colours
    colour_weights: tuple[int, ...] = ()
    launches: LatticeLaunches = field(default_factory=LatticeLaunches)  # launch parameters of the kernels on devices
    slow_steps: bool = False  # whether recomputing a step takes longer than writing and reading its tape

    def is_shared(self, sites: int) -> bool:
        """Whether threads share the work on a lattice of ``sites`` sites, by the thresholds of the C runtime."""
        return sites > (512 if self.pairs else 4096)


@dataclass
class Clock:
    """The time as a function of the number of steps.

    It is t + (steps − counted)·h, where ``t`` and ``counted`` are the time and the number of steps at the last change
    of the step size. So rounding errors do not accumulate.
    """

    t: float = 0.0
    h: float = 0.0
    counted: int = 0

    def after(self, steps: int) -> float:
        """Return the time after a number of steps."""
        return self.t + (steps - self.counted) * self.h

    def set_step(self, h: float, steps: int) -> None:
        """Change the step size to h, after a number of steps."""
        if h != self.h:
            self.t, self.h, self.counted = self.after(steps), h, steps


class BackendError(Exception):
    """A step failed inside a back end; `phigen.runtime.solver` turns this into the user's `StepError`.

    ``states`` are the rows up to the failure; the last row is the state before the failing step. For an ensemble they
    are the last states of all members. ``step`` is the number of successful steps, −1 if unknown. ``failures`` maps
    each failed member to its status.
    """

    def __init__(
        self,
        status: str,
        step: int,
        states: Floats,
        members: tuple[int, ...] = (),
        failures: Mapping[int, str] | None = None,
    ) -> None:
        super().__init__(status)
        self.status, self.step, self.states, self.members = status, step, states, members
        self.failures = failures if failures is not None else dict.fromkeys(members, status)


class MissingExtraError(Exception):
    """The generated code was built without the requested function."""


def row_steps(steps: int, stride: int) -> NDArray[np.int64]:
    """Return the numbers of the steps that are stored: 0, stride, 2·stride, …, and the last."""
    rows = np.arange(0, steps + 1, stride, dtype=np.int64)
    return rows if rows[-1] == steps else np.append(rows, steps)
