"""Kernels of lattices in C, as loops over the sites of a row."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from phigen.ir import nodes as ir
from phigen.ir.passes import row_loops
from phigen.ir.passes.by_rows import ROW
from phigen.ir.passes.simultaneous import simultaneous
from phigen.ir.passes.temporaries import temporaries
from phigen.lanes.lane_functions import FULL_RANGE_FUNCTIONS
from phigen.scheme.kernel import Kernel, Output, Role
from phigen.scheme.program import Program
from phigen.scheme.steps import Sweep
from phigen.symbolic import functions as elementary
from phigen.symbolic.expression import ONE, ZERO, gradient, substitute
from phigen.symbolic.special import SPECIAL
from phigen.symbolic.symbols import PRESENT, Symbol, kind_of
from phigen.targets.c.kernels import FUNCTIONS, lane_calls
from phigen.targets.c.lattice.layout import Layout
from phigen.targets.c.layout import comment
from phigen.targets.c.loops import statements
from phigen.targets.header import plain, sentence

#: The name of a part of H.
_PART = re.compile(r"\bH_\d+")

#: The kernel of the derivatives of a sweep along the fields at the site itself.
BLOCK = "own_slope"


def site_block(program: Program, layout: Layout, relax: Kernel) -> Kernel:
    """Return the kernel of the derivatives of a sweep along y at the site: for each field those along all fields."""
    places = layout.step.sites.places
    at_site = {places[s][0]: s for s in relax.inputs["site"] if not any(places[s][1])}
    slopes = [gradient(e, [at_site[f]])[0] if f in at_site else ZERO for e in relax.roots for f in program.coordinates]
    return replace(
        relax,
        name=BLOCK,
        purpose="how y at a site follows y there",
        outputs=(Output(BLOCK, tuple(slopes)),),
        role=Role.OWN_SLOPE,
    )


def told(program: Program, source: str = "coef") -> str:
    """The arguments of a loop over sites: coefficients, unless it goes by the parameters of the solver; and the row."""
    return "const double *coef, " * (source == "coef") + f"const {program.name}_row *row"


@dataclass(frozen=True)
class Loop:
    """A function that goes over the sites of a row, or of a piece of it; ``shared`` is its name where several parts of
    H have the same."""

    name: str
    purpose: str
    arguments: str
    body: str
    shared: str = ""

    @property
    def code(self) -> str:
        """Arguments and body, which are equal for loops that do the same."""
        return self.arguments + self.body

    def text(self, program: Program, purposes: Iterable[str] = ()) -> str:
        """The function, below what it is for."""
        sentences = [plain(sentence(one)) for one in _together(purposes or (self.purpose,))]
        said = [line for one in sentences for line in comment(one, "   ")]
        said[0] = f"/* {said[0].strip()}"
        head = f"static inline void {program.name}_{self.name}({self.arguments})"
        return "\n".join([*said[:-1], f"{said[-1]} */", head, "{", self.body + "}\n"])


def _together(purposes: Iterable[str]) -> Iterator[str]:
    """Yield the purposes of a loop, with the parts of H that have the same purpose in one sentence."""
    grouped: dict[str, dict[str, None]] = {}
    for purpose in purposes:
        part, _, manner = purpose.rpartition(": ")
        name = _PART.search(manner)
        text, entry = (f"{part}: {{}}", manner) if part or not name else (manner.replace(name[0], "{}"), name[0])
        grouped.setdefault(text, {})[entry] = None
    for text, entries in grouped.items():
        yield text.removeprefix(": ").replace("{}", ("; " if ": " in text else ", ").join(entries))


def has_ends(program: Program, kernels: Sequence[Kernel]) -> bool:
    """Whether sites beside open ends have loops of their own."""
    return program.profile == "fast" and any(weights_of(kernel) for kernel in kernels)


def weights_of(kernel: Kernel) -> list[str]:
    """The symbols of terms that open ends take away."""
    return [s for s in kernel.inputs["present"] if kind_of(s) == PRESENT]


def in_loops(program: Program) -> dict[str, str]:
    """Return the functions that flows and stages call: versions for lanes, in short code only full-range ones."""
    return far_calls(program) if program.profile == "small" else _called(program, lane_calls(program))


def far_calls(program: Program) -> dict[str, str]:
    """Return the functions for arguments that may be very large: libm where versions for lanes have no value."""
    lanes = lane_calls(program)
    return _called(program, {**FUNCTIONS, **{f: lanes[f] for f in FULL_RANGE_FUNCTIONS if f in lanes}})


def seen_calls(program: Program) -> dict[str, str]:
    """Return the functions that observables call: libm, or functions that phigen defines."""
    return _called(program, FUNCTIONS)


def _called(program: Program, calls: Mapping[str, str]) -> dict[str, str]:
    defined = {f: f"{program.name}_{f}" for f in elementary.FUNCTIONS}
    return defined | dict(calls) | {f: defined[f] for f in SPECIAL}


def forms_of(program: Program, kernel: Kernel) -> Iterator[tuple[Kernel, str]]:
    """The kernel for the loop, and for that beside open ends; short code has one for both."""
    if has_ends(program, [kernel]):
        yield _inside(kernel), ""
        yield kernel, "_end"
    else:
        yield kernel, ""


def _inside(kernel: Kernel) -> Kernel:
    """The kernel away from open ends."""
    weights = weights_of(kernel)
    values = iter(substitute(kernel.roots, dict.fromkeys(weights, ONE)))
    others = tuple(s for s in kernel.inputs["present"] if s not in weights)
    outputs = tuple(Output(o.name, tuple(next(values) for _ in o.values)) for o in kernel.outputs)
    return replace(kernel, inputs={**kernel.inputs, "present": others}, outputs=outputs)


def sweep_loop(program: Program, layout: Layout, sweep: Sweep, form: str, calls: Mapping[str, str]) -> Loop:
    """Return the loop that updates some fields of the sites of a row, or their variation."""
    built = simultaneous(temporaries(layout.loops(program).sweep(sweep)))
    known = program.profile == "fast" or sweep.is_tangent
    swept: ir.Value | None = ir.Constant(sweep.colour) if known else ir.Member(ROW, "swept")
    swept = swept if layout.leaves_out(sweep.colour) else None
    body = row_loops.sweep(built, layout.rows(program), swept, compensated=program.compensated)
    fields = [program.coordinates[i] for i in sweep.moved]
    shared = "_".join(["tangent" if sweep.is_tangent else "sweep", *fields]) + form
    text = statements(body, program.name, calls, layout.reserved(program, len(sweep.kernel.roots)))
    return Loop(sweep.kernel.name + form, _purpose(sweep.kernel, form), told(program), text, shared)


def _purpose(kernel: Kernel, form: str) -> str:
    other = {"_far": "the same for large arguments of functions", "_end": "the same beside open ends"}
    return next((text for key, text in other.items() if form.endswith(key)), kernel.purpose)


def middle_loop(
    program: Program, layout: Layout, kernel: Kernel, form: str, calls: Mapping[str, str], assign: str
) -> Loop:
    """A kernel as a loop from y, of which rows are told, into or onto what they call out."""
    built, fields = temporaries(layout.loops(program).stage(kernel)), program.coordinates
    if kernel.role is Role.OWN_SLOPE:
        outputs = [Symbol("out", f, g) for f in fields for g in fields]
    else:
        outputs = [Symbol("out", f) for f in fields]
    body = row_loops.stage(built, layout.rows(program), outputs, adds=assign == "+=")
    text = statements(body, program.name, calls, layout.reserved(program, len(kernel.roots)))
    return Loop(kernel.name + form, _purpose(kernel, form), told(program), text)
