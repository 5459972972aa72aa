"""Spelling of JavaScript: formulas, line breaks, comments and names."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence

from phigen.spec.model import Parameter
from phigen.symbolic.functions import FUNCTIONS, written_in
from phigen.targets.header import plain, sentence
from phigen.targets.language import Language
from phigen.targets.reserved import JAVASCRIPT_RESERVED

#: Largest number of characters in a line.
WIDTH = 110

LANGUAGE = Language(
    reserved=JAVASCRIPT_RESERVED,
    functions={name: name for name in FUNCTIONS} | written_in("js"),
    constants={"pi": "Math.PI", "E": "Math.E"},
    whole=str,
)


def wrapped(statement: str, indent: str = "  ") -> list[str]:
    """Return a statement as lines of limited width. Lines are broken at any space, so the statement must not contain
    strings.
    """
    deeper = f"{indent}  " if not indent else f"{indent}    "
    return textwrap.wrap(statement, WIDTH, initial_indent=indent, subsequent_indent=deeper, break_long_words=False)


def camel(name: str) -> str:
    """Return the name of a kernel in camel case, as JavaScript writes names of functions."""
    return re.sub(r"_([a-z])", lambda match: match[1].upper(), name)


def comment(text: str) -> list[str]:
    """Return the lines of the comment that stands before a function."""
    said = plain(sentence(text))
    if len(said) <= WIDTH - 8:
        return [f"/** {said} */"]
    return ["/**", *textwrap.wrap(said, WIDTH, initial_indent=" * ", subsequent_indent=" * "), " */"]


def properties(parameters: Sequence[Parameter]) -> list[str]:
    """Return the lines of a JSDoc comment that describe parameters as properties of an object."""
    kinds = [("number" if p.at == "all" else "Float64Array", p) for p in parameters]
    return [f" * @property {{{kind}}} {p.name} {plain(p.description)}".rstrip() for kind, p in kinds]


def key(name: str) -> str:
    """Return the name of a parameter as a key in an object literal.

    ``__proto__`` is written as a computed key, since a plain key would set the prototype of the object.
    """
    return f'["{name}"]' if name == "__proto__" else name
