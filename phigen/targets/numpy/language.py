"""Description of Python with NumPy as a target language."""

from __future__ import annotations

from collections.abc import Iterable

from phigen.symbolic import functions as elementary
from phigen.targets.language import Language
from phigen.targets.reserved import PYTHON_RESERVED

#: Python with NumPy. Functions are those of NumPy and those that the generated file defines; values are arrays.
LANGUAGE = Language(
    reserved=PYTHON_RESERVED,
    functions={name: f"_{name}" for name in elementary.FUNCTIONS} | elementary.written_in("numpy"),
    constants={"pi": "np.pi", "E": "np.e"},
)


def listed(items: Iterable[object]) -> str:
    """Return items as the text of a tuple."""
    return "(" + "".join(f"{quoted(i) if isinstance(i, str) else repr(i)}, " for i in items).rstrip() + ")"


def quoted(name: str) -> str:
    """Return a name in quotes."""
    return f'"{name}"'
