"""Tensors π with blocks: blocks are found, can be given in the spec, and can be nested."""

import pytest
from geometry.building import system

from phigen.errors import SpecError
from phigen.geometry.blocks import blocks
from phigen.geometry.shapes import Canonical, LiePoisson
from phigen.realisations.axioms import check
from phigen.realisations.catalogue import realise
from phigen.realisations.product import grouped
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.expression import symbols_of
from phigen.symbolic.symbols import momentum
from phigen.symbolic.verdict import PROVED

PRODUCT = BirealisationChoice("product")
SPIN = "x: {y: -z, z: y}, y: {z: -x}"


def kinds_by_block(realisation):
    return [
        part.split(": ")[1].split(",")[0] for part in realisation.explanation.split("block by block: ")[1].split("; (")
    ]


@pytest.mark.parametrize(
    ("coordinates", "brackets", "kinds"),
    [
        ("x y z a b", f"{{{SPIN}, a: {{b: a*b}}}}", ["exponential", "log-canonical"]),
        ("x a y b z q p", f"{{{SPIN}, a: {{b: 1+a**2}}, q: {{p: 1}}}}", ["exponential", "gauged", "constant"]),
        ("x y z a b q1 p1 q2 p2", f"{{{SPIN}, a: {{b: a*b}}, q1: {{p1: 1}}, q2: {{p2: 1}}}}",
         ["constant", "exponential", "log-canonical"]),
    ],
)  # fmt: skip
def test_blocks_are_found_and_proved(coordinates, brackets, kinds):
    s = system(coordinates, f"{{brackets: {brackets}}}")
    realisation = realise(s)
    assert realisation.kind == "product"
    assert realisation.symmetric
    assert kinds_by_block(realisation) == kinds
    assert [statement.verdict for statement in check(s, realisation)] == [PROVED] * 5
    for indices in blocks(s.coordinates, s.poisson):
        block_names = {s.coordinates[i] for i in indices}
        for i in indices:
            assert set(symbols_of(realisation.displacement[i])) <= block_names | {momentum(c) for c in block_names}


def test_blocks_follow_brackets_and_what_they_depend_on():
    s = system("a b c d e", "{brackets: {a: {b: e}, c: {d: c}}}")
    assert blocks(s.coordinates, s.poisson) == [[0, 1, 4], [2, 3]]
    s = system("a b c d e", "{brackets: {a: {b: e}, c: {d: 1 + e}}}")
    assert blocks(s.coordinates, s.poisson) == [[0, 1, 2, 3, 4]]


def test_constant_blocks_are_one():
    s = system("q1 q2 x y p1 p2", "{brackets: {q1: {p1: 1}, q2: {p2: 1}, x: {y: x*y}}}")
    parts = grouped(s)
    assert [p.coordinates for p in parts] == [("q1", "q2", "p1", "p2"), ("x", "y")]
    assert isinstance(parts[0].shape, Canonical)


def test_a_product_is_stated_by_its_blocks():
    s = system(
        "x y z q p",
        "{product: [{coordinates: [z, y, x], lie_algebra: {name: so(3)}}, "
        "{coordinates: [q, p], log_canonical: [[0, 2], [-2, 0]]}]}",
    )
    assert str(s.poisson[2][1]) == "x"  # {z, y} = x
    assert str(s.poisson[3][4]) == "2*(p*q)"
    assert [str(c) for c in s.casimirs.values()] == ["x**2 + (y**2 + z**2)"]
    assert realise(s).kind == "product"
    assert [statement.verdict for statement in check(s, realise(s))] == [PROVED] * 5


def test_the_form_of_a_block_keeps_its_matrices():
    # The algebra gl(3) comes with 3×3 matrices, for which the Cayley transform applies. Structure constants alone
    # contain no matrices.
    names = ", ".join(f"x{i}" for i in range(9))
    s = system(
        names.replace(",", "") + " q p",
        f"{{product: [{{coordinates: [{names}], lie_algebra: {{name: gl(3)}}}}, "
        "{coordinates: [q, p], log_canonical: [[0, 1], [-1, 0]]}]}",
    )
    parts = grouped(s)
    assert isinstance(parts[0].shape, LiePoisson)
    assert parts[0].shape.algebra.representation is not None
    assert "cayley" in kinds_by_block(realise(s))


def test_the_kind_of_the_blocks_can_be_chosen():
    s = system("x y z a b c", f"{{brackets: {{{SPIN}, a: {{b: c}}}}}}")
    realisation = realise(s, BirealisationChoice("product", of="cayley"))
    assert kinds_by_block(realisation) == ["cayley", "cayley"]
    assert [statement.verdict for statement in check(s, realisation)] == [PROVED] * 5


def test_a_block_without_closed_form_makes_the_whole_follow_paths():
    s = system("x y z a b", f"{{brackets: {{{SPIN}, a: {{b: 1 + a*b}}}}}}")
    assert realise(s).path
    with pytest.raises(SpecError, match=r"no closed form is known for the block \(a, b\)"):
        realise(s, PRODUCT)


def test_a_single_block_is_refused():
    with pytest.raises(SpecError, match="needs a block-diagonal π; here x, y, z are one block"):
        realise(system("x y z", f"{{brackets: {{{SPIN}}}}}"), PRODUCT)
