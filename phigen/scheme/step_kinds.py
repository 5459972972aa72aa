"""The kinds of steps: a record for each kind, with the properties that other packages need.

A step (`phigen.scheme.steps`) has a kind and kernels. Packages that treat kinds differently have tables with an entry
for each kind: `phigen.lanes.in_lanes` has one for steps in SIMD lanes, and a module of each target has one for the
printed code.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class StepKind:
    """A kind of step: how it computes the new state.

    ``title`` names the method in a sentence, and ``manner`` names it in the header of generated files. ``unit`` says to
    what the printed operation counts refer. The other fields are true or false:

    - ``implicit``: each step solves an equation for one point by an iteration.
    - ``predicted``: the iteration starts from a value extrapolated from earlier steps.
    - ``flows``: each step has a schedule, and a row of coefficients for each duration in the schedule.
    - ``collocates``: each step solves for all its stages at once.
    - ``sites``: the steps are those of lattices.
    """

    name: str
    title: str
    manner: str
    unit: str = "step"
    implicit: bool = False
    predicted: bool = False
    flows: bool = False
    collocates: bool = False
    sites: bool = False


NEWTON = StepKind(
    "newton",
    "Newton's method",
    "implicit, Newton iteration with the analytic matrix",
    unit="Newton iteration",
    implicit=True,
    predicted=True,
)
EXPLICIT = StepKind("explicit", "a formula", "explicit")
PATH = StepKind(
    "path",
    "paths, computed by their Taylor series",
    "along a path dm/dt = pi(m) p, by Taylor series to round-off; implicit: p = grad S_h(mean of the path)",
    unit="evaluation of the equation for p",
    implicit=True,
    predicted=True,
)
GAUSS = StepKind(
    "gauss",
    "Gauss collocation",
    "implicit, all stages by fixed-point sweeps to round-off",
    unit="evaluation at a stage",
    predicted=True,
    collocates=True,
)
SPLITTING = StepKind("splitting", "flows of parts of H", "explicit", flows=True)
SWEEPS = StepKind("sweeps", "sweeps over the sites", "explicit", unit="step of one site", sites=True)

#: All kinds of steps, by name.
STEP_KINDS: Mapping[str, StepKind] = {kind.name: kind for kind in (NEWTON, EXPLICIT, PATH, GAUSS, SPLITTING, SWEEPS)}
