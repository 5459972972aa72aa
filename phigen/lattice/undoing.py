"""Sweeps that are undone: the fields before a flow, found from those after it by the flow over the time −h.

What a sweep computes is written for −h term by term: what is odd in h changes its sign, what is even stays, so that
sines, exponentials and forces that the transpose of the sweep reads are computed once. What bonds or pairs add up is
that too: it reads nothing that the sweep moves. Flows with forces are left out: what these damp cannot be found again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from phigen.lattice.adjoint import BACK
from phigen.lattice.collecting import collecting
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.program import Program
from phigen.scheme.steps import Sites, Sweep, Sweeps
from phigen.symbolic.expression import (
    ONE,
    Expression,
    fold,
    neg,
    rebuild,
    substitute,
    symbol,
    symbols_of,
    topological,
)
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.symbols import PRESENT, Symbol, coefficient
from phigen.symbolic.verdict import PROVED, decide_zero

#: The output of a transpose that is the moved fields before the sweep, and the input of those that it reads for that.
UNDONE = "undone"

ODD, NEITHER, EVEN = -1, 0, 1


def can_be_undone(program: Program, step: Sweeps) -> bool:
    """Whether the transpose of a step finds the fields before its sweeps from those after them."""
    if not step.adjoint or step.equation or program.forced:
        return False
    parities, sweeps = _of_coefficients(step), [sweep for part in step.parts for sweep in part]
    used = {s for sweep in sweeps for s in symbols_of(*sweep.kernel.roots)}
    summed = {s for sweep in sweeps if sweep.gather for k in sweep.gather.kernels for s in symbols_of(*k.roots)}
    return all(parities.get(s, EVEN) for s in used) and all(parities.get(s, EVEN) == EVEN for s in summed)


def transposes(program: Program, step: Sweeps) -> list[list[Kernel]]:
    """The transposes of the sweeps of each part, which undo them and collect where they can."""
    kernels = {kernel.name: kernel for kernel in step.adjoint.steps} if step.adjoint else {}
    undone = can_be_undone(program, step)
    found = []
    for part in step.parts if step.adjoint else ():
        found.append([unweighted(step.sites, kernels[sweep.kernel.name + BACK]) for sweep in part])
        for k, sweep in enumerate(part if undone else ()):
            back = found[-1][k]
            found[-1][k] = undoing(program, step, sweep, collecting(program.coordinates, step, sweep, back) or back)
    return found


def unweighted(sites: Sites, back: Kernel) -> Kernel:
    """The transpose without weights of open ends in what it hands on, so that this is one value for many neighbours.

    A neighbour that takes it is there, and so is the term, if that reaches no further."""

    def handed(name: str, value: Expression) -> Expression:
        offset = sites.places[name][1]
        return _without_factors(value, offset) if any(offset) else value

    values = tuple(handed(name, value) for name, value in back.along("site"))
    return replace(back, outputs=tuple(replace(o, values=values) if o.name == "site_bar" else o for o in back.outputs))


def _without_factors(value: Expression, offset: Sequence[int]) -> Expression:
    """A product without the weights of terms that are there for every site that has a neighbour at an offset."""
    if value.op in ("mul", "neg"):
        return rebuild(value, [_without_factors(e, offset) for e in value.args])
    if value.op != "symbol" or not isinstance(value.value, Symbol) or value.value.kind != PRESENT:
        return value
    ends = [int(k) for k in value.value.key]
    pairs = zip(ends[::2], ends[1::2], offset, strict=True)
    return ONE if all(low >= min(0, o) and high <= max(0, o) for low, high, o in pairs) else value


def undoing(program: Program, step: Sweeps, sweep: Sweep, back: Kernel) -> Kernel:
    """The transpose of a sweep that reads the moved fields as they are after it, and finds what they were, `UNDONE`."""
    moved = [program.coordinates[f] for f in sweep.moved]
    changes = _turned_back(sweep.kernel.roots, _of_coefficients(step))
    before = {f: symbol(f) + change for f, change in zip(moved, changes, strict=True)}
    values = iter(_substituted(back.roots, before))
    outputs = [replace(o, values=tuple(next(values) for _ in o.values)) for o in back.outputs]
    unread = tuple(f for f in moved if f not in back.inputs["site"])
    return replace(
        back,
        inputs={**back.inputs, UNDONE: unread},
        outputs=(*outputs, Output(UNDONE, tuple(before.values()))),
    )


def _substituted(values: Sequence[Expression], before: Mapping[str, Expression]) -> list[Expression]:
    """Values at the fields before a sweep. Where these are the same in arguments of functions, as |ψ|² is that moves
    only phases, which is proved, functions are not called once more."""
    called = dict.fromkeys(e.args[0] for e in topological(values) if e.op in FUNCTIONS and len(e.args) == 1)
    moved = [e for e in called if not {*before}.isdisjoint(symbols_of(e))]
    kept = {
        e: symbol(Symbol("kept", k))
        for k, (e, other) in enumerate(zip(moved, substitute(moved, before), strict=True))
        if decide_zero("", [("", other - e)]).verdict == PROVED
    }

    def visit(e: Expression, args: list[Expression]) -> Expression:
        return kept.get(e) or rebuild(e, args)

    held = {value.value: e for e, value in kept.items()}
    return substitute(substitute(fold(values, visit), before), held)


def apart(back: Kernel) -> tuple[Kernel, Kernel] | None:
    """A transpose that undoes a sweep as two kernels, of which the latter alone reads what bonds or pairs add up: that
    is then found with the cotangents that these give back, by the same functions.

    None where the transpose itself reads it, so that it has to be found before."""
    rest = tuple(o for o in back.outputs if o.name != UNDONE)
    undo = tuple(o for o in back.outputs if o.name == UNDONE)
    read = symbols_of(*(e for o in rest for e in o.values))
    if not undo or not {*back.inputs["gathered"]}.isdisjoint(read):
        return None
    purpose = "the fields before the sweep, from what has been added up for them"
    name = back.name.removesuffix(BACK) + f"_{UNDONE}"
    return replace(back, outputs=rest), replace(back, name=name, purpose=purpose, outputs=undo)


def _of_coefficients(step: Sweeps) -> dict[str, int]:
    """How the coefficients of a flow follow the sign of its time."""
    found = [parity for parity, _ in _parities(step.prepare.roots, dict.fromkeys(step.prepare.inputs["h"], ODD))]
    if step.refresh:
        slots: dict[str, int] = {coefficient(k): parity for k, parity in enumerate(found)}
        found += [parity for parity, _ in _parities(step.refresh.roots, slots)]
    return {coefficient(k): parity for k, parity in enumerate(found)}


def _turned_back(values: Sequence[Expression], parities: Mapping[str, int]) -> list[Expression]:
    """The values over the time −h."""
    return [turned for _, turned in _parities(values, parities)]


def _parities(values: Sequence[Expression], of_symbols: Mapping[str, int]) -> list[tuple[int, Expression]]:
    """Whether values are odd or even in the time, and what they are over −h; symbols that are not listed are even."""

    def visit(node: Expression, args: list[tuple[int, Expression]]) -> tuple[int, Expression]:
        parity = of_symbols.get(node.value, EVEN) if node.op == "symbol" else _parity(node, [p for p, _ in args])
        if parity == NEITHER:
            return parity, rebuild(node, [turned for _, turned in args])
        return parity, node if parity == EVEN else neg(node)

    return fold(values, visit)


def _parity(node: Expression, of_args: Sequence[int]) -> int:
    """That of a number, a sum, a product, a power or a value of a function."""
    if all(parity == EVEN for parity in of_args):
        return EVEN
    first = of_args[0]
    if node.op in ("add", "sub", "neg"):
        return first if len({*of_args}) == 1 else NEITHER
    if node.op == "mul":
        return first * of_args[1]
    if node.op == "pow":
        return first ** int(node.value) if node.value.denominator == 1 and first else NEITHER
    known = {"odd": ODD, "even": EVEN}.get(FUNCTIONS[node.op].parity, NEITHER) if node.op in FUNCTIONS else NEITHER
    return known if first == ODD else NEITHER
