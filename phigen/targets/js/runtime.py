"""The runtime of a solver in JavaScript, assembled from the modules of `templates/js/runtime` for one system.

The modules are valid JavaScript. Lines ``// #if NAME`` or ``// #if !NAME``, ``// #else`` and ``// #endif`` include
parts; in comments of several lines ``*`` replaces ``//``. ``// #state copied`` is replaced by the statements of
`phigen.targets.state`. Imports and exports between the modules are removed.
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
    """Return the modules as one text, after the constants of the policies that they import."""
    lines = {name: _lines(name, features) for name in modules}
    imported = {match[1]: None for each in lines.values() for line in each if (match := _IMPORT.fullmatch(line))}
    constants = [JAVASCRIPT.text(policies[name]) for name in imported if name in policies]
    return "\n\n".join([*constants, *(_module(name, each) for name, each in lines.items())])


def _lines(name: str, features: Mapping[str, bool]) -> list[str]:
    path = resources.templates() / "js" / "runtime" / f"{name}.mjs"
    return resolved(path.read_text(encoding="utf-8"), features)


def _module(name: str, lines: list[str]) -> str:
    code = [line for line in lines if not line.startswith("import ")]
    public = "export class" if name in PUBLIC else "\n"
    text = "\n".join(line if line.startswith(public) else line.removeprefix("export ") for line in code)
    return re.sub(r"\n{3,}", "\n\n", text).strip("\n")


def resolved(text: str, features: Mapping[str, bool]) -> list[str]:
    """Return the lines of a text that remain for the given features. Raises `KeyError` for an unknown feature."""
    lines, open_ = list[str](), [True]
    for line in text.splitlines():
        directive = _DIRECTIVE.fullmatch(line)
        if line.strip() == "// #state copied":
            indent = line[: line.index("/")]
            lines += [indent + statement for statement in state.copied(features)]
        elif not directive:
            if all(open_):
                lines.append(line)
        elif directive[1] == "if":
            open_.append(features[directive[3]] != bool(directive[2]))
        elif directive[1] == "else":
            open_.append(not open_.pop())
        else:
            open_.pop()
    return lines
