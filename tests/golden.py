"""Golden files: what is generated of the corpus, whole for a few systems, and of the others what these do not have.

The systems that generated/left_out.txt does not list are in generated/ as users get them; `phigen build specs` writes
these. Of each system that it lists tests/golden/NAME.txt has its own part: the paragraphs that no whole solver has,
mostly the functions printed for the model. So a change of the runtime is a change of few files. Which solvers call
which functions is in tests/golden/calls.txt.

    python tests/golden.py           writes all of them
    python tests/golden.py --check   says which are out of date
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

#: The systems of the corpus of which there is the part of their own.
PARTIAL = sorted(names_left_out(GENERATED))
#: Those whose solvers are there as a whole.
WHOLE = sorted({*resources.bundled()} - {*PARTIAL})

OMITTED = "..."
NOBODY = "NAME"


@cache
def solver_files(name: str) -> Mapping[str, str]:
    """The files of a system of the corpus, as `phigen build` writes them."""
    compilation = as_given(name)
    return {file: text for target in compilation.spec.targets for file, text in files(compilation, target).items()}


def paragraphs(text: str) -> list[str]:
    """What blank lines separate."""
    return re.split(r"\n{2,}", text.strip("\n"))


def key(name: str, paragraph: str) -> str:
    """The paragraph as it would be in a system without a name: neither prefixes nor the breaks of lines count."""
    anonymous = re.sub(rf"\b{name}(?=_|\b)", NOBODY, paragraph)
    anonymous = re.sub(rf"\b{name.upper()}(?=_|\b)", NOBODY, anonymous)
    return re.sub(r"\s+", "", re.sub(r"\n \* ", " ", anonymous))


def keys(name: str, texts: Iterable[str]) -> set[str]:
    """The keys of all paragraphs of files."""
    return {key(name, paragraph) for text in texts for paragraph in paragraphs(text)}


@cache
def of_whole_solvers() -> set[str]:
    """The keys of all paragraphs that are in generated/."""
    return set[str]().union(
        *(keys(name, (path.read_text(encoding="utf-8") for path in (GENERATED / name).iterdir())) for name in WHOLE)
    )


def part(name: str, texts: Mapping[str, str], shared: Collection[str]) -> str:
    """The part of a system's own, all files in one: without the paragraphs whose keys are shared."""
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
    """The functions that the C of a system defines or calls, without the name of the system."""
    words = re.findall(r"\b(\w+)\(", solver_files(name).get(f"{name}.c", ""))
    return {re.sub(r"(_part)?\d*$", "", word.removeprefix(f"{name}_")) for word in words}


@cache
def calls() -> Mapping[str, set[str]]:
    """What `called` gives of each system, as tests/golden/calls.txt has it."""
    lines = [line.split(": ") for line in CALLS.read_text(encoding="utf-8").replace("\n    ", " ").splitlines()]
    return {name: {function for function, names in lines if name in names.split()} for name in resources.bundled()}


def table_of_calls() -> str:
    """Each function with the systems whose C defines or calls it."""
    of = {name: called(name) for name in sorted(resources.bundled())}
    lines = [f"{f}: {' '.join(n for n in of if f in of[n])}" for f in sorted(set[str]().union(*of.values()))]
    return "".join(textwrap.fill(line, 118, subsequent_indent="    ", break_on_hyphens=False) + "\n" for line in lines)


def contents() -> dict[Path, str]:
    """All golden files."""
    whole = {GENERATED / name / file: text for name in WHOLE for file, text in solver_files(name).items()}
    shared = set[str]().union(*(keys(name, solver_files(name).values()) for name in WHOLE))
    partial = {PARTS / f"{name}.txt": part(name, solver_files(name), shared) for name in PARTIAL}
    return {**whole, **partial, CALLS: table_of_calls()}


def existing() -> set[Path]:
    """The golden files that are there."""
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
