"""A program as C source: `NAME.h` and `NAME.c`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.steps import (
    LONGEST_PATH,
    MOST_PIECES,
    PLAUSIBLE,
    Explicit,
    Implicit,
    InnerSolve,
    Newton,
    Path,
    Splitting,
)
from phigen.spec.model import Parameter
from phigen.targets import special
from phigen.targets.c import extras, lanes, packs, small, splitting
from phigen.targets.c.kernels import LANES, apart, function, members, printer, wrapped_arguments
from phigen.targets.header import CHECKSUM, checksum, header_lines, plain
from phigen.targets.path import Syntax, kinds, reads_coefficients, statements
from phigen.targets.rendering import render

#: Backward differences kept for the starting guess of the inner solve.
HISTORY = 8

#: Past values that the fitted recurrence may use, a multiple of 8, and values that it is fitted to; fewer where the
#: solver would grow too large.
WINDOW, FITTED, SMALLEST = 40, 112, 32

#: The recurrence uses no more values than leave so little, in sizes of the largest.
ENOUGH = 3e-12

#: Values that a recurrence is not fitted to, but has to foresee, and how far it may be off, in sizes of the largest:
#: beyond, the motion is chaotic or the step long, and other guesses are as good.
CHECKS, HOPELESS = 8, 1e-7

#: Steps that a fit costs, about; with the recurrences for whole blocks, four times as many are saved in.
REPAY = 150

#: Steps that a fit for a member of a group costs, for each coordinate: of eight steps at once, only one is foreseen.
GROUP_REPAY = 200

#: How far from the last value a guess may be, in sizes of that value.
REACH = 4.0

#: Values that the history of a solver may hold in all.
MOST_HISTORY = 8_000

#: Most terms of the expansion of a path; a path that needs more is cut into pieces.
TERMS = 30


def emit(program: Program, command: str, *, single_file: bool = False) -> dict[str, str]:
    """File names and their contents; with ``single_file`` only `NAME.c`, which then needs no header."""
    name = program.name
    values = _values(program)
    declarations = _render("types.h", values) + "\n" + _render("functions.h", values)
    body = _body(program)
    if single_file:
        return {f"{name}.c": _sealed(program, command, declarations + "\n" + body)}
    guard = f"{name.upper()}_H"
    header = f"#ifndef {guard}\n#define {guard}\n\n{declarations}\n#endif /* {guard} */\n"
    return {
        f"{name}.h": _sealed(program, command, header),
        f"{name}.c": _sealed(program, command, f'#include "{name}.h"\n\n{body}'),
    }


def _sealed(program: Program, command: str, body: str) -> str:
    lines = header_lines(program, command)
    comment = "\n".join(f" * {line}".rstrip() for line in lines)
    return f"/*\n{comment}\n * {CHECKSUM} {checksum(body)}\n */\n{body}"


def _render(template: str, values: Mapping[str, object]) -> str:
    return render("c", template, values)


def _values(program: Program) -> dict[str, object]:
    parameters, member, step = program.parameters, members(program), program.step
    inner = step.inner if isinstance(step, Implicit) else InnerSolve()
    return {
        "NAME": program.name,
        "n": program.dimension,
        "n2": program.dimension**2,
        "order": program.order,
        "casimir_count": len(program.casimirs),
        "casimir_size": max(1, len(program.casimirs)),
        "version": program.version,
        "sha256": program.about.spec_sha256,
        **_gauge_values(program),
        "extra_declarations": extras.declarations(program),
        "stages": len(program.fractions),
        "fractions": ", ".join(repr(f) for f in program.fractions),
        "terms": TERMS,
        "series": len(step.recurrences.series) if isinstance(step, Path) else 0,
        "coefficients": max(1, step.coefficients),
        "history": HISTORY,
        **_memory_values(program),
        **_memory_lines(program),
        "coordinates": ", ".join(f"{c} = x[{i}]" for i, c in enumerate(program.coordinates)),
        "casimirs": ", ".join(f"{c} = out[{i}]" for i, c in enumerate(program.casimirs)) or "none",
        "members": [(f"double {member[p.name]};", _about(p, member[p.name])) for p in parameters]
        or [("char unused;", "this system has no parameters")],
        "defaults": ", ".join(repr(float(p.value)) for p in parameters) or "0",
        "max_iterations": inner.max_iterations,
        "tolerance": repr(inner.tolerance),
        **_admissible_values(program),
        **{f"{key}_signature": "\n".join(lines) for key, lines in _signatures(program).items()},
        "apart": apart(program),
        **lanes.values(program, _memory_values(program)),
        **packs.values(program),
        "pivoting": f"{program.name}_solve" + ("_pivoting" if isinstance(step, Implicit) and step.eliminate else ""),
    }


def _about(parameter: Parameter, member: str) -> str:
    """The comment on a member of the struct; with the name of the spec where the member has another."""
    said = plain(parameter.description) or f"default {float(parameter.value)!r}"
    return said if member == parameter.name else f"{parameter.name}: {said}"


def _memory_values(program: Program) -> dict[str, Any]:
    affordable = MOST_HISTORY // (2 * program.dimension * len(program.fractions))
    values = max(SMALLEST, min(FITTED, affordable))
    window = 8 * (values * WINDOW // FITTED // 8)
    ahead = LANES if lanes.blocks(program) else 1
    checks = min(CHECKS, window // 4)
    rows = 2 * ((values - window - ahead - checks + 1) // 2)
    fitted = rows + checks + window + ahead - 1
    return {
        "fitted": fitted,
        "kept": 2 * fitted,
        "repay": REPAY,
        "reach": repr(REACH),
        "plausible": repr(PLAUSIBLE),
        "longest_path": LONGEST_PATH,
        "most_pieces": MOST_PIECES,
        "most_repay": 4 * REPAY,
        "group_repay": GROUP_REPAY * program.dimension,
        "window": window,
        "rows": rows,
        "checks": checks,
        "enough": repr(ENOUGH),
        "hopeless": repr(HOPELESS),
        "ahead": ahead,
        "horizon": "the next values" if ahead > 1 else "the next value",
    }


def _memory_lines(program: Program) -> dict[str, object]:
    """The memory of the inner solve, where there is one."""
    name, stages = program.name, len(program.fractions)
    if not isinstance(program.step, Implicit):
        nothing: dict[str, object] = dict.fromkeys(("memory_type", "memory_members", "memory_reset", "retry"), ())
        return nothing | {"remembered_value": "at.x"}
    head = {"NAME": name, **_memory_values(program)}
    return {
        "memory_type": [*render("c", "memory.h", head).splitlines(), ""],
        "memory_members": [f"{name}_memory memory[{stages}];"],
        "memory_reset": [
            "memset(s->memory, 0, sizeof s->memory);",
            f"for (int stage = 0; stage < {stages}; ++stage) s->memory[stage].patience = {REPAY};",
        ],
        "retry": [
            "/* A guess from earlier steps may have misled it: once more without. */",
            f"if (status != {name}_OK && s->memory[stage].count > 0) {{",
            "    memset(&s->memory[stage], 0, sizeof s->memory[stage]);",
            f"    status = {name}_attempt(s, stage);",
            "}",
        ],
        "remembered_value": "s->memory[k].past[s->memory[k].count - 1]",
    }


def _gauge_values(program: Program) -> dict[str, object]:
    name, gauge = program.name, program.gauge
    start = f"{name}_start(s, params, x0);"
    if not gauge:
        nothing: dict[str, object] = dict.fromkeys(("gauge_members", "gauge_declarations"), ())
        own = {"gauges": 0, "products": 0, "prepare_arguments": "&s->params", "init_body": [f"return {start}"]}
        return nothing | own
    count = len(gauge.casimirs)
    said = "Start at x0 with a gauge of one's own: the step is an exact Poisson map for each fixed gauge"
    return {
        "gauges": count,
        "products": 1 + 2 * count,
        "prepare_arguments": "&s->params, s->gauge",
        "gauge_members": [f"double gauge[{count}]; /* multiples of {', '.join(gauge.casimirs)} taken from H */"],
        "gauge_declarations": [
            f"/* {said}. */",
            *_init_gauge(program, count)[:-1],
            _init_gauge(program, count)[-1] + ";\n",
        ],
        "init_body": [
            f"const {name}_status status = {start}",
            f"if (status == {name}_OK) {name}_choose_gauge(&s->params, s->x, s->gauge);",
            "return status;",
        ],
    }


def _admissible_values(program: Program) -> dict[str, object]:
    """What is asked of parameters; without any, nothing."""
    gauges, member = len(program.gauge.casimirs) if program.gauge else 0, members(program)
    refuse = f"if (!{program.name}_admissible(&own)) return {program.name}_BAD_ARGUMENT;"
    return {
        "refusal": [refuse] if program.parameters else [],
        "conditions": [
            f"isfinite(params->{member[p.name]})" + (f" && params->{member[p.name]} > 0.0" if p.positive else "")
            for p in program.parameters
        ],
        "zero_gauge": [f"const double gauge[{gauges}] = {{ 0.0 }};"] if gauges else [],
        "admissible_arguments": "params, gauge" if gauges else "params",
    }


def _init_gauge(program: Program, count: int) -> list[str]:
    name, n = program.name, program.dimension
    arguments = [f"{name}_solver *s", f"const {name}_params *params", f"const double x0[{n}]"]
    return wrapped_arguments(f"{name}_status {name}_init_gauge(", [*arguments, f"const double gauge[{count}]"])


def _signatures(program: Program) -> dict[str, list[str]]:
    """Signatures that are too long for one line with a long name."""
    name, n = program.name, program.dimension
    solver, params, status = f"{name}_solver *s", f"const {name}_params *params", f"{name}_status "
    state = f"const double x[{n}]"
    many = ["double *x", "size_t members", "double h", "size_t steps", "unsigned char *status"]
    return {
        "init_gauge": _init_gauge(program, len(program.gauge.casimirs) if program.gauge else 0),
        "init": wrapped_arguments(f"{status}{name}_init(", [solver, params, f"const double x0[{n}]"]),
        "ensemble": wrapped_arguments(f"{status}{name}_ensemble(", [params, *many]),
        "hamiltonian": wrapped_arguments(f"double {name}_hamiltonian(", [params, state]),
        "casimirs": wrapped_arguments(f"void {name}_casimirs(", [params, state, "double out[]"]),
        "vector_field": wrapped_arguments(f"void {name}_vector_field(", [params, state, f"double out[{n}]"]),
    }


def _path_syntax(program: Program) -> Syntax:
    return Syntax(
        printer=printer,
        covector="p[{i}]",
        fixed="const double f{i} = {value};",
        first="s[{i}][0] = {value};",
        following="s[{i}][k] = {value};",
        slope="s[{i}][k + 1] = s[{slope}][k] / (k + 1);",
        sums=f"{program.name}_taylor",
    )


def _body(program: Program) -> str:
    values, step = _values(program), program.step

    def static(kernel: Kernel) -> str:
        return function(program, kernel) + "\n"

    pieces = [_render("preamble.c", values)]
    pieces += [_render("phi.c", special.values(f, f"{program.name}_{f}")) for f in special.used(program)]
    pieces += small.pieces(program)
    if not isinstance(step, Splitting):
        pieces.append(static(step.prepare))
    if isinstance(step, Implicit):
        pieces += [static(step.main), _render("pivoting.c", values)]
        if step.eliminate:
            pieces += [static(step.eliminate), _render("unrolled.c", values)]
        pieces += [_render(f"{template}.c", values) for template in ("remember", "project", "train", "learn")]
        pieces.append(_render("plausible.c", values))
    if not isinstance(step, Splitting) or program.extras.tangent:
        pieces.append(_render("advance.c", values))
    match step:
        case Path():
            pieces += _path(program, step, values)
        case Newton():
            size = "size_relative.c" if step.inner.relative else "size.c"
            pieces += [_render(size, values), _render("newton.c", values)]
        case Splitting():
            pieces += splitting.pieces(program, step, values)
        case Explicit():
            pieces += [static(step.increment), _render("explicit.c", values)]
    if not isinstance(step, Splitting):
        pieces.append(_render("compose.c", values))
    if program.parameters:
        pieces.append(_render("admissible.c", values))
    pieces.append(_render("start.c", values))
    if program.gauge:
        pieces += [static(program.gauge.guide), static(program.gauge.products)]
        pieces += [_render(f"{template}.c", values) for template in ("gauge", "gauge_line", "choose_gauge")]
    if program.extras.tangent:
        pieces += extras.tangent(program, values, _path_syntax(program))
    if program.modified:
        pieces += extras.modified(program, program.modified.kernel, values)
    pieces += [_render("api.c", values)]
    pieces += packs.pieces(program, values) if packs.packed(program) else lanes.pieces(program, values)
    seen = program.observables
    pieces += [static(seen.energy), static(replace(seen.casimirs, name="casimir_values"))]
    pieces.append(static(replace(seen.vector_field, name="field")))
    if any(apart(program) in piece for piece in pieces):
        pieces.insert(1, _render("apart.c", values))
    return "\n".join([*pieces, _render("observables.c", values)])


def _path(program: Program, step: Path, values: Mapping[str, object]) -> list[str]:
    path = step.recurrences
    unused = [] if reads_coefficients(path) else ["(void)coef;"]
    piece = {**values, **statements(program, path, _path_syntax(program)), "unused": unused}
    pieces = [_render(f"taylor_{kind}.c", values) for kind in kinds(path)]
    pieces += [_render("holds.c", piece), _render("piece.c", piece)]
    return [*pieces, _render("path.c", values), _render("path_step.c", values)]
