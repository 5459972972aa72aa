"""What shows objects of lower rooms to users: formulas and tables of notebooks, and figures.

Systems, compilations and trajectories can be shown, but know nothing of notation and drawing, which know them. They ask
for a display by its name here; like a target (`phigen.registry`), it is imported when it is asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, cast

#: The modules and the functions of displays, by what they show.
DISPLAYS = {
    "formulas of a system": ("phigen.notation.notebook", "system_latex"),
    "page of a system": ("phigen.notation.notebook", "system_html"),
    "formulas of a compilation": ("phigen.notation.latex", "document"),
    "page of a compilation": ("phigen.notation.notebook", "compilation_html"),
    "formulas of a cell": ("phigen.notation.lattices", "document"),
    "page of a trajectory": ("phigen.notation.notebook", "trajectory_html"),
    "page of a lattice trajectory": ("phigen.notation.notebook", "lattice_trajectory_html"),
    "figure of runs": ("phigen.drawing.figures", "run_figure"),
    "figure of a lattice run": ("phigen.drawing.lattices", "lattice_figure"),
}


def display(name: str) -> Callable[..., Any]:
    """Return the function that makes a display. Raises `MissingPackageError` where it lacks a package."""
    module, function = DISPLAYS[name]
    return cast(Callable[..., Any], getattr(import_module(module), function))
