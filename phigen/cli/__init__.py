"""The command line of phigen. Each command has a module, which is imported when the command is used.

The module of a command imports the compiler inside its functions, so that the help of the command appears at once.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from io import TextIOWrapper
from typing import Any

import click

from phigen import interrupts
from phigen._version import __version__
from phigen.cli import failures
from phigen.cli.console import Console

#: The commands in the order of the help page: name → module and one line of help.
COMMANDS = {
    "new": ("phigen.cli.new", "Write a commented spec to start from."),
    "check": ("phigen.cli.check", "Prove the mathematics of a spec, or refute it."),
    "build": ("phigen.cli.build", "Write the solvers of specs."),
    "run": ("phigen.cli.run", "Integrate a run of a spec and print its errors."),
    "sweep": ("phigen.cli.sweep", "Repeat a run for many parameters and initial values."),
    "vendor": ("phigen.cli.vendor", "Copy solvers into another project, and check them there."),
    "tune": ("phigen.cli.tune", "Find the cheapest setting and step for an accuracy."),
    "compare": ("phigen.cli.compare", "Compare bi-realisations, schemes and classical methods on a run."),
    "verify": ("phigen.cli.verify", "Build every target and measure order and conservation."),
    "certify": ("phigen.cli.certify", "Bound the distance of computed steps from the exact Poisson map."),
    "report": ("phigen.cli.report", "Write one HTML page: formulas, proofs, measurements, figures."),
    "show": ("phigen.cli.show", "Show the formulas of a spec and of its step."),
    "list": ("phigen.cli.list", "List the bundled specs."),
    "schema": ("phigen.cli.schema", "Print the JSON Schema of specs, for editors."),
    "reproduce": ("phigen.cli.reproduce", "Draw the figures of the paper and print the measured numbers."),
    "demo": ("phigen.cli.demo", "Compile a Lotka–Volterra system, run it and compare."),
}


class Commands(click.Group):
    """Group of the commands. It imports the module of a command when the command is used, and turns exceptions into
    messages and exit codes.
    """

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = import_module(COMMANDS[cmd_name][0]).command
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            from difflib import get_close_matches

            similar_names = get_close_matches(args[0], COMMANDS, n=1)
            suggestion = (
                f" Did you mean {similar_names[0]!r}?" if similar_names else f" There are {', '.join(COMMANDS)}."
            )
            ctx.fail(f"No such command {args[0]!r}.{suggestion}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in COMMANDS.items()])

    def main(  # type: ignore[override]  # click declares that main never returns in standalone mode
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        standalone_mode: bool = True,
        **extra: Any,
    ) -> Any:
        """Run a command and end the process with its exit code; see `phigen.errors` for the codes."""
        console = extra.setdefault("obj", Console())
        if isinstance(sys.stdout, TextIOWrapper):
            # By default, printing a character that the terminal cannot show raises an exception. Here the character
            # is written as an escape, as Python does on stderr.
            sys.stdout.reconfigure(errors="backslashreplace")
        try:
            interrupts.working = True
            result = super().main(args, prog_name, standalone_mode=False, **extra)
            interrupts.working = False
            code = result if isinstance(result, int) else 0
        except (Exception, KeyboardInterrupt) as error:
            interrupts.working = False
            code = failures.report(error, console)
        if standalone_mode:
            failures.drop_unprinted()
            sys.exit(code)
        return code

    def invoke(self, ctx: click.Context) -> Any:
        console = ctx.ensure_object(Console)
        try:
            with console.heeding(), console.watching():
                return super().invoke(ctx)
        except (BrokenPipeError, EOFError) as error:
            # click would report these two exceptions wrongly. A broken pipe would end with exit code 1, which means a
            # wrong spec. An EOFError would count as ^D at a prompt. A real ^D does not arrive here, since prompts of
            # click raise Abort.
            return failures.report(error, console)


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="phigen", message="%(prog)s %(version)s")
def group() -> None:
    """A compiler from specs of Poisson systems ẋ = π(x)∇H(x) to solvers in C, NumPy and JavaScript.

    To start: `phigen demo`, then `phigen new mysystem`.

    Data goes to stdout, messages to stderr. Exit codes: 0 ok, 1 wrong spec, 2 wrong usage, 3 limit exceeded,
    4 internal error, 5 check failed, 6 C compiler missing or failed, 7 integration failed, 130 interrupted.
    """


def main() -> None:
    """Run the command line; entry point of the console script ``phigen``."""
    group.main(prog_name="phigen")
