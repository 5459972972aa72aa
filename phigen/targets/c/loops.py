"""Printing of functions of the loop IR in C."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import groupby

from phigen.ir import nodes as ir
from phigen.scheme.kernel import Role
from phigen.scheme.program import Program
from phigen.symbolic.expression import Expression
from phigen.targets.c.language import LANGUAGE, elementary_functions, reserved_variables
from phigen.targets.c.layout import WIDTH, comment
from phigen.targets.c.real import real_of
from phigen.targets.spelling import Dialect, Spelling

#: Functions and sizes of the runtime. In generated code, their names begin with the name of the solver.
_RUNTIME = (
    "first", "LANES", "total", "added", "ADDED", "piece_of", "between", "units", "part_of_flow", "DIM", "SUMS", "ROW",
    "ELEMENT", "BACK_PACKS", "FLOWS", "TERMS", "taylor_product", "taylor_chain", "taylor_power",
)  # fmt: skip

#: C types of integers, by type of the loop IR.
_INTEGERS = {ir.Type.INDEX: "ptrdiff_t", ir.Type.SIZE: "size_t", ir.Type.FLAG: "int"}

#: C types of loop variables, by kind of loop.
_COUNTERS = {
    "segments": "size_t",
    "search": "size_t",
    "lanes": "int",
    "packs": "int",
    "stages": "int",
    "entries": "int",
}

#: Limits for printing a case of a switch on one line: the number of statements, and the number of characters. The
#: latter leaves space for the label and the indentation.
_SHORT_CASE, _CASE_WIDTH = 2, WIDTH - 24


@dataclass(frozen=True)
class CTypes:
    """The C types of values in a solver. Names of structs begin with the name of the solver; numbers have the type
    ``real``.
    """

    prefix: str
    real: str

    def number(self, *, lanes: bool) -> str:
        """Return the C type of a number, or of a number in each SIMD lane."""
        return f"{self.prefix}_lanes" if lanes else self.real

    def value(self, kind: ir.Type) -> str:
        """Return the C type of a value that is not an address."""
        return self.real if kind is ir.Type.REAL else _INTEGERS[kind]

    def parameter(self, name: str, kind: ir.ParameterType, spell: Spelling) -> str:
        """Return the declaration of a parameter in C."""
        match kind:
            case ir.RecordType(record, mutable):
                return f"{'const ' * (not mutable)}{self.prefix}_{record} *{name}"
            case ir.Pointer(constant, restricted, lanes):
                return f"{'const ' * constant}{self.number(lanes=lanes)} *{'restrict ' * restricted}{name}"
            case ir.Vector(length, rows):
                row, sized = f"[{spell(rows)}]" if rows else "", spell(length) if length else ""
                sized = " ".join(filter(None, ["restrict" * kind.restricted, sized]))
                return f"{'const ' * kind.constant}{self.number(lanes=kind.lanes)} {name}{row}[{sized}]"
            case ir.Tape(length):
                return f"{self.real} (*{name})[{spell(length)}]"
            case ir.Type.ARRAYS:
                return f"{self.real} *const *{name}"
        return f"{self.value(kind)} {name}"


def function(printed: ir.Function, program: Program, linkage: str = "static") -> str:
    """Return a function of a solver as C, without a comment."""
    printer = _StatementPrinter.of(printed, program)
    types = printed.known_types
    parameters = ", ".join(printer.types.parameter(p, types[p], printer.spell) for p in printed.parameters)
    returned = printer.types.value(printed.returns) if printed.returns else "void"
    head = f"{linkage} {returned} {program.name}_{printed.name}({parameters})"
    return "\n".join([f"{head}\n{{", *_indented(printer.lines(printed.body)), "}\n"])


def commented(printed: ir.Function, program: Program, linkage: str = "static") -> str:
    """Return a function of a solver as C, with a comment that says its purpose."""
    return "\n".join([*comment(f"/* {printed.doc}. */"), function(printed, program, linkage)])


def table(printed: ir.ConstantTable, program: Program) -> str:
    """Return the declaration of a constant array of integers, as one line of C."""
    number = printed.length or ir.Constant(len(printed.values))
    length = _spelling(ir.Function("", "", Role.OTHER, (), ()), program)(number)
    return f"static const int {program.name}_{printed.name}[{length}] = {{ {', '.join(map(str, printed.values))} }};"


def statements(printed: ir.Function, program: Program, *, shared_line: int = 0) -> list[str]:
    """Return the lines of the body of a function in a solver.

    With ``shared_line``, several declarations of computed values are on one line of at most this number of characters.
    With 0, each declaration has its own line.
    """
    return [*_indented(_StatementPrinter.of(printed, program, shared_line).lines(printed.body))]


def _spelling(printed: ir.Function, program: Program) -> Spelling:
    name, real = program.name, real_of(program)
    language = replace(LANGUAGE, reserved=reserved_variables(name), functions=elementary_functions(name))
    dialect = Dialect(
        real.language(language),
        operators={"and": "&&", "or": "||", "not": "!", "index": "ptrdiff_t", "size": "size_t", "real": real.name},
        functions={**real.names(), **{function: f"{name}_{function}" for function in _RUNTIME}},
        pointers=frozenset(p for p in printed.parameters if isinstance(printed.known_types.get(p), ir.RecordType)),
        links=frozenset({"s"}),
    )
    return Spelling(dialect, printed.parameters, printed.body)


def _indented(lines: Iterable[str]) -> Iterator[str]:
    return (line if line.startswith("#") else f"    {line}" for line in lines)


@dataclass(frozen=True)
class _StatementPrinter:
    """Printer of the statements of one function, with its identifiers and the types of the solver; see `statements`."""

    spell: Spelling
    types: CTypes
    shared_line: int

    @classmethod
    def of(cls, printed: ir.Function, program: Program, shared_line: int = 0) -> _StatementPrinter:
        """Return the printer for a function of the loop IR in a solver."""
        return cls(_spelling(printed, program), CTypes(program.name, real_of(program).name), shared_line)

    @property
    def name(self) -> str:
        """The name of the solver."""
        return self.types.prefix

    def lines(self, body: Iterable[ir.Statement]) -> Iterator[str]:
        """Yield the lines of statements."""
        if self.shared_line:
            # Consecutive declarations share a line. Values that are printed where they are used need no line. Their
            # declarations come first, so that other declarations are consecutive.
            body = sorted(body, key=lambda s: not (isinstance(s, ir.Declare) and s.in_place))
        for kind, group in groupby(body, self._kind):
            if kind == "discards":
                yield f"{', '.join(f'(void){s.name}' for s in group if isinstance(s, ir.Discard))};"
            elif kind == "reads":
                items = [item for s in group if isinstance(s, ir.Declare) for item in s.items]
                yield self._declaration(ir.Declare(ir.Type.REAL, tuple(items)))
            elif kind == "values":
                yield from self._sharing_lines(item for s in group if isinstance(s, ir.Declare) for item in s.items)
            else:
                for s in group:
                    yield from self._statement(s)

    def _kind(self, s: ir.Statement) -> str:
        """Return the kind of a statement if consecutive statements of this kind are printed together, else ""."""
        if isinstance(s, ir.Discard):
            return "discards"
        if not self.shared_line or not isinstance(s, ir.Declare) or s.in_place or s.type is not ir.Type.REAL:
            return ""
        return "values" if isinstance(s.items[0][1], Expression) else "reads"

    def _sharing_lines(self, items: Iterable[tuple[str, ir.Value]]) -> Iterator[str]:
        line = ""
        for symbol, value in items:
            item = f"{self.spell.name(symbol)} = {self.spell(value)}"
            if line and len(line) + len(item) + 2 > self.shared_line - 4:
                yield f"{line};"
                line = ""
            line = f"{line}, {item}" if line else f"const {self.types.real} {item}"
        yield f"{line};"

    def _statement(self, s: ir.Statement) -> Iterator[str]:
        spell = self.spell
        match s:
            case ir.Declare(in_place=True):
                spell.substitute(s)
            case ir.Declare():
                yield self._declaration(s)
            case ir.Assign():
                yield f"{self._assignment(s)};"
            case ir.Together(assignments):
                yield f"{', '.join(map(self._assignment, assignments))};"
            case ir.Call(called, arguments):
                yield f"{self.name}_{called}({', '.join(map(spell, arguments))}){';' * (not called.isupper())}"
            case ir.Clear(array, None, None):
                yield f"memset({spell(array)}, 0, sizeof {spell(array)});"
            case ir.Clear(array, None, ir.Constant() as count):
                yield f"PHI_CLEAR_FIRST({spell(array)}, {spell(count)});"
            case ir.Clear(array, first, count) if count:
                start = spell(ir.Binary("+", array, first) if first else array)
                pointer = f"({spell(array)})" if isinstance(array, ir.Binary) else spell(array)
                yield f"memset({start}, 0, {spell(ir.Cast(count, 'size'))} * sizeof *{pointer});"
            case ir.Copy(ir.Name() as target, source, ir.Constant() as count):
                yield f"PHI_COPY_FIRST({spell(target)}, {spell(source)}, {spell(count)});"
            case ir.Copy(target, source, count):
                size = f"sizeof {spell(source if count is None else target)}"
                size = size if count is None else f"{spell(count)} * {size}"
                yield f"memcpy({spell(target)}, {spell(source)}, {size});"
            case ir.Append(tape, vector):
                yield f"if ({spell(tape)} != NULL) memcpy({spell(tape)}++, {spell(vector)}, sizeof *{spell(tape)});"
            case ir.Comment(text):
                yield f"/* {text} */"
            case ir.Continue():
                yield "continue;"
            case ir.Return(value):
                yield f"return {spell(value)};" if value else "return;"
            case ir.If():
                yield from self._if(s)
            case ir.Switch():
                yield from self._switch(s)
            case ir.Loop():
                yield from self._loop(s)
            case _:
                raise TypeError(s)

    def _assignment(self, s: ir.Assign) -> str:
        return f"{' = '.join(map(self.spell, (s.target, *s.too)))} {'+=' if s.adds else '='} {self.spell(s.value)}"

    def _declaration(self, s: ir.Declare) -> str:
        star, length = "", ""
        match s.type:
            case ir.Pointer(constant, restricted, lanes):
                kind = f"{'const ' * constant}{self.types.number(lanes=lanes)}"
                star = "*restrict " if restricted else "*"
            case ir.Vector(size):
                kind, length = self.types.number(lanes=s.type.lanes), f"[{self.spell(size) if size else ''}]"
            case ir.Type.ARRAYS:
                kind, star, length = self.types.real, "*const ", "[]"
            case ir.RecordType(record, mutable, address):
                kind, star = f"{'const ' * (not (s.mutable or mutable))}{self.name}_{record}", "*" * address
            case kind_of_number:
                kind = f"{'const ' * (not s.mutable)}{self.types.value(kind_of_number)}"
        items = (f"{star}{self.spell.name(symbol)}{length}{self._initial(value)}" for symbol, value in s.items)
        return f"{kind} {', '.join(items)};{f' /* {s.note} */' if s.note else ''}"

    def _initial(self, value: ir.Value) -> str:
        match value:
            case ir.Constant(None):
                return ""
            case ir.Listed(values):
                return f" = {{ {', '.join(map(self.spell, values))} }}"
        return f" = {self.spell(value)}"

    def _if(self, s: ir.If) -> Iterator[str]:
        then, otherwise = [*self.lines(s.then)], [*self.lines(s.otherwise)]
        head = f"if ({self.spell(s.condition)})"
        if len(then) == 1 and len(otherwise) <= 1:
            yield f"{head} {then[0]}"
            yield from (f"else {line}" for line in otherwise)
            return
        yield f"{head} {{"
        yield from _indented(then)
        if otherwise:
            yield "} else {"
            yield from _indented(otherwise)
        yield "}"

    def _switch(self, s: ir.Switch) -> Iterator[str]:
        """Yield the lines of a switch. Each case is on one line if all cases are short."""
        *labels, _ = s.labels
        cases = [[*self.lines(case)] for case in s.cases]
        one_line = [" ".join(lines) for lines in cases]
        short = all(len(lines) <= _SHORT_CASE for lines in cases) and max(map(len, one_line)) <= _CASE_WIDTH
        short = short and not any(text.startswith(("for", "if")) for text in one_line)
        yield f"switch ({self.spell(s.value)}) {{"
        for head, lines in zip([*(f"case {k}:" for k in labels), "default:"], cases, strict=True):
            if short:
                yield " ".join([head, *lines, "break;"])
            else:
                yield head
                yield from _indented([*lines, "break;"])
        yield "}"

    def _loop(self, s: ir.Loop) -> Iterator[str]:
        assert s.low is not None
        assert s.high is not None
        kind = _COUNTERS.get(s.kind, "ptrdiff_t")
        limit = f", {s.limit} = {self.spell(s.high)}" if s.limit else ""
        goes_on = f"{self.spell(s.condition)} && " if s.condition else ""
        goes_on += f"{s.variable} < {s.limit or self.spell(s.high)}"
        onward = f"{s.variable} += {self.spell(s.step)}" if s.step else f"++{s.variable}"
        head = f"for ({kind} {s.variable} = {self.spell(s.low)}{limit}; {goes_on}; {onward})"
        if s.independent:
            yield f"{self.name}_EACH_{s.independent}"
        if s.threads:
            yield from ("#ifdef _OPENMP", f"#pragma omp parallel for if (s->sites > {s.threads})", "#endif")
        body = [*self.lines(s.body)]
        if s.kind in ("line", "search"):
            yield from (head, *_indented(body)) if s.kind == "search" else (f"{head} {body[0]}",)
            return
        yield from (f"{head} {{{f' /* {s.note} */' if s.note else ''}", *_indented(body), "}")
