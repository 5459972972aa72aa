"""Properties of the sweeps of a lattice. The properties decide how the code for band elimination, wavefront blocking
and reverse passes is printed.
"""

from __future__ import annotations

from phigen.scheme.kernel import Kernel, Role
from phigen.scheme.program import Program
from phigen.scheme.staging import TABLE
from phigen.scheme.steps import Sites, Sweep, Sweeps
from phigen.scheme.sweep_inverse import can_recompute_fields, once, transposes
from phigen.symbolic.expression import symbols_of
from phigen.symbolic.symbols import AROUND

#: Largest number of off-diagonals on each side of a band matrix for which elimination is used.
MAX_DIAGONALS = 64


def reach(step: Sweeps) -> int:
    """Return the distance, in sites, of the farthest neighbour that a stage reads.

    The lattice has one axis.
    """
    relax = step.equation.relax if step.equation else None
    places = [step.sites.places[s] for s in relax.inputs["site"]] if relax else []
    return max((abs(offset[-1]) for f, offset in places if f not in step.sites.parameters), default=0)


def band(step: Sweeps) -> int:
    """Return how many off-diagonals the Newton matrix of a stage has on each side; 0 if band elimination does not
    apply.
    """
    if not step.equation or step.partners or len(step.sites.axes) > 1:
        return 0
    diagonals = (reach(step) + 1) * len(step.equation.relax.roots) - 1
    return diagonals if diagonals <= MAX_DIAGONALS else 0


def beside_seams(sweep: Sweep) -> bool:
    """Whether a sweep is restricted by boundary seams: the sweep omits the sites near seams, or updates only sites near
    seams.
    """
    return sweep.omits_seams or sweep.window is not None


def first_kind(sites: Sites, sweep: Sweep) -> int | None:
    """Return the code of the sites that a sweep updates, for the colour 0. Returns None unless the sweep updates only
    sites near certain boundary seams.

    Each site near seams has a code in the runtime. The code is m·c + k, where m is the bit mask of the seams, c the
    number of colours, and k the colour of the site.
    """
    return None if sweep.window is None else sweep.window * sites.colours


def wide(sites: Sites, sweep: Sweep) -> bool:
    """Whether a sweep over a row may write beyond the end of the row, up to a whole SIMD vector.

    This is possible where the halo behind the row is filled after the sweep.
    """
    return len(sites.axes) > 1 and sites.colours == 1 and not sweep.gather and not sweep.is_tangent


def chosen_ends(step: Sweeps) -> set[str]:
    """Return the values of `Ends.chosen` in the sums of the step: which sites of a bond must have the colour of a
    sweep.
    """
    gathers = (sweep.gather for part in step.parts for sweep in part if sweep.gather)
    return {ends.chosen for gather in gathers for ends in gather.ends}


def site_blocks(program: Program, step: Sweeps) -> bool:
    """Whether the Krylov methods for a stage are preconditioned with the diagonal blocks of the Newton matrix, one for
    each site.

    This is so on grids in the profile ``fast``, unless band elimination applies.
    """
    return step.equation is not None and step.partners is None and not band(step) and program.profile == "fast"


def waves(program: Program, step: Sweeps) -> bool:
    """Whether wavefront blocking applies.

    It applies in the profile ``fast`` to splittings on grids whose steps have several flows, if there are neither noise
    nor boundary seams. On grids a flow reads only neighbours, as wavefront blocking requires.
    """
    is_splitting = step.equation is None and step.partners is None and not step.sites.seams
    return is_splitting and len(step.schedule.flows) > 1 and program.noise is None and program.profile == "fast"


@once
def hands(program: Program, step: Sweeps) -> list[bool]:
    """Return for each part of H whether its transposed sweeps pass cotangents from a site to other sites."""
    passes: list[bool] = []
    if step.equation and step.adjoint:
        kernels = [kernel for kernel in step.adjoint.steps if "sums_bar" not in kernel.inputs]
        cotangents = [pair for kernel in kernels for pair in kernel.along("site")]
        summed = any(kernel.inputs["gathered"] for kernel in kernels)
        return [summed or any(any(step.sites.places[s][1]) and not e.is_zero for s, e in cotangents)]
    for part, kernels in zip(step.parts, transposes(program, step), strict=False):
        cotangents = [(s, e) for kernel in kernels for s, e in kernel.along("site")]
        passes_on = any(any(step.sites.places[s][1]) and not e.is_zero for s, e in cotangents)
        passes.append(passes_on or any(sweep.gather for sweep in part))
    return passes


def takes(program: Program, step: Sweeps) -> bool:
    """Whether each loop of the reverse pass on a grid adds the cotangents that the previous loop passed to other sites.
    Otherwise separate loops add these cotangents.

    Loops that also add cotangents are long, and are used only in the profile ``fast``.
    """
    if program.profile != "fast" or step.partners or step.sites.colours > 1 or not can_recompute_fields(program, step):
        return False
    kernels = [kernel for part in transposes(program, step) for kernel in part]
    one_kernel_per_part = all(len(part) == 1 for part in step.parts)
    reads_neighbours = any(kernel.inputs.get(AROUND) for kernel in kernels)
    return one_kernel_per_part and not reads_neighbours and any(hands(program, step))


def handed_apart(program: Program, step: Sweeps) -> list[bool]:
    """Return for each part of H whether separate loops add the cotangents that its sweeps pass to other sites.

    If `takes` is true, the loop of the next flow in the reverse pass adds the cotangents. Then only the first flow of a
    step needs separate loops, since the reverse pass of a step ends with this flow.
    """
    first = step.schedule.flows[0][0] if takes(program, step) else None
    return [passes and first in (None, k) for k, passes in enumerate(hands(program, step))]


def ways(step: Sweeps) -> list[tuple[int, int]]:
    """Return for each flow of a step the pair (part of this flow, part of the next flow).

    The last flow of a step is merged with the first flow of the next step. An additional last pair belongs to the
    merged flow.
    """
    parts = [part for part, _ in step.schedule.flows]
    next_parts = [*parts[1:], parts[1 % len(parts)]]
    return [*zip(parts, next_parts, strict=True), (parts[0], parts[1 % len(parts)])]


def shares(step: Sweeps) -> bool:
    """Whether the transposed sweeps compute sums over all sites, such as the cotangents of coefficients or
    parameters.
    """
    kernels = step.adjoint.steps if step.adjoint else ()
    kernels = tuple(kernel for kernel in kernels if "sums_bar" not in kernel.inputs)
    summed = [kernel.along(array) for kernel in kernels for array in (TABLE, "params") if array in kernel.inputs]
    return any(not e.is_zero for slopes in summed for _, e in slopes)


def givers(step: Sweeps) -> bool:
    """Whether each row needs a list of the rows that contribute to its cotangents.

    Each row has a list of the rows that it reads. The two lists differ if an axis across rows has open ends: beyond an
    open end, a row reads a mirrored row with weight 0, but receives nothing.
    """
    return any(step.sites.open_axes[:-1])


def starts_are_read(step: Sweeps) -> bool:
    """Whether the transpose of a stage reads x, the state at the start of the stage, in addition to the solution y."""
    relax = next((k for k in step.adjoint.steps if k.role is Role.TRANSPOSED_RELAX), None) if step.adjoint else None
    return relax is not None and not {*relax.inputs.get("start", ())}.isdisjoint(symbols_of(*relax.roots))


def reads_sums(kernel: Kernel) -> bool:
    """Whether a transposed kernel reads the sums over bonds or pairs themselves, and not only their cotangents."""
    return not set(kernel.inputs["gathered"]).isdisjoint(symbols_of(*kernel.roots))
