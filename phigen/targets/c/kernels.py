"""Kernels as C functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from phigen.ir import nodes as ir
from phigen.ir.kernel_functions import kernel_function
from phigen.ir.passes.cutting import cut, workspace
from phigen.ir.passes.forms import SIMD, calling
from phigen.ir.passes.function_parameters import discard_unread
from phigen.ir.passes.output_order import in_output_order
from phigen.ir.passes.simd_lanes import in_lanes
from phigen.ir.passes.zeros import without_zeros, zeros_first
from phigen.scheme.kernel import EXPONENTS, SCALARS, Kernel, Role
from phigen.scheme.program import Program
from phigen.targets.c.language import members
from phigen.targets.c.layout import comment
from phigen.targets.c.loops import statements
from phigen.targets.c.real import real_of
from phigen.targets.header import plain, sentence

#: Largest number of assignments in a function. The time of compilation grows as the square of this number.
LONGEST_FUNCTION = 200

#: Largest length of a line that declares several temporaries.
SHARED_LINE = 105


@dataclass(frozen=True)
class Form:
    """The form in which a kernel is printed as a C function called ``name``.

    An ``exported`` function accepts NULL for the default parameters. With ``returning``, the only output is the return
    value. With ``lanes``, the kernel is evaluated in all SIMD lanes, and with ``single`` in one lane. Arrays in
    ``shared`` have one value for all lanes; arrays in ``alike`` have one value for all lanes if the argument
    ``distinct_coef`` is 0. ``workspace`` is the length of the workspace array of a function that is cut into parts.
    ``linkage`` stands before the type of a static function.
    """

    name: str
    exported: bool = False
    returning: bool = False
    lanes: bool = False
    single: bool = False
    shared: frozenset[str] = frozenset()
    alike: frozenset[str] = frozenset()
    workspace: int = 0
    linkage: str = "static"

    def number(self, program: Program, array: str) -> str:
        """Return the C type of an element of an argument."""
        return f"{program.name}_lanes" if self.lanes and array not in self.shared else real_of(program).name


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
    versions: Mapping[str, str] | None = None,
    linkage: str = "static",
) -> str:
    """Return the C source of a kernel: a function, or static functions that are called in turn and share a workspace
    array.

    With ``lanes``, the kernel is evaluated at several points: each value becomes an array over the lanes, except for
    the inputs in ``shared``. The inputs in ``alike`` may be equal in all lanes: if the argument ``distinct_coef`` is 0,
    all lanes read the first lane. A kernel with inputs of this kind is inlined where the value of the argument is
    known.

    With ``single``, the kernel is evaluated in one lane, whose number is the argument ``lane``, and its outputs are
    numbers. With ``sparse``, outputs that are always zero are not stored. ``versions`` maps elementary functions to the
    functions that are called in their place (`phigen.ir.passes.forms`).
    """
    if kernel.exponents:
        return _through_exponentials(program, kernel)
    full_name = f"{program.name}_{name or kernel.name}{'_lane' if single else '_lanes' if lanes else ''}"
    plain_arrays = {*shared, "work", *(o.name for o in kernel.outputs)} if single else {*shared}
    form = Form(
        full_name, exported, returning, lanes, single, frozenset(plain_arrays), frozenset(alike), linkage=linkage
    )
    where = f", in {'one lane' if single else 'all lanes'}" if lanes else ""

    def after_passes(*, whole: bool) -> ir.Function:
        built = kernel_function(kernel, members(program), named=exported and whole)
        built = calling(built, versions or (SIMD if lanes else {}))
        built = without_zeros(built) if sparse else built if lanes else zeros_first(built)
        return built if lanes else in_output_order(built, [name for name, _ in kernel.named], by_output=whole)

    built = after_passes(whole=True)
    pieces = cut(built, LONGEST_FUNCTION)
    whole = len(pieces) == 1
    if not whole:
        built = after_passes(whole=False)
        pieces = cut(built, LONGEST_FUNCTION)
    # The comment of an exported function is in the header, so none is printed here.
    said = [] if exported else _comment(sentence(kernel.purpose + where))
    head = [*said, _signature(program, kernel, form) + "\n{"]
    if whole:
        return "\n".join([*head, *_body(program, kernel, form, built), *_exponentials(program, kernel), "}"]) + "\n"
    size = workspace(pieces)
    texts = []
    for k, piece in enumerate(pieces, 1):
        part = replace(form, name=f"{full_name}_part{k}", workspace=size, exported=False, returning=False)
        part = replace(part, alike=frozenset())
        lines = [
            *_comment(f"{program.name}_{name or kernel.name}{where}, part {k} of {len(pieces)}."),
            _signature(program, kernel, part) + "\n{",
        ]
        texts.append("\n".join([*lines, *_body(program, kernel, part, piece), "}\n"]))
    arguments = ", ".join([*kernel.inputs, *(["lane"] if single else []), *(o.name for o in kernel.outputs), "work"])
    head += ["    (void)distinct_coef; /* parts read every lane */"] if alike else []
    head.append(f"    {form.number(program, 'work')} work[{size}];")
    if exported:
        arguments = arguments.replace(f", {kernel.outputs[0].name}, work", ", value, work")
        head += [
            f"    {real_of(program).name} value[{len(kernel.roots)}];",
            *_default_parameters(program, kernel, form),
        ]
    cleared = built.with_body(*(s for s in built.body if isinstance(s, ir.Clear)))
    head += statements(cleared, program)
    head += [f"    {full_name}_part{k}({arguments});" for k in range(1, len(pieces) + 1)]
    head += _exponentials(program, kernel)
    if exported:
        head.append("    return value[0];" if returning else f"    PHI_COPY(out, value, value, {len(kernel.roots)});")
    return "\n".join([*texts, *head, "}"]) + "\n"


def _exponentials(program: Program, kernel: Kernel) -> list[str]:
    """Return the statements that replace matrices in an array by their exponentials minus 1."""
    array = kernel.outputs[0].name
    return [f"    {program.name}_matrix_exponential({n}, {array} + {start});" for start, n in kernel.exponentials]


def _through_exponentials(program: Program, kernel: Kernel) -> str:
    """Return the transpose of a kernel that computes matrix exponentials, as several functions.

    There is a function for the matrices, a function for their cotangents, and the function of the kernel, which calls
    both.
    """
    assert kernel.exponents is not None
    inner = kernel.exponents
    outer = replace(kernel, name=f"{kernel.name}_of_exponents", exponentials=(), exponents=None)
    plain_kernel = replace(outer, name=kernel.name, inputs={k: s for k, s in kernel.inputs.items() if k != EXPONENTS})
    form, count = Form(f"{program.name}_{kernel.name}"), len(inner.roots)
    lines = [*_comment(sentence(kernel.purpose)), _signature(program, plain_kernel, form) + "\n{"]
    lines += [f"    {real_of(program).name} {EXPONENTS}[{count}];"]
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
    """Return the declaration of the exported C function of a kernel."""
    form = Form(f"{program.name}_{name or kernel.name}", exported=True, returning=returning)
    return f"{_signature(program, kernel, form)};"


def _signature(program: Program, kernel: Kernel, form: Form) -> str:
    # Inputs in lanes are not const, because C99 does not convert double (*)[8] to const double (*)[8].
    real = real_of(program).name
    inputs, alone = (f"{program.name}_lanes", "restrict ") if form.lanes else (f"const {real}", "")
    kinds = {i: (f"const {real}", "") if i in form.shared else (inputs, alone) for i in kernel.inputs}
    arguments = [
        f"const {program.name}_params *params"
        if i == "params"
        else f"{real} {i}"
        if i in SCALARS
        else f"{kinds[i][0]} {i}[{kinds[i][1]}{max(1, len(symbols))}]"
        for i, symbols in kernel.inputs.items()
    ]
    # Inside a solver, inputs and outputs never overlap, so that restrict is correct. Callers of exported functions may
    # pass arrays that overlap.
    qualifier = "" if form.exported else "restrict "
    arguments += ["int lane"] if form.single else []
    arguments += ["int distinct_coef"] if form.alike else []
    for o in () if form.returning else kernel.outputs:
        # A solver may have no Casimirs. The array of NAME_casimirs would then have the length 0, so its length is left
        # out.
        length = "" if form.exported and kernel.role is Role.CASIMIRS else f"{qualifier}{max(1, len(o.values))}"
        arguments.append(f"{form.number(program, o.name)} {o.name}[{length}]")
    if form.workspace:
        arguments.append(f"{form.number(program, 'work')} work[restrict {form.workspace}]")
    linkage = f"{program.name}_APART static " if form.workspace else "" if form.exported else f"{form.linkage} "
    linkage = f"{program.name}_IN_PLACE static inline " if form.alike else linkage
    return f"{linkage}{real if form.returning else 'void'} {form.name}({', '.join(arguments)})"


def _body(program: Program, kernel: Kernel, form: Form, built: ir.Function) -> list[str]:
    """Return the lines of the body of a function. Arguments that are never read are marked as unused."""
    parameters = [*kernel.inputs, *(() if form.returning else (o.name for o in kernel.outputs))]
    parameters += [*["work"] * bool(form.workspace), *["distinct_coef"] * bool(form.alike), *["lane"] * form.single]
    if form.returning:
        *others, last = built.body
        assert isinstance(last, ir.Assign)
        built = built.with_body(*others, ir.Return(last.value))
    built = replace(built, parameters=tuple(parameters))
    if form.lanes:
        built = in_lanes(built, form.shared, form.alike, single=form.single)
    built = discard_unread(built)
    defaults = [] if ir.Discard("params") in built.body else _default_parameters(program, kernel, form)
    return [*defaults, *statements(built, program, shared_line=SHARED_LINE)]


def _default_parameters(program: Program, kernel: Kernel, form: Form) -> list[str]:
    optional = form.exported and "params" in kernel.inputs
    return ["    PHI_DEFAULT_PARAMETERS"] if optional else []


def _comment(text: str) -> list[str]:
    return comment(f"/* {plain(text)} */")
