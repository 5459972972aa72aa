"""Option ``--binding`` of ``phigen build``: files by which other languages call the generated C."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from phigen.cli.failures import Collector
from phigen.cli.generation import Options, generate

if TYPE_CHECKING:
    from phigen.cli.outputs import Change
    from phigen.compilation import Compilation

#: The languages of `phigen.bindings.emitter`, repeated here so that the command line does not import that module.
LANGUAGES = ("cpp", "fortran", "julia", "matlab", "rust")


def with_bindings(
    planned: Sequence[tuple[Compilation, list[Change]]], options: Options
) -> list[tuple[Compilation, list[Change]]]:
    """Return the ``planned`` changes with further changes: for each system, its bindings and the C that they call.

    Raises `SpecError` with a list of the systems for which bindings cannot be generated.
    """
    from phigen.bindings.emitter import binding
    from phigen.cli.outputs import Change, read

    collector, result, of_c = Collector(), [], replace(options, single_file=False)
    for compilation, changes in planned:
        with collector.collecting():
            folder = options.directory / compilation.spec.name
            files = generate(compilation, "c", of_c)
            for language in options.bindings:
                files |= binding(compilation, language)
            paths = {change.path for change in changes}
            binding_changes = [Change(folder / file, read(folder / file), text) for file, text in files.items()]
            result.append(
                (compilation, [*changes, *(change for change in binding_changes if change.path not in paths)])
            )
    collector.finish()
    return result
