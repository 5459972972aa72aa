"""The limits that the reference states are those of the code."""

import re

import pytest

from phigen import resources
from phigen.spec import limits

#: Rows of the table by the names of the numbers.
ROWS = {
    "FILE_BYTES": "size of a file, in bytes",
    "YAML_NODES": "values and keys in a file",
    "YAML_DEPTH": "nesting of lists and mappings",
    "EXPRESSION_LENGTH": "characters of an expression",
    "EXPRESSION_NODES": "numbers, names, operators and calls of an expression",
    "EXPRESSION_DEPTH": "nesting of parentheses, calls, signs and exponents",
    "NUMBER": "size of a number, below",
    "DENOMINATOR": "denominator of a number, below",
    "EXPONENT": "a written exponent",
    "COORDINATES": "coordinates",
    "OFFSET": "offset of a neighbour on a lattice",
    "SITES": "sites of a lattice",
    "BONDS": "bonds that stand in a spec",
    "ENTRIES": "entries of any other list or mapping",
    "NAME_LENGTH": "characters of a name",
    "LINE_LENGTH": "characters of a line of text",
    "TEXT_LENGTH": "characters of a text",
    "ORDER": "order, and terms",
    "CORRECTIONS": "corrections of the modified Hamiltonian",
    "OPERATIONS": "operations of one function of the generated code",
    "PRODUCT_TERMS": "terms of a product of polynomials",
    "PRODUCT_BYTES": "memory of such a product, in bytes",
    "TAYLOR_BYTES": "memory of all products of a series, in bytes",
    "SERIES_TERMS": "terms of one S_i",
    "PROOF_PRODUCTS": "products of terms in the proof of a bi-realisation",
    "STEPS": "steps of a run",
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
