"""Figures of error against time: all successful runs of a scan, not only the fastest for a target."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.measure import Result, Study
from phigen.drawing.palette import SERIES, save_for_pages, styled

#: Other methods that are drawn, with their line styles; tables show more methods. phigen's methods have solid lines.
PEERS = {
    "DOP853 in C": "-.",
    "heyoka": ":",
    "RK4 in C": (0, (1, 1)),
    "Gauss, SIMD, in C": (0, (5, 1)),
    "splitting, Kahan–Li 8, in C": (0, (3, 1, 1, 1)),
}


@styled
def work_figure(study: Study) -> Any:
    """Return a figure of energy errors and orbit errors against milliseconds, with one curve for each row of the
    table."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 3.4), layout="constrained")
    for place, what in enumerate(("energy", "orbit"), start=1):
        axes = figure.add_subplot(1, 2, place)
        for index, (label, results, style) in enumerate(_curves(study)):
            points = _front(results, what)
            axes.loglog(
                [1e3 * r.seconds for r in points], [max(getattr(r, what), 1e-16) for r in points],
                linestyle=style, color=SERIES[index % len(SERIES)], label=label, linewidth=1.2,
                marker="o" if style == "-" else "", markersize=2.5,
            )  # fmt: skip
        axes.set(xlabel="milliseconds", title=f"largest error of the {what}", ylim=(1e-15, 1e-1))
        axes.grid(visible=True)
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4)
    return figure


def _curves(study: Study) -> list[tuple[str, list[Result], Any]]:
    groups: dict[str, list[Result]] = {}
    for r in study.scans:
        if r.status == "ok":
            groups.setdefault(r.row, []).append(r)
    ours = [(label, results, "-") for label, results in groups.items() if label.startswith("phigen")]
    return ours + [(label, groups[label], style) for label, style in PEERS.items() if label in groups]


def _front(results: Sequence[Result], what: str) -> list[Result]:
    """Return the results that are more accurate than all faster results, from fast to slow."""
    front: list[Result] = []
    for r in sorted(results, key=lambda r: r.seconds):
        if not front or getattr(r, what) < getattr(front[-1], what):
            front.append(r)
    return front


def draw(studies: Sequence[Study], folder: Path) -> dict[str, str]:
    """Write a figure for each study over the short horizon; return the Markdown that shows it, by the name of the
    problem."""
    shown = {}
    for study in studies:
        if any(r.orbit == r.orbit for r in study.scans):
            name = f"benchmark_{study.problem}.svg"
            save_for_pages(work_figure(study), folder / name)
            title = f"{study.title}: error of energy and orbit against time, T = {study.horizon:g}"
            shown[study.problem] = f"![{title}](figures/{name})\n"
    return shown
