"""Display of systems, compilations and trajectories in notebooks, as LaTeX and as HTML with MathML.

The HTML has no style sheet and no script, so that it takes the style of the notebook.
"""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

import numpy as np

from phigen.compilation import Compilation
from phigen.geometry.system import System
from phigen.lattice.cell import Cell
from phigen.notation import cell_formulas, latex, mathml
from phigen.runtime.interface import Floats
from phigen.runtime.lattice import LatticeTrajectory
from phigen.runtime.trajectory import Trajectory


def system_latex(system: System) -> str:
    """Return π, H, Casimirs and invariants as displayed equations in LaTeX."""
    return "\n".join(latex.system_blocks(system))


def system_html(system: System) -> str:
    """Return HTML with H, the nonzero brackets, Casimirs, invariants, and the parameters with their defaults."""
    names, n = system.coordinates, system.dimension
    rows = [(mathml.name("H"), mathml.expression(system.hamiltonian))]
    for i in range(n):
        rows += [
            (mathml.bracket(names[i], names[j]), mathml.expression(system.poisson[i][j]))
            for j in range(i + 1, n)
            if not system.poisson[i][j].is_zero
        ]
    rows += [(mathml.name(c), mathml.expression(e)) for c, e in {**system.casimirs, **system.invariants}.items()]
    lines = [_formula(left, right) for left, right in rows]
    values = ", ".join(f"{p.name} = {float(p.value):g}" for p in system.parameters)
    caption = f"in ({', '.join(names)})" + (f", with {values}" if values else "")
    return f"<div><strong>{escape(system.name)}</strong> {escape(caption)}{''.join(lines)}</div>"


def compilation_html(compilation: Compilation) -> str:
    """Return HTML with the formulas of the system, and a line on the order and the kind of the method."""
    program = compilation.program
    caption = f"compiled to order {program.order}: {compilation.label}, {program.step.kind.manner}"
    body = _cell_html(compilation.by_sweeps().cell) if compilation.spec.lattice else system_html(compilation.system)
    return body.removesuffix("</div>") + f"<p>{escape(caption)}</p></div>"


def _cell_html(cell: Cell) -> str:
    """Return HTML with the brackets, the density of H, Casimirs, invariants and equations of motion of a lattice."""
    lines = [
        _formula(left, "".join(right)) for _, equations in cell_formulas.formulas(cell) for left, right in equations
    ]
    return f"<div><strong>{escape(cell.name)}</strong> {escape(cell_formulas.described(cell))}{''.join(lines)}</div>"


def trajectory_html(trajectory: Trajectory) -> str:
    """Return an HTML table of the first and the last state, and of the spread (maximum minus minimum) of energy and
    Casimirs."""
    head = ["", "t", *trajectory.coordinates, "energy", *trajectory.casimirs]
    table = trajectory.rows()
    body = [["start", *map(_number, table[0])], ["end", *map(_number, table[-1])]]
    blank = [""] * (1 + len(trajectory.coordinates))
    body.append(["spread", *blank, *(_spread(v) for v in (trajectory.energy, *trajectory.casimirs.values()))])
    caption = f"{trajectory.steps} steps of {trajectory.h!r}, {len(trajectory)} rows"
    rows = "".join(_row("td", cells) for cells in body)
    return f"<table><caption>{escape(caption)}</caption>{_row('th', head)}{rows}</table>"


def lattice_trajectory_html(trajectory: LatticeTrajectory) -> str:
    """Return an HTML table of field means and energy at the start and the end, and of the largest changes of energy and
    Casimirs."""
    changes = trajectory.changes()
    head = ["", "t", *(f"mean {c}" for c in trajectory.coordinates), "energy", *[*changes][1:]]
    body = []
    for label, k in (("start", 0), ("end", -1)):
        means = trajectory.x[k].reshape(len(trajectory.coordinates), -1).mean(axis=1)
        numbers = [trajectory.t[k], *means.tolist(), trajectory.energy[k]]
        body.append([label, *map(_number, numbers), *[""] * (len(changes) - 1)])
    blank = [""] * (1 + len(trajectory.coordinates))
    body.append(["largest change", *blank, *(f"{v.max():.2g}" for v in changes.values())])
    sizes = "×".join(map(str, trajectory.x.shape[2:]))
    label = f"{sizes} sites, {trajectory.steps} steps of {trajectory.h!r}, {len(trajectory)} frames"
    rows = "".join(_row("td", cells) for cells in body)
    return f"<table><caption>{escape(label)}</caption>{_row('th', head)}{rows}</table>"


def _formula(left: str, right: str) -> str:
    markup = f"<mrow>{left}<mo>=</mo>{right}</mrow>"
    return f'<div><math xmlns="http://www.w3.org/1998/Math/MathML" display="block">{markup}</math></div>'


def _number(value: float) -> str:
    return f"{value:.9g}"


def _spread(values: Floats) -> str:
    return f"{np.ptp(values):.2g}"


def _row(tag: str, cells: Iterable[str]) -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"
