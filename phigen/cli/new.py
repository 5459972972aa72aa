"""``phigen new``: write a commented spec to start from."""

from __future__ import annotations

from pathlib import Path

import click

from phigen.cli.console import Console, out_document, pass_console, verbosity
from phigen.writing import write


@click.command("new")
@click.argument("name")
@click.option("--lattice", is_flag=True, help="Write a lattice of identical sites instead of one system.")
@click.option("-o", "--output", metavar="FILE", help="The file to write; - is stdout.  [default: NAME.yaml]")
@verbosity
@pass_console
def command(console: Console, name: str, lattice: bool, output: str | None) -> None:
    """Write NAME.yaml, a commented spec to start from.

    The spec describes the free rigid body, or with --lattice a chain of spins, and is ready to run. Replace it by your
    system. Existing files are not overwritten.
    """
    from phigen import spec
    from phigen.errors import SpecError

    stem = name.removesuffix(".yaml")
    try:
        text = spec.starter(stem, lattice=lattice)
    except SpecError as error:  # without a location, since the file does not exist yet
        (diagnostic,) = error.diagnostics
        raise click.UsageError(diagnostic.message + (f"; {diagnostic.hint}" if diagnostic.hint else "")) from None
    if output == "-":
        out_document(text)
        return
    path = Path(output or f"{stem}.yaml")
    if path.exists():
        raise click.UsageError(f"{path} exists already; choose another name, or remove it first")
    write(path, text)
    console.note(f"wrote {path}; next: phigen check {path}, phigen run {path}, phigen build {path}")
