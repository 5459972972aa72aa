"""Inverse sweeps of lattices: the fields before a flow, computed from those after it by the flow over the time −h.

Of what bonds or pairs add up nothing is computed twice either: it reads nothing that the sweep moves. Where forces
damp, a multiple of a field that is added to it is divided away; other damping is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import wraps
from typing import TypeVar

from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.program import Program
from phigen.scheme.reversal import EVEN, UNDONE, before, of_coefficients, turned_back
from phigen.scheme.steps import BACK, Sites, Sweep, Sweeps
from phigen.scheme.sweep_collecting import collecting
from phigen.symbolic.expression import ONE, ZERO, Expression, gradient, rebuild, substitute, symbol, symbols_of
from phigen.symbolic.symbols import PRESENT, Symbol

T = TypeVar("T")


def once(function: Callable[[Program, Sweeps], T]) -> Callable[[Program, Sweeps], T]:
    """Keep the last result for calls with the same two objects: a printer asks dozens of times for each."""
    last: list[tuple[Program, Sweeps, T]] = []

    @wraps(function)
    def result(program: Program, step: Sweeps) -> T:
        entry = last[0] if last else None
        if entry is None or entry[0] is not program or entry[1] is not step:
            entry = (program, step, function(program, step))
            last[:] = [entry]
        return entry[2]

    return result


@once
def can_be_undone(program: Program, step: Sweeps) -> bool:
    """Whether the transpose of a step finds the fields before its sweeps from those after them."""
    if not step.adjoint or step.equation:
        return False
    parities, sweeps = of_coefficients(step), [sweep for part in step.parts for sweep in part]
    summed = {s for sweep in sweeps if sweep.gather for k in sweep.gather.kernels for s in symbols_of(*k.roots)}
    found = all(_changes(program, sweep, parities) for sweep in sweeps)
    return found and all(parities.get(s, EVEN) == EVEN for s in summed)


@once
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
    changes = _changes(program, sweep, of_coefficients(step))
    values = iter(before(back.roots, changes))
    outputs = [replace(o, values=tuple(next(values) for _ in o.values)) for o in back.outputs]
    unread = tuple(f for f in moved if f not in back.inputs["site"])
    return replace(
        back,
        inputs={**back.inputs, UNDONE: unread},
        outputs=(*outputs, Output(UNDONE, tuple(symbol(f) + change for f, change in changes.items()))),
    )


def _changes(program: Program, sweep: Sweep, parities: Mapping[str, int]) -> dict[str, Expression]:
    """What undoes a sweep, added to the fields after it that it has moved; nothing where that is not found."""
    moved, changes = [program.coordinates[f] for f in sweep.moved], sweep.kernel.roots
    if all(parities.get(s, EVEN) for s in symbols_of(*changes)):
        return dict(zip(moved, turned_back(changes, parities), strict=True))
    found = {f: _divided(f, moved, change) for f, change in zip(moved, changes, strict=True)}
    return {f: e for f, e in found.items() if e is not None} if None not in found.values() else {}


def _divided(field: str, moved: Sequence[str], change: Expression) -> Expression | None:
    """What undoes the change of a field by a multiple of itself, and more without moved fields; None for others."""
    (factor,), (more,) = gradient(change, [field]), substitute([change], {field: ZERO})
    if not {*moved}.isdisjoint(symbols_of(factor, more)):
        return None
    return -(factor * symbol(field) + more) * (ONE / (ONE + factor))


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
