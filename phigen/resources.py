"""Where the files that are not Python live: in a wheel inside the package, in a checkout beside it."""

from __future__ import annotations

from pathlib import Path

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


def file_of(given: str) -> str:
    """The path itself if there is such a file, or none of the bundled specs has that name; else that of the spec."""
    try:
        there = Path(given).is_file()
    except OSError:  # too long for a name
        there = False
    return given if there else str(bundled().get(given, given))


def _find(name: str) -> Path:
    # The checkout comes second: a wheel must not pick up a stray folder of site-packages.
    for folder in (_PACKAGE / "_data" / name, _PACKAGE.parent / name):
        if folder.is_dir():
            return folder
    raise FileNotFoundError(f"phigen's folder {name!r} is missing; the installation is incomplete: reinstall phigen")
