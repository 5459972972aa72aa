"""Properties of every command: imports, exit codes, streams, colours, interrupts."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import click
import pytest
from click.shell_completion import BashComplete

from phigen import resources
from phigen.cli import COMMANDS, group
from phigen.errors import LimitError

HEAVY = ("sympy", "numpy", "flint", "ruamel", "jinja2", "mpmath")
PHIGEN = [sys.executable, "-c", "from phigen.cli import main; main()"]


@pytest.mark.thin(2)
@pytest.mark.parametrize(
    "args", [["--help"], ["--version"], ["build", "--help"], ["demo", "--help"], ["run", "--help"], ["lst"]]
)
def test_help_imports_nothing_heavy(args):
    code = f"""
import atexit, sys
from phigen.cli import main
sys.argv = ["phigen", *{args!r}]
try:
    main()
finally:
    print("heavy:", [m for m in {HEAVY!r} if m in sys.modules], file=sys.stderr)
"""
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "heavy: []" in process.stderr


@pytest.mark.thin(3, of_all=1)
@pytest.mark.parametrize("name", ["pendulum", "toda3", "fput"])
def test_build_imports_no_numerical_library(name, tmp_path):
    """``phigen build`` imports no NumPy, because this import takes as long as the compilation of a small system."""
    code = "import sys; from phigen.cli import main; main()"
    command = [sys.executable, "-X", "importtime", "-c", code, "build", name, "-t", "c", "-q", "-o", str(tmp_path)]
    process = subprocess.run(command, capture_output=True, text=True, check=True)
    imported = {line.rpartition("|")[2].strip() for line in process.stderr.splitlines()}
    assert "phigen.compiler" in imported
    assert imported & {"numpy", "sympy", "mpmath", "matplotlib"} == set()


def test_every_command_has_help_quiet_and_verbose(phigen):
    listing = phigen("--help").output
    for name, (_, line) in COMMANDS.items():
        assert line in listing
        shown = phigen(name, "--help")
        assert shown.exit_code == 0
        assert "--quiet" in shown.output
        assert "--verbose" in shown.output


def test_every_option_is_documented_and_says_what_it_takes(phigen):
    page = (resources.bundled_specs().parent / "docs" / "commands.md").read_text(encoding="utf-8")
    for name in COMMANDS:
        shown = phigen(name, "--help").output
        assert {o for o in re.findall(r"--[a-z-]+", shown) if o not in page} <= {"--help", "--quiet", "--verbose"}, name
        assert not re.search(r"\b(INTEGER|FLOAT|TEXT|PATH)\b", shown), name


def test_wrong_spec_is_1_with_all_errors_on_stderr(phigen, write):
    write(
        "a.yaml",
        "phigen: 1\nname: a\ncoordinates: [x, y]\npoisson: {matrix: [[0, 1], [-1, 0]]}\nhamiltonian: z\nordr: 2\n",
    )
    write("b.yaml", "phigen: 1\nname: b\n")
    result = phigen("build", "a.yaml", "b.yaml")
    assert result.exit_code == 1
    assert result.stdout == ""
    assert "a.yaml:5:14: error" in result.stderr
    assert "a.yaml:6:1: error" in result.stderr
    assert "b.yaml" in result.stderr


def test_warnings_are_messages_with_their_place(phigen, write):
    head = "phigen: 1\nname: a\ncoordinates: [x, y]\npoisson: {canonical: {q: [x], p: [y]}}\norder: 2\n"
    write("a.yaml", head + "hamiltonian: log(-1 - x**2) + y\n")
    result = phigen("build", "a.yaml", "-t", "numpy")
    assert result.exit_code == 0
    warning, line, caret, *_ = result.stderr.splitlines()
    assert warning.startswith("a.yaml:6:14: warning: H is defined: undecided (no value at any of ")
    assert line.index("log(") == caret.index("^")
    assert phigen("build", "a.yaml", "-t", "numpy", "-q").stderr == ""


@pytest.mark.parametrize(
    "args", [[], ["nonsense"], ["build"], ["build", "--order", "0", "a"], ["run", "a.yaml", "--run", "nobody"]]
)
def test_wrong_usage_is_2(phigen, write, args):
    write("a.yaml")
    assert phigen(*args).exit_code == 2


def test_exceeded_limit_is_3(phigen, write):
    path = write("a.yaml")
    path.write_text(path.read_text().replace("(q**2 + p**2)/2", "(" * 99 + "q" + ")" * 99))
    assert phigen("check", path).exit_code == 3


@pytest.mark.parametrize("kind", [IndexError, EOFError])
def test_internal_error_is_4_and_asks_for_a_report(phigen, write, monkeypatch, kind):
    """Every unexpected exception is an internal error, even an EOFError, which click treats as ^D at a prompt."""

    def broken(*args, **kwargs):
        raise kind("nobody expected this")

    monkeypatch.setattr("phigen.compiler.examine", broken)
    result = phigen("check", write("a.yaml"))
    assert result.exit_code == 4
    assert "nobody expected this" in result.stderr
    assert "report" in result.stderr
    assert "Traceback" not in result.stderr
    assert "Traceback" in phigen("check", "a.yaml", "-v").stderr


def test_missing_compiler_is_6(phigen, write, monkeypatch):
    monkeypatch.setenv("CC", "/there/is/none")
    result = phigen("run", write("a.yaml"), "-t", "c")
    assert result.exit_code == 6
    assert "/there/is/none" in result.stderr


def test_failing_integration_is_7_and_keeps_what_was_computed(phigen, write):
    path = write("a.yaml")
    path.write_text(path.read_text().replace("(q**2 + p**2)/2", "p**2/2 - q**6"))
    result = phigen("run", path, "--steps", "100", "-t", "numpy", "-o", "out.csv")
    assert result.exit_code == 7
    assert "smaller step" in result.stderr
    assert "energy" in result.stdout
    assert len(path.with_name("out.csv").read_text().splitlines()) > 2


def test_errors_of_several_specs_give_the_smallest_code(phigen, write):
    write("a.yaml", "phigen: 1\n")
    path = write("b.yaml")
    path.write_text(path.read_text().replace("(q**2", "(" * 99 + "q" + ")" * 99 + " + (q**2"))
    result = phigen("check", "b.yaml", "a.yaml")
    assert result.exit_code == 1
    assert "a.yaml" in result.stderr
    assert "b.yaml" in result.stderr


def test_unwritable_output_is_no_bug_of_phigen(phigen, write):
    write("a.yaml")
    write("generated", "a file, no folder")
    result = phigen("build", "a.yaml")
    assert result.exit_code in (2, 5)
    assert "internal" not in result.stderr


def test_command_with_typing_error_gets_a_suggestion(phigen):
    assert "Did you mean 'build'?" in phigen("biuld").stderr


@pytest.mark.parametrize(
    ("misspelt", "hint"),
    [
        ("rigid_body.yaml", "did you mean 'rigid_body'? The bundled spec of that name needs neither folder nor suffix"),
        ("keplr", "did you mean 'kepler'? It is a bundled spec"),
        ("tumbler", "did you mean 'tumbler.yaml'?"),
        ("sub/henon", "phigen new NAME"),
    ],
)
@pytest.mark.parametrize("command", ["run", "build"])
def test_missing_spec_suggests_names_that_are_near(phigen, write, command, misspelt, hint):
    write("tumbler.yaml")
    result = phigen(command, misspelt)
    assert result.exit_code == 1
    assert repr(misspelt) in result.stderr
    assert hint in result.stderr


def test_bundled_spec_is_found_by_its_name(phigen, in_tmp):
    for command in ("check", "show", "build"):
        assert phigen(command, "cyclotron").exit_code == 0, command
    assert "to regenerate: phigen build cyclotron\n" in Path("generated/cyclotron/cyclotron.c").read_text()


def test_file_of_the_name_of_a_bundled_spec_wins(phigen, write):
    write("cyclotron", name="mine")
    assert json.loads(phigen("show", "cyclotron", "--json").stdout)["name"] == "mine"


def test_output_of_a_bundled_spec_is_current_next_to_other_output(phigen, in_tmp):
    for name in ("cyclotron", "pendulum"):
        assert phigen("build", name, "-o", ".").exit_code == 0
    assert phigen("build", "cyclotron", "-o", ".", "--check").exit_code == 0


def test_changed_copy_of_a_bundled_spec_is_regenerated_from_its_file(phigen, write):
    text = resources.bundled()["cyclotron"].read_text(encoding="utf-8")
    for title, command in ((None, "phigen build cyclotron"), ("title: Mine", "phigen build cyclotron.yaml")):
        write("here/cyclotron.yaml", re.sub("title: .*", title, text) if title else text)
        assert phigen("build", "here").exit_code == 0
        assert f"to regenerate: {command}\n" in Path("generated/cyclotron/cyclotron.c").read_text()


def test_no_colour_in_pipes_and_under_no_color(phigen, write):
    write("a.yaml", "phigen: 1\n")
    for environment in ({}, {"NO_COLOR": "1"}):
        process = subprocess.run(
            [*PHIGEN, "check", "a.yaml"], capture_output=True, text=True, check=False, env={**os.environ, **environment}
        )
        assert "\x1b" not in process.stdout + process.stderr


@pytest.mark.slow
def test_colour_on_a_terminal_unless_no_color(write):
    pty = pytest.importorskip("pty")
    write("a.yaml", "phigen: 1\n")

    def on_terminal(environment):
        master, slave = pty.openpty()
        clean = {k: v for k, v in os.environ.items() if k != "NO_COLOR"}
        subprocess.run([*PHIGEN, "check", "a.yaml"], stderr=slave, check=False, env={**clean, **environment})
        os.close(slave)
        return os.read(master, 10000)

    assert b"\x1b" in on_terminal({})
    assert b"\x1b" not in on_terminal({"NO_COLOR": "1"})


def test_closed_pipe_ends_quietly():
    process = subprocess.Popen([*PHIGEN, "schema"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.close()
    message = process.stderr.read()
    process.stderr.close()
    assert process.wait() == 141
    assert message == b""


def test_interrupt_is_130(write):
    write("a.yaml")
    command = [*PHIGEN, "run", "a.yaml", "-v", "-t", "numpy", "--steps", "2000000"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert any("numpy ready" in line for line in iter(process.stderr.readline, ""))
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    _, message = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "interrupted" in message
    assert "Traceback" not in message


#: A program that runs ``phigen check a.yaml`` and sends itself SIGINT at the first call for which ``condition`` holds:
#: ``function`` is the name of the called function and ``module`` that of a module which it imports.
INTERRUPTED_ONCE = """
import atexit, os, runpy, signal, sys

