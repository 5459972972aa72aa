"""docs/benchmarks.md: each table stands between two markers with its name, and is replaced alone."""

from __future__ import annotations

import shutil
from pathlib import Path

DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "benchmarks.md"
FIGURES = DOCUMENT.parent / "figures"


def markers(name: str) -> tuple[str, str]:
    return f"<!-- {name}: begin -->", f"<!-- {name}: end -->"


def replaced(text: str, name: str, table: str) -> str:
    """The text with another table between the markers of this name; raises `LookupError` where there are none."""
    begin, end = markers(name)
    if text.count(begin) != 1 or text.count(end) != 1:
        raise LookupError(f"{DOCUMENT} has no place for {name}: the lines {begin} and {end}")
    before, _, rest = text.partition(begin)
    _, _, after = rest.partition(end)
    return f"{before}{begin}\n\n{table.strip()}\n\n{end}{after}"


def publish(folder: Path, names: list[str]) -> None:
    """Put tables that were saved in a folder into the document, and its figures beside it."""
    write({name: (folder / f"{name}.md").read_text(encoding="utf-8") for name in names})
    for figure in (folder / "figures").glob("*.svg"):
        shutil.copy(figure, FIGURES / figure.name)


def write(tables: dict[str, str]) -> None:
    """Put these tables into the document."""
    text = DOCUMENT.read_text(encoding="utf-8")
    for name, table in tables.items():
        text = replaced(text, name, table)
    DOCUMENT.write_text(text, encoding="utf-8")
