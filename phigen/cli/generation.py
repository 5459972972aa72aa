"""Generation of files, and the options that change the generated files."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from phigen import resources
from phigen.cli.arguments import CORRECTIONS, order_option, scheme_option
from phigen.errors import SpecError
from phigen.registry import TARGETS
from phigen.spec.names import PARTS, PROFILES, REALS

if TYPE_CHECKING:
    from phigen.compilation import Compilation
    from phigen.spec.model import Spec

F = TypeVar("F", bound=Callable[..., Any])

DIRECTORY = "generated"


@dataclass(frozen=True)
class Options:
    """Options of one command that change the generated files, and the output folder."""

    directory: Path = Path(DIRECTORY)
    targets: tuple[str, ...] = ()
    order: int | None = None
    single_file: bool = False
    tangent: bool = False
    modified: int | None = None
    scheme: str | None = None
    profile: str | None = None
    without: tuple[str, ...] = ()
    adjoint: bool = False
    real: str | None = None
    bindings: tuple[str, ...] = ()
    stack: str | None = None

    def __post_init__(self) -> None:
        if self.real == "float" and self.profile == "fast":
            raise click.UsageError("single precision needs the profile small: leave out --profile fast")

    def compiled(self, spec: Spec) -> Compilation:
        """Compile a spec with these options, and prove its statements; see `phigen.compiler.compile_proved`."""
        from phigen.compiler import compile_proved

        compilation = compile_proved(
            spec,
            order=self.order,
            scheme=self.scheme,
            profile=self.profile,
            real=self.real,
            modified_hamiltonian=self.modified,
            tangent=self.tangent,
            adjoint=self.adjoint,
            without=self.without,
        )
        compilation = self._with_changeable_parameters(compilation) if self.bindings else compilation
        return compilation if self.stack is None else self._measured(compilation, self.stack)

    def _with_changeable_parameters(self, compilation: Compilation) -> Compilation:
        """Return the compilation, with one more function in its C. Bindings call this function to change parameters."""
        spec, part = compilation.spec, "parameters"
        if part in spec.extras.without and spec.parameters and not spec.lattice:
            message = f"--binding {self.bindings[0]} needs {spec.name}_set_parameters, which `without` leaves out"
            hint = f"leave out --binding, or the {part} of `without`"
            raise SpecError([spec.diagnostic(("without",), message, hint)])
        return compilation.including(part)

    def _measured(self, compilation: Compilation, flags: str) -> Compilation:
        """Return the compilation with the size of the stack that its C uses. The header of the C states this
        size.

        gcc measures the size, with the compiler flags ``flags``.
        """
        from phigen.compiler import emit
        from phigen.runtime.stack import stack_bound

        spec = compilation.spec
        if spec.lattice or "c" not in self.targets_of(compilation):
            message = f"--stack of {spec.name}: " + ("not for lattices" if spec.lattice else "there is no target c")
            hint = "build the lattice without --stack" if spec.lattice else "add -t c, or leave out --stack"
            raise SpecError([spec.diagnostic(("lattice" if spec.lattice else "targets",), message, hint)])
        files = emit(compilation.program, "c", "", single_file=self.single_file)
        return compilation.with_stack(stack_bound(files, spec.name, flags))

    def targets_of(self, compilation: Compilation) -> tuple[str, ...]:
        """Return the targets to write: those on the command line, or else those of the spec."""
        return self.targets or compilation.spec.targets

    def command(self, spec_files: Sequence[str]) -> str:
        """Return the command line of ``phigen build`` for spec files, with the options and the output folder of this
        object.
        """
        arguments = ["phigen", "build", *spec_files]
        if str(self.directory) != DIRECTORY:
            arguments += ["-o", str(self.directory)]
        return shlex.join([*arguments, *self.words])

    @property
    def words(self) -> list[str]:
        """Return the options that change generated files, as words of a command line."""
        arguments = [word for target in self.targets for word in ("-t", target)]
        arguments += ["--order", str(self.order)] if self.order else []
        arguments += ["--scheme", self.scheme] if self.scheme else []
        arguments += ["--profile", self.profile] if self.profile else []
        arguments += ["--real", self.real] if self.real else []
        arguments += [word for part in self.without for word in ("--without", part)]
        arguments += ["--single-file"] if self.single_file else []
        arguments += ["--tangent"] if self.tangent else []
        arguments += ["--adjoint"] if self.adjoint else []
        arguments += ["--modified", str(self.modified)] if self.modified is not None else []
        arguments += [word for language in self.bindings for word in ("--binding", language)]
        arguments += [f"--stack={self.stack}"] if self.stack is not None else []
        return arguments


def output_options(command: F) -> F:
    """Add the options of `Options` to a command."""
    for option in (
        click.option(
            "--modified", type=CORRECTIONS, metavar="N", help="Also generate modified_hamiltonian, with N corrections."
        ),
        click.option("--adjoint", is_flag=True, help="Also generate step_adjoint and pullback, gradients of runs."),
        click.option("--tangent", is_flag=True, help="Also generate step_tangent, the derivative of a step."),
        click.option(
            "--profile",
            type=click.Choice(PROFILES),
            help="Optimisation of the code for speed or for size; overrides the spec.",
        ),
        click.option("--real", type=click.Choice(REALS), help="Number type of the C; overrides the spec."),
        click.option(
            "--without", multiple=True, type=click.Choice(PARTS), help="Leave out a part of the code; may be repeated."
        ),
        click.option("--single-file", is_flag=True, help="C in one file, NAME.c, without a header."),
        scheme_option,
        order_option,
        click.option(
            "-t",
            "--target",
            "targets",
            multiple=True,
            type=click.Choice(list(TARGETS)),
            help="Target languages; overrides the spec. May be repeated.",
        ),
    ):
        command = option(command)
    return command


def generate(compilation: Compilation, target: str, options: Options) -> dict[str, str]:
    """Return the files of one target (name → text).

    The header of each file states a command that writes the same bytes on any machine.
    """
    from phigen.compiler import emit

    spec, single = compilation.spec.written or compilation.spec, options.single_file and TARGETS[target].single_file
    arguments = ["phigen build", spec.name if _is_bundled(spec) else f"{spec.name}.yaml"]
    arguments += ["-t", target] if target not in spec.targets else []
    arguments += ["--order", str(options.order)] if options.order not in (None, spec.order) else []
    arguments += ["--scheme", options.scheme] if options.scheme not in (None, spec.scheme) else []
    arguments += ["--profile", options.profile] if options.profile not in (None, spec.profile) else []
    arguments += ["--real", options.real] if options.real not in (None, spec.extras.real) else []
    arguments += [f"--without {part}" for part in options.without if part not in spec.extras.without]
    arguments += ["--single-file"] if single else []
    arguments += ["--tangent"] if options.tangent and not spec.extras.tangent else []
    arguments += ["--adjoint"] if options.adjoint and not spec.extras.adjoint else []
    arguments += ["--modified", str(options.modified)] if options.modified is not None else []
    if not compilation.spec.extras.offers("parameters", compilation.program.profile):
        # The profile leaves out the function that sets parameters. With the option --binding, the C has this function,
        # so the command must contain the option.
        arguments += [f"--binding {language}" for language in options.bindings]
    arguments += [shlex.quote(f"--stack={options.stack}")] if options.stack is not None and target == "c" else []
    expect_target(compilation, target)
    _expect_steps(compilation, target)
    return emit(compilation.program, target, " ".join(arguments), single_file=single)


def expect_target(compilation: Compilation, target: str) -> None:
    """Raise `SpecError` if the target cannot express the program.

    If ``targets`` of the spec contains the target, the error has the place of this key.
    """
    spec = compilation.spec
    try:
        TARGETS[target].expect_offered(compilation.program)
    except SpecError as error:
        if target not in spec.targets or ("targets",) not in spec.locations:
            raise
        raise SpecError([spec.diagnostic(("targets",), d.message, d.hint) for d in error.diagnostics]) from error


def _expect_steps(compilation: Compilation, target: str) -> None:
    """Raise `SpecError` if the spec has the key ``coordinates_from`` and the target is ``device``.

    This key requests steps in relative coordinates, which the code for devices cannot make.
    """
    swept = compilation.program.step.swept
    if target == "device" and swept and swept.relative:
        message, hint = (
            "coordinates_from: the target device cannot make steps in relative coordinates",
            "choose another target, or remove coordinates_from",
        )
        raise SpecError([compilation.spec.diagnostic(("coordinates_from",), message, hint)])


def _is_bundled(spec: Spec) -> bool:
    """Whether a spec has the same name and the same text as a bundled spec, wherever its file is."""
    file = resources.bundled().get(spec.name)
    return file is not None and file.read_text(encoding="utf-8") == spec.source


def files_of(compilation: Compilation, options: Options) -> dict[str, str]:
    """Return the files of a compilation for all its targets (name → text)."""
    files: dict[str, str] = {}
    for target in options.targets_of(compilation):
        files |= generate(compilation, target, options)
    return files
