import time

import pytest

from phigen.errors import ToolchainError
from phigen.runtime import toolchain


def test_missing_compiler_is_reported_with_what_was_tried(monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler -x")
    assert not toolchain.available()
    with pytest.raises(ToolchainError, match=r"no-such-compiler.*\n.*hint"):
        toolchain.find()


def test_no_compiler_on_the_path(monkeypatch, tmp_path):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ToolchainError, match="cc, gcc, clang"):
        toolchain.find()


def test_cc_may_hold_arguments(monkeypatch):
    monkeypatch.delenv("CC", raising=False)
    found = toolchain.find()
    monkeypatch.setenv("CC", f"{found.command[0]} -O1")
    assert toolchain.find().command == (found.command[0], "-O1")


def test_refused_code_shows_what_the_compiler_said(tmp_path):
    source = tmp_path / "bad.c"
    source.write_text("int f(void) { return undeclared; }\n")
    with pytest.raises(ToolchainError, match=r"bad\.c:1:\d+: error: .*undeclared"):
        toolchain.compile_library([source], tmp_path / "bad.so")


def test_compilation_time_is_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr(toolchain, "TUNING_FLAGS", ())
    slow = tmp_path / "cc"
    slow.write_text("#!/bin/sh\nsleep 30\nexit 1\n")
    slow.chmod(0o755)
    source = tmp_path / "a.c"
    source.write_text("int a;\n")
    began = time.monotonic()
    with pytest.raises(ToolchainError, match=r"within 0\.2 s"):
        toolchain.compile_library([source], tmp_path / "a.so", toolchain.Compiler((str(slow),), "slow"), timeout=0.2)
    assert time.monotonic() - began < 10  # what the driver started has ended with it


def test_unknown_flags_are_left_out(monkeypatch):
    monkeypatch.setattr(toolchain, "TUNING_FLAGS", ("-fno-such-flag-anywhere",))
    assert toolchain.flags(toolchain.find()) == toolchain.BASE_FLAGS
