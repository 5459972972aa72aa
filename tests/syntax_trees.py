"""Syntax trees of Python modules, each parsed once."""

import ast
from functools import cache
from pathlib import Path


@cache
def parsed(path: Path) -> ast.Module:
    """Return the syntax tree of the Python module in a file; each file is parsed once."""
    return ast.parse(path.read_text(encoding="utf-8"))
