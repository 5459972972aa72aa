"""Identifiers of generated code: names of the spec, changed if the language reserves them.

If a name is reserved, an underscore is appended. If a reserved name begins with an underscore, it gets the prefix ``v``
instead, since C reserves ``_Bool_`` as well as ``_Bool``. Further underscores are appended while the result equals
another name.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from phigen.symbolic.symbols import TEMPORARY, Symbol
from phigen.targets.reserved import Reserved


def identifiers(names: Iterable[str], reserved: Reserved) -> dict[str, str]:
    """Return an identifier for each name. All identifiers are distinct, and names that are not reserved are unchanged
    if possible.
    """
    names = list(names)
    chosen = {name: name for name in names if name not in reserved}
    for name in names:
        if name not in chosen:
            chosen[name] = _free(name, reserved, set(chosen.values()))
    return {name: chosen[name] for name in names}


def _free(name: str, reserved: Reserved, used: Iterable[str]) -> str:
    if name in reserved and name.startswith("_"):
        name = f"v{name}"
    while name in reserved or name in used:
        name += "_"
    return name


class Scope:
    """Identifiers of the symbols in one function, all distinct."""

    def __init__(self, reserved: Reserved) -> None:
        # Temporaries in generated code are called t1, t2, …, so coordinates with names of this form get other
        # identifiers.
        self._reserved = Reserved(reserved.words, re.compile(rf"t\d+|{reserved.pattern.pattern}"))
        self._identifiers: set[str] = set()
        self._codes: dict[str, str] = {}

    def __getitem__(self, name: str) -> str:
        """Return the identifier of a symbol. The identifier of temporary number 12 is ``t12``."""
        if name not in self._codes and isinstance(name, Symbol) and name.kind == TEMPORARY:
            self._codes[name] = name.replace(":", "")
            self._identifiers.add(self._codes[name])
        return self.request(name, name)

    def request(self, name: str, preferred: str) -> str:
        """Return the identifier of a symbol: ``preferred``, or a similar name if ``preferred`` is used already."""
        if name not in self._codes:
            self._codes[name] = _free(re.sub(r"\W", "_", preferred, flags=re.ASCII), self._reserved, self._identifiers)
            self._identifiers.add(self._codes[name])
        return self._codes[name]

    def bind(self, name: str, code: str) -> None:
        """Print ``code``, such as ``coef[3]``, in place of the symbol ``name``."""
        self._codes[name] = code
