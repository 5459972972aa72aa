"""Files made to hang, crash or mislead: each is refused at once, with an error that says what is wrong."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phigen.errors import LimitError, SpecError
from phigen.spec import limits, load, loads, starter

HEAD = "phigen: 1\nname: attack\ncoordinates: [x1, x2, x3]\npoisson: {lie_algebra: {name: so(3)}}\n"
SECONDS = 5.0  # of processor time; a hang takes far longer, and slow machines must pass


def refused(data: str | bytes, tmp_path: Path) -> SpecError:
    """Return the error of a spec file with this content, which must come within `SECONDS`."""
    path = tmp_path / "spec.yaml"
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    start = time.process_time()  # processor time of this process only
    with pytest.raises(SpecError) as caught:
        load(path)
    assert time.process_time() - start < SECONDS
    assert str(path) in str(caught.value)
    return caught.value


def hamiltonian(source: str) -> str:
    return HEAD + f"hamiltonian: {source}\n"


OVER_LIMITS = {
    "a file of 10 MB": "#" * 10_000_000,
    "parentheses 100,000 deep": hamiltonian("(" * 100_000 + "x1" + ")" * 100_000),
    "parentheses 65 deep": hamiltonian("(" * 65 + "x1" + ")" * 65),
    "signs 9,000 deep": hamiltonian("x1" + "-" * 9_000 + "x1"),
    "calls 100 deep": hamiltonian("sin(" * 100 + "x1" + ")" * 100),
    "exponents 100 deep": hamiltonian("x1" + "**x1" * 100),
    "2,001 nodes": hamiltonian("x1" + "+x1" * 1000),
    "text of 10,001 characters": hamiltonian("x1 +" + " " * 9_995 + "x1"),
    "a tower of powers": hamiltonian("9**9**9**9"),
    "repeated squaring": hamiltonian("((((((x1**9)**9)**9)**9)**9)**9)"),
    "repeated squaring through definitions": HEAD
    + "definitions: {d0: 9*x1, "
    + ", ".join(f"d{i + 1}: d{i}*d{i}" for i in range(200))
    + "}\nhamiltonian: d200\n",
    "a number of 9,000 digits": hamiltonian("9" * 9_000),
    "a huge decimal exponent": hamiltonian("1e" + "9" * 100),
    "a huge integer": HEAD + "hamiltonian: x1\nruns: {a: {initial: [1, 1, 1], step: 1, steps: " + "9" * 5000 + "}}\n",
    "sequences 100,000 deep": "[" * 100_000,
    "block sequences 100,000 deep": "- " * 100_000,
    "mappings 50,000 deep": "{a: " * 50_000,
    "30,000 values": "a: [" + "1," * 30_000 + "1]",
    "a name of 10,000 letters": HEAD + "hamiltonian: x1\ncasimirs: {" + "a" * 1000 + ": x1}\n",
    "300 coordinates": "phigen: 1\nname: many\npoisson: {brackets: {x0: {x1: 1}}}\nhamiltonian: x0\n"
    f"coordinates: [{', '.join(f'x{i}' for i in range(300))}]\n",
    "a title of 1,000 characters": hamiltonian("x1") + "title: " + "a" * 1000 + "\n",
    "order 1,000": hamiltonian("x1") + "order: 1000\n",
}


@pytest.mark.thin(2)
@pytest.mark.parametrize("title", OVER_LIMITS)
def test_limit_is_an_error_of_its_own(title: str, tmp_path: Path) -> None:
    error = refused(OVER_LIMITS[title], tmp_path)
    assert isinstance(error, LimitError)
    assert error.exit_code == 3


def test_a_limit_together_with_other_errors_has_exit_code_1(tmp_path: Path) -> None:
    error = refused(hamiltonian("x1**5000 + y1**5000"), tmp_path)
    assert len(error.diagnostics) == 3
    assert type(error) is SpecError
    assert error.exit_code == 1


ALIAS_BOMB = "a: &a [x, x]\n" + "".join(
    f"{chr(98 + i)}: &{chr(98 + i)} [*{chr(97 + i)}, *{chr(97 + i)}]\n" for i in range(20)
)

REFUSED: dict[str, tuple[str | bytes, str]] = {
    "an alias bomb": (ALIAS_BOMB, "anchor &a"),
    "an unknown alias": ("a: *a\n", "alias *a"),
    "a recursive anchor": ("a: &a [*a]\n", "anchor &a"),
    "NUL": (HEAD + "title: a\0b\n", "U+0000"),
    "a terminal escape": (HEAD + "title: \x1b[2J\n", "U+001B"),
    "text that reads from right to left": (HEAD + "title: \u202egnp.exe\n", "RIGHT-TO-LEFT OVERRIDE"),
    "bidirectional control in a comment": (HEAD + "# \u2066 x1\n", "LEFT-TO-RIGHT ISOLATE"),
    "invisible space in a name": ("coordinates: [x\u200b1]\n", "ZERO WIDTH SPACE"),
    "a line separator": (HEAD + "title: a\u2028b\n", "LINE SEPARATOR"),
    "a lone carriage return": (HEAD + "title: a\rname: b\n", "U+000D"),
    "a homoglyph": (hamiltonian("х1"), "CYRILLIC SMALL LETTER HA"),
    "not UTF-8": (HEAD.encode() + b"title: \xff\xfe\n", "0xff is not valid UTF-8"),
    "an encoded surrogate": (HEAD.encode() + b"title: \xed\xa0\x80\n", "not valid UTF-8"),
    "UTF-16": ("phigen: 1".encode("utf-16"), "byte order mark of UTF-16"),
    "UTF-8 with a byte order mark": (b"\xef\xbb\xbfphigen: 1\n", "byte order mark of UTF-8"),
    "nothing": ("", "empty"),
    "blanks": (" \n\n", "empty"),
    "null": ("null\n", "empty"),
    "a binary file": (b"\x7fELF\x02\x01\x01\x00", "not allowed"),
    "an escape beyond Unicode": ('title: "\\UFFFFFFFF"\n', "not valid YAML"),
    "an absurd version": ("%YAML 1." + "9" * 5000 + "\n---\na: 1\n", "YAML"),
    "10,000 errors": (
        HEAD + "definitions: {" + ", ".join(f"d{i}: y{i}" for i in range(900)) + "}\n",
        "only 100 errors",
    ),
    "a name that is a path": ("name: ../../etc/passwd\n", "is not a spec name"),
    "a name with a line break": ('name: "a\\nb"\n', "is not a spec name"),
    "a name that ends with a line break": ('name: "a\\n"\n', "is not a spec name"),
}


@pytest.mark.parametrize("title", REFUSED)
def test_refused_with_a_reason(title: str, tmp_path: Path) -> None:
    data, reason = REFUSED[title]
    error = refused(data, tmp_path)
    assert type(error) is SpecError
    assert error.exit_code == 1
    assert reason in str(error)


def test_messages_show_no_control_or_bidirectional_characters(tmp_path: Path) -> None:
    for data in ("title: \x1b[2J\u202e\n", 'name: "\\e[2J\\u202e"\n', '"\\u202e": 1\n', 'license: "\\u202e"\n'):
        shown = str(refused(data, tmp_path))
        assert "\x1b" not in shown
        assert "\u202e" not in shown


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    for path in (tmp_path / "missing.yaml", tmp_path, tmp_path / "a\0b"):
        with pytest.raises(SpecError, match=r"cannot read|there is no file"):
            load(path)


def test_the_largest_expressions_are_accepted() -> None:
    loads(hamiltonian("x1" + "+x1" * 999))
    loads(hamiltonian("(" * limits.EXPRESSION_DEPTH + "x1" + ")" * limits.EXPRESSION_DEPTH))
    loads(hamiltonian("x1 +" + " " * (limits.EXPRESSION_LENGTH - 6) + "x1"))


def test_long_chains_of_definitions_do_not_exhaust_the_stack() -> None:
    chain = ", ".join(f"d{i}: d{i + 1} + x{i % 3 + 1}*d{i + 1}" for i in range(900))
    loads(HEAD + f"definitions: {{{chain}, d900: x1}}\nhamiltonian: d0\n")


PIECES = [
    *"[]{}:,-?&*!|>'\"%@`#\n\t \\",
    "a",
    "1",
    ": ",
    "- ",
    "\n  ",
    "---\n",
    "hamiltonian: ",
    "poisson: ",
    "{name: so(3)}",
]


@given(st.lists(st.sampled_from(PIECES), max_size=30).map("".join))
def test_any_text_is_a_spec_or_a_spec_error(text: str) -> None:
    with pytest.raises(SpecError):
        loads(text)


@given(st.integers(0, 10_000), st.integers(0, 12), st.sampled_from([*PIECES, "", "\0", "é", "x1", "0"]))
def test_a_damaged_spec_is_a_spec_or_a_spec_error(start: int, length: int, inserted: str) -> None:
    text = starter("body")
    start %= len(text)
    with suppress(SpecError):
        loads(text[:start] + inserted + text[start + length :])
