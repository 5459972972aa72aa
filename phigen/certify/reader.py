"""Reader of generated C: it converts functions to lists of operations, on which certificates are based."""

from __future__ import annotations

import ast
import itertools
import keyword
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from phigen.certify.checker import LIBM, SERIES, RefusedError

_OPERATIONS = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.Div: "div"}

#: Name of the array through which the parts of a long C function pass values to each other.
_WORK = "work"

#: Pattern of floating-point literals in C, with a point or an exponent; integer literals are indices and do not match.
_NUMBER = r"(?<![\w.])(\d+\.\d*(?:e[-+]?\d+)?|\d+e[-+]?\d+)"

#: Pattern of Python's keywords, which are identifiers in C.
_KEYWORDS = rf"\b({'|'.join(keyword.kwlist)})\b"

#: Suffix that Python's keywords get while C is parsed as Python. No name in generated C ends in this character.
_SUFFIX = "π"

#: Line in the C of splittings with `adjoint: true`. It copies the state, and has no effect on the result of a step.
_TAPE = "if (tape != NULL) memcpy(tape++, x, sizeof *tape);"


class GeneratedC:
    """Generated C file, without comments. The name of the solver, which is the prefix of names, is removed.

    If a function would then have the name of a function of libm, its prefix becomes ``own_``.
    """

    def __init__(self, text: str, name: str) -> None:
        prefix, shadows = rf"\b{re.escape(name)}_" if name else r"\b_", "|".join(LIBM)
        text = re.sub(rf"{prefix}(?=(?:{shadows})\()", "own_", text)
        self.text = re.sub(rf"/\*.*?\*/|{prefix}(?=[A-Za-z])", "", text, flags=re.DOTALL)

    def function(self, name: str) -> tuple[list[str], str] | None:
        """Return the names of the arguments, and the body, of the C function ``name``; None if there is no such
        function."""
        matched = re.search(rf"\b{name}\(([^{{}};]*)\)\s*\{{\n(.*?)\n\}}", self.text, re.DOTALL)
        if not matched:
            return None
        arguments = re.findall(r"(\w+)(?:\[(?:restrict )?\w*\])*\s*(?:,|$)", matched[1])
        return arguments, matched[2]

    def has(self, name: str) -> bool:
        """Return whether the file has a function with this name."""
        return self.function(name) is not None

    def numbers(self, name: str, text: str | None = None) -> list[float]:
        """Return the numbers in the definition of ``name``: a static array, a macro, or an enumeration constant.

        Raises `RefusedError` if there is no such definition.
        """
        text = self.text if text is None else text
        matched = re.search(
            rf"\b{name}(?:\[\w+\])+ =\s*\{{(.*?)\}};|define {name} (.*)|\b{name} = (\d+)", text, re.DOTALL
        )
        if not matched:
            raise RefusedError(f"the C has no {name}")
        number_text = matched[1] or matched[2] or matched[3]
        return [float(v) for v in re.findall(r"-?\d[\d.]*(?:e[-+]?\d+)?", number_text)]

    def number(self, name: str) -> float:
        """Return the value of the macro or enumeration constant ``name``."""
        return self.numbers(name)[0]


