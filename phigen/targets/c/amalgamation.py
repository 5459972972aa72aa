"""Assembly of the C runtime for one solver.

The files of ``templates/c/runtime`` are valid C99, with the prefix ``phi_``. They contain switches and sizes
(``PHI_BLOCKS``, ``PHI_DIM``), whose values depend on the solver. This module processes these files as a preprocessor
would: it resolves ``#include "…"``, ``#if`` on switches, include guards, and phrases (`phigen.targets.c.phrases`). It
also removes static functions that nothing calls (`phigen.targets.c.unused`). All other directives remain.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from phigen import resources
from phigen.targets.c import phrases, states
from phigen.targets.c.files import calls_left_out, left_out
from phigen.targets.c.macros import Macros
from phigen.targets.c.real import DOUBLE, Real
from phigen.targets.c.tokens import lines_with
from phigen.targets.c.unused import without_unused
from phigen.targets.features import holds

#: Names of the phrases, which this module replaces by their texts.
_PHRASES = phrases.names()
_PREFIX = re.compile(r"\b(?:phi|PHI)_")


@dataclass
class Amalgam:
    """Assembler of the C code of one solver.

    ``switches`` are the features of the solver, and ``printed`` are the files that were printed for it, by name.
    ``real`` is the floating-point type of the code. ``headers`` collects the headers of the C library that are
    included.
    """

    name: str
    switches: Mapping[str, bool]
    printed: Mapping[str, str]
    real: Real = DOUBLE
    headers: set[str] = field(default_factory=set)
    _defined: set[str] = field(default_factory=set)
    _macros: Macros = field(default_factory=Macros)

    def __post_init__(self) -> None:
        self._defined |= set(self.left_out.values())
        self._not_called = re.compile(rf" +((if|for) \(.*\) )?({'|'.join(calls_left_out(self.switches))})\(.*\);$")
        for definition in phrases.definitions(self.switches):
            self._macros.define(self.real.spelt(definition))

    @property
    def left_out(self) -> dict[str, str]:
        """The files of the runtime that the solver does not include, each with its include guard."""
        return left_out(self.switches)

    def text(self, file: str, spelt: Callable[[Sequence[str]], Sequence[str]] = lambda lines: lines) -> str:
        """Return the text of a file. Files that it includes are inserted, except files that were included
        before.

        ``spelt`` translates all lines to another dialect of C.
        """
        return _spaced(spelt(without_unused(self._expanded(file), f"{self.name}_")))

    def texts(self, header: str, code: str) -> tuple[str, str]:
        """Return the text of a header, and the text of a source that includes the header; see `text`."""
        lines = [*self._expanded(header), _BEHIND, *self._expanded(code)]
        used = without_unused(lines, f"{self.name}_")
        border = used.index(_BEHIND)
        return _spaced(used[:border]), _spaced(used[border + 1 :])

    def _expanded(self, file: str) -> list[str]:
        if file in self.printed:
            done = file in self._defined
            self._defined.add(file)
            return [] if done else ["", *self._printed(self.printed[file].splitlines()), ""]
        lines: list[str] = []
        pending: list[str] = []
        for line in self._selected((resources.templates() / "c/runtime" / file).read_text(encoding="utf-8")):
            if not line.startswith("#include "):
                pending.append(line)
            elif line.startswith('#include "state_'):
                pending += states.part(line.split('"')[1], self.switches)
            elif line.startswith("#include <"):
                self.headers.add(line)
            elif line != '#include "phrases.h"':
                lines += [*self._own(pending), *self._expanded(line.split('"')[1])]
                pending = []
        return [*lines, *self._own(pending)]

    def _selected(self, text: str) -> list[str]:
        """Return the lines of a text that the ``#if`` conditions on switches select."""
        chosen: list[str] = []
        # An entry for each open #if: whether its current branch is selected, whether a branch was selected so far, and
        # whether the condition is on a switch.
        frames: list[list[bool]] = []
        selected = True  # whether the current branches of all open #if are selected
        for line in text.splitlines():
            if not line.startswith("#"):
                chosen += [line] * selected
                continue
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
                self._defined |= {condition} if selected else set()
            else:
                keep = True
            selected = all(frame[0] for frame in frames)
            chosen += [line] * (keep and selected)
        return chosen

    def _holds(self, condition: str) -> bool:
        return holds(condition.replace("PHI_", ""), self.switches)

    def _printed(self, lines: Sequence[str]) -> list[str]:
        """Return printed lines with phrases replaced by their texts. The lines were printed for this solver: they
        already have its number type and its names.
        """
        named = lines_with("\n".join(lines), _PHRASES)
        spelt_lines: list[str] = []
        for k, line in enumerate(lines):
            spelt_lines += map(self._prefixed, self._macros.expanded([line])) if k in named else [line]
        return spelt_lines

    def _typed(self, lines: Sequence[str]) -> list[str]:
        """Return lines that compute in double, rewritten for the number type of the solver."""
        return self.real.spelt("\n".join(lines)).split("\n") if lines else []

    def _prefixed(self, line: str) -> str:
        return _PREFIX.sub(f"{self.name}_", line)

    def _own(self, lines: Sequence[str]) -> list[str]:
        """Return lines of the runtime with macros expanded, and with the name of the solver in place of the prefix
        ``phi_``.
        """
        lines = [line for line in lines if not (line.endswith(");") and self._not_called.match(line))]
        expanded = self._macros.expanded(lines)
        return self._typed(self._prefixed("\n".join(expanded)).split("\n") if expanded else [])


#: Mark between header and source while they are processed as a single text.
_BEHIND = "/* */"


def _spaced(lines: Sequence[str]) -> str:
    """Return lines as text, with at most one blank line in succession, and with none after a title such as /* ----
    steps ---- */.
    """
    spaced: list[str] = []
    for line in lines:
        if line or (spaced and spaced[-1] and not spaced[-1].endswith(" ---- */")):
            spaced.append(line)
    return "\n".join(spaced).rstrip("\n") + "\n"
