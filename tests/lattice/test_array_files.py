"""Files with arrays of lattices: all their values are used, or an error names the place of what is refused."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from phigen.errors import SpecError
from phigen.lattice.states import Start, start_of
from phigen.spec import load

GRAPH = """\
phigen: 1
name: springs
lattice: {graph: bonds}
coordinates: [q, p]
parameters: {k: {value: 1, at: bonds}, l: {value: 0, at: bonds}, m: {value: m.csv, at: sites}}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: {sites: p**2/(2*m), bonds: "k*(q[a] - q[b] - l)**2/2"}
runs: {r: {sizes: [4], bonds: bonds.csv, initial: INITIAL, step: 0.1, steps: 4}}
"""
NUMBERS = np.arange(8.0).reshape(2, 4)
MASSES = "m\n1\n2\n3\n4\n"
#: Places (line, column) in the spec of the values of m, of the initial state, and of the bonds.
MASS_PLACE, INITIAL_PLACE, BONDS_PLACE = (5, 77), (8, 51), (8, 31)


def start(folder: Path, bonds: str = "a,b\n0,1\n", masses: str = MASSES, initial: str = "state.npy") -> Start:
    """Return the start of the run with files of these contents next to the spec."""
    (folder / "springs.yaml").write_text(GRAPH.replace("INITIAL", initial))
    (folder / "bonds.csv").write_text(bonds)
    (folder / "m.csv").write_text(masses)
    if not (folder / "state.npy").exists():
        np.save(folder / "state.npy", NUMBERS)
    spec = load(folder / "springs.yaml")
    return start_of(spec, spec.runs["r"])


def refusal(folder: Path, **files: str) -> tuple[tuple[int, int], str]:
    """Return the place and the text of the error."""
    with pytest.raises(SpecError) as error:
        start(folder, **files)
    (diagnostic,) = error.value.diagnostics
    return (diagnostic.location.line, diagnostic.location.column), diagnostic.message


@pytest.mark.parametrize(
    ("bonds", "ends", "k", "l"),
    [
        ("0,1\n1,2\n", [[0, 1], [1, 2]], [1, 1], [0, 0]),
        ("a,b\n", [], [], []),
        ("a,b,k\n0,1,5\n1,2,6\n", [[0, 1], [1, 2]], [5, 6], [0, 0]),
        ('\ufeff l, k,"b",a\n# strings\n\n9,5,1,0\n8,6,2,1\n', [[0, 1], [1, 2]], [5, 6], [9, 8]),
    ],
)
def test_columns_of_bonds_are_found_by_their_names(tmp_path, bonds, ends, k, l):  # noqa: E741
    start_values = start(tmp_path, bonds=bonds)
    assert start_values.bonds.tolist() == ends
    assert start_values.parameters["k"].tolist() == k
    assert start_values.parameters["l"].tolist() == l


@pytest.mark.parametrize(
    ("bonds", "why"),
    [
        ("a,b,zz\n0,1,1\n", "the column 'zz' is no parameter at bonds; one of k, l"),
        ("a,b,kk\n0,1,1\n", "the column 'kk' is no parameter at bonds; did you mean 'k'?"),
        ("a,b,m\n0,1,1\n", "the column 'm' is no parameter at bonds"),
        ("a,b,k,k\n0,1,5,7\n", "two columns have the name 'k'"),
        ("a,b,a\n0,1,5\n", "two columns have the name 'a'"),
        ("from,to,k\n0,1,5\n", "there is no column 'a'"),
        ("0,1,5\n1,2,6\n", "3 columns without names"),
        ("0\n1\n", "1 column without names"),
        ("", "it is empty"),
        ("a,b,k\n0,1,1\n\n1,2,nan\n", "line 4: not all its numbers are finite"),
        ("0,1\nnan,2\n", "line 2: not all its numbers are finite"),
        ("a,b\n0,1\n1,9999999999999999999999\n", "line 3: a site beyond the limit"),
        ("a,b\n0,1\n1,1.5\n", "line 3: sites are whole numbers, counted from 0"),
        ("0,1\n1,-1\n", "line 2: sites are whole numbers, counted from 0"),
        ("0,1\n2,2\n", "line 2: a bond has two different ends"),
        ("a,b\n0,1\n1\n", "cannot read 'bonds.csv'"),
        ("a,b\n0,x\n", "cannot read 'bonds.csv'"),
        ("0,1\n1,4\n", "a bond ends at site 4, but sites have the numbers 0 to 3"),
    ],
)
def test_bonds_that_mean_nothing_are_refused(tmp_path, bonds, why):
    place, message = refusal(tmp_path, bonds=bonds)
    assert place == BONDS_PLACE
    assert why in message


@pytest.mark.parametrize("masses", ["1\n2\n3\n4\n", "1,2,3,4\n", "m\n1\n2\n3\n4\n", "# masses\n1\n2\n\n3\n4"])
def test_a_column_or_a_line_of_values_is_an_array(tmp_path, masses):
    assert start(tmp_path, masses=masses).parameters["m"].tolist() == [1, 2, 3, 4]


@pytest.mark.parametrize(
    ("masses", "why"),
    [
        ("k\n1\n2\n3\n4\n", "its columns are k"),
        ("m,k\n1,1\n2,1\n3,1\n4,1\n", "its columns are m, k"),
        ("1\n2\n3\n", "3 values, not 4"),
        ("1,2\n3,4\n", "2×2 values, not 4"),
        ("m\n1\n2\ninf\n4\n", "line 4: not a finite number"),
        ("", "it is empty"),
        ("1\n2j\n3\n4\n", "cannot read 'm.csv'"),
    ],
)
def test_tables_of_values_that_do_not_fit_are_refused(tmp_path, masses, why):
    place, message = refusal(tmp_path, masses=masses)
    assert place == MASS_PLACE
    assert why in message


@pytest.mark.parametrize("kind", ["<f8", ">f4", "<i4", "bool"])
def test_arrays_of_any_real_kind_are_read(tmp_path, kind):
    np.save(tmp_path / "state.npy", np.asfortranarray(NUMBERS.astype(kind)))
    assert np.array_equal(start(tmp_path).state, NUMBERS.astype(kind))


def _with_content(path: Path, content: bytes) -> None:
    path.write_bytes(content)


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda path: np.save(path, NUMBERS * 1j), "complex numbers, not real numbers"),
        (lambda path: np.save(path, NUMBERS.astype(str)), "not real numbers"),
        (lambda path: np.save(path, NUMBERS.T), "4×2 values, not 2×4"),
        (lambda path: np.save(path, np.array(1.0)), "1 values, not 2×4"),
        (lambda path: np.save(path, NUMBERS / np.array([1, 1, 0, 1])), "the value at [0, 2] is not finite"),
        (lambda path: np.save(path, np.array([None] * 8).reshape(2, 4)), "not real numbers"),
        (lambda path: np.savez(path.open("wb"), a=NUMBERS), "magic string"),
        (lambda path: _with_content(path, path.read_bytes()[:-8] if path.exists() else b""), "cannot read"),
        (lambda path: _with_content(path, b"\x93NUMPY\x01\x00\x0a\x00{'descr': ("), "cannot read"),
        (lambda path: _with_content(path, b"\x93NUMPY\x09\x00\x0a\x00{'descr': ("), "cannot read"),
    ],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_arrays_that_are_no_states_are_refused(tmp_path, make, why):
    make(tmp_path / "state.npy")
    place, message = refusal(tmp_path)
    assert place == INITIAL_PLACE
    assert why in message


def test_a_header_does_not_decide_how_much_memory_is_asked_for(tmp_path):
    np.save(tmp_path / "state.npy", NUMBERS)
    content = (tmp_path / "state.npy").read_bytes()
    (tmp_path / "state.npy").write_bytes(content.replace(b"(2, 4)", b"(9999999999999, 99999)")[: len(content)])
    assert "cannot read" in refusal(tmp_path)[1]


def test_more_than_the_array_is_refused(tmp_path):
    with (tmp_path / "state.npy").open("wb") as file:
        np.save(file, NUMBERS)
        np.save(file, NUMBERS)
    assert "more than one array" in refusal(tmp_path)[1]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes")
@pytest.mark.parametrize("name", ["state.npy", "bonds.csv", "m.csv", "springs.yaml"])
def test_a_pipe_is_refused_at_once(tmp_path, name):
    start(tmp_path)
    (tmp_path / name).unlink()
    os.mkfifo(tmp_path / name)
    with pytest.raises(SpecError, match=f"cannot read .*{name}.*: it is not a regular file"):
        start_of(load(tmp_path / "springs.yaml"), load(tmp_path / "springs.yaml").runs["r"])