class KernelReader:
    """The operations of one C function, in their order. A value that the C uses several times occurs once.

    ``outputs[array][i]`` is the index of the operation that computes entry i of an array. If the C computes a function
    by a polynomial, the constructor adds this function to ``series``.
    """

    def __init__(self, source: GeneratedC, function: str, series: dict[str, Any]) -> None:
        self.operations: list[list[Any]] = []
        self.outputs: dict[str, dict[int, int]] = {}
        self._source, self._series = source, series
        self._inputs: dict[tuple[str, Any], int] = {}
        arguments, body = _expect(source.function(function), function)
        self._names: dict[str, Any] = {a: a for a in arguments}
        self._run(body)

    @property
    def described(self) -> dict[str, Any]:
        """The operations and outputs of the function, in the format of certificates."""
        described_outputs = {name: entries for name, entries in self.outputs.items() if name != _WORK}
        outputs = {name: [entries[i] for i in range(len(entries))] for name, entries in described_outputs.items()}
        return {"operations": self.operations, "outputs": outputs}

    def _run(self, body: str) -> None:
        body = re.sub(_NUMBER, r'"\1"', body.replace("->", "."))
        for statement in (" ".join(s.split()) for s in body.split(";")):
            if statement.startswith("return "):
                self.outputs["value"] = {0: self._index(_parsed(statement.removeprefix("return ")))}
            elif statement.startswith("const double "):
                call = _parsed(f"declare({statement.removeprefix('const double ')})")
                for declared in call.keywords if isinstance(call, ast.Call) else ():
                    self._names[str(declared.arg)] = self._index(declared.value)
            elif cleared := re.fullmatch(r"(?:\(void\))?memset\((\w+), 0, (\d+) \* sizeof \w+\[0\]\)", statement):
                self.outputs[cleared[1]] = dict.fromkeys(range(int(cleared[2])), self._operation("number", 0.0))
            elif re.fullmatch(r"\w+_part\d+\(.*\)", statement):  # call of a function with a part of the body
                self._run(_expect(self._source.function(statement.split("(")[0]), statement)[1])
            elif statement and not re.fullmatch(rf"\(void\)\w+(?:, \(void\)\w+)*|double {_WORK}\[\d+\]", statement):
                self._store(statement)

    def _store(self, statement: str) -> None:
        match _parsed(statement, mode="exec"):
            case ast.Assign([ast.Subscript(ast.Name(array), ast.Constant(int(entry)))], value):
                self.outputs.setdefault(array, {})[entry] = self._index(value)
            case _:
                raise RefusedError(f"the C has the statement {statement!r}, which certificates do not cover")

    def _index(self, e: ast.expr) -> int:
        """Append those operations of an expression that are not in the list yet, and return the index of its value."""
        match e:
            case ast.Constant(str(text)):
                return self._operation("number", float(text))
            case ast.Name(name) if isinstance(self._names.get(name), int):
                return int(self._names[name])
            case ast.Name(name) if name in self._names:
                return self._input(name, 0)
            case ast.Attribute(ast.Name(record), field):
                return self._input(record, field)
            case ast.Subscript(ast.Name(array), ast.Constant(int(entry))) if entry in self.outputs.get(array, {}):
                return self.outputs[array][entry]
            case ast.Subscript(ast.Name(array), ast.Constant(int(entry))):
                return self._input(array, entry)
            case ast.UnaryOp(ast.USub(), ast.Constant(str(text))):
                return self._operation("number", -float(text))
            case ast.UnaryOp(ast.USub(), operand):
                return self._operation("neg", self._index(operand))
            case ast.BinOp(left, operator, right) if type(operator) in _OPERATIONS:
                return self._operation(_OPERATIONS[type(operator)], self._index(left), self._index(right))
            case ast.Call(ast.Name(name), [argument]):
                return self._operation(self._function(name), self._index(argument))
        raise RefusedError(f"the C has {ast.unparse(e)!r}, which certificates do not cover")

    def _operation(self, name: str, *operands: Any) -> int:
        self.operations.append([name, *operands])
        return len(self.operations) - 1

    def _input(self, array: str, entry: Any) -> int:
        if (array, entry) not in self._inputs:
            self._inputs[array, entry] = self._operation("input", array, entry)
        return self._inputs[array, entry]

    def _function(self, name: str) -> str:
        if not self._source.has(name):
            if name not in LIBM:
                raise RefusedError(f"the C calls {name}, which certificates do not cover")
            return name
        series = name.removeprefix("own_")
        if series not in SERIES:
            raise RefusedError(f"the C calls {name}, which certificates do not cover")
        if f"series:{series}" not in self._series:
            self._series[f"series:{series}"] = _polynomial(self._source, name)
        return f"series:{series}"


