"""Files for build systems in a folder of vendored solvers: CMake, Meson, and a Python package."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

#: For each build system, the name of its file, and the suffix of the sources that the file lists.
FILES = {"cmake": ("CMakeLists.txt", ".c"), "meson": ("meson.build", ".c"), "python": ("__init__.py", ".py")}


def build_files(systems: Collection[str], solvers: Mapping[str, Collection[str]]) -> dict[str, str]:
    """Return the files for build systems (name → text).

    ``solvers`` maps the name of each solver in the folder to its files. Each build system has a suffix in `FILES`: its
    file lists all files of the solvers with this suffix.
    """
    return {FILES[system][0]: _text(system, solvers) for system in sorted(systems)}


def sources_lack(systems: Collection[str], solvers: Mapping[str, Collection[str]]) -> list[str]:
    """Return those of the build ``systems`` for which no solver has a source file."""
    endings = {Path(file).suffix for files in solvers.values() for file in files}
    return [system for system in sorted(systems) if FILES[system][1] not in endings]


def _text(system: str, solvers: Mapping[str, Collection[str]]) -> str:
    from phigen._version import __version__
    from phigen.targets.header import CHECKSUM, checksum
    from phigen.targets.rendering import render

    file, suffix = FILES[system]
    sources_of_solvers = [
        (name, sorted(f for f in files if f.endswith(suffix))) for name, files in sorted(solvers.items())
    ]
    sources_of_solvers = [(name, sources) for name, sources in sources_of_solvers if sources]
    names = [name for name, _ in sources_of_solvers]
    values = {
        "solvers": [(name, " ".join(sources)) for name, sources in sources_of_solvers],
        "quoted_solvers": [(name, _quoted(sources)) for name, sources in sources_of_solvers],
        "names": names,
        "listed": ", ".join(names),
        "quoted": _quoted(names),
    }
    body = render("vendor", file, values)
    head = [f"Written by phigen vendor {__version__} for the solvers of this folder, and rewritten together with them."]
    return "".join(f"# {line}\n" for line in [*head, f"{CHECKSUM} {checksum(body)}"]) + body


def _quoted(texts: Sequence[str]) -> str:
    return ", ".join(f"'{text}'" for text in texts)
