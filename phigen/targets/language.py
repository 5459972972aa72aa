"""Description of a language for printing formulas."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from phigen.targets.names import Scope
from phigen.targets.printer import Printer
from phigen.targets.reserved import Reserved


@dataclass(frozen=True)
class Language:
    """Spelling of formulas in a language.

    ``functions`` are names of functions, or texts with ``{0}`` for the argument; they include functions that the
    generated file defines. ``whole`` and ``real`` print integers and other numbers.
    """

    reserved: Reserved
    functions: Mapping[str, str]
    constants: Mapping[str, str]
    whole: Callable[[int], str] = "{}.0".format
    real: Callable[[float], str] = repr

    def printer(self, scope: Scope) -> Printer:
        """Return a printer of lowered trees with the names of a scope."""
        power = self.functions["power"]
        return Printer(lambda n: scope[n], self.functions, self.constants, power, self.whole, self.real)