class PathReader(KernelReader):
    """The operations that compute the Taylor series of a path, from the coordinates at its start.

    ``outputs[f"s{i}"][k]`` is the index of the operation that computes coefficient k in the series of coordinate i.
    """

    def __init__(self, source: GeneratedC, series: dict[str, Any], coordinates: int, orders: int) -> None:
        self._known = [f"s{i}" for i in range(coordinates)]
        super().__init__(source, "path_begin", series)
        _, body = _expect(source.function("path_order"), "path_order")
        unused = r"(?:\s*\(void\)\w+(?:, \(void\)\w+)*;)?"
        matched = re.fullmatch(unused + r"\s*if \(k > 0\) \{(.*?)\n    \}\n(.*)", body, re.DOTALL)
        if not matched:
            raise RefusedError("the C has recurrences of paths that certificates do not cover")
        for k in range(orders):
            text = (matched[1] if k > 0 else "") + matched[2]
            text = (
                text.replace("(double)(k + 1)", f"{k + 1}.0").replace("[k + 1]", f"[{k + 1}]").replace("[k]", f"[{k}]")
            )
            self._run(re.sub(r", k\)", f", {k})", text))

    @property
    def described(self) -> dict[str, Any]:
        """The operations and the Taylor coefficients of a path, in the format of certificates."""
        outputs = {name: list(self.outputs[name].values()) for name in self._known}
        return {"operations": self.operations, "outputs": outputs}

    def _run(self, body: str) -> None:
        super()._run(re.sub(r"\bs\[(\d+)\](?=[\[,)])", r"s\1", body))

    def _index(self, e: ast.expr) -> int:
        match e:
            case ast.Call(ast.Name("taylor_product"), [ast.Name(a), ast.Name(b), ast.Constant(int(k))]):
                return self._sum([self._times(a, j, b, k - j) for j in range(k + 1)])
            case ast.Call(ast.Name("taylor_chain"), [ast.Name(a), ast.Name(b), ast.Constant(int(k))]):
                terms = [self._times(a, j, b, k - j, self._operation("number", float(j))) for j in range(1, k + 1)]
                return self._operation("div", self._sum(terms), self._operation("number", float(k)))
            case ast.Call(ast.Name("taylor_power"), [ast.Name(a), ast.Name(b), r, ast.Constant(int(k))]):
                power, order = self._operation("add", self._index(r), self._operation("number", 1.0)), float(k)
                terms = []
                for j in range(1, k + 1):
                    factor = self._operation("mul", power, self._operation("number", float(j)))
                    factor = self._operation("sub", factor, self._operation("number", order))
                    terms.append(self._times(a, j, b, k - j, factor))
                return self._operation("div", self._sum(terms), self._operation("number", order))
        return super()._index(e)

    def _times(self, a: str, i: int, b: str, j: int, factor: int | None = None) -> int:
        first, second = (self._coefficient(*entry) for entry in ((a, i), (b, j)))
        return self._operation("mul", first if factor is None else self._operation("mul", factor, first), second)

    def _coefficient(self, array: str, order: int) -> int:
        entries = self.outputs.get(array, {})
        return entries[order] if order in entries else self._input(array, order)

    def _sum(self, terms: list[int]) -> int:
        total = terms[0]
        for term in terms[1:]:
            total = self._operation("add", total, term)
        return total


def _polynomial(source: GeneratedC, name: str) -> dict[str, Any]:
    """Return the polynomial by which the C computes a function of small arguments, and the bound for these
    arguments.
    """
    (argument,), body = _expect(source.function(name), name)
    branch = re.search(r"if \(fabs\(\w+\) [<>] ([\d.]+)\)", body)
    library_name = name.removeprefix("own_")
    beyond = re.search(rf"if \(fabs\({argument}\) > [\d.]+\) return {library_name}\({argument}\);", body) is not None
    if not branch:
        raise RefusedError(f"{name} of the C has no polynomial for small arguments")
    if "central[" in body:
        value = ""
        for c in reversed(source.numbers("central", body)):
            value = f"({value}) * {argument} + {c!r}" if value else repr(c)
        body = f"return {value};"
    else:
        body = re.sub(r"if \(fabs\([^{;]*(?:\{[^\n]*\}|\{.*?\n    \}|;)\n", "", body, count=1, flags=re.DOTALL)
    inner = GeneratedC(f"f({argument})\n{{\n{body}\n}}", "")
    kernel = KernelReader(inner, "f", {})
    operations = [["s", 0] if op[0] == "input" else op for op in kernel.operations]
    return {
        "name": library_name,
        "beyond": beyond and library_name in LIBM,
        "radius": float(branch[1]),
        "operations": operations,
    }


def _parsed(text: str, mode: str = "eval") -> Any:
    """Return the Python syntax tree of an expression or assignment in C."""
    try:
        tree = ast.parse(re.sub(_KEYWORDS, rf"\1{_SUFFIX}", text), mode=mode)
    except SyntaxError:
        raise RefusedError(f"the C has {text!r}, which certificates do not cover") from None
    for node in ast.walk(tree):
        match node:
            case ast.Name(name):
                node.id = name.removesuffix(_SUFFIX)
            case ast.Attribute(_, name):
                node.attr = name.removesuffix(_SUFFIX)
            case ast.keyword(str(name)):
                node.arg = name.removesuffix(_SUFFIX)
    return tree.body if isinstance(tree, ast.Expression) else tree.body[0]  # type: ignore[attr-defined]


