"""The manifest of a folder of vendored solvers: spec, options and version of phigen for each solver.

The manifest depends only on the specs, the options and the version: it has no date, no host name, and only relative
paths. It contains the text of each spec, so that solvers can be generated again without the spec files.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shlex
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from phigen._version import __version__
from phigen.cli.build_files import FILES
from phigen.cli.generation import Options
from phigen.errors import CheckError
from phigen.registry import TARGETS, suffixes
from phigen.spec import limits
from phigen.spec.names import PARTS, PROFILES, REALS, SCHEMES, SPEC_NAME

FILE = "phigen-vendor.json"
FORMAT = 1

_ABOUT = (
    "Solvers made by phigen; commands are for this folder. To check that they are unmodified and current: "
    "phigen vendor --check . To make them again: phigen vendor ."
)


@dataclass(frozen=True)
class ManifestEntry:
    """Entry of one vendored solver.

    ``spec_file`` is the path of the spec relative to the folder, or the name of a bundled spec. It is None if the path
    would mean nothing on another machine. ``files`` maps file names to the sha256 of their bytes.
    """

    name: str
    options: Options
    spec_file: str | None
    spec_text: str
    licence: str
    files: Mapping[str, str]
    version: str

    @property
    def command(self) -> str:
        """The command that generates the solver again."""
        return shlex.join(["phigen", "vendor", *([self.spec_file] if self.spec_file else []), ".", *self._words])

    @property
    def _words(self) -> list[str]:
        return self.options.words if self.spec_file else []

    def described(self) -> dict[str, Any]:
        """Return the entry as plain data, without options that have their defaults."""
        changed_options = {
            key: value for key, value in asdict(self.options).items() if key != "directory" and value != _UNSET[key]
        }
        spec = {"sha256": sha256(self.spec_text), "text": self.spec_text.split("\n")}
        return {
            "phigen": self.version,
            "command": self.command,
            "options": changed_options,
            "license": self.licence,
            "spec": {"file": self.spec_file, **spec} if self.spec_file else spec,
            "files": dict(sorted(self.files.items())),
        }


_UNSET = asdict(Options())


def sha256(content: str | bytes) -> str:
    """Return the SHA-256 of bytes, or of a text in UTF-8, as hexadecimal digits."""
    return hashlib.sha256(content.encode() if isinstance(content, str) else content).hexdigest()


def relative(spec_file: str, folder: Path) -> str | None:
    """Return the path of a spec relative to the folder.

    Returns None if the path leads through the root or a home folder. Such a path would mean nothing on another machine.
    """
    source, target = Path(os.path.abspath(spec_file)), Path(os.path.abspath(folder))  # noqa: PTH100  (resolve() would follow links)
    common = Path(os.path.commonpath([source, target]))
    if common == Path(common.anchor) or Path("~").expanduser().is_relative_to(common):
        return None
    return Path(os.path.relpath(source, target)).as_posix()


def text_of(entries: Mapping[str, ManifestEntry], builds: Collection[str] = ()) -> str:
    """Return the manifest as JSON; ``builds`` are the build systems that have files in the folder."""
    solvers = {name: entry.described() for name, entry in sorted(entries.items())}
    build_files = {"build_files": sorted(builds)} if builds else {}
    data = {"manifest": FORMAT, "about": _ABOUT, **build_files, "solvers": solvers}
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"


def read(folder: Path) -> tuple[dict[str, ManifestEntry], tuple[str, ...]]:
    """Return what the manifest of a folder lists: the entries by name, and the build systems.

    Without a manifest there are no entries and no build systems. Raises `CheckError` if the manifest is damaged.
    """
    path = folder / FILE
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        return {}, ()
    except ValueError as error:
        raise _damaged(path, f"it is not JSON: {error}") from None
    if not isinstance(data, dict) or data.get("manifest") != FORMAT:
        raise _damaged(path, f"it is not a manifest of format {FORMAT}, the one that phigen {__version__} reads")
    try:
        builds = tuple(_list_of_texts(data.get("build_files", [])))
        if not set(builds) <= set(FILES):
            raise ValueError(f"build systems that do not exist: {builds}")
        return {name: _entry(name, part) for name, part in data["solvers"].items()}, builds
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        what = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise _damaged(path, what) from None


def _entry(name: str, part: Mapping[str, Any]) -> ManifestEntry:
    spec, options = part["spec"], dict(part["options"])
    lines: list[str] = _list_of_texts(spec["text"])
    text, spec_file = "\n".join(lines), spec.get("file")
    if sha256(text) != spec["sha256"]:
        raise ValueError(f"{name}: the text of its spec was changed")
    # Names in the manifest become paths of files that are written or removed, so the names are checked.
    if not re.fullmatch(SPEC_NAME, name) or not (spec_file is None or isinstance(spec_file, str)):
        raise ValueError(f"{name!r} is not the name of a solver, or its spec is not a file")
    files = {str(file): str(digest) for file, digest in part["files"].items()}
    for file in files:
        if file not in {f"{name}{suffix}" for suffix in suffixes()}:
            raise ValueError(f"{name}: {file!r} is not a file of that solver")
    return ManifestEntry(
        name, _options(name, options), spec_file, text, str(part["license"]), files, str(part["phigen"])
    )


def _options(name: str, raw: dict[str, Any]) -> Options:
    targets = tuple(_list_of_texts(raw.pop("targets", [])))
    without = tuple(_list_of_texts(raw.pop("without", [])))
    unknown = sorted(raw.keys() - ({field.name for field in fields(Options)} - {"directory", "bindings", "stack"}))
    if unknown:
        raise ValueError(f"{name}: {unknown[0]!r} is not an option")
    options = Options(targets=targets, without=without, **raw)
    order, modified = options.order, options.modified
    is_valid = {
        "targets": set(targets) <= set(TARGETS),
        "without": set(without) <= set(PARTS),
        "order": order is None or (type(order) is int and 1 <= order <= limits.ORDER),
        "modified": modified is None or (type(modified) is int and 0 <= modified <= limits.CORRECTIONS),
        "scheme": options.scheme in (None, *SCHEMES),
        "profile": options.profile in (None, *PROFILES),
        "real": options.real in (None, *REALS),
    }
    is_valid |= {key: isinstance(getattr(options, key), bool) for key in ("single_file", "tangent", "adjoint")}
    for key, valid in is_valid.items():
        if not valid:
            value = getattr(options, key)
            raise ValueError(f"{name}: the option {key!r} cannot be {list(value) if type(value) is tuple else value!r}")
    return options


def _list_of_texts(value: Any) -> list[str]:
    if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
        raise TypeError(f"{value!r} is not a list of texts")
    return value


def _damaged(path: Path, why: str) -> CheckError:
    hint = f"restore {FILE} from version control, or remove it and vendor the solvers again"
    return CheckError(f"{path} cannot be used: {why}\n  hint: {hint}")
