"""Lattices on the command line."""

from __future__ import annotations

import pytest
from lattice.lattices import LATTICES

from phigen import compiler
from phigen.spec import loads


@pytest.fixture
def lattice(tmp_path):
    """Writes a lattice to a file."""

    def write(name):
        path = tmp_path / f"{name}.yaml"
        path.write_text(LATTICES[name], encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize("name", ["toda", "fput_open"])
def test_an_expansion_compiles_as_an_ordinary_spec(phigen, lattice, name):
    printed = phigen("show", lattice(name), "--expand", "4").stdout
    compilation = compiler.compile_proved(loads(printed), scheme="splitting")
    assert compilation.spec.name == f"{name.partition('_')[0]}_4"


def test_a_run_names_the_sizes_of_its_expansion(phigen, lattice):
    printed = phigen("show", lattice("spins_2"), "--expand", "quench").stdout
    assert loads(printed).name == "spins_3x2"
    assert len(loads(printed).runs["quench"].initial) == 18


@pytest.mark.parametrize(
    ("sizes", "code", "message"),
    [
        ("3", 2, "sizes are 2, along i, j; not 3"),
        ("a", 2, "'a' is not sizes such as 3x3, or the name of a run: quench"),
        ("1x4", 1, "sizes are at least 2x2"),
        ("20x20", 3, "1200 coordinates; an ordinary spec has at most 256"),
    ],
)
def test_sizes_that_do_not_fit_say_so(phigen, lattice, sizes, code, message):
    done = phigen("show", lattice("spins_2"), "--expand", sizes)
    assert (done.exit_code, message in " ".join(done.stderr.split())) == (code, True)
