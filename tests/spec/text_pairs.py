"""Reader of errors.txt, a list of specs with their errors."""

from __future__ import annotations

import re
from pathlib import Path

from phigen.errors import SpecError
from phigen.spec import loads

MINIMAL = {
    "phigen": "1",
    "name": "minimal",
    "coordinates": "[x1, x2, x3]",
    "poisson": "{lie_algebra: {name: so(3)}}",
    "hamiltonian": "x1**2",
}


def complete(fragment: str) -> str:
    """Return the fragment, followed by the keys of the minimal spec that it lacks, so that line numbers are those of
    the fragment.
    """
    missing = [f"{k}: {v}\n" for k, v in MINIMAL.items() if not re.search(rf"^{k}:", fragment, re.MULTILINE)]
    return fragment + "".join(missing)


def errors_of(text: str) -> str:
    """Return the errors that `loads` reports for a spec, in the format of errors.txt."""
    try:
        loads(text)
    except SpecError as error:
        lines = []
        for d in error.diagnostics:
            assert d.location is not None
            lines.append(f"{d.location.line}:{d.location.column}: {d.message}\n")
            lines += [f"  hint: {d.hint}\n"] if d.hint else []
        return "".join(lines)
    return ""


def cases() -> list[tuple[str, str, str]]:
    """Return the title, the spec and the expected errors of each case."""
    text = Path(__file__).with_name("errors.txt").read_text(encoding="utf-8")
    pairs = []
    for part in re.split(r"^== ", text, flags=re.MULTILINE)[1:]:
        title, _, rest = part.partition("\n")
        spec, _, expected = rest.partition("\n--\n")
        pairs.append((title, spec + "\n", expected.rstrip("\n") + "\n" if expected.strip() else ""))
    return pairs
