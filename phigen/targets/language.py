"""Description of a target language: the way in which it writes formulas."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from phigen.targets.names import Scope
from phigen.targets.printer import Printer
from phigen.targets.reserved import Reserved


@dataclass(frozen=True)
class Language:
    """Spelling of formulas in a language.

    ``functions`` maps elementary functions to their names, or to texts with ``{0}`` for the argument. If the language
    lacks a function, the generated file defines it. ``whole`` prints integers, and ``real`` prints all other numbers.
    """

    reserved: Reserved
    functions: Mapping[str, str]
    constants: Mapping[str, str]
    whole: Callable[[int], str] = "{}.0".format
    real: Callable[[float], str] = repr

    def printer(self, scope: Scope) -> Printer:
        """Return a printer of formulas with the identifiers of a scope."""
        power = self.functions["power"]
        return Printer(lambda n: scope[n], self.functions, self.constants, power, self.whole, self.real)
