"""Formulas of Gauss collocation, for display: the order, the equations of a step, and the unknowns of its stages."""

from __future__ import annotations

from phigen.compilation import CompiledGauss
from phigen.gauss.realisation import LogarithmicBlock, Plain
from phigen.symbolic.readable import readable


def method(compilation: CompiledGauss) -> str:
    """Return the description of a method, such as ``order 8, 4 stages, structure exact``."""
    stages, note = compilation.order.terms, compilation.order.note
    description = (
        f"order {compilation.order.order}, {stages} stage{'s' * (stages > 1)}, structure {compilation.structure}"
    )
    return description + (f" ({note})" if note else "")


def equations() -> list[tuple[str, str]]:
    """Return the equations of a step as text, in pairs (left side, right side); Z_i are the states of the stages."""
    return [
        ("Z_i", "z + Σ_j μ_ij L_j"),
        ("L_j", "h b_j f(Z_j)"),
        ("z′", "z + Σ_j L_j"),
        ("μ_ij + μ_ji", "1"),
    ]


def lines(compilation: CompiledGauss) -> list[str]:
    """Return lines of text. For each part of the state, a line names the unknowns of the stages. The last line says
    whether the step is a Poisson map.
    """
    listed_lines, names = [], compilation.system.coordinates
    for part in compilation.gauss.parts:
        unknowns = ", ".join(names[i] for i in part.indices)
        if isinstance(part, Plain):
            listed_lines.append(f"{unknowns}: themselves")
            continue
        if isinstance(part, LogarithmicBlock):
            listed_lines.append(f"{unknowns}: their logarithms")
            continue
        shifts = [f"{names[i]} + {readable([s], None)[0]}" for i, s in zip(part.indices, part.shift, strict=True)]
        description = unknowns if all(s.is_zero for s in part.shift) else ", ".join(shifts)
        in_ideal = (
            f"; G = g + n with n in an ideal; {part.unknowns} unknowns: g, and a linear functional in place of n"
            if part.ideal
            else ""
        )
        listed_lines.append(
            f"{description}: x̃(G E_a G*) with G in an algebra of dimension {part.algebra.dimension}, G = 1 at the start"
            + in_ideal
        )
    exact = compilation.gauss.exact
    listed_lines.append(
        "the step is a Poisson map"
        if exact
        else "the step is not a Poisson map: its structure is exact only up to truncation errors"
    )
    return listed_lines


def described(compilation: CompiledGauss) -> dict[str, object]:
    """Return the description of the method as plain data, for JSON."""
    return {
        "scheme": "gauss",
        "structure": compilation.structure,
        "stages": compilation.order.terms,
        "unknowns": lines(compilation),
    }
