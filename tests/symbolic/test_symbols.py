"""Symbols that phigen creates: their kinds, and no clashes with names in specs."""

import pickle

import pytest

from phigen.symbolic.expression import symbol
from phigen.symbolic.symbols import (
    COEFFICIENT,
    MOMENTUM,
    STEP,
    Symbol,
    coefficient,
    kind_of,
    momentum,
    plain,
    variation,
)


def test_a_symbol_knows_its_kind_and_its_key():
    assert (kind_of(momentum("x1")), momentum("x1").key) == (MOMENTUM, ("x1",))
    assert (kind_of(coefficient(12)), coefficient(12).key) == (COEFFICIENT, (12,))
    assert kind_of("p") is None


def test_symbols_of_one_kind_and_key_are_one_node_and_differ_from_all_names_of_a_spec():
    assert symbol(momentum("x")) is symbol(momentum("x"))
    assert len({symbol(n) for n in ("p_x", "p", momentum("x"), momentum(variation("x")), variation("x"), STEP)}) == 6


@pytest.mark.parametrize("name", ["p:x", "h:", "c:3"])
def test_plain_text_is_never_taken_for_a_symbol_of_phigens_own(name):
    with pytest.raises(ValueError, match="no name of a spec"):
        symbol(name)


def test_a_symbol_keeps_its_kind_between_processes():
    (restored,) = pickle.loads(pickle.dumps([symbol(Symbol("J", 2, 3))]))
    assert restored is symbol(Symbol("J", 2, 3))
    assert (restored.value.kind, restored.value.key) == ("J", (2, 3))


def test_names_for_readers():
    assert [plain(n) for n in ("x", momentum("x1"), STEP, momentum(variation("q")))] == ["x", "p_x1", "h", "p_v_q"]
