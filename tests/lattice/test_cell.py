"""Cells of lattices: symbols of neighbours, terms of a density, forces and the field at a site."""

from __future__ import annotations

from fractions import Fraction

import pytest

from phigen.lattice.cell import Cell, bond_forces, contributions, forces, vector_field
from phigen.spec.model import Parameter
from phigen.symbolic.expression import Expression, number, symbol
from phigen.symbolic.verdict import PROVED, decide_zero

x, y, z, a, b, J, B = map(symbol, ["x", "y", "z", "a", "b", "J", "B"])


def at(name: str) -> Expression:
    return symbol(name)


PARAMETERS = (Parameter("J", Fraction(1)), Parameter("B", Fraction(1), at="sites"))
BONDS = x * at("x[i+1]") + y * at("y[i+1]") + z * at("z[i+1]")
SPINS = Cell(
    "spins",
    ("x", "y", "z"),
    -J * BONDS - B * z,
    {("x", "y"): z, ("y", "x"): -z, ("y", "z"): x, ("z", "y"): -x, ("z", "x"): y, ("x", "z"): -y},
    axes=("i",),
    boundary=("periodic",),
    parameters=PARAMETERS,
)
half = Fraction(1, 2)
TODA = Cell(
    "toda",
    ("a", "b"),
    b**2 / 2 + 2 * a**2,
    {("a", "b"): a * half, ("b", "a"): -a * half, ("a", "b[i+1]"): -a * half, ("b", "a[i-1]"): at("a[i-1]") * half},
    axes=("i",),
    boundary=("periodic",),
)
PLANE = Cell("plane", ("q",), at("q[i-1,j+2]") * symbol("q"), {}, axes=("i", "j"), boundary=("periodic", "open"))


def equal(left: Expression, right: Expression) -> bool:
    return decide_zero("equal", [("", left - right)]).verdict == PROVED


@pytest.mark.parametrize("offset", [(0, 0), (1, 0), (0, -3), (-1, 2)])
def test_symbols_and_places_are_inverse(offset: tuple[int, int]) -> None:
    assert PLANE.place(PLANE.at("q", offset)) == ("q", offset)


def test_offsets_of_zero_are_not_written() -> None:
    assert [PLANE.at("q", o) for o in ((0, 0), (0, 2), (-1, 2))] == ["q", "q[j+2]", "q[i-1,j+2]"]


def test_what_is_at_no_site_has_no_place() -> None:
    with pytest.raises(KeyError, match="'J' has no value at sites"):
        SPINS.place("J")
    with pytest.raises(KeyError, match=r"k\+1 is not an axis \(i\) plus a whole number"):
        SPINS.place("x[k+1]")


def test_parameters_at_sites_move_with_the_site_and_others_do_not() -> None:
    assert SPINS.shifted(J * B * at("x[i-1]"), (1,)) is J * at("B[i+1]") * x


def test_terms_are_those_written_with_constants_multiplied_in() -> None:
    assert {str(t) for t in SPINS.terms} == {"-J*(x*x[i+1])", "-J*(y*y[i+1])", "-J*(z*z[i+1])", "-B*z"}


def test_a_product_with_a_field_is_one_term() -> None:
    density = x * (at("x[i+1]") + at("x[i-1]"))
    assert Cell("one", ("x",), density, {}, axes=("i",), boundary=("open",)).terms == (density,)


def test_forces_gather_all_densities_that_mention_the_site() -> None:
    assert equal(forces(SPINS)["z"], -J * (at("z[i+1]") + at("z[i-1]")) - B)


def test_field_of_spins_is_a_cross_product() -> None:
    field = [-J * (at(f"{c}[i+1]") + at(f"{c}[i-1]")) for c in "xyz"]
    field[2] = field[2] - B
    assert equal(vector_field(SPINS)["x"], z * field[1] - y * field[2])


def test_field_of_brackets_that_couple_neighbours() -> None:
    rates = vector_field(TODA)
    assert equal(rates["a"], a * (b - at("b[i+1]")) / 2)
    assert equal(rates["b"], 2 * (at("a[i-1]") ** 2 - a**2))


def test_contributions_know_what_an_open_end_takes_away() -> None:
    extents = {(c.low, c.high) for c in contributions(SPINS)["x"]}
    assert extents == {((0,), (1,)), ((-1,), (0,))}


def test_reach_is_that_of_brackets_and_that_of_terms() -> None:
    assert (SPINS.poisson_reach, SPINS.hamiltonian_reach, SPINS.is_local) == ((0,), (1,), True)
    assert (TODA.poisson_reach, TODA.hamiltonian_reach, TODA.is_local) == ((1,), (0,), False)
    assert PLANE.hamiltonian_reach == (1, 2)


def test_forces_along_a_bond_are_at_both_ends() -> None:
    bond = -J * at("x[a]") * at("x[b]")
    cell = Cell("graph", ("x",), B * x, {}, relation="graph", parameters=PARAMETERS, bond_hamiltonian=bond)
    assert bond_forces(cell) == {"x[a]": -J * at("x[b]"), "x[b]": -J * at("x[a]")}
    assert forces(cell) == {"x": B}
    assert cell.on(B * x, "b") is at("B[b]") * at("x[b]")
    assert cell.place("x[b]") == ("x", ("b",))
    assert cell.shifted(number(1), ()) is number(1)
