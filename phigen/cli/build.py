"""``phigen build``: write the solvers of specs to files."""

from __future__ import annotations

import shlex
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from phigen.cli.arguments import many_specs
from phigen.cli.bindings import LANGUAGES, with_bindings
from phigen.cli.console import Console, counted, indented, mend, out, pass_console, verbosity
from phigen.cli.failures import Collector
from phigen.cli.fmu import PLATFORMS, units_of, write_unit
from phigen.cli.generation import DIRECTORY, Options, files_of, output_options
from phigen.cli.left_out import FILE, names_left_out, unknown_names
from phigen.cli.sources import load_all, spec_path
from phigen.errors import CheckError
from phigen.registry import TARGETS

if TYPE_CHECKING:
    from phigen.cli.outputs import Change
    from phigen.compilation import Compilation
    from phigen.spec.model import Spec

#: Compiler flags that ``--compile`` adds. They turn warnings into errors, since generated C must compile without
#: warnings.
STRICT = ("-Wall", "-Wextra", "-Werror")


@click.command("build")
@many_specs
@click.option("-o", "--output", metavar="DIR", default=DIRECTORY, show_default=True, help="Write files to DIR/NAME/.")
@output_options
@click.option("--compile", "compiling", is_flag=True, help="Also compile the C, to DIR/NAME/libNAME.so.")
@click.option(
    "--fmu", is_flag=True, help="Also write DIR/NAME/NAME.fmu (FMI 3.0) and NAME-fmi2.fmu, for co-simulation."
)
@click.option(
    "--platform",
    "platforms",
    multiple=True,
    type=click.Choice(list(PLATFORMS)),
    help="With --fmu: compile for this platform only, not for all platforms; may be repeated.",
)
@click.option(
    "--binding",
    "bindings",
    multiple=True,
    type=click.Choice(LANGUAGES),
    help="Also write a module that calls the C from another language; may be repeated.",
)
@click.option(
    "--stack",
    metavar="FLAGS",
    help="State in the header how much stack the C uses, measured by gcc (or the gcc named in CC) with FLAGS, "
    "as in --stack=-O2.",
)
@click.option("--certify", is_flag=True, help="Also verify the solvers, and write DIR/NAME/NAME.certificate.json.")
@click.option(
    "--check", "checking", is_flag=True, help="Write nothing; fail if a file differs from what would be written."
)
@click.option("--diff", is_flag=True, help="Like --check, and print the differences.")
@click.option("--force", is_flag=True, help="Overwrite files that were edited by hand or were not written by phigen.")
@verbosity
@pass_console
def command(
    console: Console,
    spec_files: tuple[str, ...],
    output: str,
    targets: tuple[str, ...],
    order: int | None,
    scheme: str | None,
    profile: str | None,
    without: tuple[str, ...],
    single_file: bool,
    tangent: bool,
    adjoint: bool,
    modified: int | None,
    real: str | None,
    compiling: bool,
    fmu: bool,
    platforms: tuple[str, ...],
    bindings: tuple[str, ...],
    stack: str | None,
    certify: bool,
    checking: bool,
    diff: bool,
    force: bool,
) -> None:
    """Write the solvers of specs: DIR/NAME/NAME.h, NAME.c, NAME.py and NAME.mjs.

    SPEC is a file, a folder that is searched for *.yaml, or the name of a bundled spec. The statements of the spec
    are proved first; nothing is written if any spec has an error. Files that were edited by hand are not overwritten.
    Specs found in folders are left out if DIR/left_out.txt has their names.
    """
    if (checking or diff) and (compiling or certify or fmu):
        writing = "--compile, --fmu and --certify write files"
        message = f"{writing}, --check and --diff do not: leave out one or the other"
        raise click.UsageError(message)
    if platforms and not fmu:
        raise click.UsageError("--platform needs --fmu")
    options = Options(
        Path(output),
        tuple(dict.fromkeys(targets)),
        order,
        single_file,
        tangent,
        modified,
        scheme,
        profile,
        without,
        adjoint,
        real,
        tuple(dict.fromkeys(bindings)),
        stack,
    )
    compilations = _compile_all(console, spec_files, options, checking or diff)
    units = units_of(compilations, options) if fmu else {}
    planned = _plan(console, compilations, options)
    planned = with_bindings(planned, options) if bindings else planned
    if checking or diff:
        lone = _orphans(spec_files, compilations, options)
        _compare([*(c for _, changes in planned for c in changes), *lone], options.command(spec_files), diff)
        _expect_certificates(planned, options)
        console.note(f"{counted(len(planned), 'system')} up to date in {options.directory}")
        return
    _write(console, planned, options, force, compiling)
    for name, unit in units.items():
        write_unit(console, options.directory / name, unit, platforms)
    if certify:
        _certify(console, compilations, options)


