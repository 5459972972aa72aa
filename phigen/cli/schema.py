"""``phigen schema``: print the JSON Schema of spec files."""

from __future__ import annotations

import click

from phigen.cli.console import out_json, verbosity


@click.command("schema")
@verbosity
def command() -> None:
    """Print the JSON Schema of spec files, for completion and checks in editors.

    For the YAML extension of an editor, run phigen schema > phigen.schema.json and begin a spec with
    # yaml-language-server: $schema=phigen.schema.json
    """
    from phigen import spec

    out_json(spec.schema())
