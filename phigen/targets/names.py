"""Identifiers of the output: names of the user as they are where they can stand, else changed a little.

A name that a language keeps for itself gets an underscore at its end; one that begins with an underscore gets a ``v``
in front instead, for ``_Bool_`` would be as reserved as ``_Bool``. Where the changed name is taken, underscores follow.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from phigen.symbolic.symbols import TEMPORARY, Symbol
from phigen.targets.reserved import Reserved


def identifiers(names: Iterable[str], reserved: Reserved) -> dict[str, str]:
    """Distinct identifiers for names, in their order; whichever of them can stand is its own identifier."""
    names = list(names)
    given = {name: name for name in names if name not in reserved}
    for name in names:
        if name not in given:
            given[name] = _free(name, reserved, set(given.values()))
    return {name: given[name] for name in names}


def _free(wanted: str, reserved: Reserved, taken: Iterable[str]) -> str:
    if wanted in reserved and wanted.startswith("_"):
        wanted = f"v{wanted}"
    while wanted in reserved or wanted in taken:
        wanted += "_"
    return wanted


class Scope:
    """Distinct identifiers for the symbols of one function."""

    def __init__(self, reserved: Reserved) -> None:
        # t12 is a temporary; a coordinate of that name gives way.
        self._reserved = Reserved(reserved.words, re.compile(rf"t\d+|{reserved.pattern.pattern}"))
        self._taken: set[str] = set()
        self._given: dict[str, str] = {}

    def __getitem__(self, name: str) -> str:
        """The identifier of a symbol; temporary 12 becomes ``t12``."""
        if name not in self._given and isinstance(name, Symbol) and name.kind == TEMPORARY:
            self._given[name] = name.replace(":", "")
            self._taken.add(self._given[name])
        return self.request(name, name)

    def request(self, name: str, wanted: str) -> str:
        """Return the identifier of a symbol, which is ``wanted`` where that is free."""
        if name not in self._given:
            self._given[name] = _free(re.sub(r"\W", "_", wanted, flags=re.ASCII), self._reserved, self._taken)
            self._taken.add(self._given[name])
        return self._given[name]

    def bind(self, name: str, code: str) -> None:
        """Use a piece of code, such as ``coef[3]``, wherever the symbol occurs."""
        self._given[name] = code
