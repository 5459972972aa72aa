"""The runtime in C, put together for one solver.

The files of ``templates/c/runtime`` are C99 as they lie there, with the prefix ``phi_`` and with switches and sizes
(``PHI_BLOCKS``, ``PHI_DIM``) that a model defines. What a reader of the output should not see is resolved here, as a
preprocessor would: ``#include "…"`` of these files, ``#if`` on switches, guards, and phrases
(`phigen.targets.c.phrases`); so are static functions that nothing calls (`phigen.targets.c.unused`). All other
directives stay.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from phigen import resources
from phigen.targets.c import phrases, states
from phigen.targets.c.files import calls_left_out, holds, left_out
from phigen.targets.c.macros import Macros
from phigen.targets.c.unused import without_unused


@dataclass
class Amalgam:
    """What is put together: ``switches`` by their names, ``printed`` files by theirs; ``headers`` of the library."""

    name: str
    switches: Mapping[str, bool]
    printed: Mapping[str, str]
    headers: set[str] = field(default_factory=set)
    _defined: set[str] = field(default_factory=set)
    _macros: Macros = field(default_factory=Macros)

    def __post_init__(self) -> None:
        self._defined |= set(self.left_out.values())
        self._not_called = re.compile(rf" +({'|'.join(calls_left_out(self.switches))})\(.*\);$")
        for definition in phrases.definitions(self.switches):
            self._macros.define(definition)

    @property
    def left_out(self) -> dict[str, str]:
        """The files of the runtime that the solver lacks, with their include guards."""
        return left_out(self.switches)

    def text(self, file: str) -> str:
        """The file with all that it includes and that was not included before."""
        return _spaced(without_unused(self._expanded(file), f"{self.name}_"))

    def texts(self, header: str, code: str) -> tuple[str, str]:
        """The same of a header and the code behind it."""
        lines = [*self._expanded(header), _BEHIND, *self._expanded(code)]
        used = without_unused(lines, f"{self.name}_")
        border = used.index(_BEHIND)
        return _spaced(used[:border]), _spaced(used[border + 1 :])

    def _expanded(self, file: str) -> list[str]:
        if file in self.printed:
            done = file in self._defined
            self._defined.add(file)
            return [] if done else ["", *self.printed[file].splitlines(), ""]
        lines: list[str] = []
        own: list[str] = []
        for line in self._selected((resources.templates() / "c/runtime" / file).read_text(encoding="utf-8")):
            if line == '#include "phrases.h"':
                continue
            if line.startswith('#include "state_'):
                own += states.part(line.split('"')[1], self.switches)
                continue
            if line.startswith('#include "'):
                lines += [*self._own(own), *self._expanded(line.split('"')[1])]
                own = []
            elif line.startswith("#include <"):
                self.headers.add(line)
            else:
                own.append(line)
        return [*lines, *self._own(own)]

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
        return holds(condition.replace("PHI_", ""), self.switches)

    def _own(self, lines: Sequence[str]) -> list[str]:
        """Lines of the runtime with what macros stand for, and with the prefix of the solver."""
        lines = [line for line in lines if not self._not_called.match(line)]
        return [re.sub(r"\b(?:phi|PHI)_", f"{self.name}_", line) for line in self._macros.expanded(lines)]


#: What is between a header and code while both are looked at together.
_BEHIND = "/* */"


def _spaced(lines: Sequence[str]) -> str:
    """The lines with one blank line at most between two, and none behind the name of a chapter."""
    text = re.sub(r"\n{3,}", "\n\n", "\n".join(lines))
    return re.sub(r"( ---- \*/\n)\n", r"\1", text).strip("\n") + "\n"
