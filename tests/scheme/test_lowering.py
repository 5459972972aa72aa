"""Lowering of expressions to assignments: it keeps their values, computes common subexpressions once, and leaves only
operations that a target can print.
"""

import re
from fractions import Fraction
from pathlib import Path

import mpmath
import pytest
from support import NAMES, compile_text, compiled, symbols, values

from phigen.scheme.lowering import MAX_STATEMENT_OPERATIONS, assign, cost, expand_powers, operation_counts
from phigen.scheme.staging import Coefficients
from phigen.symbolic.expression import number, power, sqrt, symbols_of, topological
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.symbols import STEP, coefficient
from phigen.targets.printer import Printer

x, y, a = symbols("x y a")


class PlainPrinter(Printer):
    """Printer that writes rational numbers as fractions, so that expected lines are readable."""

    def literal(self, value):
        return str(value), 3 if value.denominator == 1 and value >= 0 else 2 if value > 0 else 1


PRINTER = PlainPrinter(
    lambda name: name.replace(":", ""),
    {**{f: f for f in FUNCTIONS}, "sqrt": "sqrt", "cbrt": "cbrt", "sign": "sign({0})"},
    {"pi": "pi", "E": "E"},
    "pow",
)


def pairs():
    """Yield the source and the expected lines of each case of passes.txt, with its title as name of the test."""
    text = Path(__file__).with_name("passes.txt").read_text(encoding="utf-8")
    for part in re.split(r"^== ", text, flags=re.MULTILINE)[1:]:
        title, _, rest = part.partition("\n")
        source, _, expected = rest.partition("\n--\n")
        yield pytest.param(source.split(";"), expected.strip().splitlines(), id=title)


def formulas(sources):
    """Return the expressions in x and y that a spec reads from these texts."""
    definitions = "".join(f"  e{k}: {source.strip()}\n" for k, source in enumerate(sources))
    text = "coordinates: [x, y]\npoisson: {canonical: {q: [x], p: [y]}}\n"
    invariants = "".join(f"  J{k}: e{k}\n" for k in range(len(sources)))
    spec = compile_text(f"{text}definitions:\n{definitions}invariants:\n{invariants}hamiltonian: y\norder: 1\n").spec
    return list(spec.invariants.values())


@pytest.mark.parametrize(("sources", "expected"), list(pairs()))
def test_lowered_form(sources, expected):
    assignments, roots = assign(expand_powers(formulas(sources)))
    lines = [f"{a.target.replace(':', '')} = {PRINTER(a.value)}" for a in assignments]
    assert [*lines, *(PRINTER(r) for r in roots)] == expected


EXPONENTS = [Fraction(n, d) for d in range(1, 9) for n in (-23, -9, -4, -3, -2, -1, 1, 2, 3, 4, 5, 9, 16, 23)]


@pytest.mark.parametrize("exponent", EXPONENTS, ids=str)
def test_expanding_a_power_keeps_its_value(exponent):
    (lowered,) = expand_powers([power(x, exponent)])
    with mpmath.workdps(40):
        at = {"x": mpmath.mpf(7) / 5}
        assert mpmath.almosteq(*values([lowered, power(x, exponent)], at), mpmath.mpf(10) ** -35)


def test_expanded_powers_are_squares_reciprocals_roots_or_calls():
    left = {e.value for n in EXPONENTS for e in topological(expand_powers([power(x, n)])) if e.op == "pow"}
    assert {v for v in left if v.denominator not in (5, 7)} == {2, -1, Fraction(1, 2), Fraction(1, 3)}


def evaluated(assignments, roots, at):
    """Return the values of the roots, after the temporaries are computed one assignment after another."""
    known = dict(at)
    for step in assignments:
        assert set(symbols_of(step.value)) <= set(known), "a temporary is read before it is written"
        assert step.target not in known, "a temporary is written twice"
        (known[step.target],) = values([step.value], known)
    return values(roots, known)


def state_and_coefficients(compilation):
    """Return a number for each symbol that the kernels of a program read."""
    at = {}
    for kernel in compilation.program.kernels:
        for names in kernel.inputs.values():
            at |= {name: mpmath.mpf(11 + 3 * k + 7 * k * k % 13) / 29 for k, name in enumerate(names)}
    return at


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize("name", NAMES)
def test_assignments_compute_the_roots(name):
    compilation = compiled(name)
    with mpmath.workdps(40):
        at = state_and_coefficients(compilation)
        for kernel in compilation.program.kernels:
            expanded = expand_powers(kernel.roots)
            assignments, trees = assign(expanded)
            computed, expected = evaluated(assignments, trees, at), values(kernel.roots, at)
            for left, right in zip(computed, expected, strict=True):
                assert abs(left - right) <= mpmath.mpf(10) ** -25 * (1 + abs(right))
            operations = [sum(1 for e in topological([s.value]) if e.args) for s in assignments]
            assert max(operations, default=0) <= 2 * MAX_STATEMENT_OPERATIONS + 1


@pytest.mark.parametrize("name", NAMES)
def test_the_step_reads_neither_parameters_nor_step_size(name):
    """What does not depend on the state is a coefficient, which the kernel ``prepare`` computes before the
    first step.
    """
    program = compiled(name).program
    static = {p.name for p in program.parameters} | {STEP}
    for kernel in program.step.kernels:
        assert kernel is program.step.prepare or not static & set(symbols_of(*kernel.roots))
    assert not set(program.coordinates) & set(symbols_of(*program.step.prepare.roots))


def test_hoisting_keeps_values_and_takes_the_largest_static_parts():
    table = Coefficients(["a"])
    roots = [(a**2 + 1) * x + sqrt(a) * y, a * (x + y), a + 1, number(3) * x]
    hoisted = table.hoist(roots)
    assert not {"a"} & set(symbols_of(*hoisted))
    with mpmath.workdps(30):
        at = {"x": mpmath.mpf(2), "y": mpmath.mpf(3), "a": mpmath.mpf(5)}
        at |= {coefficient(k): v for k, v in enumerate(values(table.values, at))}
        assert values(hoisted, at) == values(roots, at)
    assert len(table.values) == 4  # a² + 1, √a, a and a + 1; the number 3 is no coefficient


def test_hoisting_twice_adds_nothing():
    table = Coefficients(["a"])
    once = table.hoist([(a + 1) * x, a * y])
    count = len(table.values)
    assert table.hoist(once) == once
    assert len(table.values) == count


def test_a_shared_value_is_counted_once():
    shared = (x + y) * (x - y)
    assert cost([shared, shared + 1]) == cost([shared]) + 1
    counts = operation_counts([power(x, -2), sqrt(x)])
    assert counts == {"additions": 0, "multiplications": 1, "divisions": 1, "functions": 1}
