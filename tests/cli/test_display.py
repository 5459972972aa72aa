"""Display of the stages of the compiler on stderr: when it appears, and that it is erased at the end."""

import io
import re
import time
from contextlib import redirect_stderr
from types import SimpleNamespace

import pytest

from phigen import progress
from phigen.cli import display
from phigen.cli.console import Console


class Terminal(io.StringIO):
    """Text stream that claims to be a terminal, and to which only this process writes."""

    def isatty(self):
        return True

    def shows(self, text):
        """Whether the text is drawn within 30 s, long enough for a busy machine."""
        end = time.monotonic() + 30
        while text not in self.getvalue() and time.monotonic() < end:
            time.sleep(0.001)
        return text in self.getvalue()


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr(display, "DELAY", 0)
    monkeypatch.setattr(display, "PERIOD", 0.001)


def shown(console, stream, name="top"):
    """Return the text that the console writes to the stream during a stage of 0.05 s."""
    with redirect_stderr(stream), console.watching(), progress.stage(name):
        time.sleep(0.05)
    return stream.getvalue()


def test_what_lasts_is_shown_on_a_terminal_and_erased_at_its_end(monkeypatch):
    with redirect_stderr(Terminal()) as terminal, Console().watching():
        with progress.stage("top") as top, progress.stage("parts", total=12) as parts:
            parts.done = 5
            monkeypatch.setattr(display, "time", SimpleNamespace(perf_counter=lambda: top.began + 7))
            assert terminal.shows("\rtop: parts, 5 of 12, 7 s\x1b[K")
        assert terminal.getvalue().endswith("\r\x1b[K")


def test_a_message_takes_the_place_of_the_line():
    console = Console()
    with redirect_stderr(Terminal()) as terminal, console.watching(), progress.stage("top"):
        assert terminal.shows("top")
        console.note("a message")
        assert "\r\x1b[Ka message\n" in terminal.getvalue()


def test_short_work_shows_nothing(monkeypatch):
    monkeypatch.setattr(display, "DELAY", 1000)
    assert shown(Console(), Terminal()) == ""


def test_quiet_and_pipes_show_nothing():
    assert shown(Console(quiet=True), Terminal()) == ""
    assert shown(Console(), io.StringIO()) == ""


def test_long_lines_are_cut_to_the_terminal(monkeypatch):
    monkeypatch.setenv("COLUMNS", "20")
    drawn = shown(Console(), Terminal(), "a name that is longer than the line")
    assert {len(line.removesuffix("\x1b[K")) for line in drawn.split("\r")[1:-1]} == {19}


def test_stages_are_over_after_an_error():
    with redirect_stderr(Terminal()) as terminal, Console().watching():
        with pytest.raises(ValueError, match="wrong"), progress.stage("top"):
            raise ValueError("wrong")
        with progress.stage("next"):
            assert terminal.shows("\rnext, ")


def test_verbose_lists_stages_without_a_terminal(phigen, write):
    listed = phigen("check", "-v", write("a.yaml")).stderr.splitlines()
    assert [line for line in listed if line in ("a: system", "a: program")] == ["a: system", "a: program"]
    assert phigen("check", "a.yaml").stderr.startswith("a.yaml: ")


@pytest.mark.slow
def test_emission_the_compiler_and_measurements_are_stages(phigen, write):
    written = phigen("build", "-v", "--compile", write("a.yaml")).stderr.splitlines()
    assert [line for line in written if line in ("a: emission of c", "a: C compiler")] == [
        "a: emission of c",
        "a: C compiler",
    ]
    measured = phigen("verify", "-v", "--quick", "a.yaml").stderr.splitlines()
    assert any(re.fullmatch(r"a: measurements, \d+ of \d+: single steps", line) for line in measured)