def watch(frame, event, argument):
    function, module = frame.f_code.co_name, frame.f_locals.get("name")
    if event == "call" and ({condition}):
        sys.setprofile(None)
        os.kill(os.getpid(), signal.SIGINT)

sys.setprofile(watch)
sys.argv[1:] = ["check", "a.yaml"]
runpy.run_module("phigen", run_name="__main__")
"""


@pytest.mark.thin(3)
@pytest.mark.parametrize(
    "moment",
    [
        pytest.param("function == '_find_and_load' and module == 'phigen.cli'", marks=pytest.mark.slow),
        # flint imports zlib, and turns the interrupt into an ImportError.
        "function == '_find_and_load' and module == 'zlib'",
        pytest.param("function == 'system_from_spec'", marks=pytest.mark.slow),
        # The callback of a weak reference: Python ignores exceptions that it raises.
        "function == '_forget' and 'dead' in frame.f_locals",
        "function == '_shutdown'",  # threading._shutdown, when Python exits
    ],
)
def test_interrupt_at_any_moment_is_130_and_one_word(write, moment):
    write("a.yaml")
    code = INTERRUPTED_ONCE.format(condition=moment)
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    said = [line for line in process.stderr.splitlines() if line and not line.startswith("a.yaml: ")]
    assert (process.returncode, said) == (130, ["interrupted"])


def test_second_interrupt_ends_what_tidies_up(write):
    code = """
