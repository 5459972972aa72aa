"""Section on the modified Hamiltonian: measured changes against the expected powers of h."""

from __future__ import annotations

from math import isfinite

from markupsafe import Markup

from phigen.report import page
from phigen.report.drawable import drawable
from phigen.study.backward import Constancy, truncation


def modified_section(constancy: Constancy | None, why_not: str) -> Markup:
    """Return the section on the modified Hamiltonian.

    The section shows the measured changes as a table and a figure, or the reason why they were not measured.
    """
    explanation = (
        "A step of the solver agrees to all orders in h with the exact flow, over the time h, of a Hamiltonian H̃ near "
        "H, which is a series in h. So steps nearly conserve H̃, and the energy H oscillates but does not drift."
    )
    if constancy is None:
        return page.joined(
            [page.paragraph(explanation), page.paragraph(f"It was not measured here: {why_not}.", "note")]
        )
    explanation += " With more terms of this series, H̃ changes less along the trajectory."
    rows = [_row(m, constancy) for m in range(len(constancy.powers))]
    columns = [("", "Hamiltonian"), ("", "expected power"), ("", "measured power")]
    columns.append(("number", f"largest change at steps of {constancy.step:.4g}"))
    blocks = [
        page.paragraph(explanation),
        page.table("Changes along the trajectory, relative to the energy", columns, rows),
    ]
    if drawable():
        from phigen.report import pictures

        blocks.append(pictures.constancy_picture(constancy))
    return page.joined(blocks)


def _row(m: int, constancy: Constancy) -> tuple[str, list[page.Cell]]:
    observed = (
        Markup("h<sup>{}</sup>").format(f"{constancy.observed[m]:.2f}")
        if isfinite(constancy.observed[m])
        else "rounding"
    )
    stated = Markup("h<sup>{}</sup>").format(constancy.powers[m])
    return truncation(m), [("", stated), ("", observed), ("number", page.scientific(float(constancy.errors[m].max())))]
