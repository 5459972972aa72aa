"""The runtime of a solver in JavaScript: modules of `templates/js/runtime`, put together for one system.

They are JavaScript as they lie there. ``// #if NAME`` or ``// #if !NAME``, ``// #else`` and ``// #endif`` stand on
lines of their own, in comments of several lines after ``*``; imports and exports are between the modules, and go.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from phigen import resources

_DIRECTIVE = re.compile(r"\s*(?://|\*) #(if|else|endif)(?: (!?)(\w+))?")

#: The modules whose classes are exported by the result.
PUBLIC = ("errors", "solver", "lattice")


def assembled(modules: list[str], features: Mapping[str, bool]) -> str:
    """The modules, one after the other, as one text."""
    return "\n\n".join(_module(name, features) for name in modules)


def _module(name: str, features: Mapping[str, bool]) -> str:
    path = resources.templates() / "js" / "runtime" / f"{name}.mjs"
    lines = resolved(path.read_text(encoding="utf-8"), features)
    kept = [line for line in lines if not line.startswith("import ")]
    public = "export class" if name in PUBLIC else "\n"
    text = "\n".join(line if line.startswith(public) else line.removeprefix("export ") for line in kept)
    return re.sub(r"\n{3,}", "\n\n", text).strip("\n")


def resolved(text: str, features: Mapping[str, bool]) -> list[str]:
    """The lines that the features ask for. KeyError for a feature that is not told."""
    lines, open_ = list[str](), [True]
    for line in text.splitlines():
        found = _DIRECTIVE.fullmatch(line)
        if not found:
            if all(open_):
                lines.append(line)
        elif found[1] == "if":
            open_.append(features[found[3]] != bool(found[2]))
        elif found[1] == "else":
            open_.append(not open_.pop())
        else:
            open_.pop()
    return lines
