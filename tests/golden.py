"""Golden files: the generated solvers of a few systems of the corpus and, for each other system, the paragraphs of its
generated files that those few solvers lack.

generated/ holds the solvers of all systems that generated/left_out.txt does not list, as `phigen build specs` writes
them. For each system in that list, tests/golden/NAME.txt holds the paragraphs that no solver in generated/ has, mostly
the functions printed for the model. So a change of the runtime changes few golden files. tests/golden/calls.txt lists
the functions, each with the systems whose solvers call it.

`python tests/golden.py` writes all golden files, and `python tests/golden.py --check` lists those that are out of date.
"""

from __future__ import annotations

import re
import sys
import textwrap
from collections.abc import Collection, Iterable, Mapping
from functools import cache
from pathlib import Path

from solvers import files
from systems import as_given

from phigen import resources
from phigen.cli.left_out import names_left_out
from phigen.targets.header import CHECKSUM

ROOT = resources.bundled_specs().parent
GENERATED = ROOT / "generated"
PARTS = ROOT / "tests" / "golden"
CALLS = PARTS / "calls.txt"

#: Systems of the corpus with a file in tests/golden instead of a whole solver.
PARTIAL = sorted(names_left_out(GENERATED))
#: Systems of the corpus whose whole solver is in generated/.
WHOLE = sorted({*resources.bundled()} - {*PARTIAL})

OMITTED = "..."
NOBODY = "NAME"


@cache
def solver_files(name: str) -> Mapping[str, str]:
    """Return the texts of the files that `phigen build` writes for a system of the corpus, by file name."""
    compilation = as_given(name)
    return {file: text for target in compilation.spec.targets for file, text in files(compilation, target).items()}


def paragraphs(text: str) -> list[str]:
    """Return the paragraphs of a text, which blank lines separate."""
    return re.split(r"\n{2,}", text.strip("\n"))


def key(name: str, paragraph: str) -> str:
    """Return the key by which paragraphs of different systems are compared: the paragraph without the name of the
    system and without blanks and line breaks.
    """
    anonymous = re.sub(rf"\b{name}(?=_|\b)", NOBODY, paragraph)
    anonymous = re.sub(rf"\b{name.upper()}(?=_|\b)", NOBODY, anonymous)
    return re.sub(r"\s+", "", re.sub(r"\n \* ", " ", anonymous))


def keys(name: str, texts: Iterable[str]) -> set[str]:
    """Return the keys of all paragraphs of the texts."""
    return {key(name, paragraph) for text in texts for paragraph in paragraphs(text)}


@cache
def of_whole_solvers() -> set[str]:
    """Return the keys of all paragraphs of the files in generated/."""
    return set[str]().union(
        *(keys(name, (path.read_text(encoding="utf-8") for path in (GENERATED / name).iterdir())) for name in WHOLE)
    )


def part(name: str, texts: Mapping[str, str], shared: Collection[str]) -> str:
    """Return the content of tests/golden/NAME.txt: all files of a system, with ``...`` in place of paragraphs whose
    keys are in ``shared``.
    """
    return "".join(f"==== {file} ====\n{_of_file(name, texts[file], shared)}\n" for file in sorted(texts))


def _of_file(name: str, text: str, shared: Collection[str]) -> str:
    result: list[str] = []
    for paragraph in paragraphs(re.sub(rf".*{CHECKSUM}.*\n", "", text)):
        if key(name, paragraph) not in shared:
            result.append(paragraph)
        elif result[-1:] != [OMITTED]:
            result.append(OMITTED)
    return "\n\n".join(result) + "\n"


def called(name: str) -> set[str]:
    """Return the names of the functions that the C of a system defines or calls, without the name of the system."""
    words = re.findall(r"\b(\w+)\(", solver_files(name).get(f"{name}.c", ""))
    return {re.sub(r"(_part)?\d*$", "", word.removeprefix(f"{name}_")) for word in words}


@cache
def calls() -> Mapping[str, set[str]]:
    """Return the functions that each system defines or calls, as tests/golden/calls.txt states them."""
    lines = [line.split(": ") for line in CALLS.read_text(encoding="utf-8").replace("\n    ", " ").splitlines()]
    return {name: {function for function, names in lines if name in names.split()} for name in resources.bundled()}


def table_of_calls() -> str:
    """Return the content of tests/golden/calls.txt: each function with the systems whose C defines or calls it."""
    of = {name: called(name) for name in sorted(resources.bundled())}
    lines = [f"{f}: {' '.join(n for n in of if f in of[n])}" for f in sorted(set[str]().union(*of.values()))]
    return "".join(textwrap.fill(line, 118, subsequent_indent="    ", break_on_hyphens=False) + "\n" for line in lines)


def contents() -> dict[Path, str]:
    """Return the contents of all golden files as phigen generates them now, by path."""
    whole = {GENERATED / name / file: text for name in WHOLE for file, text in solver_files(name).items()}
    shared = set[str]().union(*(keys(name, solver_files(name).values()) for name in WHOLE))
    partial = {PARTS / f"{name}.txt": part(name, solver_files(name), shared) for name in PARTIAL}
    return {**whole, **partial, CALLS: table_of_calls()}


def existing() -> set[Path]:
    """Return the paths of the golden files on disk."""
    return {*PARTS.iterdir(), *GENERATED.glob("*/*")}


def _main(check: bool) -> int:
    expected, there = contents(), existing()
    off = [p for p, text in expected.items() if p not in there or p.read_text(encoding="utf-8") != text]
    off += sorted(there - expected.keys())
    for path in off:
        print(f"{path.relative_to(ROOT)}: {'out of date' if path in expected else 'of no spec'}")
        if not check and path in expected:
            path.parent.mkdir(exist_ok=True)
            path.write_text(expected[path], encoding="utf-8", newline="\n")
        elif not check:
            path.unlink()
            if not any(path.parent.iterdir()):
                path.parent.rmdir()
    if check and off:
        print(f"make golden brings {len(off)} up to date; read the diff before you commit it")
    return int(check and bool(off))


if __name__ == "__main__":
    sys.exit(_main("--check" in sys.argv[1:]))
