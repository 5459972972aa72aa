"""From a program to what is computed in lanes: blocks of implicit steps, or packs of members with explicit ones.

A lane is one of `LANES` points at which kernels are evaluated at once. An integration with implicit steps solves a
block of `LANES` of them together, and an ensemble groups of members; members with explicit steps are put into packs.
This stage decides whether that is possible and worth its room, and which kernels it takes; targets print them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from phigen.lanes import paths
from phigen.lanes.functions import (
    LANE_FORMULAS,
    LANE_FUNCTIONS,
    NEAR_FUNCTIONS,
    REACHING,
    library_calls,
    library_powers,
    operations,
    with_formulas,
)
from phigen.lanes.undoing import undoing
from phigen.scheme.kernel import Kernel
from phigen.scheme.path import PathSlopes
from phigen.scheme.program import Program
from phigen.scheme.steps import Explicit, Factorisation, Gauss, Implicit, Newton, Path, PathLanes, Splitting, Sweeps
from phigen.symbolic.expression import topological
from phigen.symbolic.special import SPECIAL

#: Points at which a kernel for lanes is evaluated at once: what one vector of AVX-512 holds.
LANES = 8

#: Bytes that the working arrays of a block, or of a group of members, may take on the stack.
MOST_STACK = 256 * 1024

#: Packs in a group, as in the runtime.
PACKS = 4

_DOUBLE = 8


@dataclass(frozen=True)
class LaneKernel:
    """A kernel in lanes: inputs that are ``shared`` have one value for all of them.

    A ``single`` one is evaluated at one lane, and its outputs are numbers; a ``sparse`` one does not store what is
    always zero.
    """

    kernel: Kernel
    shared: tuple[str, ...] = ()
    single: bool = False
    sparse: bool = False


@dataclass(frozen=True)
class Blocks:
    """Implicit steps in lanes.

    ``calls`` are the functions that the kernels call; without the library's they are ``vectorised``. ``factors`` are
    those of the Newton matrix, if it has so many zeros that they are kept, not its inverse. ``path`` is what paths
    need, with at most ``slope_terms`` terms of their derivatives. ``room`` are the values in each lane that a group of
    members takes, without those that it remembers.
    """

    kernels: tuple[LaneKernel, ...]
    calls: frozenset[str]
    vectorised: bool
    room: int
    factors: Factorisation | None = None
    path: PathSlopes | None = None
    slope_terms: int = 0

    def grouped(self, remembered: int) -> bool:
        """Whether members are integrated in groups, each with so many values that it remembers."""
        return _DOUBLE * LANES * (self.room + remembered) <= MOST_STACK


@dataclass(frozen=True)
class Packs:
    """Members with explicit steps, one in each lane.

    ``kernels`` are those of a step, or of the flows of a splitting. ``near`` are the functions that are polynomials
    near 0: where these do not reach, there is a longer way. ``back`` are the transposes of the kernels, if members are
    pulled back in packs too, so many ``abreast``; where flows are ``undone``, these find the states before them.
    """

    kernels: tuple[Kernel, ...]
    calls: frozenset[str]
    near: tuple[str, ...]
    back: tuple[Kernel, ...] = ()
    abreast: int = 0
    undone: bool = False


@dataclass(frozen=True)
class Rows:
    """Sites of a lattice, side by side in rows; ``near`` as in packs. ``limited`` are functions of flows and stages
    that have no value where arguments are very large: those of ``near``, and those with versions in lanes."""

    calls: frozenset[str]
    near: tuple[str, ...]
    limited: frozenset[str]

    def calls_limited(self, kernel: Kernel) -> bool:
        """Whether a kernel calls one of those."""
        return not operations([kernel]).isdisjoint(self.limited)


@dataclass(frozen=True)
class Traces:
    """Paths that are followed backwards in lanes, of steps that are made one at a time; see `Blocks`. Where all lanes
    would need too much room, there are half as many (``narrow``)."""

    kernels: tuple[LaneKernel, ...]
    calls: frozenset[str]
    path: PathSlopes
    slope_terms: int
    narrow: bool


@dataclass(frozen=True)
class Stages:
    """The stages of a Gauss method, one in each lane; ``narrow`` where half of the lanes are enough."""

    kernels: tuple[LaneKernel, ...]
    calls: frozenset[str]
    narrow: bool

    @property
    def lanes(self) -> int:
        """The number of lanes."""
        return LANES // 2 if self.narrow else LANES


Lanes = Blocks | Packs | Rows | Stages | Traces


def in_lanes(program: Program) -> Lanes | None:
    """What is computed in lanes; None where the spec says no, or it is not possible, or would need too much room."""
    if isinstance(program.step, Sweeps):
        return _rows(program, program.step)
    if not program.lanes:
        return None
    found = _of_steps(program) if program.offers("lanes") else None
    if found or program.single or not isinstance(program.step, Path):
        return found  # lanes are of numbers of 64 bits
    return _traces(program, program.step)


def _of_steps(program: Program) -> Blocks | Packs | Stages | None:
    if isinstance(program.step, Gauss):
        return _stages(program.step)
    if program.noise:
        return None  # every step has coefficients of its own, and guesses from earlier steps miss it
    if program.time and (program.monitor or not isinstance(program.step, Implicit)):
        return None  # members in packs would share coefficients that differ from step to step
    match program.step:
        case Newton() as step if program.offers("recurrences"):  # blocks are guessed by them
            return _newton(program, step)
        case Path() as step if step.lanes and (program.offers("recurrences") or not step.adjoint):
            return _paths(program, step, step.lanes)
        case Explicit() as step:
            back = step.adjoint.steps if step.adjoint else ()
            return _with_back(program, _packs(program, (step.increment,), ()), back, 0)
        case Splitting() as step:
            used = operations(step.flows)
            packs = _packs(program, step.flows, tuple(f for f in NEAR_FUNCTIONS if f in used))
            kept = 2 * _DOUBLE * LANES**2 * program.dimension  # bytes of a segment of one pack
            undone = undoing(program, step) if packs else ()
            if packs and undone:
                return _with_back(program, replace(packs, undone=True), undone, 0)
            return _with_back(program, packs, step.adjoint.steps if step.adjoint else (), kept)
    return None


def _rows(program: Program, step: Sweeps) -> Rows:
    """Sites are in rows in any case; most versions in lanes, and the short way near 0, are for speed.

    What is looked at now and then calls libm, whose functions take any argument.
    """
    swept = [sweep.kernel for part in step.parts for sweep in part]
    swept += step.equation.kernels if step.equation else ()
    gathers = (step.partners.energy, step.partners.field, step.partners.observed) if step.partners else ()
    seen = {kernel.name for gather in gathers for kernel in gather.kernels}
    back = (step.adjoint.prepare, step.adjoint.refresh) if step.adjoint else ()
    apart = {id(kernel) for kernel in (step.prepare, step.refresh, *back)}  # of coefficients, not of sites
    looped = [kernel for kernel in step.kernels if id(kernel) not in apart and kernel.name not in seen]
    if program.profile == "small":
        if not (program.extras.tangent or step.adjoint):  # variations are differences of sweeps there
            along = {kernel.name for kernel in (step.partners.varied.kernels if step.partners else ())}
            looped = [kernel for kernel in looped if not kernel.reads_variations and kernel.name not in along]
        return Rows(with_formulas(operations(looped) & set(REACHING)), (), frozenset())
    formed = _called_in_forms(step)
    called = operations(swept) & formed
    # transposes call the derivatives of functions where these are called, and arguments are as small
    called |= {f for f in NEAR_FUNCTIONS if f in formed and f.removesuffix("1") in called}
    near = tuple(f for f in (*NEAR_FUNCTIONS, *SPECIAL) if f in called) if program.lanes else ()
    limited = frozenset({*near, *LANE_FUNCTIONS, *LANE_FORMULAS} & called)
    return Rows(with_formulas(operations(looped)), near, limited)


def _called_in_forms(step: Sweeps) -> set[str]:
    """What those kernels call whose loops have a form for small arguments beside that for any.

    Derivatives of a stage along variations, and the transposes of what is gathered, have one form for all.
    """
    found = [sweep.kernel for part in step.parts for sweep in part]
    found += [step.equation.relax, step.equation.advance] if step.equation else []
    back = step.adjoint.steps if step.adjoint else ()
    return operations([*found, *(kernel for kernel in back if "sums_bar" not in kernel.inputs)])


def _stages(step: Gauss) -> Stages:
    """The vector field of a Gauss method at all stages; what lies where a step starts is the same for all of them."""
    kernels = [LaneKernel(step.slope, ("coef", "x"))]
    kernels += [LaneKernel(step.frame, ("coef", "z"))] if step.frame else []
    return Stages(tuple(kernels), with_formulas(operations([step.slope])), step.tableau.stages <= LANES // 2)


def _newton(program: Program, step: Newton) -> Blocks | None:
    if _block(program) > MOST_STACK:
        return None
    centred = step.centred and len(program.fractions) > 1 and step.factors is None
    linearise = _without(step.linearise, "increment_jacobian") if centred else step.linearise
    found = [LaneKernel(linearise, sparse=step.factors is not None)]
    found.append(LaneKernel(_without_matrices(step.linearise)))
    if step.factors:
        substitute = step.factors.substitute
        found += [LaneKernel(step.factors.factorise), LaneKernel(substitute)]
        found.append(LaneKernel(substitute, shared=("side",), single=True))
    elif step.invert:
        found.append(LaneKernel(_without(step.invert, "slope", "gain") if centred else step.invert))
    found += _elapsed(program)
    found += _turns(program)
    ops = operations([step.linearise, *(k.kernel for k in _turns(program))])
    back = step.adjoint.steps if step.adjoint else ()
    found += map(LaneKernel, back)
    called = with_formulas(ops | operations(back))
    return Blocks(tuple(found), called, not library_calls(ops), _group(program), step.factors)


def _paths(program: Program, step: Path, lanes: PathLanes) -> Blocks | None:
    most = paths.SLOPE_TERMS_BACK if step.adjoint else paths.SLOPE_TERMS
    room = {k: paths.stack(step, lanes.slopes, program.dimension, k) for k in most}
    terms = next((k for k, more in room.items() if _block(program, *more) <= MOST_STACK), None)
    if terms is None:
        return None
    kernels = [*paths.kernels(step, lanes, program.coordinates), *(k.kernel for k in _turns(program))]
    kernels += paths.back(step.back) if step.back else []
    ops = operations(kernels)
    needed = _group(program) + sum(room[terms])
    found = (*(LaneKernel(kernel) for kernel in kernels), *_elapsed(program))
    return Blocks(found, with_formulas(ops), not library_calls(ops), needed, path=lanes.slopes, slope_terms=terms)


def _traces(program: Program, step: Path) -> Traces | None:
    if not step.back:
        return None
    path, n = step.back, program.dimension
    _, once = paths.stack(step, path.slopes, n, paths.TERMS)
    room = _DOUBLE * LANES * (2 * step.coefficients + 6 * n * n + once)
    if room > 2 * MOST_STACK:
        return None
    kernels = [*paths.traced(step, path.slopes, path.curvature, program.coordinates), *paths.back(path)]
    return Traces(
        tuple(map(LaneKernel, kernels)), with_formulas(operations(kernels)), path.slopes, paths.TERMS, room > MOST_STACK
    )


def _elapsed(program: Program) -> list[LaneKernel]:
    """The time that the steps of a block take, of a monitored solver."""
    return [LaneKernel(program.monitor.elapsed)] if program.monitor and program.monitor.elapsed else []


def _turns(program: Program) -> list[LaneKernel]:
    """The kernels of the elements that attitudes are products of."""
    attitude = program.attitude
    if attitude is None or attitude.turn is None:
        return []
    by_covector = () if attitude.cayley or attitude.exponential is None else (attitude.exponential,)
    return [LaneKernel(kernel) for kernel in (*by_covector, attitude.turn)]


def _packs(program: Program, kernels: Sequence[Kernel], near: tuple[str, ...]) -> Packs | None:
    """Packs, where all members have the same coefficients and every function has a version for lanes."""
    ops = operations(kernels)
    states = 2 * PACKS * LANES * 3 * program.dimension
    if program.held or library_calls(ops) or library_powers(kernels) or _DOUBLE * states > MOST_STACK:
        return None
    return Packs(tuple(kernels), with_formulas(ops), near)


def _with_back(program: Program, packs: Packs | None, back: Sequence[Kernel], kept: int) -> Packs | None:
    """Packs that members are pulled back in, if the transposes of the kernels can be computed in lanes too: as many as
    may keep so many bytes on the stack, which grow with the square of their number."""
    back = back if program.offers("members") else ()
    ops = operations(back)
    abreast = next((k for k in (PACKS, 2, 1) if 2 * k**2 * kept <= MOST_STACK), 0)
    if packs is None or not abreast or library_calls(ops) or library_powers(back):
        return packs
    return replace(packs, calls=packs.calls | with_formulas(ops), back=tuple(back), abreast=abreast)


def _block(program: Program, more: int = 0, once: int = 0) -> int:
    """Bytes on the stack that a block takes, with ``more`` values in each lane for each stage, and some ``once``."""
    n = program.dimension
    each = program.step.coefficients + 4 * n + 3 * n * n + more
    return _DOUBLE * LANES * (len(program.fractions) * each + once)


def _group(program: Program) -> int:
    """Values in each lane that a group of members takes."""
    n = program.dimension
    return len(program.fractions) * program.step.coefficients + 7 * n + 3 * n * n


def _without(kernel: Kernel, *names: str) -> Kernel:
    """The kernel without these inputs and outputs."""
    inputs = {name: symbols for name, symbols in kernel.inputs.items() if name not in names}
    return replace(kernel, inputs=inputs, outputs=tuple(o for o in kernel.outputs if o.name not in names))


def _without_matrices(kernel: Kernel) -> Kernel:
    """What a pass needs that goes on with the matrices of the last."""
    outputs = tuple(o for o in kernel.outputs if "jacobian" not in o.name)
    needed = set(topological([v for o in outputs for v in o.values]))
    named = tuple((name, value) for name, value in kernel.named if value in needed)
    return replace(kernel, name="evaluate", outputs=outputs, named=named)
