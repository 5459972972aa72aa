"""Lattices that are written out as ordinary specs are recognised."""

from __future__ import annotations

import warnings
from dataclasses import replace

import pytest
from lattice.lattices import LATTICES

from phigen import resources
from phigen.compiler import compile_spec
from phigen.errors import PhigenWarning
from phigen.lattice.cell import vector_field
from phigen.lattice.cell_building import cell_from_spec
from phigen.lattice.expansion import expand, run_of
from phigen.lattice.recognition import recognised_lattice
from phigen.lattice.states import start_of
from phigen.spec import load, loads
from phigen.spec.model import Spec
from phigen.spec.yaml_text import spec_text
from phigen.symbolic.verdict import PROVED, decide_zero

SIZES = {
    "spins_1": (6,), "spins_1_open": (5,), "spins_2": (5, 4), "toda": (6,), "volterra": (8,), "fput": (16,),
    "fput_open": (6,), "kdv": (6,), "far": (5, 7), "far_open": (6, 5),
}  # fmt: skip


def expanded(name: str) -> Spec:
    """Return a bundled lattice written out as an ordinary spec."""
    return expand(cell_from_spec(loads(LATTICES[name])), SIZES[name]).spec()


def bundled(name: str) -> Spec:
    """Return a bundled spec."""
    return load(resources.bundled()[name])


@pytest.mark.parametrize("name", SIZES)
def test_a_lattice_comes_back_from_its_expansion(name: str) -> None:
    spec = loads(LATTICES[name])
    recognised = recognised_lattice(expanded(name), least=4)
    assert (recognised.lattice.axes, recognised.lattice.boundary) == (spec.lattice.axes, spec.lattice.boundary)
    assert {p.name: p.at for p in recognised.parameters} == {p.name: p.at for p in spec.parameters}
    assert recognised.lattice.kinds == spec.lattice.kinds
    assert set(recognised.invariants) == set(spec.invariants)
    mine, theirs = vector_field(cell_from_spec(recognised)), vector_field(cell_from_spec(spec))
    assert decide_zero("", [(f, e - theirs[f]) for f, e in mine.items()]).verdict == PROVED


def test_specs_that_people_wrote_are_recognised_with_casimirs_invariants_and_runs() -> None:
    spins = recognised_lattice(bundled("spin_chain5"), least=4)
    assert spins.lattice.kinds == {"C": "sites"}
    assert set(spins.invariants) == {"X", "Y", "Z"}
    assert recognised_lattice(bundled("volterra5"), least=4).lattice.kinds == {"C": "product"}
    read = loads(spec_text(spins))
    run = read.runs["reference"]
    assert start_of(read, run).state.reshape(-1).tolist() == [1, 0, 0.6, 0, 0, 0, 1, 0, -0.8, 0, 0, 0, 0.8, 0.6, 1]
    assert (run.step, run.steps) == (bundled("spin_chain5").runs["reference"].step, 1000)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("x5*x1", "2*x5*x1"),  # one bond is stronger
        ("y1: {z1: -x1}", "y1: {z1: x1}"),  # one spin rotates in the opposite direction
        ("    y3: {z3: -x3}\n", ""),  # one bracket is missing
    ],
)
def test_one_site_that_differs_is_no_lattice(old: str, new: str) -> None:
    source = resources.bundled()["spin_chain5"].read_text(encoding="utf-8")
    assert old in source
    assert recognised_lattice(loads(source.replace(old, new)), least=4) is None


@pytest.mark.parametrize("name", ["kepler", "rigid_body", "lagrange_top", "so4_manakov", "toda3"])
def test_other_systems_are_no_lattices(name: str) -> None:
    assert recognised_lattice(bundled(name), least=2) is None


def test_parameters_with_numbers_are_at_sites_with_their_values_of_a_run() -> None:
    spec = loads(LATTICES["spins_1"])
    cell = cell_from_spec(spec)
    run = spec.runs["quench"]
    start = start_of(spec, replace(run, lattice=replace(run.lattice, sizes=(6,))))
    expansion = expand(cell, (6,))
    ordinary = replace(
        expansion.spec(), runs={"quench": run_of(expansion, run, start.state, expansion.numbers(start.parameters))}
    )
    specification = loads(spec_text(recognised_lattice(ordinary, least=4)))
    again = start_of(specification, specification.runs["quench"])
    assert again.parameters["B"].tolist() == start.parameters["B"].tolist()
    assert again.state.tolist() == start.state.tolist()


def test_who_compiles_a_lattice_recognised_lattice_is_told() -> None:
    spec = loads(spec_text(replace(expanded("fput"), name="chain")), "chain.yaml")
    with pytest.warns(PhigenWarning, match="chain is a lattice of 16 identical sites") as caught:
        compile_spec(spec, scheme="splitting", order=2)
    assert "phigen show --lattice chain.yaml" in str(caught[0].message)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        compile_spec(bundled("volterra5"), scheme="splitting")  # too small for a warning
