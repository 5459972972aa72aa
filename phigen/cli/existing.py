"""Existing files that a command would replace: files of phigen are replaced, other files only with ``--force``."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from phigen.runtime.origin import Origin

_FORCE, _REPLACED = "phigen.force", "phigen.replaced"


def _keep(ctx: click.Context, parameter: click.Parameter, value: bool) -> None:
    ctx.meta[_FORCE] = value


#: The option ``--force``. click reads this option before those that name files. So the checks of files know whether
#: ``--force`` was given.
force_option = click.option(
    "--force",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_keep,
    help="Replace files of other runs, and files that phigen did not write.",
)


def expect_replaceable(path: Path, option: str | None = None) -> None:
    """Raise `click.BadParameter` for an existing file that phigen did not write, unless ``--force`` was given.

    The path of a file that may be replaced is stored, so that the command can report the replacement.
    """
    if not path.is_file() or path.stat().st_size == 0:
        return
    meta = click.get_current_context().meta
    if not meta.get(_FORCE) and not _is_of_phigen(path):
        message = f"{str(path)!r} exists, and nothing shows that phigen wrote it; --force replaces it"
        raise click.BadParameter(message, param_hint=option)
    meta.setdefault(_REPLACED, set()).add(path)


def expect_same_origin(files: Mapping[str, Path | None], origin: Origin, *, continued: bool = False) -> None:
    """Raise `click.BadParameter` if a file was written by another run, unless ``--force`` was given.

    ``files`` maps options to their files. If the run is ``continued``, ``--force`` does not apply, and a file that does
    not state its origin is accepted.
    """
    from phigen.runtime.lattice_frames import is_store
    from phigen.runtime.origin import companion, read_origin

    option_paths = [(option, path.resolve()) for option, path in files.items() if path is not None]
    if len(option_paths) == 2 and option_paths[0][1] == option_paths[1][1]:
        raise click.BadParameter(
            f"{option_paths[0][0]} and {option_paths[1][0]} name the same file", param_hint=option_paths[1][0]
        )
    force = click.get_current_context().meta.get(_FORCE) and not continued
    for option, path in files.items():
        if path is None or force or not path.exists() or not (path.is_dir() or path.is_file()):
            continue
        if path.with_name(f"{path.name}.checkpoint").exists() or (path.is_file() and path.stat().st_size == 0):
            continue  # the file is empty, or a checkpoint beside it states its origin
        if path.is_dir() and not is_store(path):
            continue  # another check refuses a folder that is no Zarr store
        file_origin = read_origin(path)
        hint = "" if continued else "; --force replaces it"
        if file_origin is None and not continued:
            if path.suffix.lower() == ".csv":
                hint = f" (the file {companion(path)} is missing){hint}"
            message = f"{str(path)!r} exists, and does not say which run of phigen wrote it{hint}"
            raise click.BadParameter(message, param_hint=option)
        if file_origin is not None and (difference := origin.difference(file_origin)):
            raise click.BadParameter(f"{str(path)!r} holds {difference}{hint}", param_hint=option)


def wrote(path: Path) -> str:
    """Return the message that a file was written, or that it replaced an existing file.

    With --resume or --extend, a run is continued in its existing file, and the message says "wrote".
    """
    ctx: Any = click.get_current_context()
    continued = ctx.params.get("resume") or ctx.params.get("extend")
    return f"{'replaced' if path in ctx.meta.get(_REPLACED, ()) and not continued else 'wrote'} {path}"


def _is_of_phigen(path: Path) -> bool:
    """Whether phigen seems to have written a file.

    A ``.csv`` or ``.npz`` file must have the column t. Any other file must contain the word phigen.
    """
    match path.suffix.lower():
        case ".csv":
            with path.open("rb") as file:
                return file.readline(1 << 16).strip().split(b",")[0] == b"t"
        case ".npz":
            if not zipfile.is_zipfile(path):
                return False
            with zipfile.ZipFile(path) as archive:
                return "t.npy" in archive.namelist()
        case _:
            return b"phigen" in path.read_bytes()