def _compile_all(console: Console, spec_files: Sequence[str], options: Options, checking: bool) -> list[Compilation]:
    collector, compilations = Collector(), []
    for spec in _to_build(console, load_all(spec_files, collector), spec_files, options.directory, checking):
        start = time.perf_counter()
        with collector.collecting():
            compilations.append(options.compiled(spec))
            stages = ", ".join(f"{stage} {seconds:.2f}" for stage, seconds in compilations[-1].seconds.items())
            console.detail(f"{spec.name}: {time.perf_counter() - start:.2f} s ({stages})")
    collector.finish()
    for compilation in compilations:
        for note in compilation.notes:
            console.note(f"{compilation.spec.name}: {note}")
    return compilations


def _to_build(
    console: Console, specs: Sequence[Spec], spec_files: Sequence[str], directory: Path, checking: bool
) -> list[Spec]:
    """Return the specs to build.

    Specs found in a searched folder are left out if ``left_out.txt`` in the output folder has their names. Specs that
    the user names are always built. With --check, raises CheckError if ``left_out.txt`` has names that no spec has.
    """
    folders = [file for file in spec_files if Path(spec_path(file)).is_dir()]
    left_out = names_left_out(directory) if folders else {}
    unknown = unknown_names(left_out, {spec.name for spec in specs})
    if checking and unknown:
        raise CheckError("\n".join([*unknown, "  hint: remove these lines, or check the folder of these specs too"]))
    named_files = {spec_path(file) for file in spec_files}
    chosen_specs = [spec for spec in specs if spec.name not in left_out or spec.file in named_files]
    if len(chosen_specs) < len(specs):
        console.note(f"{counted(len(specs) - len(chosen_specs), 'spec')} left out by {directory / FILE}")
    return chosen_specs


def _plan(
    console: Console, compilations: Sequence[Compilation], options: Options
) -> list[tuple[Compilation, list[Change]]]:
    from phigen.cli.outputs import changes

    result = []
    for compilation in compilations:
        name, start = compilation.spec.name, time.perf_counter()
        files = files_of(compilation, options)
        console.detail(f"{name}: {time.perf_counter() - start:.2f} s emitting")
        result.append((compilation, changes(options.directory / name, name, files, options.targets or TARGETS)))
    return result


def _orphans(spec_files: Sequence[str], compilations: Sequence[Compilation], options: Options) -> Iterator[Change]:
    """Yield changes that remove generated files whose spec no longer exists.

    A build of single specs removes nothing, since it does not know which other specs exist.
    """
    from phigen.cli.outputs import orphans

    if any(Path(spec_path(file)).is_dir() for file in spec_files):
        names = [c.spec.name for c in compilations]
        yield from orphans(options.directory, names, options.targets or TARGETS)


def _compare(planned: Sequence[Change], command: str, diff: bool) -> None:
    """Raise CheckError with a list of the files that the command line ``command`` would change.

    Does nothing if no file would change. With ``diff``, the differences are printed first.
    """
    outdated = [change for change in planned if change.state != "unchanged"]
    if diff:
        for change in outdated:
            out(change.diff().rstrip("\n"))
    if not outdated:
        return
    lines = [f"{change.path}: {_complaint(change)}" for change in outdated]
    lone = [c for c in outdated if c.state == "stale" and not _has_successor(c, planned)]
    remedies = [f"rm {shlex.join(str(c.path) for c in lone)}"] if lone else []
    if len(outdated) > len(lone):
        forced = " --force" if any(c.obstacle for c in outdated) else ""
        remedies.insert(0, command + forced)
    raise CheckError("\n".join([f"{counted(len(outdated), 'file')} out of date", *indented(lines), *mend(remedies)]))


def _complaint(change: Change) -> str:
    if change.obstacle and change.state == "different":
        return change.obstacle.removeprefix(f"{change.path} ")
    return {
        "missing": "missing",
        "different": "differs from what phigen generates from its spec",
        "stale": "no spec of this build produces it",
    }[change.state]


