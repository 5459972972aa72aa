"""Registry of the functions that make formulas, tables and figures of systems, compilations and trajectories.

`phigen.notation` and `phigen.drawing` import the classes of systems and trajectories, so these classes cannot import
notation and drawing. Instead, these classes call `display` with a name in `DISPLAYS`. The function `display` imports
the module that this table lists for the name.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, cast

#: Name of a display → the module and the function that make it: formulas, a table or a figure of an object.
DISPLAYS = {
    "formulas of a system": ("phigen.notation.notebook", "system_latex"),
    "page of a system": ("phigen.notation.notebook", "system_html"),
    "formulas of a compilation": ("phigen.notation.latex", "document"),
    "page of a compilation": ("phigen.notation.notebook", "compilation_html"),
    "formulas of a cell": ("phigen.notation.cell_formulas", "document"),
    "page of a trajectory": ("phigen.notation.notebook", "trajectory_html"),
    "page of a lattice trajectory": ("phigen.notation.notebook", "lattice_trajectory_html"),
    "figure of runs": ("phigen.drawing.figures", "run_figure"),
    "figure of a spectrum": ("phigen.drawing.spectra", "spectrum_figure"),
    "figure of a lattice run": ("phigen.drawing.lattice_figures", "lattice_figure"),
}


def display(name: str) -> Callable[..., Any]:
    """Return the function for ``name`` in `DISPLAYS`, which makes formulas, a table or a figure of an object.

    The returned function raises `MissingPackageError` if a package that it needs is missing.
    """
    module, function = DISPLAYS[name]
    return cast(Callable[..., Any], getattr(import_module(module), function))
