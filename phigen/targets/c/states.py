"""Files that the C runtime includes: members of structs, and statements that copy, restore or reset these
members.

The texts come from lists of `StateBlock` in `phigen.targets.state`, `phigen.targets.c.row_state` and
`phigen.targets.c.structs`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from phigen.targets.c import structs
from phigen.targets.c.row_state import LATTICE, ROW
from phigen.targets.state import STATE, StateBlock, belongs


@dataclass(frozen=True)
class Part:
    """File that the runtime includes. It consists of the texts ``lines(block)`` of all ``blocks``, indented by
    ``indent`` spaces.
    """

    blocks: Sequence[StateBlock]
    indent: int
    lines: Callable[[StateBlock], Iterator[str]]


def _members(block: StateBlock) -> Iterator[str]:
    return iter(block.members)


def _reset(block: StateBlock) -> Iterator[str]:
    return iter(block.reset)


PARTS = {
    "state_members.h": Part(STATE, 4, _members),
    "state_saved.h": Part(STATE, 4, StateBlock.save),
    "state_restored.h": Part(STATE, 8, StateBlock.restore),
    "state_reset.h": Part(STATE, 8, _reset),
    "state_of_lattice.h": Part(LATTICE, 4, _members),
    "state_placed.h": Part(LATTICE, 4, _reset),
    "state_of_row.h": Part(ROW, 4, _members),
    "state_row_begun.h": Part(ROW, 4, _reset),
    "state_of_table.h": Part(structs.TABLE, 4, _members),
    "state_of_model.h": Part(structs.MODEL, 4, _members),
    "state_of_members.h": Part(structs.MEMBERS, 4, _members),
    "state_of_cotangent.h": Part(structs.COTANGENT, 4, _members),
    "state_of_pulled.h": Part(structs.PULLED, 4, _members),
    "state_of_back_group.h": Part(structs.BACK_GROUP, 4, _members),
    "state_of_transpose.h": Part(structs.TRANSPOSE, 4, _members),
    "state_of_flow.h": Part(structs.FLOW, 4, _members),
    "state_of_traced.h": Part(structs.TRACED, 4, _members),
}


def part(file: str, switches: Mapping[str, bool]) -> list[str]:
    """Return the lines of one of the files in `PARTS`, for a solver with these switches."""
    lines = PARTS[file]
    return [" " * lines.indent + line for b in lines.blocks if belongs(b, switches) for line in lines.lines(b)]


def header(file: str) -> str:
    """Return one of the files in `PARTS` with ``#if`` conditions, so that the runtime compiles without a generated
    solver.
    """
    lines = PARTS[file]
    text_lines = []
    for block in lines.blocks:
        text = [" " * lines.indent + line for line in lines.lines(block)]
        condition = " ".join(f"PHI_{w}" if w.isupper() else w for w in block.when.replace("!", "! ").split())
        text_lines += [f"#if {condition}", *text, "#endif"] if text and condition else text
    return "\n".join(text_lines)
