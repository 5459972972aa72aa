import stat
import subprocess
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from phigen.errors import ToolchainError
from phigen.runtime import cache, toolchain

FILES = {"one.c": '#include "one.h"\nint one(void) { return ONE; }\n', "one.h": "#define ONE 1\n"}


def entries(folder):
    return sorted(p for p in Path(folder).iterdir() if p.suffix == ".so")


@pytest.fixture
def compilations(monkeypatch):
    commands = []
    real = toolchain.compile_library
    monkeypatch.setattr(toolchain, "compile_library", lambda *a, **k: (commands.append(1), real(*a, **k)))
    return commands


def test_second_request_does_not_compile(cache_directory, compilations):
    assert cache.load(FILES).one() == 1
    assert cache.build(FILES) == entries(cache_directory)[0]
    assert len(compilations) == 1
    assert [p.name for p in cache_directory.iterdir()] == [entries(cache_directory)[0].name]


def test_every_file_counts(cache_directory):
    assert cache.load({**FILES, "one.h": "#define ONE 2\n"}).one() == 2
    assert cache.load(FILES).one() == 1
    assert len(entries(cache_directory)) == 2


def test_compiler_and_flags_count(cache_directory, monkeypatch):
    cache.build(FILES)
    monkeypatch.setattr(toolchain, "BASE_FLAGS", (*toolchain.BASE_FLAGS, "-g"))
    cache.build(FILES)
    assert len(entries(cache_directory)) == 2


@pytest.mark.parametrize("damage", [b"", b"\x7fELF junk"])
def test_damaged_entry_is_rebuilt(cache_directory, compilations, damage):
    path = cache.build(FILES)
    path.write_bytes(damage)
    assert cache.load(FILES).one() == 1
    assert len(compilations) == 2


@pytest.mark.slow
def test_concurrent_processes_share_one_directory(cache_directory):
    code = f"from phigen.runtime import cache; assert cache.load({FILES!r}).one() == 1"

    def run(_):
        return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)

    with ThreadPoolExecutor(6) as pool:
        for process in pool.map(run, range(6)):
            assert (process.returncode, process.stderr) == (0, "")
    assert len(entries(cache_directory)) == 1
    assert len(list(cache_directory.iterdir())) == 1


def test_unwritable_directory_falls_back_with_a_warning(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    monkeypatch.setenv("PHIGEN_CACHE_DIR", str(blocked / "cache"))
    text = {"one.c": "int one(void) { return 11; }\n"}
    with pytest.warns(RuntimeWarning, match="PHIGEN_CACHE_DIR"):
        assert cache.load(text).one() == 11
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # the second load repeats no warning
        assert cache.load(text).one() == 11


def test_read_only_directory_still_serves(cache_directory):
    path = cache.build(FILES)
    cache_directory.chmod(stat.S_IRUSR | stat.S_IXUSR)
    try:
        assert cache.build(FILES) == path
    finally:
        cache_directory.chmod(stat.S_IRWXU)


def test_size_is_bounded_and_the_newest_stays(cache_directory, monkeypatch):
    first = cache.build(FILES)
    monkeypatch.setattr(cache, "MAXIMUM_SIZE", 1)
    second = cache.build({"two.c": "int two(void) { return 2; }\n"})
    assert entries(cache_directory) == [second]
    assert not first.exists()


def test_clear_removes_all(cache_directory):
    cache.build(FILES)
    assert cache.clear() == 1
    assert cache.clear() == 0
    assert cache.load(FILES).one() == 1


def test_directory_follows_the_environment(monkeypatch, tmp_path):
    monkeypatch.delenv("PHIGEN_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache.directory() == tmp_path / "phigen"
    monkeypatch.setenv("PHIGEN_CACHE_DIR", str(tmp_path / "mine"))
    assert cache.directory() == tmp_path / "mine"


def test_failed_compilation_leaves_nothing(cache_directory):
    with pytest.raises(ToolchainError):
        cache.build({"bad.c": "int f(void) { return undeclared; }\n"})
    assert list(cache_directory.iterdir()) == []
