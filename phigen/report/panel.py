"""Page with only the live panel, to be embedded in another page."""

from __future__ import annotations

from phigen.compilation import Compilation
from phigen.errors import CheckError
from phigen.lattice.states import start_of
from phigen.report import page
from phigen.report.live import Live, gathered, live_section, script
from phigen.report.live_lattice import gathered_lattice, lattice_live_section, lattice_script
from phigen.spec.model import Run


class NoPanelError(CheckError):
    """The system has no live panel; the message says why."""


def panel_page(compilation: Compilation, run: Run) -> str:
    """Return the HTML of a page with only the live panel of a run.

    The panel has one solver, whose order is that of the spec. Raises `NoPanelError`, and `SpecError` for initial values
    that cannot be read.
    """
    live: Live
    spec = compilation.spec
    if spec.lattice:
        lattice = compilation.by_sweeps()
        live = gathered_lattice(lattice, None, run, start_of(spec, run), ())
        body, code, panel = lattice_live_section(lattice, live), lattice_script(live), page.FIELDS
    else:
        live = gathered(compilation, None, run, spec.parameters_of(run), ())
        body, code, panel = live_section(compilation, live), script(live), page.CURVES
    if not live.solvers:
        raise NoPanelError(f"{spec.name} has no live panel: {live.why_not}")
    return page.alone(spec.title or spec.name, body, code, panel)