def _expect(function: tuple[list[str], str] | None, name: str) -> tuple[list[str], str]:
    if function is None:
        raise RefusedError(f"the C has no function {name}")
    return function


def read(text: str, name: str) -> dict[str, Any]:
    """Return the data about the C of a solver that a certificate needs: the kind of step, the functions as lists of
    operations, and tables.

    Raises `RefusedError` for C that certificates do not cover.
    """
    source, series = GeneratedC(text, name), dict[str, Any]()
    kind = next((kind for kind, functions in _FUNCTIONS.items() if source.has(functions[-1])), "")
    if not kind:
        raise RefusedError("the C has a kind of step that certificates do not cover")
    facts = _FACTS[kind](source)
    names = [f for f in (*_FUNCTIONS[kind][:-1], "at_time") if source.has(f)]
    names += _FUNCTIONS[kind][-1:] if kind != "splitting" else [f"change{flow}" for flow in facts["moves"]]
    kernels = {name: KernelReader(source, name, series).described for name in names if name not in _OF_PATHS}
    if "prepare_row" in kernels:
        kernels["prepare"] = kernels.pop("prepare_row")
    kernels["prepare"]["outputs"].setdefault("coef", [])
    fractions = source.numbers("fractions") if re.search(r"\bfractions\[", source.text) else [1.0]
    moments = {"splitting": "moments"}.get(kind, "middles")
    middles = source.numbers(moments) if "at_time" in kernels else []
    return {"kind": kind, "fractions": fractions, "middles": middles, **facts, "kernels": kernels, "series": series}


#: Kind of step → names of the C functions that are read. The last function of a kind identifies this kind. If the C has
#: the last functions of several kinds, the kind that is listed first counts.
_FUNCTIONS = {
    "path": ("prepare", "generate", "path_begin", "path_order"),
    "newton": ("prepare", "linearise"),
    "gauss": ("prepare", "stage_field", "stage_change"),
    "splitting": ("prepare_row", "flows"),
    "explicit": ("prepare", "explicit"),
}


#: Names of functions that compute paths; they are read by `PathReader`, not by `KernelReader`.
_OF_PATHS = ("path_begin", "path_order")


def _path(source: GeneratedC) -> dict[str, Any]:
    names = {"negligible": "NEGLIGIBLE", "least_share": "LEAST_SHARE", "difference": "DIFFERENCE", "solved": "SOLVED",
             "nearly_solved": "NEARLY_SOLVED", "shrinking": "SHRINKING", "most_terms": "TERMS"}  # fmt: skip
    return {key: source.number(name) for key, name in names.items()}


def _newton(source: GeneratedC) -> dict[str, Any]:
    names = {"floor": "FLOOR", "tolerance": "TOLERANCE", "nearly_solved": "NEARLY_SOLVED"}
    return {key: source.number(name) for key, name in names.items()}


def _gauss(source: GeneratedC) -> dict[str, Any]:
    weights, mixing = source.numbers("weights"), source.numbers("mixing")
    lanes = len(weights)  # number of entries of a row, which may be padded to whole SIMD vectors
    nodes = len(mixing) // lanes
    rows = [mixing[j * lanes : j * lanes + nodes] for j in range(nodes)]
    names = {"solved": "SOLVED", "stalled": "STALLED", "rounding": "ROUNDING", "nearly_rounding": "NEARLY_ROUNDING"}
    numbers = {key: source.number(name) for key, name in names.items()}
    return {"weights": weights[:nodes], "mixing": rows, "plain": int(source.number("PLAIN")), **numbers}


def _splitting(source: GeneratedC) -> dict[str, Any]:
    """Return the tables of a splitting: durations of flows, sequences of flows, and the coordinates that each flow
    changes.

    A method with a corrector has three sequences (inverse corrector, step, corrector), other methods have one.
    """
    row = int(source.number("ROW"))
    schedules = [_schedule(source, "flows", {"coef": 0, "ROW": row})]
    if source.has("corrector"):
        correctors = [_schedule(source, "corrector", {"coef": 0, "ROW": row, "after": is_after}) for is_after in (0, 1)]
        schedules = [correctors[0], *schedules, correctors[1]]
    moves = {str(flow): _moves(source, flow) for flow in sorted({flow for called in schedules for flow, _ in called})}
    multiples = source.numbers("multiples") if re.search(r"\bmultiples\[", source.text) else []
    return {"fractions": source.numbers("times"), "multiples": multiples, "schedules": schedules, "moves": moves}


