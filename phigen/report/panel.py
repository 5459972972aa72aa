"""A page with the live panel alone, to be shown inside another page."""

from __future__ import annotations

from phigen.compilation import Compilation
from phigen.lattice.states import start_of
from phigen.report import page
from phigen.report.live import gathered, live_section, script
from phigen.report.live_lattice import gathered_lattice, lattice_live_section, lattice_script
from phigen.spec.model import Run


def panel_page(compilation: Compilation, run: Run) -> str | None:
    """The HTML of the panel of a run, of the order of the spec; None where there is none.

    Raises `SpecError` for a start that cannot be read.
    """
    spec = compilation.spec
    if spec.lattice:
        lattice = compilation.by_sweeps()
        fields = gathered_lattice(lattice, None, run, start_of(spec, run), ())
        body, code, panel = lattice_live_section(lattice, fields), lattice_script(fields), page.FIELDS
        has_solver = bool(fields.solvers)
    else:
        live = gathered(compilation, None, run, spec.parameters_of(run), ())
        body, code, panel, has_solver = live_section(compilation, live), script(live), page.CURVES, bool(live.solvers)
    return page.alone(spec.title or spec.name, body, code, panel) if has_solver else None
