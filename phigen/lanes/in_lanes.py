"""The parts of a program that are computed in SIMD lanes.

A lane is one of `LANES` points at which kernels are evaluated together. If steps are implicit, `LANES` consecutive
steps of an integration are solved together as a *block*, and members of an ensemble as a *group*. If steps are
explicit, `LANES` members of an ensemble form a batch, called a *pack*. This module decides whether lanes are possible
and fit on the stack, and which kernels they need. Targets print these kernels.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from phigen.lanes import path_kernels
from phigen.lanes.inverse_flows import recomputing_transposes
from phigen.lanes.lane_functions import (
    FULL_RANGE_FUNCTIONS,
    LANE_FORMULAS,
    LANE_FUNCTIONS,
    SMALL_ARGUMENT_FUNCTIONS,
    library_calls,
    library_powers,
    operations,
    with_formulas,
)
from phigen.scheme.kernel import Kernel
from phigen.scheme.path import PathSlopes
from phigen.scheme.program import Program
from phigen.scheme.steps import Explicit, Factorisation, Gauss, Newton, Path, PathLanes, Splitting, Sweeps
from phigen.symbolic.expression import topological
from phigen.symbolic.special import SPECIAL

#: Number of lanes: the number of doubles in one vector of AVX-512.
LANES = 8

#: Largest size of the working arrays of a block or a group of members. It is half of the 512 KiB that a thread has as
#: stack on macOS.
MAX_STACK_BYTES = 256 * 1024

#: Largest number of packs (SIMD batches of members) in a group. The runtime has the same constant, with the same value.
PACKS_PER_GROUP = 4

#: Number of arrays (stages × unknowns) that a batch of members needs for a Gauss step: the unknowns, and the increments
#: of three steps.
MEMBER_BATCHES = 4

#: Largest numbers of stages for which members of an ensemble are integrated in batches. The second number applies under
#: two conditions together: kernels call functions, and single trajectories iterate only a part of the unknowns
#: (`phigen.scheme.steps.ReducedSweeps`). A batch iterates all unknowns, which takes longer. Measured time in batches,
#: divided by the time without batches: Kowalevski top 1.13 with eight stages, 0.85 with six; two pendulums 1.15 with
#: four stages, 0.6 with two.
MAX_BATCHED_STAGES, MAX_BATCHED_STAGES_WITH_FUNCTIONS = 6, 3

_DOUBLE = 8


@dataclass(frozen=True)
class LaneKernel:
    """Kernel that is evaluated in all lanes; inputs that are ``shared`` have one value for all lanes.

    A ``single`` kernel is evaluated in a single lane, and its outputs are numbers. A ``sparse`` kernel does not store
    outputs that are always zero.
    """

    kernel: Kernel
    shared: tuple[str, ...] = ()
    single: bool = False
    sparse: bool = False


@dataclass(frozen=True)
class Blocks:
    """Implicit steps that are solved together: consecutive steps of a trajectory, or a group of members.

    ``calls`` are the functions that the kernels call. The loops are ``vectorised`` if the kernels call no library
    function. ``factors`` are the factors of a sparse Newton matrix, which take the place of its inverse. For steps
    along paths, ``path`` has the recurrences for the derivatives of a path. The Taylor series of the derivatives have
    at most ``slope_terms`` terms. ``room`` is the number of values that a group of members needs in each lane; the
    values of predictors are not counted.
    """

    kernels: tuple[LaneKernel, ...]
    calls: frozenset[str]
    vectorised: bool
    room: int
    factors: Factorisation | None = None
    path: PathSlopes | None = None
    slope_terms: int = 0

    def grouped(self, stored: int) -> bool:
        """Whether members are integrated in groups, that is, whether a group fits on the stack.

        ``stored`` is the number of values that the predictor of one member stores.
        """
        return _DOUBLE * LANES * (self.room + stored) <= MAX_STACK_BYTES


@dataclass(frozen=True)
class Packs:
    """Members of an ensemble with explicit steps, in batches with one member in each lane.

    ``kernels`` are the kernels of a step, or of the flows of a splitting. ``small_argument`` are the functions that
    have a polynomial for small arguments. For larger arguments, a version for all arguments is called. ``transposes``
    are the transposed kernels, if the reverse pass uses lanes too. The reverse pass takes ``reverse_packs`` batches of
    members together. If ``recomputed``, a transpose computes the state before a flow by the inverse flow.
    """

    kernels: tuple[Kernel, ...]
    calls: frozenset[str]
    small_argument: tuple[str, ...]
    transposes: tuple[Kernel, ...] = ()
    reverse_packs: int = 0
    recomputed: bool = False


@dataclass(frozen=True)
class Rows:
    """SIMD lanes of a lattice: neighbouring sites of a row. ``calls`` are the functions that loops over sites
    call.

    ``small_argument`` are the functions that have a polynomial for small arguments. ``limited`` are the functions in
    flows and stages that have a fast version: a polynomial for small arguments, a vector version, or a formula of
    vector versions. Fast versions may fail at very large arguments.
    """

    calls: frozenset[str]
    small_argument: tuple[str, ...]
    limited: frozenset[str]

    def calls_limited(self, kernel: Kernel) -> bool:
        """Whether a kernel calls one of the functions in ``limited``."""
        return not operations([kernel]).isdisjoint(self.limited)


@dataclass(frozen=True)
class Traces:
    """Paths in lanes, for the reverse pass of an integration that takes one step at a time.

    ``narrow`` says that half the number of lanes is used, since all lanes would need too much stack. ``calls`` are the
    functions that the kernels call. ``path`` has the recurrences for the derivatives of a path. The Taylor series of
    the derivatives have at most ``slope_terms`` terms.
    """

    kernels: tuple[LaneKernel, ...]
    calls: frozenset[str]
    path: PathSlopes
    slope_terms: int
    narrow: bool


@dataclass(frozen=True)
class Stages:
    """The stages of a Gauss method, one in each lane. ``narrow`` says that half the number of lanes is enough for the
    stages.

    ``batched`` are the kernels for batches of members of an ensemble, with one member in each lane. ``batched`` is ()
    if members are integrated one by one.
    """

    kernels: tuple[LaneKernel, ...]
    calls: frozenset[str]
    narrow: bool
    batched: tuple[LaneKernel, ...] = ()

    @property
    def lanes(self) -> int:
        """The number of lanes."""
        return LANES // 2 if self.narrow else LANES


Lanes = Blocks | Packs | Rows | Stages | Traces


def in_lanes(program: Program) -> Lanes | None:
    """Return the parts of a program that are computed in lanes.

    Returns None if the spec excludes lanes, if no parts can be computed in lanes, or if they would need too much stack.
    """
    lowering = LOWERINGS.get(program.step.kind.name)
    return lowering(program, program.step) if lowering else None


def _is_lowered(program: Program) -> bool:
    """Whether several steps of a trajectory, or several members, may be computed together in lanes.

    This is not possible with noise: coefficients then differ from step to step, so that predictors from earlier steps
    fail. If H depends on the time, coefficients differ as well; then lanes are used only for implicit steps without a
    monitor.
    """
    dated = program.time and (program.monitor or not program.step.kind.implicit)
    return program.lanes and program.offers("lanes") and not program.noise and not dated


def _of_newton(program: Program, step: Newton) -> Blocks | None:
    # Blocks of steps have recurrences as predictors, so the target must offer recurrences.
    return _newton(program, step) if _is_lowered(program) and program.offers("recurrences") else None


def _of_path(program: Program, step: Path) -> Blocks | Traces | None:
    """Return `Blocks` if several steps can be solved together. Otherwise return `Traces`, for the paths of the reverse
    pass.

    The result is None if neither is possible. `Traces` require numbers of 64 bits.
    """
    blocks = None
    if _is_lowered(program) and step.lanes and (program.offers("recurrences") or not step.adjoint):
        blocks = _paths(program, step, step.lanes)
    if blocks or program.single or not program.lanes:
        return blocks  # the code for `Traces` assumes numbers of 64 bits
    return _traces(program, step)


def _of_explicit(program: Program, step: Explicit) -> Packs | None:
    if not _is_lowered(program):
        return None
    packs = _packs(program, (step.increment,))
    return packs and _with_transposes(program, packs, step.adjoint.steps if step.adjoint else (), 0)


def _of_splitting(program: Program, step: Splitting) -> Packs | None:
    if not _is_lowered(program):
        return None
    packs = _packs(program, step.flows)
    if packs is None:
        return None
    segment_bytes = 2 * _DOUBLE * LANES**2 * program.dimension  # the stored states of one batch of members
    if inverse_transposes := recomputing_transposes(program, step):
        packs = _with_transposes(program, replace(packs, recomputed=True), inverse_transposes, 0)
    else:
        packs = _with_transposes(program, packs, step.adjoint.steps if step.adjoint else (), segment_bytes)
    used = operations([*packs.kernels, *packs.transposes])
    return replace(packs, small_argument=tuple(f for f in SMALL_ARGUMENT_FUNCTIONS if f in used))


def _of_gauss(program: Program, step: Gauss) -> Stages | None:
    return _stages(program, step) if program.lanes and program.offers("lanes") else None


def _rows(program: Program, step: Sweeps) -> Rows:
    """Return the `Rows` of a lattice: which functions the loops over sites call, and which functions have a fast
    version.

    Polynomials for small arguments, and most vector versions of functions, are used only in the profile ``fast``.
    Observables are evaluated rarely, so they call libm, whose functions accept any argument.
    """
    swept = [sweep.kernel for part in step.parts for sweep in part]
    swept += step.equation.kernels if step.equation else ()
    gathers = (step.partners.energy, step.partners.field, step.partners.observed) if step.partners else ()
    observable_names = {kernel.name for gather in gathers for kernel in gather.kernels}
    reverse_coefficients = (step.adjoint.prepare, step.adjoint.refresh) if step.adjoint else ()
    of_coefficients = {
        id(kernel) for kernel in (step.prepare, step.refresh, *reverse_coefficients)
    }  # The loops of these kernels are over coefficients, not over sites.
    looped = [
        kernel for kernel in step.kernels if id(kernel) not in of_coefficients and kernel.name not in observable_names
    ]
    if program.profile != "fast":
        # If the solver has no tangent maps and no gradients, its C has no kernels that read variations. Derivatives
        # along variations are then computed as difference quotients of sweeps.
        if not (program.extras.tangent or step.adjoint):
            varied_names = {kernel.name for kernel in (step.partners.varied.kernels if step.partners else ())}
            looped = [kernel for kernel in looped if not kernel.reads_variations and kernel.name not in varied_names]
        return Rows(with_formulas(operations(looped) & set(FULL_RANGE_FUNCTIONS)), (), frozenset())
    called_with_forms = _called_in_forms(step)
    called = operations(swept) & called_with_forms
    # Transposes call the derivatives of the functions in ``called``, at arguments that are small too. The name of a
    # derivative is the name of the function followed by 1.
    called |= {f for f in SMALL_ARGUMENT_FUNCTIONS if f in called_with_forms and f.removesuffix("1") in called}
    small_argument = tuple(f for f in (*SMALL_ARGUMENT_FUNCTIONS, *SPECIAL) if f in called) if program.lanes else ()
    limited = frozenset({*small_argument, *LANE_FUNCTIONS, *LANE_FORMULAS} & called)
    return Rows(with_formulas(operations(looped)), small_argument, limited)


def _called_in_forms(step: Sweeps) -> set[str]:
    """Return the functions that are called by kernels whose loops have two forms: for small arguments, and for all
    arguments.

    Derivatives of a stage along variations, and transposes of sums over bonds or pairs, have a single form.
    """
    kernels = [sweep.kernel for part in step.parts for sweep in part]
    kernels += [step.equation.relax, step.equation.advance] if step.equation else []
    transposes = step.adjoint.steps if step.adjoint else ()
    return operations([*kernels, *(kernel for kernel in transposes if "sums_bar" not in kernel.inputs)])


def _stages(program: Program, step: Gauss) -> Stages:
    """Return the kernels of the vector field of a Gauss method, with one stage in each lane, and their transposes.

    All lanes share the state at the start of the step.
    """
    kernels = [LaneKernel(step.slope, ("coef", "x"))]
    kernels += [LaneKernel(step.frame, ("coef", "x", "z"))] if step.frame else []
    reduced = [step.reduced.slope, step.reduced.follow] if step.reduced else []
    kernels += [LaneKernel(kernel, ("coef", "x")) for kernel in reduced]
    others = [*step.stage_transposes, *(k.kernel for k in _elapsed(program))]
    kernels += [LaneKernel(kernel, ("coef", "x")) for kernel in others]
    called = with_formulas(operations([step.slope, *others]))
    return Stages(tuple(kernels), called, step.tableau.stages <= LANES // 2, _batched_stages(program, step))


def _batched_stages(program: Program, step: Gauss) -> tuple[LaneKernel, ...]:
    """Return the kernels of a Gauss step for batches of members, with one member in each lane.

    Returns () if it is faster to compute members one by one, or if the arrays of a batch need too much stack.
    """
    arrays = MEMBER_BATCHES * step.tableau.stages * step.unknowns + 6 * program.dimension
    if _DOUBLE * LANES * arrays > MAX_STACK_BYTES:
        return ()
    calls_functions = program.about.operations["functions"] > 0
    limit = MAX_BATCHED_STAGES_WITH_FUNCTIONS if step.reduced and calls_functions else MAX_BATCHED_STAGES
    if step.tableau.stages > limit:
        return ()
    elapsed = program.monitor.elapsed if program.monitor else None
    named = {"field": step.slope, "change": step.change, "frame": step.frame, "elapsed": elapsed}
    return tuple(LaneKernel(replace(kernel, name=f"member_{name}")) for name, kernel in named.items() if kernel)


def _newton(program: Program, step: Newton) -> Blocks | None:
    if _block(program) > MAX_STACK_BYTES:
        return None
    centred = step.centred and len(program.fractions) > 1 and step.factors is None
    linearise = _without(step.linearise, "increment_jacobian") if centred else step.linearise
    kernels = [LaneKernel(linearise, sparse=step.factors is not None)]
    kernels.append(LaneKernel(_without_matrices(step.linearise)))
    if step.factors:
        substitute = step.factors.substitute
        kernels += [LaneKernel(step.factors.factorise), LaneKernel(substitute)]
        kernels.append(LaneKernel(substitute, shared=("side",), single=True))
    elif step.invert:
        kernels.append(LaneKernel(_without(step.invert, "slope", "gain") if centred else step.invert))
    kernels += _elapsed(program)
    kernels += _turns(program)
    ops = operations([step.linearise, *(k.kernel for k in _turns(program))])
    transposes = step.adjoint.steps if step.adjoint else ()
    kernels += map(LaneKernel, transposes)
    called = with_formulas(ops | operations(transposes))
    return Blocks(tuple(kernels), called, not library_calls(ops), _group(program), step.factors)


def _paths(program: Program, step: Path, lanes: PathLanes) -> Blocks | None:
    term_counts = path_kernels.SLOPE_TERMS_BACK if step.adjoint else path_kernels.SLOPE_TERMS
    room = {k: path_kernels.stack(step, lanes.slopes, program.dimension, k) for k in term_counts}
    terms = next((k for k, values in room.items() if _block(program, *values) <= MAX_STACK_BYTES), None)
    if terms is None:
        return None
    kernels = [*path_kernels.kernels(step, lanes, program.coordinates), *(k.kernel for k in _turns(program))]
    kernels += path_kernels.back(step.back) if step.back else []
    ops = operations(kernels)
    needed = _group(program) + sum(room[terms])
    lane_kernels = (*(LaneKernel(kernel) for kernel in kernels), *_elapsed(program))
    return Blocks(
        lane_kernels, with_formulas(ops), not library_calls(ops), needed, path=lanes.slopes, slope_terms=terms
    )


def _traces(program: Program, step: Path) -> Traces | None:
    if not step.back:
        return None
    path, n = step.back, program.dimension
    _, once = path_kernels.stack(step, path.slopes, n, path_kernels.MAX_TERMS)
    room = _DOUBLE * LANES * (2 * step.coefficients + 6 * n * n + once)
    if room > 2 * MAX_STACK_BYTES:
        return None
    kernels = [*path_kernels.traced(step, path.slopes, path.curvature, program.coordinates), *path_kernels.back(path)]
    return Traces(
        tuple(map(LaneKernel, kernels)),
        with_formulas(operations(kernels)),
        path.slopes,
        path_kernels.MAX_TERMS,
        room > MAX_STACK_BYTES,
    )


def _elapsed(program: Program) -> list[LaneKernel]:
    """Return the kernel of the physical time that a step takes, if there is a monitor; else []."""
    return [LaneKernel(program.monitor.elapsed)] if program.monitor and program.monitor.elapsed else []


def _turns(program: Program) -> list[LaneKernel]:
    """Return the kernels of the attitude increments of a step: group elements, whose product is the attitude."""
    attitude = program.attitude
    if attitude is None or attitude.turn is None:
        return []
    by_covector = () if attitude.cayley or attitude.exponential is None else (attitude.exponential,)
    return [LaneKernel(kernel) for kernel in (*by_covector, attitude.turn)]


def _packs(program: Program, kernels: Sequence[Kernel]) -> Packs | None:
    """Return batches of members with one member in each lane.

    Returns None if members have different coefficients, if a function has no vector version, or if the arrays do not
    fit on the stack.
    """
    ops = operations(kernels)
    states = 2 * PACKS_PER_GROUP * LANES * 3 * program.dimension
    if program.step.corrected:
        return None  # the members of a pack begin and end their runs at different steps
    if program.held or library_calls(ops) or library_powers(kernels) or _DOUBLE * states > MAX_STACK_BYTES:
        return None
    return Packs(tuple(kernels), with_formulas(ops), ())


def _with_transposes(program: Program, packs: Packs, transposes: Sequence[Kernel], stored: int) -> Packs:
    """Return the packs with transposes, or unchanged if the transposes cannot be computed in lanes.

    The states that the reverse pass stores need ``stored`` bytes for one pack, and k² times as much for k packs.
    ``reverse_packs`` becomes the largest number of packs whose states fit on the stack.
    """
    transposes = transposes if program.offers("members") else ()
    ops = operations(transposes)
    reverse_packs = next((k for k in (PACKS_PER_GROUP, 2, 1) if 2 * k**2 * stored <= MAX_STACK_BYTES), 0)
    if not reverse_packs or library_calls(ops) or library_powers(transposes):
        return packs
    return replace(
        packs, calls=packs.calls | with_formulas(ops), transposes=tuple(transposes), reverse_packs=reverse_packs
    )


def _block(program: Program, per_stage: int = 0, shared: int = 0) -> int:
    """Return the number of bytes on the stack for a block of steps, which are solved together in SIMD lanes.

    Each lane has additional values: ``per_stage`` values for each stage, and ``shared`` values for all stages together.
    """
    n = program.dimension
    each = program.step.coefficients + 4 * n + 3 * n * n + per_stage
    return _DOUBLE * LANES * (len(program.fractions) * each + shared)


def _group(program: Program) -> int:
    """Return the number of values that a group of members needs in each lane. Additional values for paths are not
    counted.
    """
    n = program.dimension
    return len(program.fractions) * program.step.coefficients + 7 * n + 3 * n * n


def _without(kernel: Kernel, *names: str) -> Kernel:
    """Return the kernel without the inputs and outputs that have one of these names."""
    inputs = {name: symbols for name, symbols in kernel.inputs.items() if name not in names}
    return replace(kernel, inputs=inputs, outputs=tuple(o for o in kernel.outputs if o.name not in names))


def _without_matrices(kernel: Kernel) -> Kernel:
    """Return the kernel of a Newton iteration that reuses the matrices of an earlier iteration."""
    outputs = tuple(o for o in kernel.outputs if "jacobian" not in o.name)
    needed = set(topological([v for o in outputs for v in o.values]))
    named = tuple((name, value) for name, value in kernel.named if value in needed)
    where = kernel.purpose.partition(":")[0]
    purpose = f"{where}: the displacement alpha - y and the increment beta - alpha"
    return replace(kernel, name="evaluate", purpose=purpose, outputs=outputs, named=named)


#: Kind of step → function that decides what a program with this kind of step computes in SIMD lanes.
LOWERINGS: Mapping[str, Callable[[Program, Any], Lanes | None]] = {
    "newton": _of_newton,
    "explicit": _of_explicit,
    "path": _of_path,
    "gauss": _of_gauss,
    "splitting": _of_splitting,
    "sweeps": _rows,
}
