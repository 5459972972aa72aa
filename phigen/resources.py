"""Paths of the templates and of the bundled specs: inside the package in a wheel, beside the package in a checkout."""

from __future__ import annotations

from pathlib import Path

from phigen.errors import Diagnostic

_PACKAGE = Path(__file__).resolve().parent


def templates() -> Path:
    """Return the folder of the templates, with one sub-folder per target.

    Raises `FileNotFoundError` if the installation is incomplete.
    """
    return _find("templates")


def bundled_specs() -> Path:
    """Return the folder of the bundled spec files, ``NAME.yaml``; lattices are in its sub-folder ``lattices``.

    Raises `FileNotFoundError` if the installation is incomplete.
    """
    return _find("specs")


def bundled() -> dict[str, Path]:
    """Return the names of the bundled specs with the paths of their files, lattices last."""
    folder = bundled_specs()
    files = [*sorted(folder.glob("*.yaml")), *sorted(folder.glob("lattices/*.yaml"))]
    return {path.stem: path for path in files}


def bundled_name(file: str) -> str | None:
    """Return the name of a bundled spec, if ``file`` is the path of its file; None for other files."""
    path = Path(file)
    return path.stem if path.is_absolute() and bundled().get(path.stem) == path else None


def file_of(source: str) -> str:
    """Return the path of a spec file: ``source`` if this is a file, else the path of the bundled spec with this
    name.

    If there is neither, ``source`` is returned unchanged.
    """
    try:
        exists = Path(source).is_file()
    except OSError:  # the text cannot be a path: it is too long for a file name
        exists = False
    return source if exists else str(bundled().get(source, source))


def missing(source: str) -> Diagnostic:
    """Return the error, with a hint, for a ``source`` that is neither a file nor the name of a bundled spec."""
    also = "" if set(source) & {"/", "."} else ", and no bundled spec has that name"
    return Diagnostic(f"there is no file {source!r}{also}", hint=suggestion(source))


def suggestion(source: str) -> str:
    """Return a hint for a spec that was not found.

    The hint names a similar spec or file, or else the command that lists the specs.
    """
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
    # In a checkout the folder is beside the package. The folder inside the package is tried first, since a folder
    # beside an installed package may be an unrelated one with the same name.
    for folder in (_PACKAGE / "_data" / name, _PACKAGE.parent / name):
        if folder.is_dir():
            return folder
    raise FileNotFoundError(f"phigen's folder {name!r} is missing; the installation is incomplete: reinstall phigen")
