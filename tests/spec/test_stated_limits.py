"""The limits that docs/spec.md states are those of the code."""

import re

import pytest

from phigen import resources, spec
from phigen.errors import LimitError, SpecError
from phigen.spec import limits

#: For each limit in the code, its row of the table in docs/spec.md.
ROWS = {
    "FILE_BYTES": "size of a file, in bytes",
    "YAML_NODES": "values and keys in a file",
    "YAML_DEPTH": "nesting of lists and mappings",
    "EXPRESSION_LENGTH": "characters of an expression",
    "EXPRESSION_NODES": "numbers, names, operators and calls of an expression",
    "EXPRESSION_DEPTH": "nesting of parentheses, calls, signs and exponents",
    "NUMBER": "absolute value of a number, below",
    "DENOMINATOR": "denominator of a number, below",
    "EXPONENT": "a written exponent",
    "COORDINATES": "coordinates",
    "OFFSET": "offset of a neighbour on a lattice",
    "SITES": "sites of a lattice",
    "BONDS": "bonds listed in a spec",
    "ENTRIES": "entries of any other list or mapping",
    "NAME_LENGTH": "characters of a name",
    "LINE_LENGTH": "characters of a line of text",
    "TEXT_LENGTH": "characters of a text",
    "ORDER": "order, and terms",
    "CORRECTIONS": "corrections of the modified Hamiltonian",
    "OPERATIONS": "operations of one function of the generated code",
    "PRODUCT_TERMS": "terms of a product of polynomials",
    "PRODUCT_BYTES": "memory of a product of polynomials, or of a gradient, in bytes",
    "TAYLOR_BYTES": "memory of all products and sums of a series, in bytes",
    "SERIES_TERMS": "terms of one S_i",
    "CELLS": "exponents of all monomials of one S_h, and of its derivatives",
    "PROOF_PRODUCTS": "products of terms in the proof of a bi-realisation",
    "SWEEP_SEED": "seed of a sweep",
    "SEED": "seed of noise",
    "MEMBERS": "members of a run",
    "SOURCES": "sources of noise",
    "STEPS": "steps of a run",
    "SWEPT": "members of a sweep",
    "ERRORS": "errors that are listed",
}
NAMES = [name for name in vars(limits) if name.isupper()]


@pytest.mark.parametrize("name", NAMES)
def test_the_reference_states_the_limit(name):
    page = (resources.bundled_specs().parent / "docs" / "spec.md").read_text(encoding="utf-8")
    table = dict(re.findall(r"^\| (.+) \| (.+) \|$", page.split("## Limits")[1], re.MULTILINE))
    stated = table[ROWS[name]].replace(",", "")
    base, _, exponent = stated.partition("10") if any(c in "⁰¹²³⁴⁵⁶⁷⁸⁹" for c in stated) else (stated, "", "")
    digits = exponent.translate(str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789"))
    assert (10 ** int(digits) if digits else int(base)) == getattr(limits, name)


HEAD = "phigen: 1\nname: t\ncoordinates: [x1, x2, x3]\npoisson: {lie_algebra: {name: so(3)}}\n"


def formula(text):
    return f"{HEAD}hamiltonian: {text}\n"


def key(line):
    return f"{formula('x1')}{line}\n"


def run(line):
    return key(f"runs: {{r: {{initial: [1, 1, 1], {line}}}}}")


NAMED = "phigen: 1\nname: t\npoisson: {brackets: {x0: {x1: 1}}}\nhamiltonian: x0\n"


#: Limits, each with a function that returns a spec with n of the limited things.
EXACTLY = {
    "a file": ("FILE_BYTES", lambda n: "#" * n),
    "values": ("YAML_NODES", lambda n: f"[{'1,' * (n - 1)}]"),
    "lists": ("YAML_DEPTH", lambda n: "[" * n + "]" * n),
    "an expression": ("EXPRESSION_LENGTH", lambda n: formula("x1 +" + " " * (n - 6) + "x1")),
    "its nodes": ("EXPRESSION_NODES", lambda n: formula("-" * (n % 2 == 0) + "x1" + "+x1" * ((n - 1) // 2))),
    "parentheses": ("EXPRESSION_DEPTH", lambda n: formula("(" * n + "x1" + ")" * n)),
    "an exponent": ("EXPONENT", lambda n: formula(f"x1**{n}")),
    "a number": ("NUMBER", lambda n: formula(f"x1*{n - 1}")),
    "a denominator": ("DENOMINATOR", lambda n: formula(f"x1*1e-{len(str(n - 1)) - 1}")),
    "coordinates": ("COORDINATES", lambda n: f"{NAMED}coordinates: [{', '.join(f'x{i}' for i in range(n))}]\n"),
    "definitions": ("ENTRIES", lambda n: key(f"definitions: {{{', '.join(f'd{i}: x1' for i in range(n))}}}")),
    "a name": ("NAME_LENGTH", lambda n: key(f"casimirs: {{{'a' * n}: x1}}")),
    "a line": ("LINE_LENGTH", lambda n: key(f"title: {'a' * n}")),
    "a text": ("TEXT_LENGTH", lambda n: key(f"description: {'a' * n}")),
    "an order": ("ORDER", lambda n: key(f"order: {n}")),
    "terms": ("ORDER", lambda n: key(f"terms: {n}")),
    "the degree of a spray": ("ORDER", lambda n: key(f"birealisation: {{kind: spray, degree: {n}}}")),
    "corrections": ("CORRECTIONS", lambda n: key(f"modified_hamiltonian: {n}")),
    "steps": ("STEPS", lambda n: run(f"step: 0.1, steps: {n}")),
    "a stride": ("STEPS", lambda n: run(f"step: 0.1, steps: 1, stride: {n}")),
    "a duration": ("STEPS", lambda n: run(f"step: 1, duration: {n}")),
}


def breaks_a_limit(text):
    try:
        spec.loads(text)
    except LimitError:
        return True
    except SpecError:
        pass  # an error, but not of a limit
    return False


@pytest.mark.parametrize("what", EXACTLY)
def test_the_limit_itself_is_kept_and_one_more_is_not(what, monkeypatch):
    name, text = EXACTLY[what]
    if name == "YAML_NODES":  # a test with the real limit of 20,000 values would take a second
        monkeypatch.setattr(limits, name, 100)
    most = getattr(limits, name)
    assert not breaks_a_limit(text(most))
    assert breaks_a_limit(text(most + 1))


def test_no_more_errors_are_listed_than_the_limit():
    unknown = ", ".join(f"d{i}: y{i}" for i in range(limits.ERRORS + 50))
    with pytest.raises(SpecError) as caught:
        spec.loads(key(f"definitions: {{{unknown}}}"))
    *listed, last = caught.value.diagnostics
    assert len(listed) == limits.ERRORS
    assert "there may be more" in last.message
