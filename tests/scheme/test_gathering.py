"""Gathering of static factors, which do not depend on the state: expressions keep their values, and a step needs fewer
operations.
"""

import pytest

from phigen.scheme.gathering import gather
from phigen.scheme.lowering import cost
from phigen.scheme.staging import Coefficients
from phigen.symbolic.expression import call, number, symbol, text
from phigen.symbolic.numeric import evaluate

x, y, h, k = (symbol(n) for n in ("x", "y", "h", "k"))
HALF, QUARTER = number(1) / 2, number(1) / 4
POINT = {"x": 0.7, "y": -1.3, "h": 0.11, "k": 2.3}

#: Expressions in the states x, y and the static symbols h, k, each with the largest cost allowed after gathering.
CASES = {
    "a square": ((h * x / 2) ** 2, 2),
    "a sum of squares": (QUARTER * h**2 * x**2 + QUARTER * (h**2 * y**2), 4),
    "different statics": (h * x + k * y, 3),
    "a number leaves a sum": (h * (HALF * x * y + QUARTER * (k * (x * call("sin", y)))), 25),
    "differences": (h * (k * x) - HALF * (h * (k * y)), 3),
    "what is static": (h * k - 3, 0),
    "minus": (-x, 0),
}


@pytest.mark.parametrize(("e", "least"), CASES.values(), ids=CASES)
def test_gathered_expressions_have_the_same_value_and_no_more_operations(e, least):
    coefficients, plain = Coefficients(["h", "k"]), Coefficients(["h", "k"])
    (gathered,) = gather(coefficients, [e])
    values = evaluate(coefficients.values, POINT)
    slots = dict(zip(coefficients.slots, values, strict=True))
    assert evaluate([gathered], POINT | slots) == pytest.approx(evaluate([e], POINT), rel=1e-15)
    assert not {"h", "k"} & set(text(gathered).replace("*", " ").split())
    assert cost([gathered]) <= min(least, cost(plain.hoist([e])))
