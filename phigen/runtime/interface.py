"""Interfaces of generated solvers (names, sizes and features that the runtime needs), and the errors of failing
steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phigen.ir.launches import EnsembleLaunch, LatticeLaunches

Floats = NDArray[np.float64]

#: Function that an integration calls from time to time, with the number of steps done so far.
Progress = Callable[[int], Any]


#: Names of the constants of the C enumeration NAME_status, by value, without the prefix NAME_.
STATUSES = ("OK", "NO_CONVERGENCE", "SINGULAR", "NOT_FINITE", "BAD_ARGUMENT")


def status_name(value: int) -> str:
    """Return the name of a status code of the generated C, without the prefix; ``STATUS_9`` for the unknown code 9."""
    return STATUSES[value] if value < len(STATUSES) else f"STATUS_{value}"


@dataclass(frozen=True)
class Draws:
    """Selection of a trajectory's random numbers: ``seed``, ``member``, and the number of its first ``step``."""

    seed: int = 0
    member: int = 0
    step: int = 0


#: Default selection of random numbers: those of seed 0 and member 0, from step 0 on.
FIRST_DRAWS = Draws()


@dataclass(frozen=True)
class Interface:
    """Names, sizes and features of a generated solver; names are in the order of their declaration in the spec."""

    name: str  # name of the system, the prefix of the symbols of the C code
    coordinates: tuple[str, ...]
    order: int
    parameters: Mapping[str, float]  # name → default value
    positive: frozenset[str] = frozenset()  # the parameters that must be positive
    nonnegative: frozenset[str] = frozenset()  # the parameters that must be 0 or positive
    casimirs: tuple[str, ...] = ()
    time: str = ""  # the name of the time, "" if the Hamiltonian does not depend on it
    moving: frozenset[str] = frozenset()  # ``energy`` and Casimirs, if forces or a time-dependent H change their values
    monitored: bool = False  # whether a monitor rescales time by dt = g dτ: steps are equal in τ, not in t
    attitude: tuple[int, ...] = ()  # the shape of the attitude, () if the spec reconstructs none
    position: bool = False  # whether the spec reconstructs a position too
    noise: tuple[str, ...] = ()  # names of the sources of noise
    draws: int = 0  # number of random increments that a step with noise uses
    single: bool = False  # whether the C computes in single precision
    observables: tuple[str, ...] = ()
    # launch parameters of the kernel that integrates ensembles on graphics cards
    ensemble: EnsembleLaunch = field(default_factory=EnsembleLaunch)

    @property
    def dimension(self) -> int:
        """The number of coordinates."""
        return len(self.coordinates)

    @property
    def element(self) -> int:
        """The number of values that describe an attitude and a position together; 0 if the spec reconstructs
        neither."""
        return math.prod(self.attitude) + 3 * self.position if self.attitude else 0


@dataclass(frozen=True)
class LatticeInterface(Interface):
    """Interface of the solver of a lattice, whose states have the shape (coordinates, *sizes).

    ``coordinates`` are the coordinates of one site. Parameters in ``at_sites`` have a value at each site, parameters in
    ``at_bonds`` a value at each bond of a graph. ``casimir_kinds`` has one entry per Casimir: ``sites`` for a Casimir
    with a value at each site, and ``sum`` or ``product`` for the sum or the product of densities over all sites. The
    number of sites along axis k is a multiple of ``periods[k]``, and at least ``least[k]``.
    """

    axes: tuple[str, ...] = ()
    at_sites: tuple[str, ...] = ()
    casimir_kinds: tuple[str, ...] = ()
    periods: tuple[int, ...] = ()
    least: tuple[int, ...] = ()
    required: frozenset[str] = frozenset()  # parameters at sites or bonds whose defaults depend on the sizes
    first_open: bool = False  # whether the first axis has open ends
    open_axes: tuple[bool, ...] = ()
    colour_period: int = 1  # number of planes of the first axis after which the colours of sites repeat
    graph: bool = False
    pairs: bool = False  # whether every pair of sites interacts
    compensated: bool = False  # whether the C stores a compensation term for each value of the state
    at_bonds: tuple[str, ...] = ()
    masses: str = ""  # parameter with the masses of bodies in relative coordinates; its first value must be positive
    observed_fields: tuple[str, ...] = ()  # observables with a value at each site
    colours: int = 1
    # weights w of the axes: the site (i, j, …) has the colour (w₁ i + w₂ j + …) modulo the number of colours
    colour_weights: tuple[int, ...] = ()
    launches: LatticeLaunches = field(default_factory=LatticeLaunches)  # launch parameters of the kernels on devices
    slow_steps: bool = False  # whether a step takes longer to recompute than to write to a tape and read back

    def is_shared(self, sites: int) -> bool:
        """Whether the C uses several threads for a lattice of ``sites`` sites, rather than one thread."""
        return sites > (512 if self.pairs else 4096)


@dataclass
class Clock:
    """The time as a function of the number of steps, without accumulated rounding errors.

    The time after ``steps`` steps is t + (steps − counted)·h, where ``t`` and ``counted`` are the time and the number
    of steps at the last change of the step size.
    """

    t: float = 0.0
    h: float = 0.0
    counted: int = 0

    def after(self, steps: int) -> float:
        """Return the time after a number of steps."""
        return self.t + (steps - self.counted) * self.h

    def set_step(self, h: float, steps: int) -> None:
        """Change the step size to h after ``steps`` steps. From then on, `after` counts from the time of that step."""
        if h != self.h:
            self.t, self.h, self.counted = self.after(steps), h, steps


class BackendError(Exception):
    """A step failed in the generated code; `phigen.runtime.solver` converts this error to the user's
    `StepError`.

    ``states`` are the rows up to the failure; the last row is the state before the failing step. For an ensemble,
    ``states`` are the last states of all members. ``step`` is the number of successful steps, −1 if unknown.
    ``failures`` maps the number of each failed member to the name of its status.
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
    """The generated code lacks a function, since an option such as ``tangent`` or ``adjoint`` was not set."""


def row_steps(steps: int, stride: int) -> NDArray[np.int64]:
    """Return the numbers of the steps after which a state is stored: 0, stride, 2·stride, …, and the last."""
    rows = np.arange(0, steps + 1, stride, dtype=np.int64)
    return rows if rows[-1] == steps else np.append(rows, steps)
