"""Provenance of files: the spec and the run from which a table, store, figure or film was made.

An origin is one line of ASCII text, ``phigen origin: SPEC RUN DIGEST``, followed by the command if that is not ``phigen
run``. The line is stored in an array ``origin`` of a ``.npz``, in an attribute of a Zarr store, and in the metadata of
figures, films and pages. A ``.csv`` cannot contain the line, since some programs would read it as data. The line of a
``.csv`` is in ``FILE-metadata.json`` beside the ``.csv``: the W3C recommendation "Metadata Vocabulary for Tabular Data"
names this file.
"""

from __future__ import annotations

import json
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote, unquote

import numpy as np

from phigen.spec.identity import digest
from phigen.spec.model import Run, Spec, SweepSettings
from phigen.writing import write

_FORM = re.compile(rb"phigen origin: (\S+) (\S+) ([0-9a-f]{16})(?![0-9a-f])(?: by (\w+))?")


@dataclass(frozen=True)
class Origin:
    """Provenance of a file: the names of a spec and of its run, and a hash of the equations and observables of the
    spec.

    ``command`` is the command of phigen that wrote the file. For sweeps ``run`` is the name of the sweep.
    """

    spec: str
    run: str
    digest: str
    command: str = "run"

    def __str__(self) -> str:
        command_text = "" if self.command == "run" else f" by {self.command}"
        return f"phigen origin: {quote(self.spec)} {quote(self.run)} {self.digest}{command_text}"

    @property
    def _kind(self) -> str:
        return "sweep" if self.command == "sweep" else "run"

    @property
    def _named(self) -> str:
        return f"the {self._kind} {self.run} of {self.spec}"

    def difference(self, requested: Origin) -> str:
        """Return a text about the first difference between this origin and the origin ``requested``; "" if they are
        equal.

        The text is the end of a sentence that begins with "the file holds".
        """
        if self.command != requested.command:
            return f"a result of phigen {requested.command}, not of phigen {self.command}"
        if (self.spec, self.run) != (requested.spec, requested.run):
            return f"{requested._named}, not {self._named}"
        if self.digest != requested.digest:
            changed = "with other equations, Casimirs or observables"
            return f"the {requested._kind} {requested.run} of another spec {requested.spec}, {changed}"
        return ""


def origin_of(spec: Spec, run: Run | SweepSettings | None, command: str = "run") -> Origin:
    """Return the `Origin` of the files that a command writes for a run or a sweep.

    ``run`` is None for a spec without runs.
    """
    return Origin(spec.name, run.name if run else "-", digest(spec), command)


def companion(path: Path) -> Path:
    """Return the path of the JSON file with the metadata of a ``.csv`` file, in the same folder."""
    return path.with_name(f"{path.name}-metadata.json")


def mark(path: Path, origin: Origin) -> None:
    """Write the origin of a ``.csv`` into the metadata file beside it; do nothing for other files, which contain their
    origin."""
    if path.suffix.lower() != ".csv":
        return
    columns = [{"titles": title, "datatype": "double"} for title in _header(path)]
    table = {"url": path.name, "dc:source": str(origin), "tableSchema": {"columns": columns}}
    text = json.dumps({"@context": "http://www.w3.org/ns/csvw", **table}, indent=1)
    write(companion(path), text + "\n")


def read_origin(path: Path) -> Origin | None:
    """Return the provenance that a file contains (a spec, a run and a command); None if it contains none."""
    suffix = path.suffix.lower()
    if path.is_dir():
        return _within((path / ".zattrs").read_bytes()) if (path / ".zattrs").is_file() else None
    if suffix == ".csv":
        return _of_table(path)
    if suffix != ".npz":
        return _within(path.read_bytes())
    try:
        with np.load(path, allow_pickle=False) as archive:
            return _within(str(archive["origin"]).encode())
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None


def _of_table(path: Path) -> Origin | None:
    """Return the origin in the metadata file of a ``.csv``; None if the columns listed there are not those of the
    ``.csv``.
    """
    try:
        described = json.loads(companion(path).read_text(encoding="utf-8"))
        titles = [column["titles"] for column in described["tableSchema"]["columns"]]
        source = described["dc:source"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return _within(str(source).encode()) if titles == _header(path) else None


def _header(path: Path) -> list[str]:
    with path.open(encoding="utf-8", errors="replace") as file:
        return file.readline().rstrip("\r\n").split(",")


def _within(data: bytes) -> Origin | None:
    match = _FORM.search(data)
    parts = match.groups(default=b"run") if match else ()
    return Origin(*(unquote(part.decode("ascii", "replace")) for part in parts)) if parts else None
