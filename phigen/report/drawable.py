"""Whether there are figures: matplotlib is optional."""

from __future__ import annotations

from importlib.util import find_spec

from phigen.drawing.palette import INSTALLED_BY

#: The note in place of figures where matplotlib is missing.
NO_FIGURES = f"There are no figures on this page, since matplotlib was not installed: {INSTALLED_BY}."


def drawable() -> bool:
    """Whether figures can be drawn."""
    return find_spec("matplotlib") is not None
