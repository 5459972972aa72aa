"""Bi-realisation of a block-diagonal π: the product of bi-realisations of its blocks."""

from __future__ import annotations

from collections.abc import Sequence

from phigen.geometry.blocks import blocks
from phigen.geometry.shapes import Canonical, Constant
from phigen.geometry.subsystems import block_of
from phigen.geometry.system import System
from phigen.realisations.protocol import BiRealisation, Builder, refuse
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.expression import ZERO, Expression

KIND = "product"


def build(system: System, choice: BirealisationChoice, build_part: Builder) -> BiRealisation:
    """Return the product of the bi-realisations that ``build_part`` makes for the blocks of π.

    Raises `SpecError` if π has only one block, if the kind does not apply to a block, or if the solver would have to
    follow a path for a block. A path can be followed for the whole system only.
    """
    parts = grouped(system)
    if len(parts) < 2:
        raise refuse(
            f"birealisation {KIND} needs a block-diagonal π; here {', '.join(system.coordinates)} are one block"
        )
    return assembled(system, parts, build_part, choice)


def grouped(system: System) -> list[System]:
    """Return the blocks of π as separate systems with H = 0. All blocks with constant π together form one system."""
    single = [block_of(system, indices) for indices in blocks(system.coordinates, system.poisson)]
    constant = [b for b in single if isinstance(b.shape, Constant | Canonical)]
    if len(constant) < 2:
        return single
    together = {c for b in constant for c in b.coordinates}
    merged = block_of(system, [i for i, c in enumerate(system.coordinates) if c in together])
    return [merged, *(b for b in single if b not in constant)]


def assembled(
    system: System, parts: Sequence[System], build_part: Builder, choice: BirealisationChoice
) -> BiRealisation:
    """Return the product of the bi-realisations that ``build_part`` makes for some ``parts`` of a system.

    Raises `SpecError` if the solver would have to follow a path for a part.
    """
    realisations = [build_part(part, choice) for part in parts]
    for part, realisation in zip(parts, realisations, strict=True):
        if realisation.path:
            names = ", ".join(part.coordinates)
            raise refuse(
                f"birealisation {KIND}: no closed form is known for the block ({names})",
                "use birealisation: karasev, which needs no closed form",
            )

    def joined(name: str) -> tuple[Expression, ...]:
        values = {c: e for r in realisations for c, e in zip(r.coordinates, getattr(r, name), strict=True)}
        return tuple(values.get(c, ZERO) for c in system.coordinates)

    descriptions = [f"({', '.join(r.coordinates)}): {r.kind}, {_first_clause(r.explanation)}" for r in realisations]
    return BiRealisation(
        KIND,
        system.coordinates,
        joined("alpha"),
        joined("beta"),
        joined("displacement"),
        joined("increment"),
        symmetric=all(r.symmetric for r in realisations),
        exact=all(r.exact for r in realisations),
        explanation=f"π is block diagonal, block by block: {'; '.join(descriptions)}",
        reference="; ".join(dict.fromkeys(r.reference for r in realisations)),
    )


def _first_clause(explanation: str) -> str:
    return explanation.removeprefix("auto picked ").partition("since ")[2] or explanation
