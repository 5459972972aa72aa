"""The transpose of a step of a lattice as NumPy functions on whole arrays over the sites."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from phigen.lattice.adjoint import BACK
from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.steps import Gather, Sweep, Sweeps
from phigen.symbolic.expression import Expression
from phigen.targets.code import Code, lower
from phigen.targets.names import Scope
from phigen.targets.numpy import colours
from phigen.targets.numpy.language import LANGUAGE
from phigen.targets.reserved import PYTHON_RESERVED

#: The statements that read what a kernel needs, and its temporaries.
Body = Callable[[Program, Sweeps, Kernel, Code, Scope, tuple[str, ...]], list[str]]

_OWN = {"coef", "x", "sites", "parameters", "h", "kick", "np", "gathered", "start", "bar", "own", "coef_bar"}
_OWN |= {"here", "there", "bond", *LANGUAGE.functions.values()}


def functions(program: Program, step: Sweeps, body: Body) -> Iterator[str]:
    """The transposes of all sweeps, or of the kernels of an equation, and the list of those of each part."""
    kernels = {kernel.name: kernel for kernel in step.adjoint.steps} if step.adjoint else {}
    every = [sweep for part in step.parts for sweep in part]
    yield from colours.functions(step, (_sweep(program, step, s, kernels[s.kernel.name + BACK], body) for s in every))
    for sweep in every:
        if sweep.gather:
            yield _gather(program, step, sweep.gather, kernels, body)
    if step.equation and step.partners and step.partners.field.names:
        yield _gather(program, step, step.partners.field, kernels, body)
    for kernel in (step.equation.relax, step.equation.advance) if step.equation else ():
        yield _at_middle(program, step, kernels[kernel.name + BACK], body)
    if not step.equation:
        listed = ["    (" + ", ".join(f"_{sweep.kernel.name}{BACK}" for sweep in part) + ",)," for part in step.parts]
        yield "\n".join(["# Their transposes.", "PARTS_BACK = (", *listed, ")\n"])


def _sweep(
    program: Program, step: Sweeps, sweep: Sweep, kernel: Kernel, body: Body
) -> tuple[Sweep, str, str, list[str]]:
    """The cotangent before a sweep from that after it, x being the state before: the parts of a function."""
    code, scope = lower(kernel), Scope(PYTHON_RESERVED | _OWN | {"change_bar", "colour", "window"})
    names = sweep.gather.names if sweep.gather else ()
    seeds = ", ".join(colours.chosen(step, sweep, f"bar[{f}]", "0.0") for f in sweep.moved)
    lines = [*colours.early(sweep, "bar"), f"    change_bar = [{seeds}]"]
    gather = _name(sweep.gather) if sweep.gather else ""
    lines += [f"    gathered = _{gather}(coef, x, sites)"] if gather else []
    lines += [*body(program, step, kernel, code, scope, names), "    bar = bar.copy()"]
    lines += _stored(program, step, kernel, code, LANGUAGE.printer(scope))
    if gather:
        listed = _gathered(kernel, code, scope, names)
        lines.append(f"    bar = _{gather}{BACK}(coef, x, [{listed}], bar, sites, coef_bar, own)")
    return sweep, kernel.name, "coef, x, bar, sites, coef_bar, own", [*lines, "    return bar"]


def _name(gather: Gather) -> str:
    return gather.kernels[0].name.removesuffix("_a").removesuffix("_b")


def _gathered(kernel: Kernel, code: Code, scope: Scope, names: Sequence[str]) -> str:
    """The cotangents of sums over bonds or pairs."""
    show, values = LANGUAGE.printer(scope), {s.index: s.value for s in code.stores if s.array == "gathered_bar"}
    order = [kernel.inputs["gathered"].index(n) if n in kernel.inputs["gathered"] else -1 for n in names]
    return ", ".join(f"sites.filled({show(values[k])})" if k in values else "sites.filled(0.0)" for k in order)


def _at_middle(program: Program, step: Sweeps, kernel: Kernel, body: Body) -> str:
    """What a cotangent of y, or of the change of x, gives to those of y, called x here, and of the start."""
    seed = next(array for array in kernel.inputs if array.endswith("_bar"))
    code, scope = lower(kernel), Scope(PYTHON_RESERVED | _OWN | {seed, "start_bar"})
    names = step.partners.field.names if step.partners and kernel.inputs["gathered"] else ()
    lines = [f"def _{kernel.name}(coef, start, x, {seed}, sites, coef_bar, own):"]
    lines += ["    gathered = _forces(sites.parameters, x, sites)"] * bool(names)
    lines += body(program, step, kernel, code, scope, names)
    lines.append("    bar, start_bar = np.zeros_like(x), np.zeros_like(x)")
    lines += _stored(program, step, kernel, code, LANGUAGE.printer(scope))
    if step.partners and names:
        called = f"_{_name(step.partners.field)}{BACK}(sites.parameters, x"
        lines.append(f"    bar = {called}, [{_gathered(kernel, code, scope, names)}], bar, sites, coef_bar, own)")
    return "\n".join([*lines, "    return bar, start_bar\n"])


def _stored(
    program: Program, step: Sweeps, kernel: Kernel, code: Code, show: Callable[[Expression], str]
) -> Iterator[str]:
    """Each cotangent added to where its value was read, at sites or at the ends of bonds or pairs."""
    fields, apart = program.coordinates, "sums_bar" in kernel.inputs
    graph = step.partners is not None and step.partners.graph
    every = "np.broadcast_to({}, here.shape)" if graph else "_apart({}, sites)"
    every = every if apart else "sites.filled({})"
    for store in (s for s in code.stores if not s.value.is_zero):
        value, index = show(store.value), store.index
        match store.array:
            case "coef_bar":
                yield f"    coef_bar[{index}] += {every.format(value)}.sum()"
            case "params_bar":
                yield f'    own["{kernel.inputs["params"][index]}"] += {every.format(value)}.sum()'
            case "bonds_bar":
                yield f'    np.add.at(own["{kernel.inputs["bonds"][index]}"], bond, {value})'
            case "start_bar":
                name = kernel.inputs["start"][index]
                yield f"    start_bar[{fields.index(str(name.key[0]))}] += {value}"  # type: ignore[attr-defined]
            case "site_bar":
                name, back = kernel.inputs["site"][index], value
                base = (step.sites.ends if apart else step.sites.places)[name][0]
                if apart and graph:
                    back = f"sites.summed({value}, {'here' if step.sites.ends[name][1] == 'a' else 'there'})"
                elif apart:
                    back = f"{every.format(value)}.sum(axis={1 if step.sites.ends[name][1] == 'a' else 0})"
                elif any(offset := step.sites.places[name][1]):
                    back = f"sites.returned({value}, {', '.join(map(str, offset))})"
                into = f"bar[{fields.index(base)}]" if base in fields else f'own["{base}"]'
                yield f"    {into} += {back}"


def _gather(program: Program, step: Sweeps, gather: Gather, kernels: dict[str, Kernel], body: Body) -> str:
    """The cotangents of what bonds or pairs read, from those of their sums at sites."""
    assert step.partners
    graph, first = step.partners.graph, "parameters" if "params" in gather.kernels[0].inputs else "coef"
    lines = [f"def _{_name(gather)}{BACK}({first}, x, gathered_bar, bar, sites, coef_bar, own):"]
    for ends in gather.ends:
        kernel = kernels[ends.kernel.name + BACK]
        code, scope = lower(kernel), Scope(PYTHON_RESERVED | _OWN | {"gathered_bar", "sums_bar"})
        show = LANGUAGE.printer(scope)
        if graph:
            lines.append(f"    here, there, bond = sites.bonds({ends.end!r}, {ends.chosen!r})")
            lines.append("    sums_bar = [g[here] for g in gathered_bar]")
        else:
            lines.append("    sums_bar = [g[:, None] for g in gathered_bar]")
        lines += body(program, step, kernel, code, scope, ())
        lines += _stored(program, step, kernel, code, show)
    return "\n".join([*lines, "    return bar\n"])
