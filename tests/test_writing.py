"""Files are written atomically: each file is complete or absent, and several files appear together."""

import os
import stat
from contextlib import suppress
from pathlib import Path

import pytest
from full_disk import FULL, largest_file

from phigen.writing import naming, replacing, write, write_all


@pytest.fixture
def in_tmp(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def tree():
    return {str(p): p.read_text() if p.is_file() else None for p in sorted(Path().rglob("*"))}


@pytest.mark.parametrize("contents", [("small", 2000 * "large"), (2000 * "large", "small")])
def test_all_files_or_none_and_the_error_names_the_one_that_did_not_fit(in_tmp, contents):
    Path("old").write_text("as it was")
    large = "old" if len(contents[0]) > 100 else "a/b/new"
    with largest_file(100), pytest.raises(OSError, match=FULL) as raised:
        write_all(dict(zip((Path("old"), Path("a/b/new")), contents, strict=True)))
    assert raised.value.filename == large
    assert tree() == {"old": "as it was"}


def test_a_folder_in_the_way_of_one_file_stops_all(in_tmp):
    Path("folder").mkdir()
    with pytest.raises(IsADirectoryError) as raised:
        write_all({Path("first"): "1", Path("folder"): "2"})
    assert raised.value.filename == "folder"
    assert tree() == {"folder": None}


def test_interrupted_writing_leaves_no_files(in_tmp):
    with suppress(KeyboardInterrupt), replacing(Path("a")) as file:
        file.write(b"half")
        raise KeyboardInterrupt
    assert tree() == {}


def test_permissions_stay_and_new_files_have_those_of_the_user(in_tmp):
    Path("script").write_text("old")
    Path("script").chmod(0o751)
    mask = os.umask(0o027)
    try:
        write_all({Path("script"): "new", Path("other"): "new"})
    finally:
        os.umask(mask)
    assert [stat.S_IMODE(Path(p).stat().st_mode) for p in ("script", "other")] == [0o751, 0o640]


def test_a_link_stays_and_a_pipe_is_written_to(in_tmp):
    Path("folder").mkdir()
    Path("folder/real").write_text("old")
    Path("link").symlink_to("folder/real")
    write(Path("link"), "new")
    assert Path("link").is_symlink()
    assert Path("folder/real").read_text() == "new"
    os.mkfifo("pipe")
    reader = os.open("pipe", os.O_RDONLY | os.O_NONBLOCK)
    write(Path("pipe"), "said")
    assert os.read(reader, 10) == b"said"
    os.close(reader)
    assert Path("pipe").is_fifo()


def test_devices_are_not_replaced(in_tmp):
    write(Path("/dev/null"), "gone")
    assert Path("/dev/null").is_char_device()
    with pytest.raises(OSError, match="No space left on device") as raised:
        write(Path("/dev/full"), "text")
    assert raised.value.filename == "/dev/full"


def test_names_that_are_no_utf8_can_be_written(in_tmp):
    name = os.fsdecode(b"a\xff")
    write(Path(name), f"about {name}")
    assert Path(name).read_bytes() == b"about a\\udcff"


def test_errors_without_a_number_are_errors_of_the_file_too():
    with pytest.raises(OSError, match="strange") as raised, naming("a"):
        raise OSError("strange")
    assert (raised.value.filename, raised.value.strerror) == ("a", "strange")
