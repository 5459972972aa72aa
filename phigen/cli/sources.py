"""Files and folders of specs named on a command line: search and loading."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from phigen import resources
from phigen.cli.failures import Collector
from phigen.errors import Diagnostic, SpecError

if TYPE_CHECKING:
    from phigen.spec.model import Spec

SUFFIXES = (".yaml", ".yml")


def load_one(source: str) -> Spec:
    """The spec in a file, or the bundled one of that name if there is no such file."""
    from phigen import spec

    path = found(source)
    if Path(path).is_dir():
        raise SpecError([Diagnostic(f"{path!r} is a folder; this command takes one spec file")])
    return spec.load(path)


def found(source: str) -> str:
    """The path itself if there is a file or a folder with specs; else that of the bundled spec of that name.

    Raises `SpecError` if there is none of these.
    """
    path = Path(source)
    # A folder that `phigen build kepler -o .` made must not hide the bundled kepler.
    if source in resources.bundled() and (not path.exists() or (path.is_dir() and not any(_below(source)))):
        return str(resources.bundled()[source])
    if path.exists():
        return source
    raise SpecError([resources.missing(source)])


def as_given(spec: Spec) -> str:
    """Name of a spec on a command line: its file, or the name of a bundled one."""
    return resources.bundled_name(spec.file) or spec.file


def load_all(paths: Sequence[str], collector: Collector) -> list[Spec]:
    """All specs in the files and below the folders, in natural order; errors go to the collector.

    Two specs of one name are an error: their output would be in the same place.
    """
    specs: dict[str, Spec] = {}
    files: list[str] = []
    for path in paths:
        with collector.collecting():
            files += spec_files(path)
    for file in dict.fromkeys(files):
        with collector.collecting():
            spec = load_one(file)
            if spec.name in specs:
                hint = "names are prefixes of the generated code, and must differ"
                message = f"the name {spec.name!r} is taken by {specs[spec.name].file}"
                raise SpecError([spec.diagnostic(("name",), message, hint)])
            specs[spec.name] = spec
    return list(specs.values())


def spec_files(source: str) -> Iterator[str]:
    """The spec file or the bundled spec itself, or the spec files below it if it is a folder, hidden ones left out."""
    path = found(source)
    if not Path(path).is_dir():
        yield path
        return
    files = list(_below(path))
    if not files:
        raise SpecError([Diagnostic(f"there are no specs (*.yaml) in the folder {path!r}")])
    yield from files


def _below(path: str) -> Iterator[str]:
    from phigen.symbolic.expression import natural_key

    for folder, folders, files in os.walk(path):
        folders[:] = sorted((f for f in folders if not f.startswith(".")), key=natural_key)
        for file in sorted(files, key=natural_key):
            if file.endswith(SUFFIXES) and not file.startswith("."):
                yield os.path.join(folder, file)  # noqa: PTH118  (as the user wrote it: "./specs" stays "./specs")