import os, signal
from phigen import interrupts
interrupts.obey()
interrupts.working = True
try:
    os.kill(os.getpid(), signal.SIGINT)
finally:
    os.kill(os.getpid(), signal.SIGINT)
    print("not reached")
"""
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (process.returncode, process.stdout, process.stderr) == (130, "", "interrupted\n")


def test_interrupt_inside_an_import_is_no_internal_error(phigen, write, monkeypatch):
    def broken(*args, **kwargs):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt:
            raise ImportError("half a module")  # noqa: B904

    monkeypatch.setattr("phigen.compiler.examine", broken)
    assert phigen("check", write("a.yaml")).exit_code == 130


def test_the_end_of_input_at_a_prompt_is_an_interrupt(phigen, write, monkeypatch):
    monkeypatch.setattr("phigen.compiler.examine", lambda *args, **kwargs: click.prompt("really"))
    assert phigen("check", write("a.yaml")).exit_code == 130


def test_completion_script_is_offered():
    env = {**os.environ, "_PHIGEN_COMPLETE": "bash_source"}
    code = "from phigen.cli import group; group.main(prog_name='phigen', args=[])"
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, env=env)
    assert "_PHIGEN_COMPLETE=bash_complete" in process.stdout


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("run kep", ["plain,kepler", "plain,kepler_eccentric"]),
        (
            "run k",
            [
                "plain,krill.yaml",
                "plain,kelp/",
                "plain,kepler",
                "plain,kepler_eccentric",
                "plain,kowalevski_gauss",
                "plain,kowalevski_top",
                "plain,kdv",
                "plain,klein_gordon",
            ],
        ),
        ("vendor kep", ["plain,kepler", "plain,kepler_eccentric"]),
        ("run kr", ["file,kr"]),
        ("run kelp/", ["file,kelp/"]),
        ("list --path kep", ["plain,kepler", "plain,kepler_eccentric"]),
        ("run kepler --run ", ["plain,eccentric", "plain,circle"]),
        ("verify kepler krill.yaml --run t", ["plain,turn"]),
        ("tune wrong.yaml --run ", []),
        ("report lost.yaml --run ", []),
        ("run --run ", []),
    ],
)
def test_shell_is_offered_names_and_runs(phigen, write, line, offered):
    write("krill.yaml")
    write("wrong.yaml", "phigen: 1\n")
    Path("kelp").mkdir()
    words = ["phigen", *line.split(" ")]
    environment = {"COMP_WORDS": " ".join(words), "COMP_CWORD": str(len(words) - 1)}
    completer = BashComplete(group, {}, "phigen", "_PHIGEN_COMPLETE")
    with pytest.MonkeyPatch.context() as patch:
        for name, value in environment.items():
            patch.setenv(name, value)
        assert completer.complete().splitlines() == offered


def test_error_classes_keep_their_codes():
    assert LimitError.exit_code == 3
    assert group.name
