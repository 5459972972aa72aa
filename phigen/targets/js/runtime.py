"""Assembly of the runtime of a solver in JavaScript from the modules in `templates/js/runtime`.

The modules are valid JavaScript. `phigen.targets.js.files` has the conditions for modules, and for calls of functions
that only some solvers have. Lines ``// #if NAME`` or ``// #if !NAME``, ``// #else`` and ``// #endif`` select parts of a
module; inside comments of several lines, ``*`` takes the place of ``//``. A line ``// #state NAME`` is replaced by
lines of `phigen.targets.js.state`, and ``// #members NAME`` by members of a class. Imports and exports between the
modules are removed.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from phigen import resources
from phigen.scheme.policies import Policy
from phigen.targets.js import state
from phigen.targets.js.files import HOOKS, MEMBERS, chosen
from phigen.targets.policies import JAVASCRIPT

_IMPORT = re.compile(r'import .* from "\./(\w+)\.mjs";')
_DIRECTIVE = re.compile(r"\s*(?://|\*) #(if|else|endif)(?: (!?)(\w+))?")

#: The modules whose exports remain in the assembled module.
PUBLIC = ("errors", "solver", "lattice")


def assembled(modules: list[str], features: Mapping[str, bool], policies: Mapping[str, Policy]) -> str:
    """Return the text of all modules. The text begins with groups of constants: those items of ``policies`` that the
    modules import.
    """
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
    """Return the lines of a text that remain when its conditions on ``features`` are evaluated. Raises `KeyError` for
    an unknown feature.
    """
    lines, open_ = list[str](), [True]
    for line in text.splitlines():
        directive = _DIRECTIVE.fullmatch(line)
        if not directive:
            if all(open_):
                lines += _included(line, features)
        elif directive[1] == "if":
            open_.append(features[directive[3]] != bool(directive[2]))
        elif directive[1] == "else":
            open_.append(not open_.pop())
        else:
            open_.pop()
    return lines


def _included(line: str, features: Mapping[str, bool]) -> list[str]:
    """Return the lines that replace a line of a module; [] for a call of a function that the solver does not have."""
    indent, word, name = _parts(line)
    if word == "#state":
        return [indent + statement for statement in state.part(name, features)]
    if word == "#members":
        return [*_members(name, features), ""] if name in chosen(MEMBERS, features) else []
    function, _, rest = line.strip().partition("(")
    return [] if function in HOOKS and rest.endswith(");") and not _is_chosen(function, features) else [line]


def _parts(line: str) -> tuple[str, str, str]:
    """Return the indentation of a directive and its two words; for other lines, return three empty texts.

    In a comment of several lines, the indentation includes the ``*`` at the beginning of the line.
    """
    words = line.split()
    indent = line[: len(line) - len(line.lstrip())]
    if len(words) == 3 and words[0] in ("//", "*") and words[1] in ("#state", "#members"):
        return indent + "* " * (words[0] == "*"), words[1], words[2]
    return "", "", ""


def _members(name: str, features: Mapping[str, bool]) -> list[str]:
    """Return the lines that module ``members_NAME`` contributes to the class Solver."""
    lines = _lines(f"members_{name}", features)
    begin = next(k for k, line in enumerate(lines) if line.startswith("export class "))
    return lines[begin + 1 : lines.index("}", begin)]


def _is_chosen(function: str, features: Mapping[str, bool]) -> bool:
    return function in chosen({function: HOOKS[function]}, features)
