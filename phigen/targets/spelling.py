"""Values of the loop IR as text. The printers of statements in all languages use this module."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache

from phigen.ir import nodes as ir
from phigen.ir.walk import statements, values
from phigen.symbolic.expression import Expression
from phigen.symbolic.symbols import TEMPORARY, Symbol
from phigen.targets.language import Language
from phigen.targets.names import Scope
from phigen.targets.printer import ATOM, PRODUCT, SUM

#: Binding strengths of operators. They decide where parentheses are needed, as in `phigen.targets.printer`.
_STRENGTH = {"or": 1, "and": 1, "+": 3, "-": 3, "*": 4, "/": 4, "%": 4}
_STRENGTH |= dict.fromkeys(("==", "!=", "<", "<=", ">", ">="), 2)
_ATOM = 9
_OF_ARITHMETIC = {SUM: 3, PRODUCT: 4, ATOM: _ATOM}


@dataclass(frozen=True)
class Dialect:
    """Spelling of values of the loop IR in a language.

    ``operators`` and ``functions`` map names in the IR to names in the language, if these differ. ``select`` is the
    format of a conditional value: {0} is the condition, {1} the value if it is true, and {2} the value if it is false.
    ``subscript`` prints an element of an array, and ``member`` a member of a record. Indices count from 0.
    """

    language: Language
    operators: Mapping[str, str] = field(default_factory=dict)
    functions: Mapping[str, str] = field(default_factory=dict)
    select: str = "{0} ? {1} : {2}"
    subscript: str = "{0}[{1}]"
    member: str = "{0}.{1}"
    pointers: frozenset[str] = frozenset()  # names of parameters whose values are addresses of records
    links: frozenset[str] = frozenset()  # names of members of records whose values are addresses of other records
    quote: str = '"{0}"'


class Spelling:
    """Printer of the values in one function, with the identifiers that it has chosen for the function."""

    def __init__(self, dialect: Dialect, reserved: Iterable[str], body: ir.Block) -> None:
        """Choose the identifiers of a function from the statements of its ``body``.

        Names of the spec keep their spelling unless they are ``reserved``, are defined by statements of the body, or
        are functions that the dialect can call.
        """
        self.dialect = dialect
        called = _words("\n".join(dialect.language.functions.values()))
        self.scope = Scope(dialect.language.reserved | {*reserved, *called, *_fixed(body)})
        declarations = [s for s in statements(body) if isinstance(s, ir.Declare) and not s.in_place]
        self._pointers = set(dialect.pointers)
        for s in declarations:
            if isinstance(s.type, ir.RecordType):
                change = self._pointers.update if s.type.address else self._pointers.difference_update
                change(self.name(n) for n, _ in s.items)
        names = dict.fromkeys(name for s in declarations for name, _ in s.items)
        temporaries = (n for n in names if isinstance(n, Symbol) and n.kind == TEMPORARY)
        for k, temporary in enumerate(temporaries, 1):
            self.scope.bind(temporary, f"t{k}")
        for name in names:
            if not isinstance(name, Symbol):
                self.scope[name]
        self._arithmetic = dialect.language.printer(self.scope)

    def name(self, symbol: str) -> str:
        """Return the identifier of a symbol."""
        if isinstance(symbol, Symbol) and symbol.kind == ir.FIXED:
            text = str(symbol.key[0])
            return self.dialect.functions.get(text, text) if text.isupper() else text
        if isinstance(symbol, Symbol) and symbol.kind == ir.LABEL:
            return self.scope.request(symbol, str(symbol.key[0]))
        return self.scope[symbol]

    def substitute(self, declaration: ir.Declare) -> None:
        """Record the symbols that a declaration defines. From now on, their values are printed instead of the
        symbols.
        """
        for symbol, value in declaration.items:
            text, strength = self._spelt(value)
            self.scope.bind(symbol, text if strength else f"({text})")

    def __call__(self, value: ir.Value, strength: int = 0) -> str:
        """Return a value as text, in parentheses if it binds less strongly than ``strength``."""
        text, binding = self._spelt(value)
        return text if binding >= strength else f"({text})"

    def _spelt(self, value: ir.Value) -> tuple[str, int]:
        match value:
            case Expression():
                text, level = self._arithmetic.bound(value)
                return text, _OF_ARITHMETIC[level]
            case ir.Name(symbol):
                return self.name(symbol), _ATOM
            case ir.Constant(str() as text):
                return self.dialect.quote.format(text), _ATOM
            case ir.Constant(float() as number):
                return self.dialect.language.real(number), _ATOM
            case ir.Constant(number):
                return repr(number), _ATOM
            case ir.Member(record, name):
                text = self(record, _ATOM)
                is_link = isinstance(record, ir.Member) and record.name in self.dialect.links
                address = is_link or text in self._pointers
                return f"{text}->{name}" if address else self.dialect.member.format(text, name), _ATOM
            case ir.Entry(array, index):
                return self.dialect.subscript.format(self(array, _ATOM), self(index)), _ATOM
            case ir.Binary("&", left, right):
                return f"{self(left, _ATOM)} & {self(right, _ATOM)}", 0
            case ir.Binary(operator, left, right):
                level, spelt = _STRENGTH[operator], self.dialect.operators.get(operator, operator)
                return f"{self(left, level)} {spelt} {self(right, level + (operator != 'and'))}", level
            case ir.Accumulated(start, terms):
                return f"{self(start, 3)} + {self(terms)}", 3
            case ir.Cast(inner, kind) if kind not in self.dialect.operators:
                return self._spelt(inner)
            case ir.Cast(inner, kind):
                return f"({self.dialect.operators[kind]}){self(inner, _ATOM)}", _ATOM
            case ir.Select(condition, then, otherwise):
                return self.dialect.select.format(self(condition), self(then), self(otherwise)), 0
            case ir.Prefix(operator, inner):
                return f"{self.dialect.operators.get(operator, operator)}{self(inner, _ATOM)}", _ATOM
            case ir.Grouped(inner):
                return f"({self(inner)})", _ATOM
            case ir.Several(values):
                return ", ".join(map(self, values)), 0
            case ir.Listed(values):
                return f"[{', '.join(map(self, values))}]", _ATOM
            case ir.Called(name, arguments, instance):
                owner = f"{self(instance, _ATOM)}." if instance else ""
                return f"{owner}{self.dialect.functions.get(name, name)}({', '.join(map(self, arguments))})", _ATOM
        raise TypeError(value)


@cache
def _words(text: str) -> frozenset[str]:
    return frozenset(re.findall(r"\w+", text))


def _fixed(body: ir.Block) -> Iterator[str]:
    """Yield the identifiers of variables that statements define."""
    for node in values(body):
        match node:
            case ir.Name(Symbol(kind=ir.FIXED, key=(name,))):
                yield from _words(str(name))
            case ir.Declare(items=items):
                yield from (str(s.key[0]) for s, _ in items if isinstance(s, Symbol) and s.kind == ir.FIXED)
            case ir.Unpack(names):
                yield from names
            case ir.Loop(variable=variable, limit=limit):
                yield from (variable, limit)
            case ir.Discard(name):
                yield name
