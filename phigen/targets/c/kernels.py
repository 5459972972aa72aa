"""Kernels as C functions."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from phigen.lanes.lane_functions import LANE_FORMULAS, LANE_FUNCTIONS
from phigen.scheme.kernel import EXPONENTS, SCALARS, Kernel, Role
from phigen.scheme.lowering import Assignment
from phigen.scheme.program import Program
from phigen.symbolic import functions as elementary
from phigen.symbolic.expression import Expression, topological
from phigen.symbolic.symbols import TEMPORARY, WORK, Symbol, kind_of
from phigen.targets.c.layout import comment
from phigen.targets.code import Code, StoreStatement, bound, lower, parts, with_zeros_first
from phigen.targets.header import plain, sentence
from phigen.targets.language import Language
from phigen.targets.names import Scope, identifiers
from phigen.targets.printer import Printer
from phigen.targets.reserved import C_RESERVED

FUNCTIONS = elementary.written_in("c")
# Digits, since -std=c99 hides M_PI.
LANGUAGE = Language(
    reserved=C_RESERVED,
    functions=FUNCTIONS,
    constants={"pi": "3.141592653589793", "E": "2.718281828459045"},
    declare="const double {name} = {value};",
    assign="{place} = {value};",
    subscript="{array}[{index}]",
    parameter="params->{name}",
)

#: Most assignments in one function; longer ones take quadratic time to compile.
LONGEST_FUNCTION = 200

#: Longest line that several temporaries share.
SHARED_LINE = 105


@dataclass(frozen=True)
class Form:
    """Form in which a kernel is printed as a C function called ``name``.

    An ``exported`` function takes NULL for the default parameters. ``returning`` returns the only output. ``lanes``
    evaluates at all SIMD lanes, ``single`` at one of them. ``sparse`` stores no zeros. ``functions`` are the names of
    the functions that it calls. All lanes share the arrays in ``shared``; those in ``alike`` have one value for all
    lanes if the argument ``own`` is 0. ``workspace`` is the size of the workspace of a function that is cut into parts.
    """

    name: str
    exported: bool = False
    returning: bool = False
    lanes: bool = False
    single: bool = False
    sparse: bool = False
    functions: Mapping[str, str] = field(default_factory=lambda: FUNCTIONS)
    shared: frozenset[str] = frozenset()
    alike: frozenset[str] = frozenset()
    workspace: int = 0

    def number(self, program: Program, array: str) -> str:
        """The type of an entry of an array."""
        return f"{program.name}_lanes" if self.lanes and array not in self.shared else "double"

    def lane(self, array: str) -> str:
        """The inner index of an array."""
        if not self.lanes or array in self.shared:
            return ""
        return "[own * lane]" if array in self.alike else "[lane]"


def function(
    program: Program,
    kernel: Kernel,
    *,
    name: str = "",
    exported: bool = False,
    returning: bool = False,
    lanes: bool = False,
    single: bool = False,
    sparse: bool = False,
    shared: Sequence[str] = (),
    alike: Sequence[str] = (),
    functions: Mapping[str, str] | None = None,
) -> str:
    """The C source of a kernel: one function, or a chain of static ones that share a workspace.

    With ``lanes`` the kernel is evaluated at several points: each value becomes an array over them, but for the inputs
    that are ``shared``. Of those ``alike`` all lanes read the first where the argument ``own`` is 0; compilers put such
    a kernel in the place of its calls, where that is known. A ``single`` one is evaluated at one of these points, the
    argument ``lane``, and its outputs are numbers. What is always zero is not stored if ``sparse``. ``functions`` are
    the names of those that it calls.
    """
    if functions is None:
        functions = lane_calls(program) if lanes else FUNCTIONS
    if kernel.exponents:
        return _through_exponentials(program, kernel)
    full_name = f"{program.name}_{name or kernel.name}{'_lane' if single else '_lanes' if lanes else ''}"
    plain_arrays = {*shared, "work", *(o.name for o in kernel.outputs)} if single else {*shared}
    form = Form(
        full_name, exported, returning, lanes, single, sparse, functions, frozenset(plain_arrays), frozenset(alike)
    )
    where = f" in {'one lane' if single else 'all lanes'}" if lanes else ""
    called = f"{program.name}_{name or kernel.name}{where}"
    code = lower(kernel)
    code = code if lanes else _in_order(kernel, with_zeros_first(code))
    pieces = parts(code, LONGEST_FUNCTION)
    said = [] if exported else _comment(f"{called}." if lanes else sentence(kernel.purpose))  # the header says it
    head = [*said, _signature(program, kernel, form) + "\n{"]
    if len(pieces) == 1:
        return "\n".join([*head, *_body(program, kernel, form, pieces[0]), *_exponentials(program, kernel), "}"]) + "\n"
    workspace = 1 + max((k for p in pieces for k in p.kept), default=0)
    texts = []
    for k, piece in enumerate(pieces, 1):
        part = replace(form, name=f"{full_name}_part{k}", workspace=workspace, exported=False, returning=False)
        part = replace(part, alike=frozenset())
        lines = [*_comment(f"{called}, part {k} of {len(pieces)}."), _signature(program, kernel, part) + "\n{"]
        texts.append("\n".join([*lines, *_body(program, kernel, part, piece), "}\n"]))
    arguments = ", ".join([*kernel.inputs, *(["lane"] if single else []), *(o.name for o in kernel.outputs), "work"])
    head += ["    (void)own; /* parts read every lane */"] if alike else []
    head.append(f"    {form.number(program, 'work')} work[{workspace}];")
    if exported:
        arguments = arguments.replace(f", {kernel.outputs[0].name}, work", ", value, work")
        head += [f"    double value[{len(kernel.roots)}];", *_default_parameters(program, kernel, form)]
    head += [_clear(array, size) for array, size in code.cleared]
    head += [f"    {full_name}_part{k}({arguments});" for k in range(1, len(pieces) + 1)]
    head += _exponentials(program, kernel)
    if exported:
        head.append("    return value[0];" if returning else f"    PHI_COPY(out, value, value, {len(kernel.roots)});")
    return "\n".join([*texts, *head, "}"]) + "\n"


def _exponentials(program: Program, kernel: Kernel) -> list[str]:
    """The statements that put exponentials less 1 in the places of matrices."""
    array = kernel.outputs[0].name
    return [f"    {program.name}_matrix_exponential({n}, {array} + {start});" for start, n in kernel.exponentials]


def _through_exponentials(program: Program, kernel: Kernel) -> str:
    """The transpose of a kernel with exponentials: the matrices, their cotangents, and what follows from these."""
    assert kernel.exponents is not None
    inner = kernel.exponents
    outer = replace(kernel, name=f"{kernel.name}_of_exponents", exponentials=(), exponents=None)
    plain_kernel = replace(outer, name=kernel.name, inputs={k: s for k, s in kernel.inputs.items() if k != EXPONENTS})
    form, count = Form(f"{program.name}_{kernel.name}"), len(inner.roots)
    lines = [*_comment(sentence(kernel.purpose)), _signature(program, plain_kernel, form) + "\n{"]
    lines += [f"    double {EXPONENTS}[{count}];"]
    lines += [f"    {program.name}_{inner.name}({', '.join([*inner.inputs, EXPONENTS])});"]
    place = 0
    for start, n in kernel.exponentials:
        arguments = f"{n}, coef_bar + {start}, {EXPONENTS} + {place}"
        lines.append(f"    {program.name}_matrix_exponential_adjoint({arguments});")
        place += n * n
    passed = ", ".join([*kernel.inputs, *(o.name for o in kernel.outputs)])
    lines += [f"    {program.name}_{outer.name}({passed});", "}"]
    return "\n".join([function(program, inner), function(program, outer), *lines]) + "\n"


def declaration(program: Program, kernel: Kernel, *, name: str = "", returning: bool = False) -> str:
    """Return the declaration of an exported function, as `function` defines it."""
    form = Form(f"{program.name}_{name or kernel.name}", exported=True, returning=returning)
    return f"{_signature(program, kernel, form)};"


def lane_calls(program: Program) -> Mapping[str, str]:
    """Return the names of the functions that the loops over lanes call: SIMD versions if there are any."""
    versions = {f: f"{program.name}_{f}_lane" for f in LANE_FUNCTIONS}
    return {**FUNCTIONS, **versions, **{f: text.format_map(versions) for f, text in LANE_FORMULAS.items()}}


def _in_order(kernel: Kernel, code: Code) -> Code:
    """Return code in another order: first named values, then for each output its further values and its stores."""
    by_target = {a.target: a for a in code.assignments}
    ordered: dict[str, Assignment] = {}

    def take(targets: Iterable[str]) -> None:
        needed, left = set(), [*targets]
        while left:
            target = left.pop()
            if target in by_target and target not in needed:
                needed.add(target)
                left += _reads(by_target[target].value)
        ordered.update((a.target, a) for a in code.assignments if a.target in needed)

    take(name for name, _ in kernel.named)
    for o in kernel.outputs:
        take(r for s in code.stores if s.array == o.name for r in _reads(s.value))
    return replace(code, assignments=tuple(ordered.values()))


def _reads(value: Expression) -> list[str]:
    return [e.value for e in topological([value]) if e.op == "symbol"]


def _signature(program: Program, kernel: Kernel, form: Form) -> str:
    # C99 has no conversion from double (*)[8] to const double (*)[8]: the inputs of lanes are not const.
    number = f"{program.name}_lanes" if form.lanes else "double"
    inputs, alone = (number, "restrict ") if form.lanes else ("const double", "")
    kinds = {i: ("const double", "") if i in form.shared else (inputs, alone) for i in kernel.inputs}
    arguments = [
        f"const {program.name}_params *params"
        if i == "params"
        else f"double {i}"
        if i in SCALARS
        else f"{kinds[i][0]} {i}[{kinds[i][1]}{max(1, len(symbols))}]"
        for i, symbols in kernel.inputs.items()
    ]
    # restrict: the outputs never overlap the inputs of our own calls; callers of the API get no such duty.
    qualifier = "" if form.exported else "restrict "
    arguments += ["int lane"] if form.single else []
    arguments += ["int own"] if form.alike else []
    for o in () if form.returning else kernel.outputs:
        # The caller of NAME_casimirs sizes the array by NAME_CASIMIRS, which may be 0.
        length = "" if form.exported and kernel.role is Role.CASIMIRS else f"{qualifier}{max(1, len(o.values))}"
        arguments.append(f"{form.number(program, o.name)} {o.name}[{length}]")
    if form.workspace:
        arguments.append(f"{form.number(program, 'work')} work[restrict {form.workspace}]")
    linkage = f"{program.name}_APART static " if form.workspace else "" if form.exported else "static "
    linkage = f"{program.name}_IN_PLACE static inline " if form.alike else linkage
    return f"{linkage}{'double' if form.returning else 'void'} {form.name}({', '.join(arguments)})"


def _body(program: Program, kernel: Kernel, form: Form, code: Code) -> list[str]:
    arrays = [*kernel.inputs, *(o.name for o in kernel.outputs), "work", "lane", *(["own"] if form.alike else [])]
    calls = {f: f"{program.name}_{f}" for f in elementary.FUNCTIONS} | dict(form.functions)
    called = re.findall(r"[A-Za-z_]\w*", " ".join(calls.values()))
    scope = Scope(C_RESERVED | {*arrays, *called})
    declared = _bound(program, kernel, form, code, scope)
    for k in range(form.workspace):
        scope.bind(Symbol(WORK, k), f"work[{k}]{form.lane('work')}")
    for k, a in enumerate((a for a in code.assignments if kind_of(a.target) == TEMPORARY), 1):
        scope.bind(a.target, f"t{k}")
    show = printer(scope, calls)
    stores = [s for s in code.stores if not (form.sparse and s.value.is_zero)]
    touched = {i for i, symbols in kernel.inputs.items() if not code.used.isdisjoint(symbols)}
    lines = [f"    const double {', '.join(declared)};"] if declared else []
    lines += _statements(kernel, form, code, stores, scope, show)
    unused = [i for i in kernel.inputs if i not in touched]
    written = {*(s.array for s in stores), *(array for array, _ in code.cleared)}
    unused += [o.name for o in kernel.outputs if o.name not in written]
    if form.workspace and not any("work[" in line for line in lines):
        unused.append("work")
    if form.alike and form.alike.isdisjoint(touched):
        unused.append("own")
    if form.returning:
        lines = [line.replace(f"{kernel.outputs[0].name}[0] =", "return", 1) for line in lines]
    head = [f"    {', '.join(f'(void){u}' for u in unused)};"] if unused else []
    head += _default_parameters(program, kernel, form) if "params" in touched else []
    if not form.lanes or form.single:
        return [*head, *lines]
    loop = [f"    {program.name}_EACH_LANE", f"    for (int lane = 0; lane < {program.name}_LANES; ++lane) {{"]
    return [*head, *loop, *(f"    {line}" for line in lines), "    }"]


def _default_parameters(program: Program, kernel: Kernel, form: Form) -> list[str]:
    optional = form.exported and "params" in kernel.inputs
    return ["    PHI_DEFAULT_PARAMETERS"] if optional else []


def _bound(program: Program, kernel: Kernel, form: Form, code: Code, scope: Scope) -> list[str]:
    """Bind the used inputs of a kernel in a scope, and return the declarations of those that get a variable.

    Exported functions read all inputs before they write any output, since their arguments may overlap.
    """
    member = members(program)

    def entry(array: str, i: int, s: str) -> str:
        return array if array in SCALARS else f"{array}[{i}]{form.lane(array)}"

    named = bound(kernel, code, scope, lambda s: f"params->{member[s]}", entry, named=form.exported)
    return [f"{name} = {place}" for name, place in named]


def _statements(
    kernel: Kernel, form: Form, code: Code, stores: Sequence[StoreStatement], scope: Scope, show: Printer
) -> Iterator[str]:
    """Assignments and stores; those of a kernel with several outputs under headings."""
    order = {a.target: k for k, a in enumerate(code.assignments)}
    split = len(kernel.outputs) > 1 and not form.lanes and not form.workspace
    groups = (
        [(o.name, [s for s in stores if s.array == o.name]) for o in kernel.outputs] if split else [("", [*stores])]
    )
    named = [order[name] for name, _ in kernel.named if name in order]
    ends = [1 + max((order[r] for s in of for r in _reads(s.value) if r in order), default=-1) for _, of in groups]
    done = 0
    if split and named:
        yield "    /* momenta */"
        ends.insert(0, max(named) + 1)
        groups.insert(0, ("", []))
    if not split:
        ends = [len(code.assignments)]
        yield from (_clear(array, size) for array, size in code.cleared)
    for (heading, of), end in zip(groups, ends, strict=True):
        if heading:
            yield f"    /* {heading.replace('_', ' ')} */"
        yield from _declared((a.target, f"{scope[a.target]} = {show(a.value)}") for a in code.assignments[done:end])
        done = max(done, end)
        yield from (_clear(array, size) for array, size in code.cleared if array == heading)
        for s in of:
            yield f"    {s.array}[{s.index}]{form.lane(s.array)} = {show(s.value)};"


def _clear(array: str, size: int) -> str:
    return f"    PHI_CLEAR_FIRST({array}, {size});"


def _declared(assignments: Iterable[tuple[str, str]]) -> Iterator[str]:
    """Statements for assignments to workspace or to constants; short ones share lines."""
    line = ""
    for target, text in assignments:
        joined = f"{line}, {text}" if line else f"    const double {text}"
        if line and (kind_of(target) == WORK or len(joined) > SHARED_LINE):
            yield f"{line};"
            joined = f"    const double {text}"
        line = joined
        if kind_of(target) == WORK:
            yield f"    {text};"
            line = ""
    if line:
        yield f"{line};"


def printer(scope: Scope, functions: Mapping[str, str] = FUNCTIONS) -> Printer:
    """Prints lowered trees in C, with the names of a scope."""
    return replace(LANGUAGE, functions=functions).printer(scope)


def members(program: Program) -> dict[str, str]:
    """The members of the parameter struct, by the names of the parameters."""
    return identifiers((p.name for p in program.parameters), C_RESERVED)


def _comment(text: str) -> list[str]:
    return comment(f"/* {plain(text)} */")
