"""Option ``--fmu`` of ``phigen build``: solvers as functional mock-up units."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from phigen.cli.console import Console
from phigen.cli.failures import Collector
from phigen.cli.generation import Options, generate

if TYPE_CHECKING:
    from phigen.compilation import Compilation
    from phigen.fmu.archive import MockupUnit

#: The platforms of `phigen.fmu.platforms.PLATFORMS`, repeated here so that the command line does not import that
#: module.
_SYSTEMS, _MACHINES = ("linux", "windows", "darwin"), ("x86_64", "aarch64")
PLATFORMS = tuple(f"{machine}-{system}" for system in _SYSTEMS for machine in _MACHINES)


def units_of(compilations: Sequence[Compilation], options: Options) -> dict[str, MockupUnit]:
    """Return the FMU (functional mock-up unit) of each system, by the name of the system.

    Raises `SpecError` with a list of the systems for which no FMU can be made.
    """
    from phigen.fmu.archive import unit_of

    # --stack measures the stack that the generated C needs. The functions of FMI may need more, so FMUs do not state
    # the size of the stack.
    collector, units, of_c = Collector(), {}, replace(options, single_file=False, stack=None)
    for compilation in compilations:
        with collector.collecting():
            changeable = compilation.including("parameters").with_stack(None)
            units[compilation.spec.name] = unit_of(changeable, generate(changeable, "c", of_c))
    collector.finish()
    return units


def write_unit(console: Console, folder: Path, unit: MockupUnit, platforms: Sequence[str]) -> None:
    """Compile an FMU, and write it to a folder as two files, one for FMI 3.0 and one for FMI 2.0.

    Raises `ToolchainError`.
    """
    from phigen.fmu.archive import archive, binaries
    from phigen.fmu.platforms import compilers
    from phigen.writing import write_all

    start, libraries = time.perf_counter(), dict[str, bytes]()
    for platform in platforms or compilers():
        console.note(f"{unit.name}: compiling for {platform}")
        libraries |= binaries(unit, [platform])
    paths = {folder / f"{unit.name}.fmu": 3, folder / f"{unit.name}-fmi2.fmu": 2}
    write_all({path: archive(unit, version, libraries) for path, version in paths.items()})
    made_for = ", ".join(libraries) or "no machine: there is no C compiler; sources only"
    console.note(f"wrote {' and '.join(map(str, paths))} in {time.perf_counter() - start:.2f} s, for {made_for}")
