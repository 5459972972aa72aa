"""Generated NumPy modules define nothing that neither they nor the runtime read."""

import ast
import re

import pytest

from phigen import resources

ROOT = resources.bundled_specs().parent
#: Constants for users of a module.
PUBLIC = {"VERSION", "SPEC_SHA256", "ORDER", "COORDINATES", "CASIMIRS"}


@pytest.mark.parametrize("path", sorted(ROOT.glob("generated/*/*.py")), ids=lambda path: path.stem)
def test_each_private_function_and_constant_of_a_numpy_module_is_used(path):
    text = path.read_text(encoding="utf-8")
    body = ast.parse(text).body
    functions = {node.name for node in body if isinstance(node, ast.FunctionDef) and node.name.startswith("_")}
    constants = {name.id for node in body if isinstance(node, ast.Assign) for name in node.targets} - PUBLIC
    runtime = "\n".join(file.read_text(encoding="utf-8") for file in ROOT.glob("phigen/runtime/*.py"))
    assert functions
    assert constants
    read_once = {name for name in functions | constants if len(re.findall(rf"\b{name}\b", text)) == 1}
    assert {name for name in read_once if not re.search(rf"\b{name}\b", runtime)} == set()
