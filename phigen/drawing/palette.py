"""Style of figures: colours, fonts, and output files that are reproducible byte by byte."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from phigen.errors import MissingPackageError
from phigen.writing import write

if TYPE_CHECKING:
    from matplotlib.figure import Figure

P = ParamSpec("P")
T = TypeVar("T")

#: Colours by their roles. SVG files contain the colours literally. A page replaces each colour by a variable of its
#: style sheet; therefore no two colours are equal. The colours of curves (``series-1``, …) have a contrast of at least
#: 3 to white and to black. Readers with any kind of colour vision can distinguish these colours, which are those of
#: Okabe and Ito, with the light ones darkened.
PALETTE: Mapping[str, str] = {
    "paper": "#ffffff",
    "ink": "#24292f",
    "muted": "#6e7781",
    "grid": "#d0d7de",
    "leaf": "#8b98a9",
    "series-1": "#0072b2",
    "series-2": "#d55e00",
    "series-3": "#009e73",
    "series-4": "#cc79a7",
    "series-5": "#a6761d",
    "series-6": "#7a7a7a",
}
#: Colours of some roles on a dark page; the other colours are visible on light and dark pages.
DARK: Mapping[str, str] = {"paper": "#0d1117", "ink": "#e6edf3", "muted": "#9198a1", "grid": "#30363d"}
SERIES = tuple(colour for role, colour in PALETTE.items() if role.startswith("series"))

#: Command that installs what figures need. It does not depend on how phigen was installed.
INSTALLED_BY = "pip install matplotlib"

#: Suffixes of files for figures.
SUFFIXES = (".png", ".svg", ".pdf")

_STYLE: Any = {
    "svg.hashsalt": "phigen",
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
    "savefig.dpi": 200,
    "figure.dpi": 100,
    "figure.facecolor": PALETTE["paper"],
    "axes.facecolor": "none",
    "axes.edgecolor": PALETTE["muted"],
    "axes.labelcolor": PALETTE["ink"],
    "axes.titlecolor": PALETTE["ink"],
    "axes.titlesize": 9.5,
    "axes.labelsize": 9,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-3, 5),
    "grid.color": PALETTE["grid"],
    "grid.linewidth": 0.5,
    "xtick.color": PALETTE["muted"],
    "ytick.color": PALETTE["muted"],
    "xtick.labelcolor": PALETTE["ink"],
    "ytick.labelcolor": PALETTE["ink"],
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "text.color": PALETTE["ink"],
    "font.family": ["DejaVu Sans"],
    "font.size": 9,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "lines.solid_capstyle": "round",
    "lines.solid_joinstyle": "round",
}


#: Style of a horizontal reference line, for instance at the size of rounding errors, at an accuracy, or at 0.
MARK: Mapping[str, Any] = {"color": PALETTE["muted"], "linewidth": 0.8, "linestyle": (0, (1, 2)), "zorder": 1}


def require_matplotlib() -> None:
    """Raise `MissingPackageError` if matplotlib is not installed, or if parts of it are missing."""
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        problem = "is not installed" if error.name == "matplotlib" else f"cannot be imported: {error}"
        raise MissingPackageError(f"figures need matplotlib, which {problem}\n  hint: {INSTALLED_BY}") from error


@contextmanager
def _styled() -> Iterator[None]:
    """Context in which matplotlib has the settings of this module instead of those of the user."""
    require_matplotlib()
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield


def styled(draw: Callable[P, T]) -> Callable[P, T]:
    """Decorate a function that draws or writes figures, so that it uses the settings of this module."""

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> T:
        with _styled():
            return draw(*args, **kwargs)

    return drawn


@styled
def save(figure: Figure, path: str | Path, origin: str = "") -> None:
    """Write a figure as PNG, SVG or PDF, by the suffix of the path; equal figures give equal bytes.

    The metadata contain the name phigen and the text ``origin``, but no date.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise ValueError(f"cannot draw {str(path)!r}: the suffix must be one of {', '.join(SUFFIXES)}")
    write(Path(path), _rendered(figure, suffix[1:], creator="phigen", origin=origin or None))


@styled
def save_for_pages(figure: Figure, path: Path) -> None:
    """Write an SVG file for web pages, with dark colours for readers who prefer dark pages."""
    write(path, in_both_themes(_rendered(figure, "svg").decode("utf-8")))


def in_both_themes(svg_text: str) -> str:
    """Return the SVG text with variables in place of the colours that differ between light and dark pages.

    In browsers, the variables have the colours for light or dark pages, as the reader prefers. Programs that do not
    support variables need files with literal colours.
    """
    for role in DARK:
        svg_text = svg_text.replace(PALETTE[role], f"var(--{role})")
    light, dark = (
        ":root{" + "; ".join(f"--{role}: {colours[role]}" for role in DARK) + "}" for colours in (PALETTE, DARK)
    )
    style = f"{light} @media (prefers-color-scheme: dark){{{dark}}}"
    return svg_text.replace('<style type="text/css">', f'<style type="text/css">{style} ', 1)


@styled
def svg(figure: Figure) -> str:
    """Return a figure as SVG text, without a background."""
    return _rendered(figure, "svg", transparent=True).decode("utf-8")


def _rendered(
    figure: Figure, kind: str, transparent: bool = False, creator: str | None = None, origin: str | None = None
) -> bytes:
    metadata = {"png": {"Software": creator} | ({"Description": origin} if origin else {}),
                "svg": {"Date": None, "Creator": creator, "Description": origin},
                "pdf": {"CreationDate": None, "Creator": creator, "Producer": None, "Subject": origin}}  # fmt: skip
    buffer = io.BytesIO()
    figure.savefig(buffer, format=kind, metadata=metadata[kind], transparent=transparent)
    return _shortened(buffer.getvalue()) if kind == "svg" else buffer.getvalue()


def _shortened(text: bytes) -> bytes:
    """Return an SVG file whose positions are cut to three decimals, so that long curves take fewer bytes."""
    return re.sub(rb"(?<=[ML ])(-?\d+\.\d{3})\d+", rb"\1", text)
