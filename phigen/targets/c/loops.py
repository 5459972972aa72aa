"""Functions of the loop IR in C."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cache

from phigen.ir import nodes as ir
from phigen.ir.passes.forms import LANE, NEAR
from phigen.lanes.lane_functions import LANE_FORMULAS, LANE_FUNCTIONS
from phigen.symbolic.functions import FUNCTIONS
from phigen.targets.c.kernels import LANGUAGE
from phigen.targets.c.layout import WIDTH
from phigen.targets.spelling import Dialect, Spelling

#: Functions and sizes of the runtime, whose names begin with that of the solver.
_RUNTIME = ("first", "LANES", "total", "added", "ADDED", "piece_of", "between", "units", "part_of_flow", "DIM", "SUMS")

#: Types of values that are no pointers.
_TYPES = {
    ir.Type.REAL: "double",
    ir.Type.INDEX: "ptrdiff_t",
    ir.Type.SIZE: "size_t",
    ir.Type.FLAG: "int",
    ir.Type.ARRAYS: "double *const *",
}

#: The most statements of a case of a switch that are printed on one line, and their most letters: the label, and the
#: indentation in a loop, have the rest of the line.
_SHORT_CASE, _CASE_WIDTH = 2, WIDTH - 24


def function(printed: ir.Function, name: str, *, inline: bool = False) -> str:
    """Return a function by rows of a solver as text, without its comment."""
    parameters = ", ".join(_parameter(p, name) for p in printed.parameters)
    head = f"static {'inline ' * inline}void {name}_{printed.name}({parameters})"
    return f"{head}\n{{\n{statements(printed, name)}}}\n"


@cache
def elementary_functions(name: str) -> dict[str, str]:
    """Return what loops call elementary functions: functions of the solver where the library of C has none.

    Versions for small arguments and for SIMD lanes, see `phigen.ir.passes.forms`, are functions of the solver, or
    formulas of these.
    """
    lanes = {f: f"{name}_{f}{LANE}" for f in LANE_FUNCTIONS}
    formulas = {f: text.format_map(lanes) for f, text in LANE_FORMULAS.items()}
    near = {f + NEAR: f"{name}_{f}{NEAR}" for f in FUNCTIONS}
    in_lanes = {f + LANE: text for f, text in {**lanes, **formulas}.items()}
    return {**{f: f"{name}_{f}" for f in FUNCTIONS}, **LANGUAGE.functions, **near, **in_lanes}


def _parameter(parameter: str, name: str) -> str:
    kind = ir.TYPES[parameter]
    text = f"const {name}_{kind.name} *" if isinstance(kind, ir.RecordType) else _type(kind)
    return f"{text}{'' if text.endswith(('*', ' ')) else ' '}{parameter}"


def _type(kind: ir.Type | ir.Pointer) -> str:
    if isinstance(kind, ir.Pointer):
        return f"{'const ' * kind.constant}double *{'restrict ' * kind.restricted}"
    return _TYPES[kind]


def statements(printed: ir.Function, name: str) -> str:
    """Return the body of a function of a solver as text."""
    dialect = Dialect(
        replace(LANGUAGE, functions=elementary_functions(name)),
        operators={"and": "&&", "or": "||", "index": "ptrdiff_t", "size": "size_t"},
        functions={function: f"{name}_{function}" for function in _RUNTIME},
        pointers=frozenset({"row", "s"}),
    )
    spelling = Spelling(dialect, printed.parameters, printed.body)
    return "".join(f"{line}\n" for line in _indented(_lines(printed.body, spelling, name)))


def _indented(lines: Iterable[str]) -> Iterator[str]:
    return (line if line.startswith("#") else f"    {line}" for line in lines)


def _lines(body: Iterable[ir.Statement], spelling: Spelling, name: str) -> Iterator[str]:
    for s in body:
        yield from _statement(s, spelling, name)


def _statement(s: ir.Statement, spelling: Spelling, name: str) -> Iterator[str]:
    match s:
        case ir.Declare(in_place=True):
            spelling.substitute(s)
        case ir.Declare():
            yield _declaration(s, spelling, name)
        case ir.Assign():
            yield f"{_assignment(s, spelling)};"
        case ir.Together(assignments):
            yield f"{', '.join(_assignment(a, spelling) for a in assignments)};"
        case ir.Call(called, arguments):
            yield f"{name}_{called}({', '.join(map(spelling, arguments))}){';' * (not called.isupper())}"
        case ir.Clear(array, first, count):
            start = spelling(ir.Binary("+", array, first) if first else array)
            yield f"memset({start}, 0, {spelling(ir.Cast(count, 'size'))} * sizeof *{spelling(array)});"
        case ir.Discard(parameter):
            yield f"(void){parameter};"
        case ir.Comment(text):
            yield f"/* {text} */"
        case ir.Continue():
            yield "continue;"
        case ir.Return(None):
            yield "return;"
        case ir.If():
            yield from _if(s, spelling, name)
        case ir.Switch():
            yield from _switch(s, spelling, name)
        case ir.Loop():
            yield from _loop(s, spelling, name)
        case _:
            raise TypeError(s)


def _assignment(s: ir.Assign, spelling: Spelling) -> str:
    return f"{' = '.join(map(spelling, (s.target, *s.too)))} {'+=' if s.adds else '='} {spelling(s.value)}"


def _declaration(s: ir.Declare, spelling: Spelling, name: str) -> str:
    star, length = "", ""
    match s.type:
        case ir.Pointer(constant, restricted):
            kind, star = f"{'const ' * constant}double", "*restrict " if restricted else "*"
        case ir.Vector(size):
            kind, length = "double", f"[{spelling(size)}]"
        case ir.Type.ARRAYS:
            kind, star, length = "double", "*const ", "[]"
        case ir.RecordType(record):
            kind = f"{'const ' * (not s.mutable)}{name}_{record}"
        case kind_of_number:
            kind = f"{'const ' * (not s.mutable)}{_TYPES[kind_of_number]}"
    items = (f"{star}{spelling.name(symbol)}{length}{_initial(value, spelling)}" for symbol, value in s.items)
    return f"{kind} {', '.join(items)};{f' /* {s.note} */' if s.note else ''}"


def _if(s: ir.If, spelling: Spelling, name: str) -> Iterator[str]:
    then, otherwise = [*_lines(s.then, spelling, name)], [*_lines(s.otherwise, spelling, name)]
    head = f"if ({spelling(s.condition)})"
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


def _switch(s: ir.Switch, spelling: Spelling, name: str) -> Iterator[str]:
    """Yield the lines of a switch; each case is on a line if all cases are short."""
    *labels, _ = s.labels
    cases = [[*_lines(case, spelling, name)] for case in s.cases]
    one_line = [" ".join(lines) for lines in cases]
    short = all(len(lines) <= _SHORT_CASE for lines in cases) and max(map(len, one_line)) <= _CASE_WIDTH
    short = short and not any(text.startswith(("for", "if")) for text in one_line)
    yield f"switch ({spelling(s.value)}) {{"
    for head, lines in zip([*(f"case {k}:" for k in labels), "default:"], cases, strict=True):
        if short:
            yield " ".join([head, *lines, "break;"])
        else:
            yield head
            yield from _indented([*lines, "break;"])
    yield "}"


def _initial(value: ir.Value, spelling: Spelling) -> str:
    match value:
        case ir.Constant(None):
            return ""
        case ir.Listed(values):
            return f" = {{ {', '.join(map(spelling, values))} }}"
    return f" = {spelling(value)}"


def _loop(s: ir.Loop, spelling: Spelling, name: str) -> Iterator[str]:
    assert s.low is not None
    assert s.high is not None
    kind = "size_t" if s.kind == "segments" else "ptrdiff_t"
    limit = f", {s.limit} = {spelling(s.high)}" if s.limit else ""
    goes_on = f"{spelling(s.condition)} && " if s.condition else ""
    goes_on += f"{s.variable} < {s.limit or spelling(s.high)}"
    onward = f"{s.variable} += {spelling(s.step)}" if s.step else f"++{s.variable}"
    head = f"for ({kind} {s.variable} = {spelling(s.low)}{limit}; {goes_on}; {onward})"
    if s.independent:
        yield f"{name}_EACH_{s.independent}"
    if s.threads:
        yield from ("#ifdef _OPENMP", f"#pragma omp parallel for if (s->sites > {s.threads})", "#endif")
    body = [*_lines(s.body, spelling, name)]
    if s.kind == "line":
        yield f"{head} {body[0]}"
        return
    yield from (f"{head} {{{f' /* {s.note} */' if s.note else ''}", *_indented(body), "}")
