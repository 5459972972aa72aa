"""The language rules of CONTRIBUTING that a machine can check, in the whole package."""

import ast
import re
from itertools import pairwise
from pathlib import Path

import pytest
from syntax_trees import parsed

ROOT = Path(__file__).resolve().parent.parent

#: The packages of phigen (rooms), and its modules outside packages.
ROOMS = sorted(
    path.name for path in (ROOT / "phigen").iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()
)
#: Forbidden names of variables and arguments: they do not say what the value is. Fields of records are not checked.
EMPTY_NAMES = {"found", "given", "kept", "made", "own", "taken", "told", "wanted"}
#: Forbidden first words of docstrings: a sentence that begins with one of them names its object last, or not at all.
INVERTED = ("How", "Of", "That", "What", "Whatever")


def _stored(node: ast.AST) -> str | None:
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        return node.id
    return node.arg if isinstance(node, ast.arg) else None


def empty_names(tree: ast.Module) -> list[str]:
    """Return the variables and arguments of a module with forbidden names, each with its line."""
    fields = {
        id(line.target)
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
        for line in node.body
        if isinstance(line, ast.AnnAssign)
    }
    return [
        f"{node.lineno}: {name}"  # type: ignore[attr-defined]
        for node in ast.walk(tree)
        if id(node) not in fields and (name := _stored(node)) in EMPTY_NAMES
    ]


def breaches(tree: ast.Module) -> list[str]:
    """Return the names and docstrings of a module that break the rules, each with its line."""
    listed = empty_names(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            words = (ast.get_docstring(node) or "").split()
            if words and words[0] in INVERTED:
                listed.append(f"{getattr(node, 'lineno', 1)}: {' '.join(words[:6])} …")
    return listed


@pytest.mark.parametrize("room", ROOMS)
def test_rooms_keep_the_rules(room: str) -> None:
    place = ROOT / "phigen" / room
    files = [place] if place.suffix else sorted(place.rglob("*.py"))
    assert files
    assert {str(f): b for f in files if (b := breaches(parsed(f)))} == {}


def test_variables_of_tests_name_their_content() -> None:
    trees = {file: ast.parse(file.read_text(encoding="utf-8")) for file in (ROOT / "tests").rglob("*.py")}
    assert len(trees) > 200
    assert {str(file): names for file, tree in trees.items() if (names := empty_names(tree))} == {}


def test_breaches_are_seen() -> None:
    source = (
        '"""What a module has."""\ndef f(given):\n    """Of it."""\n    for found in given:\n        kept = found\n'
    )
    source += 'class C:\n    """A record."""\n    made: int\n'
    listed = breaches(ast.parse(source))
    assert [line.partition(" ")[2] for line in listed] == ["given", "found", "kept", "What a module has. …", "Of it. …"]


#: Class names that two modules may share. All other class names occur once, so that a name in an error message
#: identifies the class.
SHARED_CLASS_NAMES = {"Constant", "Function"}


def test_class_names_occur_once() -> None:
    files = sorted((ROOT / "phigen").rglob("*.py"))
    names = [node.name for f in files for node in ast.walk(parsed(f)) if isinstance(node, ast.ClassDef)]
    assert {name for name in names if names.count(name) > 1} <= SHARED_CLASS_NAMES


#: Words that may occur twice in a row in comments, such as ``long long`` for the C type.
REPEATED = {"steps", "planes", "long"}


def test_no_comment_of_generated_code_repeats_a_word() -> None:
    files = [f for f in (ROOT / "generated").rglob("*") if f.suffix in {".c", ".h", ".js", ".mjs"}]
    files += (ROOT / "tests" / "golden").glob("*.txt")
    assert len(files) > 40
    repeated = {
        f"{f.name}: {pair[0]}"
        for f in files
        for pair in re.finditer(r"(?<![\w.$-])([A-Za-z]{3,})(?: |\n   )\1(?![\w.$(-])", f.read_text(encoding="utf-8"))
        if pair[1] not in REPEATED
    }
    assert repeated == set()


def _interrupted_paragraphs(page: str) -> list[str]:
    """Return the lines inside paragraphs of a page that Markdown would take for list items, such as ``+ b = c``."""
    text = re.sub(r"```.*?```", "", page, flags=re.DOTALL)
    lines = text.splitlines()
    item, paragraph = re.compile(r"\s*(?:\d+\.|[-*+]) "), re.compile(r"[^\s#|*+-].*[^:.]$")
    return [b for a, b in pairwise(lines) if item.match(b) and paragraph.match(a) and not item.match(a)]


def test_no_line_of_a_paragraph_begins_like_an_item_of_a_list() -> None:
    assert _interrupted_paragraphs("The sum is a\n+ b here.\n\n1. A step\n2. Another\n\nThese:\n- one\n") == [
        "+ b here."
    ]
    pages = [*(ROOT / "docs").glob("*.md"), *ROOT.glob("*.md")]
    assert len(pages) > 20
    assert {
        f"{p.name}: {line}" for p in pages for line in _interrupted_paragraphs(p.read_text(encoding="utf-8"))
    } == set()
