"""Measures of the architecture that must not grow: cycles of imports, lines of conditions in the runtimes, tests on the
kind of a step.
"""

import ast
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from syntax_trees import parsed

from phigen import resources

ROOT = Path(__file__).resolve().parents[1]

#: Number of modules in the largest cycle of imports; imports inside functions count. Names in tables
#: (`phigen.registry`, `phigen.display`), whose modules are imported on demand, do not count.
LARGEST_CIRCLE = 2

#: Rooms (packages and modules of phigen) from the lowest to the highest: each imports only rooms before it.
ORDER = [
    "_version",
    "progress",
    "interrupts",
    "errors",
    "display",
    "memory",
    "reading",
    "writing",
    "packages",
    "resources",
    "registry",
    "symbolic",
    "spec",
    "geometry",
    "realisations",
    "splitting",
    "attitude",
    "gauss",
    "series",
    "scheme",
    "lattice",
    "lanes",
    "ir",
    "targets",
    "compilation",
    "runtime",
    "notation",
    "proofs",
    "compiler",
    "api",
    "study",
    "sweeping",
    "drawing",
    "initial_value",
    "tuning",
    "certify",
    "bindings",
    "fmu",
    "report",
    "paper",
    "jax",
    "torch",
    "mpi",
    "cli",
    "__main__",
]

#: Largest share of lines with preprocessor conditions among the non-blank lines of the C runtime, in percent.
CONDITIONS = 7.8

#: Largest share of lines ``// #if``, ``// #else`` and ``// #endif`` in the JavaScript runtime, in percent.
JAVASCRIPT_CONDITIONS = 2.8

#: Modules of targets that may use regular expressions, each with the text that they read. Passes over C read tokens
#: instead.
REGULAR_EXPRESSIONS = {
    "phigen/targets/names.py": "names of the spec, for identifiers",
    "phigen/targets/reserved.py": "names of the spec, for identifiers",
    "phigen/targets/spelling.py": "patterns of functions and names of the loop IR",
    "phigen/targets/header.py": "descriptions in specs; files of users, for their checksum",
    "phigen/targets/c/language.py": "names of the spec, for identifiers",
    "phigen/targets/c/tokens.py": "the text of the runtime and of printed parts: the lexer of C",
    "phigen/targets/c/macros.py": "lines of the runtime that name phrases",
    "phigen/targets/c/amalgamation.py": "lines of the runtime that call hooks, and its prefix",
    "phigen/targets/c/layout.py": "lines of finished C, where they may be broken",
    "phigen/targets/c/lattice/loops.py": "descriptions of kernels, for their comments",
    "phigen/targets/js/printing.py": "names of kernels and arrays, for identifiers",
    "phigen/targets/js/runtime.py": "lines of the runtime that include or import",
}

#: Largest number of modules with the same name. Modules of different targets count as one, since each target may have a
#: module of this name.
LARGEST_NAMESAKES = 3

#: Largest number of places where code asks for the kind of a step or of a compilation: ``isinstance``, class patterns,
#: comparisons of kinds or of their names. Code should read the record of the kind, an entry in a table, or a method
#: instead.
KIND_TESTS = 0

#: Classes of steps and compilations, by the modules that define them; tests on these classes are counted.
KINDS = {
    "phigen.scheme.steps": {"Newton", "Explicit", "Path", "Gauss", "Splitting", "Sweeps"},
    "phigen.scheme.step_kinds": {"NEWTON", "EXPLICIT", "PATH", "GAUSS", "SPLITTING", "SWEEPS"},
    "phigen.compilation": {"CompiledSeries", "CompiledSplitting", "CompiledGauss", "CompiledLattice"},
    "phigen.lattice.series": {"SeriesPlan"},
    "phigen.lattice.sweep_plans": {"SplittingPlan"},
}


@cache
def imports() -> dict[str, set[str]]:
    """Return the modules of phigen that each module imports. Imports inside functions count; imports for annotations
    alone do not.
    """
    files = {".".join(p.relative_to(ROOT).with_suffix("").parts): p for p in sorted((ROOT / "phigen").rglob("*.py"))}
    files = {name.removesuffix(".__init__"): path for name, path in files.items()}
    graph = {}
    for name, path in files.items():
        modules = set()
        for node in executed(parsed(path)):
            if isinstance(node, ast.Import):
                modules |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                members = {f"{node.module}.{alias.name}" for alias in node.names}
                modules |= members & files.keys() or {node.module}
                modules |= {node.module} if members - files.keys() else set()
        graph[name] = (modules & files.keys()) - {name}
    return graph


