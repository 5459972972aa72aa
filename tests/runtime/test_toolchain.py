import os
import shlex
import time

import pytest

from phigen.api import chosen_target
from phigen.errors import ToolchainError
from phigen.runtime import toolchain

REAL = toolchain.find()

OUTPUT = 'while [ "$1" != -o ]; do shift; done\n'

#: Broken compilers: the shell commands by which each answers a request for a library, and the end of the error message.
BROKEN = {
    "writes nothing": ("exit 0", "reported success, but wrote no library"),
    "writes an empty file": (f'{OUTPUT}: > "$2"', "reported success, but wrote an empty file"),
    "writes junk": (f'{OUTPUT}echo junk > "$2"', "reported success, but wrote a file that is not a library"),
    "writes an object": (
        f'{shlex.quote(REAL.command[0])} -c -x c - -o "$0.o" < /dev/null\n{OUTPUT}cp "$0.o" "$2"',
        "reported success, but its output is not a shared library",
    ),
    "refuses": ("echo no licence >&2; exit 3", "failed with exit code 3:\n    no licence"),
    "says nothing": ("exit 3", "failed with exit code 3 without a message"),
    "crashes": ("kill -SEGV $$", "was ended by SIGSEGV"),
    "hangs": ("sleep 60", "did not answer within 0.4 s"),
    "leaves something that hangs": ("sleep 60 & exit 2", "failed with exit code 2"),
    "talks without end": ("while :; do echo talk; done", "did not answer within 0.4 s"),
}


@pytest.fixture
def compiler(tmp_path, monkeypatch):
    """Return a function that writes a fake compiler: a shell script that answers --version and otherwise executes
    ``body``.
    """
    monkeypatch.setattr(toolchain, "_GRACE", 0.1)

    def make(body, version="echo fake 1.0", name="compiler"):
        path = tmp_path / name
        path.write_text(f'#!/bin/sh\ncase "$*" in *--version) {version}; exit;; esac\n{body}\n')
        path.chmod(0o755)
        return path

    return make


def hasty(monkeypatch):
    """Reduce the time that phigen waits for an answer of a compiler to 0.4 s."""
    monkeypatch.setattr(toolchain, "_TRIAL_TIMEOUT", 0.4)


@pytest.mark.thin(2)
@pytest.mark.parametrize("kind", BROKEN)
def test_a_compiler_that_is_named_and_does_not_work_is_refused_with_the_reason(kind, compiler, monkeypatch):
    body, reason = BROKEN[kind]
    if "within" in reason:
        hasty(monkeypatch)
    monkeypatch.setenv("CC", f"{compiler(body)} -O1")
    began = time.monotonic()
    with pytest.raises(ToolchainError) as raised:
        chosen_target("auto")
    assert f"named in CC, {os.environ['CC']}, {reason}" in str(raised.value)
    assert "\n  hint: " in str(raised.value)
    assert raised.value.exit_code == 6
    assert time.monotonic() - began < 30  # phigen does not wait 60 s for a process that the compiler left behind


@pytest.mark.parametrize(
    ("version", "reason"),
    [
        ("sleep 60", "did not answer within 0.4 s"),
        ("exit 1", "does not report its version: --version failed with exit code 1"),
        ("true", "does not report its version: --version printed nothing"),
    ],
)
def test_a_compiler_must_report_its_version(version, reason, compiler, monkeypatch):
    if "within" in reason:
        hasty(monkeypatch)
    monkeypatch.setenv("CC", str(compiler("exit 1", version)))
    with pytest.raises(ToolchainError, match=reason):
        toolchain.available()


@pytest.mark.parametrize(
    ("named", "reason"),
    [
        ("no-such-compiler -x", "named in CC, no-such-compiler -x, was not found"),
        ("/dev/null", "named in CC, /dev/null, is not a program"),
        ('gcc "', 'CC=gcc " cannot be read as a command: No closing quotation'),
    ],
)
def test_what_is_no_command_is_refused(named, reason, monkeypatch):
    monkeypatch.setenv("CC", named)
    with pytest.raises(ToolchainError) as raised:
        toolchain.find()
    assert reason in str(raised.value)


def test_without_a_name_the_first_that_works_is_taken(compiler, tmp_path, monkeypatch):
    monkeypatch.setenv("CC", " ")
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    compiler("exit 0", name="cc")
    compiler(f'exec {shlex.quote(REAL.command[0])} "$@"', name="gcc")
    assert toolchain.find().command == (str(tmp_path / "gcc"),)


def test_without_a_working_compiler_numpy_is_chosen_with_the_reasons(compiler, tmp_path, monkeypatch):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(toolchain, "find_spec", lambda name: None)
    messages = []
    assert not toolchain.available()
    assert chosen_target("auto", messages.append) == "numpy"
    compiler("exit 5", name="gcc")
    assert chosen_target("auto", messages.append) == "numpy"
    assert "using NumPy, which is slower: no C compiler works: none of cc, gcc, clang was found" in messages[0]
    assert "cc was not found; gcc failed with exit code 5 without a message; clang was not found" in messages[1]


def test_numpy_needs_no_compiler(monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    assert chosen_target("numpy") == "numpy"


def test_cc_may_hold_arguments(monkeypatch):
    monkeypatch.setenv("CC", f"{REAL.command[0]} -O1")
    assert toolchain.find().command == (REAL.command[0], "-O1")


def test_refused_code_shows_what_the_compiler_said(tmp_path):
    source = tmp_path / "bad.c"
    source.write_text("int f(void) { return undeclared; }\n")
    with pytest.raises(ToolchainError, match=r"bad\.c:1:\d+: error: .*undeclared"):
        toolchain.compile_library([source], tmp_path / "bad.so")


def test_compilation_time_is_bounded(tmp_path, compiler):
    slow = toolchain.Compiler((str(compiler("sleep 30")),), "slow")
    began = time.monotonic()
    with pytest.raises(ToolchainError, match=r"within 0\.2 s"):
        toolchain.compile_library([tmp_path / "a.c"], tmp_path / "a.so", slow, timeout=0.2)
    assert time.monotonic() - began < 10  # not the 30 s that the compiler takes


def test_a_library_that_was_there_does_not_stand_for_the_one_that_was_not_made(tmp_path, compiler):
    old = tmp_path / "a.so"
    old.write_bytes(b"\x7fELF")
    with pytest.raises(ToolchainError, match="wrote no library"):
        toolchain.compile_library([tmp_path / "a.c"], old, toolchain.Compiler((str(compiler("exit 0")),), "lazy"))


def test_unknown_flags_are_left_out(monkeypatch):
    monkeypatch.setattr(toolchain, "TUNING_FLAGS", ("-fno-such-flag-anywhere", "-fno-math-errno"))
    monkeypatch.setenv("CC", f"{REAL.command[0]} -O1 -O2")
    assert toolchain.find().flags == (*toolchain.BASE_FLAGS, "-fno-math-errno")
