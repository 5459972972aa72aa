"""Text under headings, for a terminal."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence

from phigen.cli.console import heading, out


def section(title: str, lines: Sequence[str]) -> None:
    """Indented lines under a heading."""
    out("\n" + heading(title))
    for line in lines:
        out(f"  {line}")


def assignments(pairs: Sequence[tuple[str, str]]) -> list[str]:
    """Lines ``name = value``, the signs below one another."""
    width = max((_width(name) for name, _ in pairs), default=0)
    return [f"{name}{' ' * (width - _width(name))} = {value}" for name, value in pairs]


def _width(name: str) -> int:
    """Columns on a terminal: the tilde of H̃ takes none."""
    return sum(not unicodedata.combining(c) for c in name)
