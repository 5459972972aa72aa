"""Locations of the files that are not Python: in a wheel inside the package, in a checkout beside it."""

from __future__ import annotations

from pathlib import Path

from phigen.errors import Diagnostic

_PACKAGE = Path(__file__).resolve().parent


def templates() -> Path:
    """The folder of the templates, with one sub-folder per target.

    Raises `FileNotFoundError` if the installation is incomplete.
    """
    return _find("templates")


def bundled_specs() -> Path:
    """The folder of the bundled spec files, ``NAME.yaml``; those of lattices are in ``lattices``.

    Raises `FileNotFoundError` if the installation is incomplete.
    """
    return _find("specs")


def bundled() -> dict[str, Path]:
    """The files of the bundled specs by their names, lattices last."""
    folder = bundled_specs()
    files = [*sorted(folder.glob("*.yaml")), *sorted(folder.glob("lattices/*.yaml"))]
    return {path.stem: path for path in files}


def bundled_name(file: str) -> str | None:
    """The name of the bundled spec that is in a file, None if that is another file."""
    path = Path(file)
    return path.stem if path.is_absolute() and bundled().get(path.stem) == path else None


def file_of(source: str) -> str:
    """Return the path itself if there is such a file, or if no bundled spec has that name; else the path of the
    bundled spec."""
    try:
        exists = Path(source).is_file()
    except OSError:  # too long for a name
        exists = False
    return source if exists else str(bundled().get(source, source))


def missing(source: str) -> Diagnostic:
    """Return the error for a text that names neither a file nor a bundled spec, with suggestions."""
    also = "" if set(source) & {"/", "."} else ", and no bundled spec has that name"
    return Diagnostic(f"there is no file {source!r}{also}", hint=suggestion(source))


def suggestion(source: str) -> str:
    """The hint for a spec that was not found: a bundled one or a file of nearly that name, or how to find one."""
    from difflib import get_close_matches

    path, names = Path(source), bundled()
    if path.stem in names:
        return f"did you mean {path.stem!r}? The bundled spec of that name needs neither folder nor suffix"
    neighbouring_files = [p.name for p in path.parent.glob("*.y*ml")] if path.parent.is_dir() else []
    if similar := get_close_matches(path.name, neighbouring_files, n=1) or [
        p for p in neighbouring_files if Path(p).stem == path.name
    ]:
        return f"did you mean {str(path.with_name(similar[0]))!r}?"
    if similar := get_close_matches(path.stem, names, n=3):
        specs = "bundled specs" if len(similar) > 1 else "a bundled spec"
        return f"did you mean {' or '.join(map(repr, similar))}? {'These are' if len(similar) > 1 else 'It is'} {specs}"
    return "phigen list shows the bundled specs; phigen new NAME writes a spec to start from"


def _find(name: str) -> Path:
    # The checkout is tried second: a wheel must not use an unrelated folder in site-packages.
    for folder in (_PACKAGE / "_data" / name, _PACKAGE.parent / name):
        if folder.is_dir():
            return folder
    raise FileNotFoundError(f"phigen's folder {name!r} is missing; the installation is incomplete: reinstall phigen")
