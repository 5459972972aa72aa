"""Inverse sweeps of lattices: the fields before a flow, computed from the fields after it by the flow over the time −h.

A sum over bonds or pairs has the same value before and after a sweep, since it reads no field that the sweep updates.
If a damping force adds a multiple of a field to this field, the inverse divides by a number. Other damping has no
inverse.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import wraps
from typing import TypeVar

from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.program import Program
from phigen.scheme.reversal import EVEN, STATE_BEFORE, before, of_coefficients, over_negative_time
from phigen.scheme.steps import BACK, Sites, Sweep, Sweeps
from phigen.scheme.sweep_collecting import collecting
from phigen.symbolic.expression import ONE, ZERO, Expression, gradient, rebuild, substitute, symbol, symbols_of
from phigen.symbolic.symbols import PRESENT, Symbol

T = TypeVar("T")


def once(function: Callable[[Program, Sweeps], T]) -> Callable[[Program, Sweeps], T]:
    """Decorator that stores the last result of a function of a program and its step.

    Printers call the decorated functions dozens of times with the same program and step.
    """
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
def can_recompute_fields(program: Program, step: Sweeps) -> bool:
    """Whether the reverse pass can compute the fields before a sweep from those after it, by the inverse flow.
    Otherwise the fields before each sweep are stored.
    """
    if not step.adjoint or step.equation:
        return False
    parities, sweeps = of_coefficients(step), [sweep for part in step.parts for sweep in part]
    summed = {s for sweep in sweeps if sweep.gather for k in sweep.gather.kernels for s in symbols_of(*k.roots)}
    invertible = all(_changes(program, sweep, parities) for sweep in sweeps)
    return invertible and all(parities.get(s, EVEN) == EVEN for s in summed)


@once
def transposes(program: Program, step: Sweeps) -> list[list[Kernel]]:
    """Return for each part of H the transposed kernels of its sweeps.

    If the fields can be recomputed, each kernel also computes the values that the fields had before its sweep. Each
    site then collects the contributions of its neighbours, if `collecting` allows this.
    """
    kernels = {kernel.name: kernel for kernel in step.adjoint.steps} if step.adjoint else {}
    invertible = can_recompute_fields(program, step)
    transposes_of_parts = []
    for part in step.parts if step.adjoint else ():
        transposes_of_parts.append([unweighted(step.sites, kernels[sweep.kernel.name + BACK]) for sweep in part])
        for k, sweep in enumerate(part if invertible else ()):
            transpose = transposes_of_parts[-1][k]
            transposes_of_parts[-1][k] = recomputing_transpose(
                program, step, sweep, collecting(program.coordinates, step, sweep, transpose) or transpose
            )
    return transposes_of_parts


def unweighted(sites: Sites, transpose: Kernel) -> Kernel:
    """Return a transposed kernel in which some factors for open ends are omitted.

    A factor is 0 if a term of H extends beyond an open end, else 1. Factors are omitted in values that a site stores
    for a neighbour: without factors, the values for several neighbours are often equal. A factor can be omitted if it
    is 1 at every site that has this neighbour. It cannot be omitted if the term extends beyond the neighbour.
    """

    def without_weights(name: str, value: Expression) -> Expression:
        offset = sites.places[name][1]
        return _without_factors(value, offset) if any(offset) else value

    values = tuple(without_weights(name, value) for name, value in transpose.along("site"))
    return replace(
        transpose, outputs=tuple(replace(o, values=values) if o.name == "site_bar" else o for o in transpose.outputs)
    )


def _without_factors(value: Expression, offset: Sequence[int]) -> Expression:
    """Return a product without some of its factors for open ends.

    A factor is left out if it is 1 at every site that has a neighbour at ``offset``. `unweighted` explains the factors.
    """
    if value.op in ("mul", "neg"):
        return rebuild(value, [_without_factors(e, offset) for e in value.args])
    if value.op != "symbol" or not isinstance(value.value, Symbol) or value.value.kind != PRESENT:
        return value
    positions = [int(k) for k in value.value.key]
    pairs = zip(positions[::2], positions[1::2], offset, strict=True)
    return ONE if all(low >= min(0, o) and high <= max(0, o) for low, high, o in pairs) else value


def recomputing_transpose(program: Program, step: Sweeps, sweep: Sweep, transpose: Kernel) -> Kernel:
    """Return the transpose of a sweep for a reverse pass that has the fields after the sweep, but not those before it.

    The kernel recomputes the fields before the sweep, as its output `STATE_BEFORE`.
    """
    updated = [program.coordinates[f] for f in sweep.moved]
    changes = _changes(program, sweep, of_coefficients(step))
    values = iter(before(transpose.roots, changes))
    outputs = [replace(o, values=tuple(next(values) for _ in o.values)) for o in transpose.outputs]
    unread = tuple(f for f in updated if f not in transpose.inputs["site"])
    return replace(
        transpose,
        inputs={**transpose.inputs, STATE_BEFORE: unread},
        outputs=(*outputs, Output(STATE_BEFORE, tuple(symbol(f) + change for f, change in changes.items()))),
    )


def _changes(program: Program, sweep: Sweep, parities: Mapping[str, int]) -> dict[str, Expression]:
    """Return the increments of the inverse of a sweep, by the name of the field; empty if there is no inverse."""
    updated, changes = [program.coordinates[f] for f in sweep.moved], sweep.kernel.roots
    if all(parities.get(s, EVEN) for s in symbols_of(*changes)):
        return dict(zip(updated, over_negative_time(changes, parities), strict=True))
    increments = {f: _inverse_of_multiple(f, updated, change) for f, change in zip(updated, changes, strict=True)}
    return {f: e for f, e in increments.items() if e is not None} if None not in increments.values() else {}


def _inverse_of_multiple(field: str, updated: Sequence[str], change: Expression) -> Expression | None:
    """Return the increment of the inverse of the map x ↦ x + cx + b of a field x; ``change`` is cx + b.

    Returns None if c or b depends on fields that the sweep updates.
    """
    (factor,), (constant_part,) = gradient(change, [field]), substitute([change], {field: ZERO})
    if not {*updated}.isdisjoint(symbols_of(factor, constant_part)):
        return None
    return -(factor * symbol(field) + constant_part) * (ONE / (ONE + factor))


def apart(transpose: Kernel) -> tuple[Kernel, Kernel] | None:
    """Divide a transposed kernel that recomputes fields into two kernels: one for the cotangents, and one for the
    fields before the sweep.

    Only the second kernel reads sums over bonds or pairs. So the loop that passes the cotangents through these sums can
    also compute the sums. Returns None if the cotangents depend on the sums, or if no fields are recomputed.
    """
    cotangent_outputs = tuple(o for o in transpose.outputs if o.name != STATE_BEFORE)
    state_outputs = tuple(o for o in transpose.outputs if o.name == STATE_BEFORE)
    read_symbols = symbols_of(*(e for o in cotangent_outputs for e in o.values))
    if not state_outputs or not {*transpose.inputs["gathered"]}.isdisjoint(read_symbols):
        return None
    purpose = "the fields before the sweep, from sums over bonds or pairs"
    name = transpose.name.removesuffix(BACK) + "_inverse"
    return replace(transpose, outputs=cotangent_outputs), replace(
        transpose, name=name, purpose=purpose, outputs=state_outputs
    )
