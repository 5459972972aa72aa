"""Measures what docs/safety.md says of generated C, and writes its tables: python docs/make_safety.py

Needs gcc, and cppcheck with its MISRA addon.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections import Counter
from pathlib import Path

from phigen import resources, spec
from phigen.compilation import Compilation
from phigen.compiler import compile_spec, emit
from phigen.runtime.stack import CallGraph, call_graph

PAGE = Path(__file__).resolve().parent / "safety.md"
#: The systems of the tables, one for each kind of step that microcontrollers are likely to make.
SYSTEMS = ("pendulum_euler", "pendulum", "henon_heiles", "rigid_body", "dzhanibekov", "predator_prey", "satellite")
#: Functions of libc and libm that generated C may call.
LIBRARY = {
    "acos", "asin", "atan", "atan2", "cbrt", "ceil", "cos", "cosh", "erf", "exp", "expm1", "fabs", "floor", "fmod",
    "frexp", "hypot", "ldexp", "log", "log1p", "memcmp", "memcpy", "memmove", "memset", "nearbyint", "pow", "rint",
    "round", "scalbn", "sin", "sincos", "sinh", "sqrt", "tan", "tanh", "trunc",
}  # fmt: skip
#: Flags of the measured stacks.
FLAGS = ("-O2", "-ffp-contract=off")


def small(name: str) -> Compilation:
    """The bundled system ``name`` in the profile for safety-related use."""
    return compile_spec(spec.load(resources.bundled()[name]).overridden(profile="certified"))


def stacks(compilation: Compilation) -> CallGraph:
    """The call graph of the C of a system, by gcc."""
    return call_graph(emit(compilation.program, "c", ""), compilation.spec.name, FLAGS)


def misra(compilation: Compilation) -> Counter[str]:
    """The number of places of the C of a system at which each rule of MISRA C:2012 is not kept, by cppcheck."""
    with tempfile.TemporaryDirectory() as scratch:
        folder, name = Path(scratch), compilation.spec.name
        for file, text in emit(compilation.program, "c", "").items():
            (folder / file).write_text(text, encoding="utf-8")
        command = ["cppcheck", "--addon=misra", "--std=c99", "-q", "--template={id}", f"{name}.c"]
        process = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    return Counter(re.findall(r"^misra-c2012-([\d.]+)$", process.stderr, re.M))


def row_of_bounds(name: str) -> str:
    """A row of the table of bounds: RAM, stack, and operations of one evaluation."""
    compilation = small(name)
    graph, operations = stacks(compilation), compilation.program.about.operations
    deepest = (graph.deepest(f"{name}_{function}") for function in ("init", "step"))
    counts = (operations[kind] for kind in ("additions", "multiplications", "divisions", "functions"))
    cells = (name, compilation.program.order, *deepest, *counts)
    return f"| {' | '.join(map(str, cells))} |"


def rows_of_rules() -> list[str]:
    """Rows of the table of rules: the number of places at which each is not kept, with its reason."""
    counts = misra(small("rigid_body"))
    return [
        f"| {rule} | {CATEGORIES[rule]} | {counts[rule]} | {REASONS[rule]} |"
        for rule in sorted(REASONS, key=lambda r: [int(part) for part in r.split(".")])
    ]


#: Rules of MISRA C:2012 that generated C does not keep everywhere, with the reasons.
REASONS = {
    "2.4": "structs are named by typedefs, and their tags are not used, so that no tag can clash with a name",
    "2.5": "macros that say orders, versions and checksums are for the code that includes the header",
    "8.7": "functions of the interface are called by the code that uses the solver",
    "9.3": "`{0}` sets all of an array to zero",
    "10.3": "results of comparisons are stored as int, and counts of members are converted to size_t",
    "10.4": "a size_t is compared with an enumeration constant",
    "10.8": "a count of steps becomes a double, exact below 2⁵³",
    "12.3": "several variables are declared in one line where they belong together",
    "13.3": "one loop runs backwards over coefficients, and decrements its index inside a subscript",
    "15.5": "functions return early if an argument is not valid",
    "17.8": "functions change arguments: NULL becomes the address of the defaults, and counts are counted down",
    "18.4": "an address in a table of quaternions is computed with +",
}
CATEGORIES = dict.fromkeys(REASONS, "required") | dict.fromkeys(
    ("2.4", "2.5", "8.7", "12.3", "13.3", "15.5", "17.8", "18.4"), "advisory"
)


def with_table(page: str, name: str, rows: list[str]) -> str:
    """The page with the body of a table, which stands between two comments."""
    begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
    before, after = page.split(begin)[0], page.split(end)[1]
    head = page.split(begin)[1].split(end)[0].strip().splitlines()[:2]
    return before + "\n".join([begin, "", *head, *rows, "", end]) + after


def main() -> None:
    """Measure all and write the tables."""
    page = PAGE.read_text(encoding="utf-8")
    page = with_table(page, "bounds", [row_of_bounds(name) for name in SYSTEMS])
    PAGE.write_text(with_table(page, "rules", rows_of_rules()), encoding="utf-8")


if __name__ == "__main__":
    main()
