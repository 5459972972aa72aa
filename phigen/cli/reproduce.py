"""``phigen reproduce paper``: the figures of the paper arXiv:2303.15883, with measured numbers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from phigen.cli.console import Console, heading, out, out_json, pass_console, table, verbosity

if TYPE_CHECKING:
    from phigen.paper.plate import Plate


@click.command("reproduce")
@click.argument("what", type=click.Choice(["paper"]))
@click.option("-o", "--output", "folder", metavar="DIR", type=click.Path(path_type=Path), default=Path("paper"),
              show_default=True, help="Folder for the figures.")  # fmt: skip
@click.option("--format", "suffix", type=click.Choice(["svg", "png", "pdf"]), default="svg", show_default=True)
@click.option("--figure", "names", metavar="NAME", multiple=True, help="Make this figure only.  [default: all]")
@click.option("--json", "as_json", is_flag=True, help="Print the numbers as JSON.")
@verbosity
@pass_console
def command(console: Console, what: str, folder: Path, suffix: str, names: tuple[str, ...], as_json: bool) -> None:
    """Draw the figures of the paper (arXiv:2303.15883), and print measured numbers beside those of the paper.

    Files DIR/NAME.svg are overwritten. The command needs matplotlib and a C compiler. It takes half a minute, since the
    rigid body makes 10^8 steps with each of three methods.
    """
    from phigen.drawing.palette import require_matplotlib, save
    from phigen.paper.plates import PLATES

    require_matplotlib()
    unknown_plates = [name for name in names if name not in PLATES]
    if unknown_plates:
        raise click.BadParameter(f"there is no figure {unknown_plates[0]!r}; there are {', '.join(PLATES)}",
                                 param_hint="--figure")  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    plates = {}
    for name in names or PLATES:
        console.detail(f"drawing {name}")
        plates[name] = PLATES[name]()
        path = folder / f"{name}.{suffix}"
        save(plates[name].figure, path)
        console.note(f"wrote {path}")
    findings = described(plates)
    if as_json:
        out_json(findings)
    else:
        out("\n".join(lines_of(findings)))


def described(plates: dict[str, Plate]) -> list[dict[str, Any]]:
    """Return the titles of figures and the numbers measured for them, as data for JSON."""
    return [
        {
            "figure": name,
            "title": plate.title,
            "findings": [
                {"quantity": f.quantity, "paper": f.paper, "measured": f.measured} for f in plate.findings
            ],
        }
        for name, plate in plates.items()
    ]  # fmt: skip


def lines_of(figures: list[dict[str, Any]]) -> list[str]:
    """Return one table per figure, from the result of `described`."""
    lines: list[str] = []
    for figure in figures:
        rows = [("", "the paper", "measured")]
        rows += [(f["quantity"], f["paper"], _four_digits(f["measured"])) for f in figure["findings"]]
        lines += [heading(figure["title"]), *(f"  {line}" for line in table(rows)), ""]
    return lines[:-1]


def _four_digits(value: float) -> str:
    """Return a number as text with four digits; a number as small as a rounding error has one digit."""
    return f"{value:.0e}" if 0 < abs(value) < 1e-11 else f"{value:.4g}"
