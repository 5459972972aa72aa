"""The runtime in C, put together for one solver.

The files of ``templates/c/runtime`` are C99 as they lie there, with the prefix ``phi_`` and with switches and sizes
(``PHI_BLOCKS``, ``PHI_DIM``) that a model defines. What a reader of the output should not see is resolved here, as a
preprocessor would: ``#include "…"`` of these files, ``#if`` on switches, guards, and macros that files in ``macros``
define. All other directives stay.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from phigen import resources

_NAME = re.compile(r"\bPHI_\w+")
_DEFINITION = re.compile(r"#define (\w+)(?:\(([^)]*)\))?(?: (.*))?$")


@dataclass(frozen=True)
class Macro:
    """What ``text`` a name stands for; ``parameters`` are None where it is used without any."""

    parameters: tuple[str, ...] | None
    text: str

    def of(self, arguments: Sequence[str]) -> str:
        """The text for arguments; ValueError if they are too many or too few."""
        given = dict(zip(self.parameters or (), arguments, strict=True))
        return re.sub(r"\b\w+\b", lambda word: given.get(word[0], word[0]), self.text) if given else self.text


@dataclass
class Amalgam:
    """What is put together: ``switches`` by their names, ``printed`` files by theirs; ``headers`` of the library."""

    name: str
    switches: Mapping[str, bool]
    printed: Mapping[str, str]
    headers: set[str] = field(default_factory=set)
    _defined: set[str] = field(default_factory=set)
    _macros: dict[str, Macro] = field(default_factory=dict)

    def text(self, file: str) -> str:
        """The file with all that it includes and that was not included before."""
        text = re.sub(r"\n{3,}", "\n\n", "\n".join(self._expanded(file)))
        return re.sub(r"( ---- \*/\n)\n", r"\1", text).strip("\n") + "\n"

    def _expanded(self, file: str) -> list[str]:
        if file in self.printed:
            done = file in self._defined
            self._defined.add(file)
            return [] if done else ["", *self.printed[file].splitlines(), ""]
        lines: list[str] = []
        own: list[str] = []
        for line in self._selected((resources.templates() / "c/runtime" / file).read_text(encoding="utf-8")):
            if file.startswith("macros/"):
                self.define(line)
            elif line.startswith('#include "'):
                lines += [*self.own(own), *self._expanded(line.split('"')[1])]
                own = []
            elif line.startswith("#include <"):
                self.headers.add(line)
            else:
                own.append(line)
        return [*lines, *self.own(own)]

    def _selected(self, text: str) -> list[str]:
        """The lines that the switches choose."""
        chosen: list[str] = []
        frames: list[list[bool]] = []  # of each condition: whether it is chosen, was chosen before, is one of ours
        for line in text.splitlines():
            directive, _, condition = line.partition(" ")
            if directive in ("#if", "#ifdef", "#ifndef"):
                ours = "PHI_" in condition
                holds = not ours or (
                    condition not in self._defined if directive == "#ifndef" else self._holds(condition)
                )
                frames.append([holds, holds, ours])
                keep = not ours
            elif directive in ("#elif", "#else", "#endif"):
                frame = frames[-1]
                keep = not frame[2]
                if frame[2] and directive != "#endif":
                    frame[0] = not frame[1] and (directive == "#else" or self._holds(condition))
                    frame[1] = frame[1] or frame[0]
                elif directive == "#endif":
                    frames.pop()
            elif directive == "#define" and condition.startswith("PHI_FILE_"):
                keep = False
                if all(frame[0] for frame in frames):
                    self._defined.add(condition)
            else:
                keep = True
            if keep and all(frame[0] for frame in frames):
                chosen.append(line)
        return chosen

    def _holds(self, condition: str) -> bool:
        return any(all(self._switch(s) for s in part.split(" && ")) for part in condition.split(" || "))

    def _switch(self, text: str) -> bool:
        return self.switches[text.removeprefix("!").removeprefix("PHI_")] != text.startswith("!")

    def define(self, line: str) -> None:
        """Keep the macro, if the line defines one."""
        if found := _DEFINITION.match(line):
            self._macros[found[1]] = Macro(tuple(found[2].split(", ")) if found[2] else None, found[3] or "")

    def own(self, lines: Sequence[str]) -> list[str]:
        """Lines of the runtime with what macros stand for, and with the prefix of the solver."""
        nothing = [name for name, macro in self._macros.items() if macro == Macro(None, "")]
        kept = [self._expanded_line(line) for line in _without_heads(lines, nothing)]
        return [re.sub(r"\b(?:phi|PHI)_", f"{self.name}_", line) for line in kept]

    def _expanded_line(self, line: str) -> str:
        """The line with what macros stand for. A comma, or nothing, has no blank before it."""
        at = 0
        while found := _NAME.search(line, at):
            macro = self._macros.get(found[0])
            at = found.end()
            if macro is None:
                continue
            arguments, after = ([], at) if macro.parameters is None else _arguments(line, at)
            text, at = macro.of(arguments), found.start()
            before = line[:at].rstrip(" ") if text[:1] in ("", ",") else line[:at]
            line, at = before + text + line[after:], len(before)
        return line


def _arguments(line: str, at: int) -> tuple[list[str], int]:
    """The arguments of a macro in parentheses, and where these end; ValueError where the line has no such."""
    if line[at : at + 1] != "(":
        raise ValueError(f"a macro without its arguments: {line.strip()}")
    found, depth, begin = [], 0, at + 1
    for k in range(at, len(line)):
        depth += (line[k] in "([") - (line[k] in ")]")
        if depth == 0 or (depth == 1 and line[k] == ","):
            found.append(line[begin:k].strip())
            begin = k + 1
        if depth == 0:
            return found, k + 1
    raise ValueError(f"a macro whose arguments do not end on its line: {line.strip()}")


def _without_heads(lines: Sequence[str], heads: Sequence[str]) -> list[str]:
    """The lines without these heads of loops; what is below a head, in braces or not, is there by itself."""
    over = re.compile(rf"^( *)(?:{'|'.join(heads)})(?: (.*))?$") if heads else re.compile("(?!)")
    kept: list[str] = []
    ends: list[tuple[str, str]] = []  # of each loop that was struck out: its indentation, and the line that ends it
    for line in lines:
        while ends and ends[-1][1] == "" and not line.startswith(ends[-1][0] + " "):
            ends.pop()
        if ends and line == ends[-1][1]:
            ends.pop()
            continue
        shift = 4 * len(ends)
        found = over.match(line)
        if found is None:
            kept.append(line[shift:] if line.startswith(" " * shift) else line)
        elif found[2] in (None, "{"):
            ends.append((found[1], f"{found[1]}}}" if found[2] else ""))
        else:
            kept.append(f"{found[1]}{found[2]}"[shift:])
    return kept
