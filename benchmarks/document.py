"""Tables of the docs: each stands between two markers with its name, on one page, and is replaced alone."""

from __future__ import annotations

import shutil
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1] / "docs"
DOCUMENT = DOCS / "benchmarks.md"
FIGURES = DOCS / "figures"
#: Pages with tables, beside the one of the benchmarks.
PAGES = {"pullbacks": DOCS / "gradients.md", "devices": DOCS / "devices.md"}


def markers(name: str) -> tuple[str, str]:
    return f"<!-- {name}: begin -->", f"<!-- {name}: end -->"


def replaced(text: str, name: str, table: str) -> str:
    """The text with another table between the markers of this name; raises `LookupError` where there are none."""
    begin, end = markers(name)
    if text.count(begin) != 1 or text.count(end) != 1:
        raise LookupError(f"{page(name)} has no place for {name}: the lines {begin} and {end}")
    before, _, rest = text.partition(begin)
    _, _, after = rest.partition(end)
    return f"{before}{begin}\n\n{table.strip()}\n\n{end}{after}"


def publish(folder: Path, names: list[str]) -> None:
    """Put tables that were saved in a folder into the document, and its figures beside it."""
    write({name: (folder / f"{name}.md").read_text(encoding="utf-8") for name in names})
    for figure in (folder / "figures").glob("*.svg"):
        shutil.copy(figure, FIGURES / figure.name)


def page(name: str) -> Path:
    """The page of a table: that of the first word of its name, or the one of the benchmarks."""
    return PAGES.get(name.partition("-")[0], DOCUMENT)


def write(tables: dict[str, str]) -> None:
    """Put these tables into their pages."""
    for name, table in tables.items():
        document = page(name)
        document.write_text(replaced(document.read_text(encoding="utf-8"), name, table), encoding="utf-8")
