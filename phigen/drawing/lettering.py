"""Ticks and axis names of three-dimensional plots.

matplotlib only estimates the room for ticks and names. This module measures the drawn texts, and places the names so
that they do not overlap other texts.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, cast

from phigen.symbolic.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: This fraction of an axis at each end has no ticks, since two axes meet there.
CORNER = 0.08
#: LETTERS: number of characters of a tick label that fit beside the vertical axis. WIDTH: width of each further
#: character in points.
LETTERS, WIDTH = 4, 2.2
#: Names that overlap other texts are moved several times. PAD: distance of one move, in points. MOST_MOVES: largest
#: number of moves of a name. GAP: smallest distance between two texts, in pixels.
PAD, MOST_MOVES, GAP = 3.0, 20, 3.5
_SUPERSCRIPTS = str.maketrans("−-0123456789", "⁻⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def letter(axes: Any, names: tuple[str, ...], box: Floats, max_ticks: int) -> None:
    """Set ticks and names of the axes of a three-dimensional plot that shows the ``box`` (2, 3).

    Each axis has about ``max_ticks`` ticks. If the ticks show values divided by a power of ten, the name of the axis
    contains this power.
    """
    for axis, name, (low, high) in zip(_axes(axes), names, box.T.tolist(), strict=True):
        ticks = _ticks(low, high, max_ticks)
        axis.set_ticks(ticks)
        formatter = axis.get_major_formatter()
        formatter.set_locs(ticks)
        power = formatter.get_offset().partition("e")[2]
        axis.offsetText.set_visible(False)
        axis.set_label_text(f"{name} / 10{power.translate(_SUPERSCRIPTS)}" if power else name)
        axis.labelpad = -6.0
    longest = max(map(len, axes.zaxis.get_major_formatter().format_ticks(axes.zaxis.get_ticklocs())), default=0)
    axes.tick_params(pad=-1, labelsize=7)
    axes.zaxis.set_tick_params(pad=-1 + WIDTH * max(0, longest - LETTERS))


def _ticks(low: float, high: float, max_ticks: int) -> list[float]:
    from matplotlib.ticker import MaxNLocator

    corner = CORNER * (high - low)
    ticks = [float(v) for v in MaxNLocator(max_ticks).tick_values(low, high)]
    return [v for v in ticks if low + corner <= v <= high - corner]


def move_apart(figure: Figure) -> None:
    """Move axis names of three-dimensional plots outwards until they overlap no other text of their plot.

    The plots shrink if names would leave the figure.
    """
    spaces, layout = figure.findobj(lambda artist: hasattr(artist, "zaxis")), cast(Any, figure.get_layout_engine())
    left = right = 0.0
    for _ in range(MOST_MOVES if spaces else 0):
        figure.draw_without_rendering()
        names = [axis.label.get_window_extent() for axes in spaces for axis in _axes(axes)]
        meeting = [axis for axes in spaces for axis in _meeting(axes)]
        # The layout of matplotlib reserves room for ticks, but none for the names of the axes of three-dimensional
        # plots.
        overhang = min(name.x0 for name in names), max(name.x1 for name in names) - figure.bbox.x1
        left, right = max(left, left - overhang[0]), max(right, right + overhang[1])
        if not meeting and overhang[0] >= 0 and overhang[1] <= 0:
            return
        for axis in meeting:
            axis.labelpad += PAD
        width = figure.bbox.width
        layout.set(rect=(left / width, 0, 1 - (left + right) / width, 1))


def _axes(axes: Any) -> tuple[Any, Any, Any]:
    return axes.xaxis, axes.yaxis, axes.zaxis


def _meeting(axes: Any) -> Iterator[Any]:
    """Yield the axes whose names overlap another text of the panel."""
    ticks = [tick.label1.get_window_extent() for axis in _axes(axes) for tick in axis.get_major_ticks()]
    names = [axis.label.get_window_extent().padded(GAP) for axis in _axes(axes)]
    for k, (axis, name) in enumerate(zip(_axes(axes), names, strict=True)):
        if name.count_overlaps([*ticks, *names[:k]]):
            yield axis
