"""Search and loading of the specs that a command line names."""

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
    """Return the spec in the file ``source``. If this file does not exist, return the bundled spec of that name."""
    from phigen import spec

    path = spec_path(source)
    if Path(path).is_dir():
        raise SpecError([Diagnostic(f"{path!r} is a folder; this command takes one spec file")])
    return spec.load(path)


def spec_path(source: str) -> str:
    """Return the path of a spec file, of a folder with specs, or of a bundled spec.

    A file, or a folder that contains specs, takes precedence over a bundled spec of the same name. Raises `SpecError`
    if nothing has the name ``source``.
    """
    path = Path(source)
    # The command `phigen build kepler -o .` makes a folder kepler without specs. This folder must not hide the bundled
    # spec.
    if source in resources.bundled() and (not path.exists() or (path.is_dir() and not any(_below(source)))):
        return str(resources.bundled()[source])
    if path.exists():
        return source
    raise SpecError([resources.missing(source)])


def as_given(spec: Spec) -> str:
    """Return the text by which a command line names a spec: its file, or the name of a bundled spec."""
    return resources.bundled_name(spec.file) or spec.file


def load_all(paths: Sequence[str], collector: Collector) -> list[Spec]:
    """Return the specs in files and below folders, in natural order. Errors go to the collector.

    Two specs of the same name are an error, since their output would be in the same place.
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
                hint = "give each spec another name, since names of the generated code begin with it"
                message = f"the name {spec.name!r} is taken by {specs[spec.name].file}"
                raise SpecError([spec.diagnostic(("name",), message, hint)])
            specs[spec.name] = spec
    return list(specs.values())


def spec_files(source: str) -> Iterator[str]:
    """Yield the path of a spec file or of a bundled spec. For a folder, yield the spec files below it that are not
    hidden.
    """
    path = spec_path(source)
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
