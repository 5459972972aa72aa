"""What printing takes of a language: formulas, and kernels that are functions of arrays, one number at a time."""

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
    """How a language writes the pieces of a kernel.

    ``functions`` are the names of functions, or texts with ``{0}`` for the argument, those that a file defines itself
    among them. ``declare`` and ``assign`` are statements, ``subscript`` an entry of an array whose first index is
    ``base``, ``parameter`` a parameter of the system. ``point`` follows whole numbers. ``clear`` sets the
    first entries of an array to zero, so many of them; without it each is stored by itself.
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
        """An entry of an array, counted from 0 here."""
        return self.subscript.format(array=array, index=index + self.base)

    def printer(self, scope: Scope) -> Printer:
        """Prints lowered trees with the names of a scope."""
        return Printer(lambda n: scope[n], self.functions, self.constants, self.functions["power"], self.point)

    def statements(self, kernel: Kernel, arrays: Mapping[str, str]) -> list[str]:
        """The body of a kernel: its arguments are called as ``arrays`` says, entries are read and stored."""
        code = with_zeros_first(lower(kernel)) if self.clear else lower(kernel)
        taken = [*arrays.values(), *self.functions.values()]
        scope = Scope(self.reserved | taken)

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
