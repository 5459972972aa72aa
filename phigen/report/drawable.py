"""Whether there are figures: matplotlib is optional."""

from __future__ import annotations

from importlib.util import find_spec

#: What the page says where matplotlib is missing.
NO_FIGURES = "There are no figures on this page, since matplotlib was not installed: pip install 'phigen[plot]'."


def drawable() -> bool:
    """Whether figures can be drawn."""
    return find_spec("matplotlib") is not None
