"""Check whether figures can be drawn: this needs matplotlib, which is optional."""

from __future__ import annotations

from importlib.util import find_spec

from phigen.drawing.palette import INSTALLED_BY

#: Note in place of figures if matplotlib is missing.
NO_FIGURES = f"There are no figures on this page, since matplotlib was not installed: {INSTALLED_BY}."


def drawable() -> bool:
    """Return whether matplotlib is installed, so that figures can be drawn."""
    return find_spec("matplotlib") is not None
