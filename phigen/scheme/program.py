"""The program representation: what the scheme hands to the targets.

A `Program` is a set of straight-line `Kernel` functions and the name of the driver that calls them. There are two
stages. ``prepare`` computes, from parameters and step size, every value that does not depend on the state:
the coefficients ``c:0``, ``c:1``, …. All other kernels of the step read these and the state only.
Kernels hold expression graphs; `phigen.scheme.lowering` turns one into a list of assignments.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from phigen._version import __version__
from phigen.scheme.alternation import Schedule
from phigen.scheme.path import Path, PathSlopes
from phigen.spec.model import NO_EXTRAS, Extras, Parameter
from phigen.symbolic.expression import Expression


@dataclass(frozen=True)
class Output:
    """An array that a kernel fills: ``values`` in row-major order."""

    name: str
    values: tuple[Expression, ...]
    comment: str = ""


@dataclass(frozen=True)
class Kernel:
    """A pure function from named vectors of symbols to named arrays.

    ``inputs`` maps the name of an argument to the symbols that its entries stand for. ``named`` are values
    worth a name of their own in the output (momenta, second derivatives), with a comment for their group.
    """

    name: str
    purpose: str
    inputs: Mapping[str, tuple[str, ...]]
    outputs: tuple[Output, ...]
    named: tuple[tuple[str, Expression], ...] = ()

    @property
    def roots(self) -> list[Expression]:
        """The expressions of all outputs, in order."""
        return [v for o in self.outputs for v in o.values]


#: How far an implicit step may lead, in sizes of the state and of what the vector field says, if the energy is lost.
PLAUSIBLE = 1.5


@dataclass(frozen=True)
class Program:
    """A solver, ready to be printed. ``driver`` is ``newton``, ``explicit``, ``path`` or ``splitting``.

    ``schedule`` lists the flows of a step of a splitting, whose kernels are ``flow1``, ``flow2``, …; there is a table
    of coefficients for each row of the schedule; ``composition`` is its name. ``path`` holds the recurrences of a path
    driver, ``path_slopes`` those for its derivatives, if several paths are to be followed in ``lanes``. A step of size
    h is the composition of one step of each of the ``fractions`` of h. ``tangent_path`` is the path with its variation
    (`phigen.scheme.tangent`), if ``extras`` ask for the tangent map. ``gauge`` names the Casimirs whose multiple the
    solver chooses for each trajectory.

    ``relative`` tells that the coordinates are positive or keep their sign (log-canonical π), so that errors
    of the inner solve count relative to each coordinate. ``facts`` are the lines of the header.
    """

    name: str
    title: str
    coordinates: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    casimirs: tuple[str, ...]
    order: int
    driver: str
    coefficients: int
    kernels: Mapping[str, Kernel]
    path: Path | None = None
    path_slopes: PathSlopes | None = None
    schedule: Schedule | None = None
    composition: str = ""
    fractions: tuple[float, ...] = (1.0,)
    gauge: tuple[str, ...] = ()
    extras: Extras = NO_EXTRAS
    tangent_path: Path | None = None
    relative: bool = False
    symmetric: bool = True
    max_iterations: int = 20
    lanes: bool = True
    tolerance: float = 1e-17
    license: str = "0BSD"
    spec_sha256: str = ""
    facts: tuple[str, ...] = ()
    operations: Mapping[str, int] = field(default_factory=dict)

    @property
    def version(self) -> str:
        """The version of phigen that made this program."""
        return __version__

    @property
    def driver_unit(self) -> str:
        """What the operation counts of the header refer to."""
        return {"explicit": "step", "splitting": "step", "newton": "Newton iteration"}.get(
            self.driver, "evaluation of the equation for p"
        )

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)
