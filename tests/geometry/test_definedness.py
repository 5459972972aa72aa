"""Formulas that are defined nowhere are found: divisions by 0 by proof, others by evaluation at points."""

import pytest

from phigen import CheckError, spec
from phigen.compiler import compile_proved, examine
from phigen.errors import PhigenWarning
from phigen.proofs.statements import DEFINEDNESS
from phigen.symbolic.verdict import REFUTED, UNDECIDED

PAIR = "phigen: 1\nname: t\ncoordinates: [x, y]\npoisson: {canonical: {q: [x], p: [y]}}\n"
RUN = "runs: {one: {initial: [1, 0.5], step: 0.1, steps: 1}}\n"


def statements(text):
    return examine(spec.loads(PAIR + text)).groups.get(DEFINEDNESS, ())


@pytest.mark.parametrize(
    ("text", "name", "detail"),
    [
        (
            "hamiltonian: 1/(sin(x)**2+cos(x)**2-1) + y\n",
            "H",
            "a division by cos(x)**2 + sin(x)**2 - 1, which is 0: proved",
        ),
        ("hamiltonian: x*y + log((x+y)**2-x**2-2*x*y-y**2)\n", "H", "which is 0: proved"),
        ("hamiltonian: log(-1-x**2) + y\n" + RUN, "H", "no value at any of 192 points, nor where a run starts"),
        (
            "hamiltonian: x*y\ninvariants: {F: x*y/(exp(x)*exp(-x)-1)}\n",
            "F",
            "exp(-x) - 1, which is 0: proved",
        ),
    ],
)
def test_what_has_no_value_anywhere_is_refused_where_it_stands(text, name, detail):
    (statement,) = statements(text)
    assert (statement.name, statement.verdict) == (f"{name} is defined", REFUTED)
    with pytest.raises(CheckError, match=f"{name} is defined") as caught:
        compile_proved(spec.loads(PAIR + text))
    line = {"H": 5, "F": 6}[name]
    assert str(caught.value).startswith(f"<string>:{line}:")
    assert detail in statement.detail


def test_where_no_run_says_where_it_starts_a_search_in_vain_is_a_warning():
    text = PAIR + "hamiltonian: sqrt(1e-6 - x**2) + y**2\n"
    (statement,) = examine(spec.loads(text)).groups[DEFINEDNESS]
    assert (statement.verdict, statement.detail) == (UNDECIDED, "no value at any of 192 points")
    with pytest.warns(PhigenWarning, match=r"^<string>:5:14: warning: H is defined: undecided"):
        compile_proved(spec.loads(text))


def test_a_run_that_starts_where_something_has_no_value_is_a_warning():
    runs = "runs: {good: {initial: [1, 1], step: 0.1, steps: 1}, bad: {initial: [-1, 1], step: 0.1, steps: 1}}\n"
    text = PAIR + "hamiltonian: y**2 + x - log(x)\ninvariants: {F: x - log(x) + y**2}\n" + runs
    (statement,) = examine(spec.loads(text)).groups[DEFINEDNESS]
    assert (statement.name, statement.detail) == ("everything is defined where bad starts", "no value of H, F there")
    with pytest.warns(PhigenWarning, match=r"^<string>:7:\d+: warning: everything is defined where bad starts"):
        compile_proved(spec.loads(text))


@pytest.mark.parametrize(
    "text",
    [
        "hamiltonian: sqrt(1e-6 - x**2) + y**2\n" + RUN.replace("1, 0.5", "0.0001, 0"),
        "hamiltonian: sqrt(1 - x**2 - y**2) + acosh(2 + x) + 1/(x - y)\n",
        "parameters: {a: 0}\nhamiltonian: x**2/(1 + a) + log(x*y)\n",
    ],
)
def test_what_has_a_value_somewhere_is_not_mentioned(text):
    assert statements(text) == ()