def _schedule(source: GeneratedC, function: str, names: dict[str, int]) -> list[list[int]]:
    """Return the flows that a C function calls in order, each as [number of the flow, row of coefficients]."""
    _, body = _expect(source.function(function), function)
    return _called(_block(iter(map(str.strip, body.splitlines()))), names, [])


#: Largest number of flows in a step, counting each iteration of a loop.
MOST_FLOWS = 10_000


def _block(lines: Iterator[str]) -> list[tuple[str, Any]]:
    """Parse statements up to the end of a block: loops, calls of flows, and statements that advance the pointer
    ``coef``."""
    statements = list[tuple[str, Any]]()
    for line in itertools.takewhile(lambda line: line != "}", lines):
        loop = re.fullmatch(r"for \(int (\w+) = (\d+); \w+ < (\d+); (?:\+\+\w+|\w+ \+= (\d+))\) \{", line)
        call = re.fullmatch(r"flow(\d+)\((.*), x, displacement, start\);", line)
        advance = re.fullmatch(r"coef \+= (.*);", line)
        if loop and int(loop[3]) <= MOST_FLOWS:
            statements.append(("loop", (loop[1], range(int(loop[2]), int(loop[3]), int(loop[4] or 1)), _block(lines))))
        elif call:
            statements.append(("call", (int(call[1]), call[2])))
        elif advance:
            statements.append(("advance", advance[1]))
        elif line not in ("", _TAPE):
            raise RefusedError(f"the C has the statement {line!r}, which certificates do not cover")
    return statements


def _called(statements: list[tuple[str, Any]], names: dict[str, int], called: list[list[int]]) -> list[list[int]]:
    """Execute parsed statements: append the flows that they call to ``called``, and return ``called``.

    Each flow is appended as [number of the flow, row of coefficients]. ``names`` has the values of loop variables and
    of ``coef``.
    """
    for kind, about in statements:
        if kind == "call":
            called.append([about[0], _integer_value(about[1], names) // names["ROW"]])
            if len(called) > MOST_FLOWS:
                raise RefusedError(f"a step of the C has more than {MOST_FLOWS} flows, the limit of certificates")
        elif kind == "advance":
            names["coef"] += _integer_value(about, names)
        else:
            variable, rounds, inner = about
            for names[variable] in rounds:
                _called(inner, names, called)
    return called


def _integer_value(text: str, names: Mapping[str, int]) -> int:
    """Return the value of an integer expression in C with the given ``names``. Raises `RefusedError` for other
    expressions."""

    def value(node: ast.expr) -> int:
        match node:
            case ast.Constant(int(number)):
                return number
            case ast.Name(name) if name in names:
                return names[name]
            case ast.BinOp(left, ast.Add(), right):
                return value(left) + value(right)
            case ast.BinOp(left, ast.Mult(), right):
                return value(left) * value(right)
            case ast.IfExp(condition, then, otherwise):
                return value(then) if value(condition) else value(otherwise)
        raise RefusedError(f"the C has {text!r} where whole numbers are expected")

    try:
        text = re.sub(r"\((\w+) \? (\w+) : (\w+)\)", r"(\2 if \1 else \3)", text)
        return value(ast.parse(text, mode="eval").body)
    except (SyntaxError, ValueError, RecursionError):
        raise RefusedError(f"the C has {text!r} where whole numbers are expected") from None


def _moves(source: GeneratedC, flow: int) -> list[list[int]]:
    """Return the coordinates that a flow changes, as pairs [i, j]: the flow adds its increment j to coordinate i."""
    _, body = _expect(source.function(f"flow{flow}"), f"flow{flow}")
    changes = re.findall(r"add\(x, displacement, start, (\d+), change\[(\d+)\]\);", body)
    if len(changes) != body.count(";") - 2:
        raise RefusedError(f"function flow{flow} of the C has statements that certificates do not cover")
    return [[int(i), int(j)] for i, j in changes]


_FACTS: dict[str, Callable[[GeneratedC], dict[str, Any]]] = {
    "path": _path,
    "newton": _newton,
    "gauss": _gauss,
    "splitting": _splitting,
    "explicit": lambda source: {},
}
