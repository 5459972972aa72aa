"""The file ``left_out.txt`` in an output folder: names of specs that builds of whole folders leave out."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from pathlib import Path

from phigen.errors import Diagnostic, Location, SpecError
from phigen.reading import opened_text

FILE = "left_out.txt"
SPEC_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)


def names_left_out(directory: Path) -> dict[str, Location]:
    """Return the names in the list of an output folder, each with its location; {} if there is no list.

    The list has one name per line; ``#`` begins a comment. Raises `SpecError` for lines that are no names, and for
    names that occur twice.
    """
    path = directory / FILE
    if not path.exists():
        return {}
    with opened_text(path) as stream:
        try:
            lines = stream.read().splitlines()
        except UnicodeDecodeError:
            raise SpecError([Diagnostic(f"{path} is not a text in UTF-8")]) from None
    names: dict[str, Location] = {}
    errors = []
    for number, line in enumerate(lines, 1):
        name = line.split("#", 1)[0].strip()
        place = Location(number, line.find(name) + 1, str(path))
        if name and not SPEC_NAME.fullmatch(name):
            errors.append(Diagnostic(f"{name!r} is not the name of a spec", place, "write one name in each line", line))
        elif name in names:
            errors.append(Diagnostic(f"{name} is in line {names[name].line} already", place, "", line))
        elif name:
            names[name] = place
    if errors:
        raise SpecError(errors)
    return names


def unknown_names(places_by_name: Mapping[str, Location], specs: Collection[str]) -> list[str]:
    """Return a message for each name in ``left_out.txt`` that is not the name of a spec."""
    return [f"{place}: no spec has the name {name}" for name, place in places_by_name.items() if name not in specs]
