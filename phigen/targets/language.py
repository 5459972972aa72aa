"""Description of a language for printing: formulas, and kernels that read and write entries of arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from phigen.scheme.kernel import SCALARS, Kernel
from phigen.targets.code import bound, lower, with_zeros_first
from phigen.targets.names import Scope
from phigen.targets.printer import Printer
from phigen.targets.reserved import Reserved


@dataclass(frozen=True)
class Language:
    """Spelling of kernels in a language.

    ``functions`` are the names of functions, or texts with ``{0}`` for the argument, including functions that the
    generated file defines. ``declare`` and ``assign`` are statements, ``subscript`` is an entry of an array whose first
    index is ``base``, ``parameter`` a parameter of the system. ``point`` follows integers. ``clear`` sets the first
    ``{size}`` entries of an array to zero; if it is empty, each zero is stored by a statement.
    """

    reserved: Reserved
    functions: Mapping[str, str]
    constants: Mapping[str, str]
    declare: str
    assign: str
    subscript: str
    parameter: str
    base: int = 0
    point: str = ".0"
    clear: str = ""

    def entry(self, array: str, index: int) -> str:
        """Return the text of an entry of an array; ``index`` counts from 0."""
        return self.subscript.format(array=array, index=index + self.base)

    def printer(self, scope: Scope) -> Printer:
        """Return a printer of lowered trees with the names of a scope."""
        return Printer(lambda n: scope[n], self.functions, self.constants, self.functions["power"], self.point)

    def statements(self, kernel: Kernel, arrays: Mapping[str, str]) -> list[str]:
        """Return the statements of a kernel; ``arrays`` maps its arguments to their names in the output."""
        code = with_zeros_first(lower(kernel)) if self.clear else lower(kernel)
        used = [*arrays.values(), *self.functions.values()]
        scope = Scope(self.reserved | used)

        def entry(argument: str, i: int, s: str) -> str:
            return arrays[argument] if argument in SCALARS else self.entry(arrays[argument], i)

        named = bound(kernel, code, scope, lambda s: self.parameter.format(name=s), entry, named=False)
        lines = [self.declare.format(name=name, value=place) for name, place in named]
        show = self.printer(scope)
        lines += [self.declare.format(name=scope[a.target], value=show(a.value)) for a in code.assignments]
        lines += [self.clear.format(array=arrays[array], size=size) for array, size in code.cleared]
        places = [self.entry(arrays[s.array], s.index) for s in code.stores]
        return lines + [
            self.assign.format(place=p, value=show(s.value)) for p, s in zip(places, code.stores, strict=True)
        ]
