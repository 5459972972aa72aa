"""``phigen list``: the specs that come with phigen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from phigen.cli.completion import bundled_names
from phigen.cli.console import out, out_json, table, verbosity

if TYPE_CHECKING:
    from pathlib import Path

    from phigen.spec.model import Spec


@click.command("list")
@click.option(
    "--path", "name", metavar="NAME", shell_complete=bundled_names, help="Print only the path of the bundled spec NAME."
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON, one object for each spec.")
@verbosity
def command(name: str | None, as_json: bool) -> None:
    """List the bundled specs: name, dimension, kind of π, title.

    Commands accept these names: phigen run kepler. To copy a spec as a start: cp "$(phigen list --path kepler)" .
    """
    from phigen import resources, spec

    files = resources.bundled()
    if name is not None:
        out(_path_of(name, files))
        return
    specs = [spec.load(file) for file in files.values()]
    if as_json:
        out_json([_described(s, str(files[s.name])) for s in specs])
        return
    rows = [("NAME", "DIM", "STRUCTURE", "TITLE")]
    rows += [(s.name, str(s.dimension), kind_of_structure(s), s.title) for s in specs]
    out("\n".join(table(rows, right=[1])))


def kind_of_structure(spec: Spec) -> str:
    """Return the shape of π as text; for a lattice, the relation of its sites."""
    if spec.lattice:
        axes = len(spec.lattice.axes)
        return f"lattice, {axes}-dimensional" if axes else f"lattice, {spec.lattice.relation}"
    from phigen.geometry.forms import algebra_of_form, poisson_matrix
    from phigen.geometry.shapes import recognise

    matrix = poisson_matrix(spec.poisson, spec.coordinates, algebra_of_form(spec.poisson, spec.coordinates))
    shape = recognise(spec.coordinates, matrix)
    return str(shape).split(",")[0].split(" in ")[0]


def _described(spec: Spec, path: str) -> dict[str, object]:
    return {
        "name": spec.name,
        "title": spec.title,
        "dimension": spec.dimension,
        "structure": kind_of_structure(spec),
        "order": spec.order,
        "runs": list(spec.runs),
        "path": path,
    }


def _path_of(name: str, files: dict[str, Path]) -> str:
    from difflib import get_close_matches

    if name in files:
        return str(files[name])
    similar_names = get_close_matches(name, files, n=1)
    hint = f"did you mean {similar_names[0]!r}?" if similar_names else "phigen list shows them"
    raise click.UsageError(f"there is no bundled spec {name!r}; {hint}")
