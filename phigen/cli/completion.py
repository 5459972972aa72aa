"""Shell completion of names: bundled specs, and the runs of the spec on the command line."""

from __future__ import annotations

from pathlib import Path

import click
from click.shell_completion import CompletionItem

from phigen import resources
from phigen.cli.sources import SUFFIXES, load_one
from phigen.errors import PhigenError


def specs(ctx: click.Context, parameter: click.Parameter, prefix: str) -> list[CompletionItem[str]]:
    """Return the names that begin with the prefix: spec files and folders in the working directory, then
    bundled specs.

    If no bundled spec matches, the shell completes file names instead.
    """
    bundled = bundled_names(ctx, parameter, prefix)
    if not bundled:
        return [CompletionItem(prefix, type="file")]
    matching_paths = [path for path in sorted(Path().glob("[!.]*")) if path.name.startswith(prefix)]
    files = [path.name for path in matching_paths if path.suffix in SUFFIXES]
    folders = [f"{path.name}/" for path in matching_paths if path.is_dir()]
    return [CompletionItem(name) for name in (*files, *folders, *bundled)]


def bundled_names(ctx: click.Context, parameter: click.Parameter, prefix: str) -> list[str]:
    """Return the names of bundled specs that begin with the prefix."""
    return [name for name in resources.bundled() if name.startswith(prefix)]


def runs(ctx: click.Context, parameter: click.Parameter, prefix: str) -> list[str]:
    """Return the names of runs that begin with the prefix. The runs are those of the specs on the command line.

    Specs with errors are ignored.
    """
    run_names: list[str] = []
    # While click completes an option, the other words of the command line are not assigned to parameters yet. So each
    # of these words may be a spec.
    for source in ctx.args:
        try:
            run_names += load_one(source).runs
        except PhigenError:
            continue
    return [name for name in dict.fromkeys(run_names) if name.startswith(prefix)]