def _has_successor(change: Change, planned: Sequence[Change]) -> bool:
    return any(c.path.parent == change.path.parent and c.after is not None for c in planned)


def _write(
    console: Console,
    planned: Sequence[tuple[Compilation, list[Change]]],
    options: Options,
    force: bool,
    compiling: bool,
) -> None:
    from phigen.cli.outputs import apply

    obstacles = [change.obstacle for _, changes in planned for change in changes if change.obstacle]
    if obstacles and not force:
        hint = "  hint: --diff shows the differences; --force overwrites"
        raise CheckError("\n".join(["nothing was written", *indented(obstacles), hint]))
    for compilation, changes in planned:
        apply(changes)
        _report(console, options.directory / compilation.spec.name, compilation, changes)
    if compiling:
        for compilation, _ in planned:
            if any(TARGETS[t].compiled for t in options.targets_of(compilation)):
                _compile_library(console, options.directory / compilation.spec.name, compilation.spec.name)


def _certify(console: Console, compilations: Sequence[Compilation], options: Options) -> None:
    """Verify the written solvers, and write a certificate for each system that meets all bounds.

    The certificate of an earlier build is removed first. A system that misses a bound gets no certificate. After all
    systems have been verified, their errors are raised together.
    """
    from phigen.cli import certificate
    from phigen.cli.verify import missed_bounds, verified, verified_lattice
    from phigen.compiler import compile_proved
    from phigen.writing import write

    collector = Collector()
    for compilation in compilations:
        spec, path = (
            compilation.spec,
            certificate.path_of(options.directory / compilation.spec.name, compilation.spec.name),
        )
        with collector.collecting():
            path.unlink(missing_ok=True)
            subject = compile_proved(spec, tangent=True)
            judged = verified_lattice if spec.lattice else verified
            verification = judged(subject, None, False, console, options.targets_of(compilation))
            if verification.failures:
                raise missed_bounds(verification)
            write(path, certificate.text_of(compilation, files_of(compilation, options), verification))
            console.note(f"wrote {path}: {len(verification.checks)} measurements")
    collector.finish()


def _expect_certificates(planned: Sequence[tuple[Compilation, list[Change]]], options: Options) -> None:
    """Raise CheckError if a certificate on disk does not belong to the planned files of its system.

    Systems without a certificate on disk pass.
    """
    from phigen.cli import certificate

    complaints = []
    for compilation, _ in planned:
        path = certificate.path_of(options.directory / compilation.spec.name, compilation.spec.name)
        complaints.append(certificate.obsolete(path, compilation, files_of(compilation, options)))
    if any(complaints):
        lines = ["certificates out of date", *indented([f for f in complaints if f])]
        raise CheckError("\n".join([*lines, "  hint: build with --certify, or remove them"]))


def _report(console: Console, folder: Path, compilation: Compilation, changes: Sequence[Change]) -> None:
    written_files = [_within(folder, c.path) for c in changes if c.state in ("missing", "different")]
    removed = [_within(folder, c.path) for c in changes if c.state == "stale"]
    sentences = [f"wrote {', '.join(written_files)}"] if written_files else []
    sentences += [f"removed {', '.join(removed)}, which are no longer generated from the spec"] if removed else []
    program = compilation.program
    method = compilation.named(f"order {program.order}, {compilation.label}")
    console.note(f"{folder}: {'; '.join(sentences) or 'unchanged'} ({method})")
    library = folder / _library(compilation.spec.name)
    if written_files and library.exists():
        console.note(f"{library} is older than its sources; --compile builds it again")


def _within(folder: Path, path: Path) -> str:
    """Return a path relative to the folder of a system, or unchanged if it is not in that folder."""
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else path.name


def _compile_library(console: Console, folder: Path, name: str) -> None:
    from phigen.runtime import toolchain
    from phigen.writing import write

    installed, start = toolchain.find(), time.perf_counter()
    compiler = replace(installed, tuning=installed.tuning + STRICT)
    library = folder / _library(name)
    with tempfile.TemporaryDirectory(prefix="phigen-") as scratch:
        fresh = Path(scratch) / library.name
        toolchain.compile_library([folder / f"{name}.c"], fresh, compiler)
        write(library, fresh.read_bytes())
        library.chmod(fresh.stat().st_mode)
    console.note(f"compiled {library} with {installed.command[0]} in {time.perf_counter() - start:.2f} s")


def _library(name: str) -> str:
    return f"lib{name}.so"
