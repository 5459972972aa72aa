"""The runtime of a solver in JavaScript: modules of `templates/js/runtime`, put together for one system.

They are JavaScript as they lie there. ``// #if NAME`` or ``// #if !NAME``, ``// #else`` and ``// #endif`` stand on
lines of their own, in comments of several lines after ``*``; ``// #state copied`` stands for what
`phigen.targets.state` lists; imports and exports are between the modules, and go.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from phigen import resources
from phigen.scheme.policies import Policy
from phigen.targets import state
from phigen.targets.policies import JAVASCRIPT

_IMPORT = re.compile(r'import .* from "\./(\w+)\.mjs";')
_DIRECTIVE = re.compile(r"\s*(?://|\*) #(if|else|endif)(?: (!?)(\w+))?")

#: The modules whose classes are exported by the result.
PUBLIC = ("errors", "solver", "lattice")


def assembled(modules: list[str], features: Mapping[str, bool], policies: Mapping[str, Policy]) -> str:
    """The modules, one after the other, as one text; before them the constants of the policies that they import."""
    lines = {name: _lines(name, features) for name in modules}
    imported = {found[1]: None for each in lines.values() for line in each if (found := _IMPORT.fullmatch(line))}
    constants = [JAVASCRIPT.text(policies[name]) for name in imported if name in policies]
    return "\n\n".join([*constants, *(_module(name, each) for name, each in lines.items())])


def _lines(name: str, features: Mapping[str, bool]) -> list[str]:
    path = resources.templates() / "js" / "runtime" / f"{name}.mjs"
    return resolved(path.read_text(encoding="utf-8"), features)


def _module(name: str, lines: list[str]) -> str:
    kept = [line for line in lines if not line.startswith("import ")]
    public = "export class" if name in PUBLIC else "\n"
    text = "\n".join(line if line.startswith(public) else line.removeprefix("export ") for line in kept)
    return re.sub(r"\n{3,}", "\n\n", text).strip("\n")


def resolved(text: str, features: Mapping[str, bool]) -> list[str]:
    """The lines that the features ask for. KeyError for a feature that is not told."""
    lines, open_ = list[str](), [True]
    for line in text.splitlines():
        found = _DIRECTIVE.fullmatch(line)
        if line.strip() == "// #state copied":
            indent = line[: line.index("/")]
            lines += [indent + statement for statement in state.copied(features)]
        elif not found:
            if all(open_):
                lines.append(line)
        elif found[1] == "if":
            open_.append(features[found[3]] != bool(found[2]))
        elif found[1] == "else":
            open_.append(not open_.pop())
        else:
            open_.pop()
    return lines
