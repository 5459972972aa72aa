"""The parts of a splitting and their flows, for reading."""

from __future__ import annotations

from collections.abc import Sequence

from phigen.compilation import CompiledSplitting
from phigen.notation import parts
from phigen.scheme.steps import Splitting, Step
from phigen.splitting.flow import Flow
from phigen.symbolic.expression import Expression, symbol
from phigen.symbolic.readable import readable


def method(compilation: CompiledSplitting) -> str:
    """``order 4, 2 parts with exact flows``."""
    count = len(compilation.splitting.flows)
    note = f" ({compilation.order.note})" if compilation.order.note else ""
    return f"order {compilation.order.order}, {count} part{'s' * (count > 1)} with exact flows{note}"


def images(flow: Flow, coordinates: Sequence[str]) -> dict[str, Expression]:
    """Images of the coordinates that a flow changes, after the time ``h:``."""
    return {c: symbol(c) + e for c, e in zip(coordinates, flow.increment, strict=True) if not e.is_zero}


def definitions(flow: Flow, coordinates: Sequence[str]) -> list[tuple[str, Expression]]:
    """The generator of a flow: its Hamiltonian, or the non-zero components of a force, by coordinates."""
    if not flow.force:
        return [("", flow.hamiltonian)]
    return [(c, f) for c, f in zip(coordinates, flow.force, strict=True) if not f.is_zero]


def formulas(compilation: CompiledSplitting, most: int | None) -> list[tuple[str, str]]:
    """The parts of H and the images of the coordinates under the flow of each, as pairs of a name and a text.

    Parts that occur more than once in long formulas have names, σ with a number, and come last.
    """
    listed: list[tuple[str, str]] = []
    for k, flow in enumerate(compilation.splitting.flows, 1):
        moved = images(flow, compilation.system.coordinates)
        named = [f"{flow.letter}_{k}{': ' * bool(c)}{c}" for c, _ in definitions(flow, compilation.system.coordinates)]
        local = [e for _, e in definitions(flow, compilation.system.coordinates)]
        listed += zip(named, readable(local, most), strict=True)
        listed += [(f"Φ_{k}: {name}", text) for name, text in parts.texts(moved, most)]
    return listed


def schedule(step: Step) -> list[tuple[int, float]]:
    """The flows of a splitting in order, as pairs of a part and a fraction of the step; none for other steps."""
    if not isinstance(step, Splitting):
        return []
    return [(part, step.schedule.times[row]) for part, row in step.schedule.flows]


def described(compilation: CompiledSplitting) -> dict[str, object]:
    """The parts, and the flows of a step as pairs of a part, counted from 1, and a fraction of the step."""
    parts = []
    for flow in compilation.splitting.flows:
        moved = images(flow, compilation.system.coordinates)
        local = definitions(flow, compilation.system.coordinates)
        texts = readable([*(e for _, e in local), *moved.values()], None)
        force = {c: t for (c, _), t in zip(local, texts, strict=False)}
        part: dict[str, object] = {"force": force} if flow.force else {"hamiltonian": texts[0]}
        parts.append(part | {"flow": dict(zip(moved, texts[len(local) :], strict=True)), "manner": flow.manner})
    steps = [[part + 1, time] for part, time in schedule(compilation.program.step)]
    return {"scheme": "splitting", "parts": parts, "flows": steps}
