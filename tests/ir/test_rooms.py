"""The packages of the loop IR (the intermediate representation of generated code) and of the targets import only the
modules that they may import.
"""

import ast
from pathlib import Path

import pytest

import phigen

ROOMS = {"ir": ("phigen.targets", "phigen.lattice", "phigen.runtime"), "targets": ("phigen.lattice", "phigen.runtime")}


@pytest.mark.parametrize("room", ROOMS)
def test_rooms_import_nothing_above_them(room: str) -> None:
    for file in Path(phigen.__file__).with_name(room).rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                assert not node.module.startswith(ROOMS[room]), f"{file}: {node.module}"
