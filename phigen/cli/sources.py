"""The SPEC arguments of commands: files and folders of specs."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from phigen.cli.failures import Collector
from phigen.errors import Diagnostic, SpecError
from phigen.spec import limits
from phigen.spec.names import SCHEMES

if TYPE_CHECKING:
    from phigen.spec.model import Spec

SUFFIXES = (".yaml", ".yml")

#: What files of figures end in.
FIGURES = (".png", ".svg", ".pdf")

#: The type of ``--order``.
ORDER = click.IntRange(1, limits.ORDER)

#: The type of ``--modified``.
CORRECTIONS = click.IntRange(0, limits.CORRECTIONS)

#: How the one-step map is made, instead of the spec's way.
scheme_option = click.option(
    "--scheme", type=click.Choice(SCHEMES), help="How steps are made, instead of the spec's scheme."
)

one_spec = click.argument("spec_file", metavar="SPEC", type=click.Path())
many_specs = click.argument("spec_files", metavar="SPEC...", nargs=-1, required=True, type=click.Path())


def file_ending(*suffixes: str) -> Callable[[click.Context, click.Parameter, str | None], Path | None]:
    """The callback of an option that names a file: checks its suffix and its folder before any work is done."""

    def checked(ctx: click.Context, parameter: click.Parameter, value: str | None) -> Path | None:
        if value is not None and Path(value).suffix.lower() not in suffixes:
            raise click.BadParameter(f"{value!r} must end in {' or '.join(suffixes)}")
        if value is not None and not Path(value).parent.is_dir():
            raise click.BadParameter(f"there is no folder {str(Path(value).parent)!r}")
        return Path(value) if value is not None else None

    return checked


def load_one(path: str) -> Spec:
    """The spec in a file, with a hint where the file is missing and a bundled spec has that name."""
    from phigen import spec

    if not Path(path).exists():
        raise SpecError([Diagnostic(f"there is no file {path!r}", hint=_bundled_hint(path))])
    if Path(path).is_dir():
        raise SpecError([Diagnostic(f"{path!r} is a folder; this command takes one spec file")])
    return spec.load(path)


def load_all(paths: Sequence[str], collector: Collector) -> list[Spec]:
    """All specs in the files and below the folders, in natural order; errors go to the collector.

    Two specs of one name are an error: their output would be in the same place.
    """
    found: dict[str, Spec] = {}
    for file in dict.fromkeys(file for path in paths for file in spec_files(path)):
        with collector.collecting():
            spec = load_one(file)
            if spec.name in found:
                hint = "names are prefixes of the generated code, and must differ"
                message = f"the name {spec.name!r} is taken by {found[spec.name].file}"
                raise SpecError([spec.diagnostic(("name",), message, hint)])
            found[spec.name] = spec
    return list(found.values())


def spec_files(path: str) -> Iterator[str]:
    """The path itself, or the spec files below it if it is a folder, hidden ones left out."""
    from phigen.symbolic.expression import natural_key

    if not Path(path).is_dir():
        yield path
        return
    count = 0
    for folder, folders, files in os.walk(path):
        folders[:] = sorted((f for f in folders if not f.startswith(".")), key=natural_key)
        for file in sorted(files, key=natural_key):
            if file.endswith(SUFFIXES) and not file.startswith("."):
                count += 1
                yield os.path.join(folder, file)  # noqa: PTH118  (as the user wrote it: "./specs" stays "./specs")
    if not count:
        raise SpecError([Diagnostic(f"there are no specs (*.yaml) in the folder {path!r}")])


def _bundled_hint(path: str) -> str:
    from difflib import get_close_matches

    from phigen import resources

    name = Path(path).stem
    bundled = {p.stem: p for p in resources.bundled_specs().glob("*.yaml")}
    if name in bundled:
        return f'{name} is a bundled spec; write "$(phigen list --path {name})"'
    beside = [p.name for p in Path(path).parent.glob("*.y*ml")] if Path(path).parent.is_dir() else []
    near = get_close_matches(Path(path).name, beside, n=1)
    if near:
        return f"did you mean {str(Path(path).with_name(near[0]))!r}?"
    return "phigen new NAME writes a spec to start from; phigen list shows the bundled ones"
