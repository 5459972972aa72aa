"""``phigen vendor``: copy solvers into another project, with a manifest by which they can be checked later."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from phigen import resources
from phigen._version import __version__
from phigen.cli import manifest
from phigen.cli.build_files import FILES, build_files, sources_lack
from phigen.cli.completion import specs
from phigen.cli.console import Console, counted, indented, mend, pass_console, verbosity
from phigen.cli.failures import Collector
from phigen.cli.generation import Options, files_of, output_options
from phigen.cli.manifest import ManifestEntry
from phigen.cli.sources import SUFFIXES, as_given, load_all
from phigen.errors import CheckError
from phigen.registry import suffixes

if TYPE_CHECKING:
    from phigen.cli.outputs import Change
    from phigen.compilation import Compilation
    from phigen.spec.model import Spec


@dataclass(frozen=True)
class VendorRequest:
    """Request to vendor or to check one solver: its spec, the origin of the spec, and options.

    ``found`` is false if the spec file is absent and the text of the spec comes from the manifest.
    """

    spec: Spec
    spec_file: str | None
    options: Options
    found: bool = True


@dataclass(frozen=True)
class VendoredSolver:
    """Solver in a folder of another project: the request for it, and the files (name → text) that it should have."""

    order: VendorRequest
    compilation: Compilation
    files: Mapping[str, str]

    @property
    def entry(self) -> ManifestEntry:
        """Return the entry of the solver in the manifest."""
        spec, order = self.order.spec, self.order
        files = {file: manifest.sha256(text) for file, text in self.files.items()}
        return ManifestEntry(spec.name, order.options, order.spec_file, spec.source, spec.license, files, __version__)


@click.command("vendor")
@click.argument("paths", metavar="[SPEC...] DEST", nargs=-1, required=True, type=click.Path(), shell_complete=specs)
@output_options
@click.option("--cmake", is_flag=True, help="Also write a CMakeLists.txt for the folder.")
@click.option("--meson", is_flag=True, help="Also write a meson.build for the folder.")
@click.option("--python", is_flag=True, help="Also write an __init__.py, which makes the folder a package.")
@click.option(
    "--check", "checking", is_flag=True, help="Write nothing; fail if a file differs from what would be written."
)
@click.option("--force", is_flag=True, help="Overwrite files that were edited by hand or were not written by phigen.")
@verbosity
@pass_console
def command(
    console: Console,
    paths: tuple[str, ...],
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
    cmake: bool,
    meson: bool,
    python: bool,
    checking: bool,
    force: bool,
) -> None:
    """Copy solvers into the folder DEST of another project, and check them there later.

    The files NAME.h, NAME.c, NAME.py are those of `phigen build`. For each solver, DEST/phigen-vendor.json records
    the spec, the options and the version of phigen. Without SPEC, the solvers in DEST are generated again.

    --check tests that the files are unmodified, and agree with their specs and this version of phigen. Without SPEC,
    --check tests all files of DEST. If a spec is missing, a message says that changes of this spec cannot be checked.
    """
    *spec_files, last = paths
    folder = Path(last)
    _expect_folder(folder, spec_files, checking)
    options = Options(
        targets=tuple(dict.fromkeys(targets)),
        order=order,
        single_file=single_file,
        tangent=tangent,
        adjoint=adjoint,
        modified=modified,
        scheme=scheme,
        profile=profile,
        without=without,
        real=real,
    )
    if options.words and not spec_files:
        raise click.UsageError(
            "options that change the generated files need a SPEC; without SPEC, phigen takes the options "
            "from the manifest"
        )
    (entries, systems), collector = manifest.read(folder), Collector()
    asked = {"cmake": cmake, "meson": meson, "python": python}
    build_systems = [system for system in FILES if asked[system] or system in systems]
    orders = _from_specs(spec_files, folder, options, entries, checking, collector)
    if not spec_files:
        orders = _from_manifest(folder, entries, collector)
    vendored = [m for m in (_vendored_solver(order, collector) for order in orders) if m]
    if checking:
        problems = [p for m in vendored for p in _problems(folder, entries, m, spec_files)]
        problems += [] if spec_files else [*_extra(folder, entries), *_wrong_builds(folder, entries, build_systems)]
        with collector.collecting():
            _judge(folder, problems)
        collector.finish()
        _report_check(console, folder, vendored)
        return
    collector.finish()
    _write(console, folder, entries, vendored, build_systems, force)


def _expect_folder(folder: Path, spec_files: Sequence[str], checking: bool) -> None:
    if folder.is_file() or (folder.suffix in SUFFIXES and not folder.is_dir()):
        suggested = shlex.join(["phigen", "vendor", *spec_files, str(folder), "DEST"])
        raise click.UsageError(
            f"{folder} is not a folder; the last argument is the folder for the solvers: {suggested}"
        )
    if (folder / manifest.FILE).is_file():
        return
    message = f"{folder} holds no solvers that were vendored: there is no {folder / manifest.FILE}"
    if checking:
        suggested = shlex.join(["phigen", "vendor", *(spec_files or ["SPEC"]), str(folder)])
        raise CheckError(f"{message}\n  hint: {suggested} puts one there")
    if not spec_files:
        raise click.UsageError(f"{message}; to put one there: phigen vendor SPEC {folder}")


def _from_specs(
    spec_files: Sequence[str],
    folder: Path,
    options: Options,
    entries: Mapping[str, ManifestEntry],
    checking: bool,
    collector: Collector,
) -> list[VendorRequest]:
    """Return requests for the specs that the command line names.

    The options are those of the command line. But if the command is a check without options, each solver has the
    options that the manifest states for it.
    """
    orders = []
    for spec in load_all(spec_files, collector) if spec_files else []:
        entry = entries.get(spec.name)
        order_options = entry.options if checking and entry and not options.words else options
        origin = resources.bundled_name(spec.file) or manifest.relative(spec.file, folder)
        orders.append(VendorRequest(spec, origin, order_options))
    return orders


def _from_manifest(folder: Path, entries: Mapping[str, ManifestEntry], collector: Collector) -> list[VendorRequest]:
    """Return requests for all solvers in the manifest.

    The text of a spec is read from its file. If the file is missing, the copy of the text in the manifest is used.
    """
    from phigen import spec as specs

    orders = []
    for name, entry in entries.items():
        with collector.collecting():
            path = _path_of_spec(folder, entry)
            if path is None:
                copy = specs.loads(entry.spec_text, f"{folder / manifest.FILE}({name})")
                orders.append(VendorRequest(copy, entry.spec_file, entry.options, found=False))
                continue
            spec = specs.load(path)
            if spec.name != name:
                raise CheckError(f"{path} now defines {spec.name}, but {name} in {folder} was generated from this file")
            orders.append(VendorRequest(spec, entry.spec_file, entry.options))
    return orders


def _path_of_spec(folder: Path, entry: ManifestEntry) -> Path | None:
    """Return the path of a spec, as seen from the working directory; None if the file is absent."""
    if entry.spec_file is None:
        return None
    if bundled := resources.bundled().get(entry.spec_file):
        return bundled
    path = Path(os.path.normpath(folder / entry.spec_file))
    return path if path.is_file() else None


def _vendored_solver(order: VendorRequest, collector: Collector) -> VendoredSolver | None:
    options = order.options
    with collector.collecting():
        compilation = options.compiled(order.spec)
        return VendoredSolver(order, compilation, files_of(compilation, options))
    return None


# -- writing


def _write(
    console: Console,
    folder: Path,
    entries: dict[str, ManifestEntry],
    vendored: Sequence[VendoredSolver],
    builds: Sequence[str],
    force: bool,
) -> None:
    from phigen.cli.outputs import Change, apply, read

    planned: list[tuple[VendoredSolver, list[Change]]] = []
    for m in vendored:
        known = entries.get(m.order.spec.name)
        changes = [Change(folder / file, read(folder / file), text) for file, text in m.files.items()]
        left = [folder / file for file in (known.files if known else ()) if file not in m.files]
        changes += [Change(path, text_before, None) for path in left if (text_before := read(path)) is not None]
        planned.append((m, changes))
    all_entries = {**entries, **{m.order.spec.name: m.entry for m in vendored}}
    texts = build_files(builds, {name: entry.files for name, entry in all_entries.items()})
    for system in sources_lack(builds, {name: entry.files for name, entry in all_entries.items()}):
        file, suffix = FILES[system]
        target = "numpy" if suffix == ".py" else "c"
        raise click.UsageError(f"{file} lists {suffix} files, but no solver in the folder has one; add -t {target}")
    build_changes = [Change(folder / file, read(folder / file), text) for file, text in texts.items()]
    obstacles = [o for m, changes in planned for c in changes if (o := _obstacle(c, entries.get(m.order.spec.name)))]
    obstacles += [c.obstacle for c in build_changes if c.obstacle]
    if obstacles and not force:
        raise CheckError("\n".join(["nothing was written", *indented(obstacles), "  hint: --force overwrites"]))
    text = manifest.text_of(all_entries, builds)
    listing = Change(folder / manifest.FILE, read(folder / manifest.FILE), text)
    apply([*(c for _, changes in planned for c in changes), *build_changes, listing])
    for m, changes in planned:
        console.note(_changes_sentence(folder, m, changes))
    for change in build_changes:
        if change.state != "unchanged":
            console.note(f"{folder}: wrote {change.path.name}")


def _obstacle(change: Change, entry: ManifestEntry | None) -> str:
    """Return why a file must not be changed; "" if it may be.

    The checksum in a file covers only the text below its header, so edits of the header are detected by the hash in
    the manifest.
    """
    if change.obstacle or change.before is None or change.before == change.after:
        return change.obstacle
    stated = entry.files.get(change.path.name) if entry else None
    edited = stated is not None and stated != manifest.sha256(change.before)
    return f"{change.path} was edited by hand after phigen generated it" if edited else ""


def _changes_sentence(folder: Path, vendored: VendoredSolver, changes: Sequence[Change]) -> str:
    written_files = [c.path.name for c in changes if c.state in ("missing", "different")]
    removed = [c.path.name for c in changes if c.state == "stale"]
    sentences = [f"wrote {', '.join(written_files)}"] if written_files else []
    sentences += [f"removed {', '.join(removed)}"] if removed else []
    sentences = sentences or [f"{vendored.order.spec.name} unchanged"]
    if not vendored.order.found:
        sentences.append("from the copy of the spec in the manifest, since the file of the spec was not found")
    return (
        f"{folder}: {'; '.join(sentences)} (order {vendored.compilation.program.order}, {vendored.compilation.label})"
    )


# -- checking


@dataclass(frozen=True)
class VendorProblem:
    """Problem with one file, and the command that corrects it."""

    path: Path
    what: str
    remedy: str


def _problems(
    folder: Path, entries: Mapping[str, ManifestEntry], vendored: VendoredSolver, spec_files: Sequence[str]
) -> Iterator[VendorProblem]:
    """Yield the problems with the files of one solver."""
    order = vendored.order
    arguments = [as_given(order.spec), str(folder), *order.options.words] if spec_files else [str(folder)]
    entry = entries.get(order.spec.name)
    for file in sorted({*vendored.files, *(entry.files if entry else ())}):
        path = folder / file
        complaint, edited = _complaint(path, entry, vendored)
        if complaint:
            yield VendorProblem(
                path, complaint, shlex.join(["phigen", "vendor", *arguments, *(["--force"] if edited else [])])
            )


def _complaint(path: Path, entry: ManifestEntry | None, vendored: VendoredSolver) -> tuple[str, bool]:
    """Return the problem with a file, and whether its correction needs ``--force``.

    If there is no problem, the text is "". Files that were edited by hand need ``--force``.
    """
    content = path.read_bytes() if path.is_file() else None
    stated, expected = entry.files.get(path.name) if entry else None, vendored.files.get(path.name)
    if content is None:
        return (
            ("missing", False)
            if expected is not None
            else ("missing, and phigen no longer generates it from its spec", False)
        )
    if stated is None:
        return "not in the manifest", content != (expected or "").encode()
    if manifest.sha256(content) != stated:
        if manifest.sha256(content.replace(b"\r\n", b"\n")) == stated:
            return "its line endings were changed; for git, put '* -text' into .gitattributes beside it", True
        return "edited by hand", True
    if expected is None:
        return "phigen no longer generates it from its spec", False
    return ("" if content == expected.encode() else f"stale: {_cause(entry, vendored)}"), False


def _cause(entry: ManifestEntry | None, vendored: VendoredSolver) -> str:
    """Return why phigen would generate a different file now."""
    causes = []
    if entry and entry.spec_text != vendored.order.spec.source:
        causes.append("its spec has changed")
    if entry and entry.version != __version__:
        causes.append(f"it was generated by phigen {entry.version}, but the installed version is {__version__}")
    if entry and entry.options != vendored.order.options:
        causes.append("it was generated with other options")
    return "; ".join(causes) or "phigen generates a different file from its spec"


def _wrong_builds(folder: Path, entries: Mapping[str, ManifestEntry], builds: Sequence[str]) -> Iterator[VendorProblem]:
    """Yield the problems with files of build systems, such as CMakeLists.txt, that are absent or out of date."""
    from phigen.cli.outputs import Change, read

    for file, text in build_files(builds, {name: entry.files for name, entry in entries.items()}).items():
        change = Change(folder / file, read(folder / file), text)
        if change.state != "unchanged":
            problem = "missing" if change.before is None else "edited by hand" if change.obstacle else "stale"
            force = ["--force"] if change.obstacle else []
            yield VendorProblem(change.path, problem, shlex.join(["phigen", "vendor", str(folder), *force]))


def _extra(folder: Path, entries: Mapping[str, ManifestEntry]) -> Iterator[VendorProblem]:
    """Yield generated files that the manifest does not list; other files belong to the user."""
    from phigen.cli.outputs import read
    from phigen.targets.header import split

    known_files = {file for entry in entries.values() for file in entry.files} | {file for file, _ in FILES.values()}
    for path in sorted(folder.iterdir()):
        if path.suffix in suffixes() and path.is_file() and path.name not in known_files and split(read(path) or "")[0]:
            yield VendorProblem(path, "extra: generated, but not in the manifest", shlex.join(["rm", str(path)]))


def _judge(folder: Path, problems: Sequence[VendorProblem]) -> None:
    """Raise a `CheckError` that lists the problems and the commands that correct them; do nothing if there are none."""
    if not problems:
        return
    lines = [f"{p.path}: {p.what}" for p in problems]
    remedies = list(dict.fromkeys(p.remedy for p in problems))
    remedies = [r for r in remedies if f"{r} --force" not in remedies]
    head = f"{counted(len(problems), 'vendored file')} in {folder} modified, missing or stale"
    raise CheckError("\n".join([head, *indented(lines), *mend(remedies)]))


def _report_check(console: Console, folder: Path, vendored: Sequence[VendoredSolver]) -> None:
    gone = [m.order for m in vendored if not m.order.found]
    for order in gone:
        spec_place = os.path.normpath(folder / order.spec_file) if order.spec_file else "path not recorded"
        console.note(
            f"{order.spec.name}: its spec ({spec_place}) was not found, so its changes cannot be checked; "
            "the files agree with the copy of the spec in the manifest"
        )
    files = counted(sum(len(m.files) for m in vendored), "file")
    verdict = "unmodified" + ("" if gone else " and current")
    console.note(f"{folder}: {counted(len(vendored), 'solver')}, {files}: {verdict}")
