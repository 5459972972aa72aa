"""Printing of text under headings on terminals."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence

from phigen.cli.console import heading, out


def section(title: str, lines: Sequence[str]) -> None:
    """Print indented lines under a heading."""
    out("\n" + heading(title))
    for line in lines:
        out(f"  {line}")


def assignments(pairs: Sequence[tuple[str, str]]) -> list[str]:
    """Return lines ``name = value`` with aligned equals signs."""
    width = max((_width(name) for name, _ in pairs), default=0)
    return [f"{name}{' ' * (width - _width(name))} = {value}" for name, value in pairs]


def _width(name: str) -> int:
    """Return the number of columns that a name takes on a terminal; the tilde in H̃ is a character without width."""
    return sum(not unicodedata.combining(c) for c in name)