def executed(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes of a syntax tree, except those under ``if TYPE_CHECKING``."""
    for node in ast.iter_child_nodes(tree):
        if not (isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"):
            yield node
            yield from executed(node)


def upward_imports() -> list[str]:
    """Return the imports of modules from rooms above their own, as "MODULE imports MODULE"."""
    level = {room: k for k, room in enumerate(ORDER)}

    def height(module: str) -> int:
        return level[module.split(".")[1]] if "." in module else len(ORDER)

    pairs = [(name, other) for name, others in imports().items() for other in sorted(others)]
    return [f"{name} imports {other}" for name, other in pairs if height(other) > height(name)]


def circles(graph: dict[str, set[str]]) -> list[set[str]]:
    """Return the strongly connected components with more than one module, the largest first."""
    reached = {name: reachable(graph, name) for name in graph}
    components = {frozenset(o for o in reached[name] if name in reached[o]) for name in graph}
    return sorted((set(c) for c in components if len(c) > 1), key=len, reverse=True)


def reachable(graph: dict[str, set[str]], start: str) -> set[str]:
    """Return the modules that a module imports directly or indirectly, and the module itself."""
    seen, open_ = {start}, [start]
    while open_:
        for other in graph[open_.pop()] - seen:
            seen.add(other)
            open_.append(other)
    return seen


def conditions() -> tuple[int, int]:
    """Return the number of lines with preprocessor conditions in the C runtime, without include guards, and that of all
    non-blank lines.
    """
    counted = total = 0
    for file in (resources.templates() / "c/runtime").glob("*.[ch]"):
        lines = [line for line in file.read_text(encoding="utf-8").splitlines() if line.strip()]
        total += len(lines)
        counted += sum(1 for line in lines if re.match(r"#\s*(if|el|endif)", line))
        counted -= 2 * sum(1 for line in lines if line.startswith("#ifndef PHI_FILE_"))
    return counted, total


def javascript_conditions() -> tuple[int, int]:
    """Return the number of lines with conditions in the JavaScript runtime, and that of all non-blank lines."""
    files = (resources.templates() / "js/runtime").glob("*.mjs")
    lines = [line for f in files for line in f.read_text(encoding="utf-8").splitlines() if line.strip()]
    return sum(1 for line in lines if re.match(r"\s*(//|\*) #(if|else|endif)", line)), len(lines)


def kind_tests(tree: ast.AST) -> list[int]:
    """Return the numbers of the lines of a module that test the kind of a step, a plan, or a compilation."""
    imported = (node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module in KINDS)
    kinds = {a.asname or a.name for node in imported for a in node.names if a.name in KINDS[node.module or ""]}
    asked = list[int]()
    for node in ast.walk(tree):
        is_call = isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "isinstance"
        is_comparison = isinstance(node, ast.Compare) and not isinstance(node.ops[0], ast.In | ast.NotIn)
        listed = node.args[1:] if is_call else [node.cls] if isinstance(node, ast.MatchClass) else []
        listed = [node.left, *node.comparators] if is_comparison else listed
        named = [{ast.unparse(n) for n in ast.walk(part) if isinstance(n, ast.Name | ast.Attribute)} for part in listed]
        if any(kinds & names or any(n.endswith("kind.name") for n in names) for names in named):
            asked.append(node.lineno)
    return asked


def all_kind_tests() -> dict[str, list[int]]:
    """Return the lines that test the kind of a step, a plan or a compilation, for each module of phigen with such a
    line.
    """
    files = sorted((ROOT / "phigen").rglob("*.py"))
    asked = {str(p.relative_to(ROOT)): kind_tests(parsed(p)) for p in files}
    return {name: lines for name, lines in asked.items() if lines}


def test_circles_of_imports_do_not_grow():
    (largest, *_) = circles(imports())
    assert len(largest) <= LARGEST_CIRCLE, sorted(largest)


def test_rooms_import_those_below_them():
    """A room imports only lower rooms, inside functions too."""
    assert not upward_imports()


def test_conditions_in_the_runtime_do_not_grow():
    counted, total = conditions()
    assert 100.0 * counted / total <= CONDITIONS


def test_conditions_in_the_runtime_in_javascript_do_not_grow():
    counted, total = javascript_conditions()
    assert 0 < 100.0 * counted / total <= JAVASCRIPT_CONDITIONS


def test_regular_expressions_read_what_is_listed():
    """Only the modules in `REGULAR_EXPRESSIONS` import ``re``, so no other module edits generated text by regular
    expressions.
    """
    files = [path for room in ("targets", "ir", "lanes") for path in sorted((ROOT / "phigen" / room).rglob("*.py"))]
    users = {str(p.relative_to(ROOT)) for p in files if re.search(r"^import re$", p.read_text("utf-8"), re.MULTILINE)}
    assert users == REGULAR_EXPRESSIONS.keys()


def shared_names() -> Counter[str]:
    """Return the names that two or more modules have, each with the number of these modules. Modules of different
    targets with the same name count as one.
    """
    files = (p for p in (ROOT / "phigen").rglob("*.py") if p.name != "__init__.py")
    rooms = {(p.stem, "targets" if "targets" in p.parts else p.parent) for p in files}
    return Counter({name: n for name, n in Counter(name for name, _ in rooms).items() if n > 1})


def test_names_of_modules_are_shared_by_few():
    assert max(shared_names().values()) <= LARGEST_NAMESAKES, shared_names()


def test_circles_are_found():
    graph = {"a": {"b"}, "b": {"c"}, "c": {"a", "d"}, "d": set()}
    assert circles(graph) == [{"a", "b", "c"}]


def test_tests_on_kinds_do_not_grow():
    asked = all_kind_tests()
    assert sum(map(len, asked.values())) <= KIND_TESTS, asked


def test_tests_on_kinds_are_found():
    source = """
from phigen.scheme.steps import Newton, Path as Traced, Sweep
def f(step):
    if isinstance(step, Newton | Traced) or isinstance(step, Sweep):
        return 1
    match step:
        case Traced(recurrences=r):
            return r
        case Sweep():
            return 2
    if step.kind.name == "newton":
        return 3
"""
    assert sorted(kind_tests(ast.parse(source))) == [4, 7, 11]


if __name__ == "__main__":
    print([len(circle) for circle in circles(imports())], "modules in circles")
    print(len(upward_imports()), "imports from higher rooms")
    print(shared_names().total(), "modules whose name another module has")
    print(sum(map(len, all_kind_tests().values())), "tests on kinds of steps and compilations")
    print("{} of {} lines of the runtime in C are conditions".format(*conditions()))
    print("{} of {} lines of the runtime in JavaScript are conditions".format(*javascript_conditions()))
