"""Makes the figures of docs/paper.md, their numbers and its tables anew: python docs/make_paper.py [FIGURE …]"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import click

from phigen.cli.reproduce import described, lines_of
from phigen.drawing.palette import save_for_pages
from phigen.paper.plates import PLATES

DOCS = Path(__file__).resolve().parent
PAGE, FIGURES = DOCS / "paper.md", DOCS / "figures"
FACTS = FIGURES / "paper.json"


def with_tables(page: str, entries: list[dict]) -> str:
    """The page with the tables of these figures, each in a text block that begins with the title of its figure."""
    for entry in entries:
        block = "```text\n" + click.unstyle("\n".join(lines_of([entry]))) + "\n```"
        page = re.sub(rf"```text\n{re.escape(entry['title'])}\n.*?```", lambda _, b=block: b, page, flags=re.DOTALL)
    return page


def main(chosen: list[str]) -> None:
    """These figures, all by default."""
    facts_by_figure = {entry["figure"]: entry for entry in json.loads(FACTS.read_text(encoding="utf-8"))}
    for name in chosen or PLATES:
        print(name, file=sys.stderr)
        plate = PLATES[name]()
        save_for_pages(plate.figure, FIGURES / f"{name}.svg")
        facts_by_figure |= {entry["figure"]: entry for entry in described({name: plate})}
    entries = [facts_by_figure[name] for name in PLATES]
    # Later digits differ from compiler to compiler.
    for finding in [finding for entry in entries for finding in entry["findings"]]:
        finding["measured"] = float(f"{finding['measured']:.4g}")
    FACTS.write_text(json.dumps(entries, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8"), entries), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
