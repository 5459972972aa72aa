"""Formulas of a splitting, for display: the parts of H and their exact flows."""

from __future__ import annotations

from collections.abc import Sequence

from phigen.compilation import CompiledSplitting
from phigen.notation import named_parts
from phigen.scheme.steps import Step
from phigen.splitting.flow import Flow
from phigen.splitting.matrices import MatrixExponential
from phigen.symbolic.expression import Expression, substitute, symbol
from phigen.symbolic.readable import readable
from phigen.symbolic.symbols import Symbol, plain

#: Letters in formulas for a constant matrix A, and for E = exp(hA) − 1. A number follows if there are several matrices.
RATES, EXPONENTIAL = "A", "E"


def method(compilation: CompiledSplitting) -> str:
    """Return the description of a method, such as ``order 4, 2 parts with exact flows``."""
    count = len(compilation.splitting.flows)
    note = f" ({compilation.order.note})" if compilation.order.note else ""
    return f"order {compilation.order.order}, {count} part{'s' * (count > 1)} with exact flows{note}"


def images(compilation: CompiledSplitting, flow: Flow) -> dict[str, Expression]:
    """Return the coordinates that a flow changes, each with its value after the time h.

    An entry of a matrix exponential is a symbol such as E12: the letter E, the number of the matrix if there are
    several (see `matrices`), and the entry's row and column.
    """
    entries: dict[str, Expression] = {}
    for number, matrix in matrices(compilation):
        indices = [_place(matrix, k) for k in range(len(matrix.rates))]
        entries |= {
            e: symbol(Symbol(f"{EXPONENTIAL}{number}", index)) for e, index in zip(matrix.symbols, indices, strict=True)
        }
    coordinates = compilation.system.coordinates
    new_values = {c: symbol(c) + e for c, e in zip(coordinates, flow.increment, strict=True) if not e.is_zero}
    return dict(zip(new_values, substitute(list(new_values.values()), entries), strict=True))


def matrices(compilation: CompiledSplitting) -> list[tuple[str, MatrixExponential]]:
    """Return the distinct matrix exponentials of all flows, each in a pair with its number.

    The number is a text; it is "" if there is only one matrix exponential.
    """
    distinct = list(dict.fromkeys(e for flow in compilation.splitting.flows for e in flow.exponentials))
    return [(str(k) if len(distinct) > 1 else "", e) for k, e in enumerate(distinct, 1)]


def rates(number: str, matrix: MatrixExponential) -> dict[Symbol, Expression]:
    """Return the nonzero entries of the matrix A of an exponential exp(hA) − 1, by their symbols, such as A12."""
    return {Symbol(f"{RATES}{number}", _place(matrix, k)): e for k, e in enumerate(matrix.rates) if not e.is_zero}


def _place(matrix: MatrixExponential, k: int) -> str:
    """Return row and column, counted from 1, of entry ``k``: ``12``, or ``1_12`` if the matrix has ten rows or more."""
    return ("_" * (matrix.size > 9)).join(str(i + 1) for i in divmod(k, matrix.size))


def definitions(flow: Flow, coordinates: Sequence[str]) -> list[tuple[str, Expression]]:
    """Return the Hamiltonian or the force of ``flow``, as pairs (name, expression).

    For a Hamiltonian there is one pair, with the name "". For a force there is a pair for each nonzero component, with
    the name of its coordinate.
    """
    if not flow.force:
        return [("", flow.hamiltonian)]
    return [(c, f) for c, f in zip(coordinates, flow.force, strict=True) if not f.is_zero]


def formulas(compilation: CompiledSplitting, max_terms: int | None) -> list[tuple[str, str]]:
    """Return pairs of a name and a text: the parts of H, and for each flow the coordinates after the time h.

    Long formulas contain symbols σ_1, σ_2, … for repeated subexpressions; the definitions of these symbols follow the
    formulas of the flow. The last pairs define the matrix exponentials that occur in the flows.
    """
    equations: list[tuple[str, str]] = []
    for k, flow in enumerate(compilation.splitting.flows, 1):
        new_values = images(compilation, flow)
        definition_lines = [
            f"{flow.letter}_{k}{': ' * bool(c)}{c}" for c, _ in definitions(flow, compilation.system.coordinates)
        ]
        local = [e for _, e in definitions(flow, compilation.system.coordinates)]
        equations += zip(definition_lines, readable(local, max_terms), strict=True)
        equations += [(f"Φ_{k}: {name}", text) for name, text in named_parts.texts(new_values, max_terms)]
    for number, matrix in matrices(compilation):
        equations.append((f"{EXPONENTIAL}{number}", f"exp(h*{RATES}{number}) - 1"))
        entries = rates(number, matrix)
        equations += zip(map(plain, entries), readable(list(entries.values()), max_terms), strict=True)
    return equations


def schedule(step: Step) -> list[tuple[int, float]]:
    """Return the flows of a step in their order, as pairs (number of the part, fraction of h); numbers count from 0.

    If the step is no splitting, the list is empty.
    """
    schedule = step.flow_schedule
    return [(part, schedule.times[row]) for part, row in schedule.flows] if schedule else []


def described(compilation: CompiledSplitting) -> dict[str, object]:
    """Return the parts of H and the flows of a step as plain data, for JSON.

    ``flows`` has pairs (number of the part, fraction of the step) in the order of application; numbers count from 1.
    ``generators`` has the matrices A of exponentials E = exp(hA) − 1, row by row.
    """
    parts = []
    for flow in compilation.splitting.flows:
        new_values = images(compilation, flow)
        local = definitions(flow, compilation.system.coordinates)
        texts = readable([*(e for _, e in local), *new_values.values()], None)
        force = {c: t for (c, _), t in zip(local, texts, strict=False)}
        part: dict[str, object] = {"force": force} if flow.force else {"hamiltonian": texts[0]}
        parts.append(part | {"flow": dict(zip(new_values, texts[len(local) :], strict=True)), "manner": flow.manner})
    steps = [[part + 1, time] for part, time in schedule(compilation.program.step)]
    generators = {
        f"{EXPONENTIAL}{number}": [
            texts[i : i + matrix.size]
            for texts in [readable(list(matrix.rates), None)]
            for i in range(0, len(texts), matrix.size)
        ]
        for number, matrix in matrices(compilation)
    }
    description: dict[str, object] = {"generators": generators} if generators else {}
    return {"scheme": "splitting", "parts": parts, **description, "flows": steps}
