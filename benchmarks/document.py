"""Replacement of tables in pages of docs/. Each table stands on one page between two markers with its name."""

from __future__ import annotations

import shutil
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1] / "docs"
DOCUMENT = DOCS / "benchmarks.md"
FIGURES = DOCS / "figures"
#: Pages with tables other than docs/benchmarks.md, by the first word of the name of the table.
PAGES = {"pullbacks": DOCS / "gradients.md", "devices": DOCS / "devices.md"}


def markers(name: str) -> tuple[str, str]:
    return f"<!-- {name}: begin -->", f"<!-- {name}: end -->"


def replaced(text: str, name: str, table: str) -> str:
    """Return the text of a page with another table between the markers of ``name``; raises `LookupError` without
    markers."""
    begin, end = markers(name)
    if text.count(begin) != 1 or text.count(end) != 1:
        raise LookupError(f"{page(name)} has no place for {name}: the lines {begin} and {end}")
    before, _, rest = text.partition(begin)
    _, _, after = rest.partition(end)
    return f"{before}{begin}\n\n{table.strip()}\n\n{end}{after}"


def publish(folder: Path, names: list[str]) -> None:
    """Put the named tables from a folder of results into their pages, and copy the figures of the folder to
    docs/figures."""
    write({name: (folder / f"{name}.md").read_text(encoding="utf-8") for name in names})
    for figure in (folder / "figures").glob("*.svg"):
        shutil.copy(figure, FIGURES / figure.name)


def page(name: str) -> Path:
    """Return the page of a table: the page of `PAGES` for the first word of its name, or docs/benchmarks.md."""
    return PAGES.get(name.partition("-")[0], DOCUMENT)


def write(tables: dict[str, str]) -> None:
    """Put tables (name → Markdown) into their pages."""
    for name, table in tables.items():
        document = page(name)
        document.write_text(replaced(document.read_text(encoding="utf-8"), name, table), encoding="utf-8")
