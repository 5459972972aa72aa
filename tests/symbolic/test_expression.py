"""Derivatives and sums of large systems: algorithms that skip zeros give the same expressions as those that do not."""

import pytest

from phigen.spec import loads
from phigen.symbolic import expression
from phigen.symbolic.expression import ZERO, derivatives, sparse_derivatives, symbol, total, total_at

NAMES = ("x", "y", "z")


def parsed(text):
    return loads(
        "phigen: 1\nname: t\ncoordinates: [x, y, z]\npoisson: {lie_algebra: {name: so(3)}}\nparameters: {a: 1}\n"
        f"hamiltonian: {text}\n"
    ).hamiltonian


@pytest.mark.parametrize(
    "text", ["x**2*y + a*z", "sin(x*y)**2*(x - x) + exp(a)", "atan2(x + y, y*z) + (x - y)**4/(1 + x**2)", "a", "y"]
)
def test_sparse_derivatives_are_the_derivatives_that_are_not_zero(text):
    roots = [parsed(text), parsed("x*y + z")]
    dense = [dict(zip(NAMES, row, strict=True)) for row in zip(*(derivatives(roots, n) for n in NAMES), strict=True)]
    nonzero = [{n: d for n, d in row.items() if not d.is_zero} for row in dense]
    assert sparse_derivatives(roots, NAMES) == nonzero


@pytest.mark.parametrize("places", [[], [0], [3], [0, 1], [2, 5, 6], [1, 2, 3, 4, 7], list(range(9))])
def test_a_sum_without_its_zeros_is_the_same_tree(places):
    terms = {k: symbol(f"v{k}") for k in places}
    assert total_at(terms) is total([terms.get(k, ZERO) for k in range(11)])


def test_equal_formulas_are_one_node_which_is_forgotten_with_its_last_use():
    x, before = symbol("forgotten"), {*expression._NODES}
    formula = x * (x + 3) ** 2
    assert formula is x * (x + 3) ** 2
    assert not {*expression._NODES} <= before
    del formula
    assert {*expression._NODES} <= before


def test_order_of_terms_depends_only_on_their_contents():
    """The order of terms in a sum depends only on their contents. Terms of equal depth are ordered by a hash of the
    content, which is computed on demand.
    """
    texts = {}
    for turn in (1, -1):
        terms = {n: symbol("x") ** n * symbol("y") for n in (2, 3, 4, 5)[::turn]}
        texts[turn] = [str(terms[n] + terms[m]) for n in terms for m in terms if n < m]
        del terms
    assert sorted(texts[1]) == sorted(texts[-1])
