"""Arguments and options that several commands share, and checks of files named on the command line."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

import click

from phigen.cli.completion import runs, specs
from phigen.cli.existing import expect_replaceable
from phigen.registry import RUNNABLE
from phigen.spec import limits
from phigen.spec.names import PROFILES, SCHEMES

#: Suffixes of figures.
FIGURES = (".png", ".svg", ".pdf")
#: Suffixes of films. Only runs of lattices can be drawn as films.
FILMS = (".gif", ".mp4")

#: The orders that ``--order`` accepts.
ORDER = click.IntRange(1, limits.ORDER)

#: The numbers of corrections that ``--modified`` accepts.
CORRECTIONS = click.IntRange(0, limits.CORRECTIONS)

order_option = click.option("--order", metavar="K", type=ORDER, help="Order of the method; overrides the spec.")

#: The seeds that ``--seed`` accepts. A seed selects the random numbers of a run with noise.
SEED = click.IntRange(0, limits.SEED)

#: The option for the target of the solver. The value auto stands for C, or for NumPy if there is no C compiler.
target_option = click.option(
    "-t",
    "--target",
    type=click.Choice(["auto", *RUNNABLE]),
    default="auto",
    show_default=True,
    help="Target of the solver; auto is C, or NumPy without a C compiler.",
)

settings_option = click.option(
    "--set", "settings", metavar="NAME=VALUE", multiple=True, help="Value of a parameter or of an initial coordinate."
)

#: The option ``--scheme``, which overrides the scheme in the spec.
scheme_option = click.option("--scheme", type=click.Choice(SCHEMES), help="Scheme of the steps; overrides the spec.")

#: The option for the profile of code that phigen itself runs; ``profile:`` in a spec only applies to ``phigen build``.
profile_option = click.option(
    "--profile",
    type=click.Choice(PROFILES),
    help="Optimisation of the C for speed or for size.  [default: fast]",
)

#: The option that names a run of a spec, for commands with the argument SPEC.
run_option = click.option(
    "--run", "name", metavar="NAME", shell_complete=runs, help="The run of the spec to use.  [default: the first]"
)

one_spec = click.argument("spec_file", metavar="SPEC", type=click.Path(), shell_complete=specs)
many_specs = click.argument(
    "spec_files", metavar="SPEC...", nargs=-1, required=True, type=click.Path(), shell_complete=specs
)


def _one_of(choices: Sequence[str]) -> str:
    """Return the words as "a, b or c"."""
    return " or ".join([", ".join(choices[:-1]), choices[-1]]) if len(choices) > 1 else choices[0]


def file_ending(*suffixes: str) -> Callable[[click.Context, click.Parameter, str | None], Path | None]:
    """Return the callback of an option that names a file.

    Before any work is done, the callback checks the suffix of the file, and that the file can be written.
    """

    def checked(ctx: click.Context, parameter: click.Parameter, value: str | None) -> Path | None:
        if value is None:
            return None
        if Path(value).suffix.lower() not in suffixes:
            raise click.BadParameter(f"{value!r} must end in {_one_of(suffixes)}")
        if Path(value).suffix.lower() == ".zarr" and Path(value).is_dir():
            expect_writable(Path(value) / "zarr")  # an existing store is a folder; files are written in it
        else:
            expect_writable(Path(value))
            expect_replaceable(Path(value))
        return Path(value)

    return checked


def expect_writable(path: Path, option: str | None = None) -> None:
    """Raise `click.BadParameter` for a path that is a folder, or whose folder is missing or read-only.

    ``option`` is the name of the option in the message.
    """
    device = path.exists() and not path.is_file() and not path.is_dir()
    if path.is_dir():
        raise click.BadParameter(f"{str(path)!r} is a folder", param_hint=option)
    if not path.parent.is_dir():
        raise click.BadParameter(f"there is no folder {str(path.parent)!r}", param_hint=option)
    if not device and not os.access(path.parent, os.W_OK):
        raise click.BadParameter(f"nothing can be written to the folder {str(path.parent)!r}", param_hint=option)
