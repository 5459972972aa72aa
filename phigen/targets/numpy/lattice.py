"""A lattice as a Python module: kernels work on whole arrays over the sites."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.steps import VARIED, Gather, Sweep, Sweeps
from phigen.symbolic.symbols import BEGINS, CHOSEN, COEFFICIENT, GATHERED, INCREMENT, INITIAL, VARIATION, Symbol
from phigen.targets import lattice
from phigen.targets.code import Code, lower
from phigen.targets.header import facts
from phigen.targets.names import Scope
from phigen.targets.numpy import colours, functions, lattice_adjoint
from phigen.targets.numpy.language import LANGUAGE, listed, quoted
from phigen.targets.rendering import render
from phigen.targets.reserved import PYTHON_RESERVED

#: How functions are written: those of NumPy, and those that the file defines.
_OWN = frozenset({"coef", "x", "sites", "parameters", "h", "kick", "np", *LANGUAGE.functions.values()})


#: The templates of implicit steps.
_SERIES = ("lattice_series", "lattice_guesses", "lattice_newton")


def body(program: Program, step: Sweeps, prepare: str) -> str:
    """The text of the module; ``prepare`` are the functions that compute coefficients."""
    values = {
        **facts(program, listed, quoted),
        **lattice.tables(program, step, listed),
        "schedule": repr(tuple(step.schedule.flows)),
        "by_colour": repr(step.by_colour),
    }
    values["sized"] = bool(program.time or program.noise)
    arguments = {"t0": "0.0"} if program.time else {}
    arguments |= {"seed": "0", "member": "0", "step0": "0"} if program.noise else {}
    values["arguments"] = "".join(f", {name}={value}" for name, value in arguments.items())
    values["passed"] = "".join(f", {name}={name}" for name in arguments)
    graph = step.others.graph
    values["equation"] = step.equation is not None
    values["adjoint"] = step.adjoint is not None
    flows = "(part, _), _ in sites.schedule" if step.by_colour else "part, _ in SCHEDULE"
    values["kept"] = "2 * len(SCHEDULE)" if step.equation else f"sum(len(PARTS[part]) for {flows})"
    values["pairs"] = step.partners is not None and not graph
    values["sites"] = "_Coloured" if step.by_colour else "_Graph" if graph else "_Sites"
    values["flow"] = "(part, sites.colour), row" if step.by_colour else "part, row"
    values["flows"] = "sites.schedule" if step.by_colour else "SCHEDULE"
    graphs = ["lattice_graph", *(["lattice_colours"] if step.by_colour else [])] if graph else []
    drawing = ["lattice_noise", "philox"] if program.noise else []
    parts = ["lattice", "lattice_sites", *graphs, *drawing, *(_SERIES if step.equation else ("lattice_splitting",))]
    parts += ["lattice_steps", *(["lattice_tangent"] if program.extras.tangent else [])]
    pieces = [render("numpy", f"{part}.py", values) for part in parts]
    if step.adjoint:
        kind = "series" if step.equation else "splitting"
        pieces += [render("numpy", f"lattice_adjoint{part}.py", values) for part in (f"_{kind}", "")]
    pieces += [render("numpy", "lattice_seen.py", values), prepare]
    pieces += functions.called(program)
    pieces += _gathers(program, step)
    pieces += colours.functions(step, (_sweep(program, step, sweep) for sweep in step.sweeps))
    if step.equation:
        pieces += [_at_middle(program, step, kernel) for kernel in step.equation.kernels]
    else:
        pieces.append(_table("PARTS", "The sweeps of each part of H.", step.parts))
        if program.extras.tangent:
            pieces.append(_table("TANGENTS", "Their derivatives.", step.tangents))
    pieces += lattice_adjoint.functions(program, step, _body) if step.adjoint else []
    pieces += [_seen(program, step, kernel) for kernel in program.observables.kernels]
    return "\n\n".join(piece.strip("\n") + "\n" for piece in pieces)


def _table(name: str, comment: str, parts: Iterable[Iterable[Sweep]]) -> str:
    listed = ["    (" + ", ".join(f"_{sweep.kernel.name}" for sweep in part) + ",)," for part in parts]
    return "\n".join([f"# {comment}", f"{name} = (", *listed, ")\n"])


def _sweep(program: Program, step: Sweeps, sweep: Sweep) -> tuple[Sweep, str, str, list[str]]:
    """One sweep as a function from a state to the next, or from a variation of the state to the next: its parts."""
    kernel, code = sweep.kernel, lower(sweep.kernel)
    scope = Scope(PYTHON_RESERVED | _OWN | {"v", "moved", "gathered", "colour", "window"})
    own, given = ("v", "x, v") if sweep.is_tangent else ("x", "x")
    lines = colours.early(sweep, own)
    lines += [f"    gathered = _{_sums_of(sweep)}(coef, {given}, sites)"] if sweep.gather else []
    names = sweep.gather.names if sweep.gather else ()
    lines += [*_body(program, step, kernel, code, scope, names), f"    moved = {own}.copy()"]
    show = LANGUAGE.printer(scope)
    for store in code.stores:
        place = f"[{sweep.moved[store.index]}]"
        new = f"{own}{place} + ({show(store.value)})"
        lines.append(f"    moved{place} = {colours.chosen(step, sweep, new, own + place)}")
    return sweep, kernel.name, f"coef, {given}, sites", [*lines, "    return moved"]


def _sums_of(sweep: Sweep) -> str:
    """The function that adds up what bonds or pairs do in a sweep."""
    name = sweep.kernel.name
    return f"gather_{name}" if sweep.is_tangent else name.replace("sweep", "gather")


def _at_middle(program: Program, step: Sweeps, kernel: Kernel) -> str:
    """A kernel of the equation of a stage as a function of y, which is its x, and of x, where the stage starts."""
    code = lower(kernel)
    scope = Scope(PYTHON_RESERVED | _OWN | {"start", "gathered", "v"})
    varied = ", v" if kernel.name in VARIED else ""
    lines, gathers = [f"def _{kernel.name}(coef, start, x{varied}, sites):"], kernel.inputs["gathered"]
    names: Sequence[str] = ()
    if gathers and step.partners:
        gather = step.partners.varied if varied else step.partners.field
        names = gather.names
        lines.append(f"    gathered = _{'slopes' if varied else 'forces'}(sites.parameters, x{varied}, sites)")
    lines += _body(program, step, kernel, code, scope, names)
    show = LANGUAGE.printer(scope)
    values = ", ".join(f"np.broadcast_to({show(s.value)}, sites.sizes)" for s in code.stores)
    return "\n".join([*lines, f"    return np.array([{values}])\n"])


def _seen(program: Program, step: Sweeps, kernel: Kernel) -> str:
    """A kernel as a function that fills arrays over the sites."""
    code = lower(kernel)
    scope = Scope(PYTHON_RESERVED | _OWN | {"out", "gathered"})
    lines, partners = [f"def _{kernel.name}(parameters, x, sites):"], step.partners
    names: Sequence[str] = ()
    if partners and partners.field.names and kernel.name == "vector_field":
        lines.append("    gathered = _forces(parameters, x, sites)")
        names = partners.field.names
    lines += _body(program, step, kernel, code, scope, names)
    lines.append(f"    out = np.empty(({len(code.stores)}, *sites.sizes))")
    show = LANGUAGE.printer(scope)
    lines += [f"    out[{s.index}] = {show(s.value)}" for s in code.stores]
    if partners and partners.energy.names and kernel.name == "energy":
        lines.append("    out += 0.5 * _energies(parameters, x, sites)")
    return "\n".join([*lines, "    return out\n"])


def _gathers(program: Program, step: Sweeps) -> Iterator[str]:
    """What bonds or pairs add, as functions of the state."""
    if step.partners:
        if not step.partners.graph:
            yield render("numpy", "pairs.py", {})
        for sweep in step.sweeps:
            if sweep.gather:
                yield _gather(program, step, sweep.gather, _sums_of(sweep), "coef")
        partners = {"energies": step.partners.energy, "forces": step.partners.field, "slopes": step.partners.varied}
        for name, gather in partners.items():
            if gather.names:
                yield _gather(program, step, gather, name, "parameters")


def _gather(program: Program, step: Sweeps, gather: Gather, name: str, first: str) -> str:
    """Kernels of bonds or pairs, summed up at each site."""
    varied = ", v" if name == "slopes" or "tangent" in name else ""
    lines = [f"def _{name}({first}, x{varied}, sites):", "    sums = 0.0"]
    lines += ['    with np.errstate(all="ignore"):']
    for ends in gather.ends:
        code = lower(ends.kernel)
        scope = Scope(PYTHON_RESERVED | _OWN | {"v", "sums", "gathered", "here", "there", "bond"})
        body = _body(program, step, ends.kernel, code, scope)
        show = LANGUAGE.printer(scope)
        if step.others.graph:
            body = [f"    here, there, bond = sites.bonds({ends.end!r}, {ends.chosen!r})", *body]
            added = [f"sites.summed({show(s.value)}, here)" for s in code.stores]
        else:
            added = [f"_over_others({show(s.value)}, sites)" for s in code.stores]
        lines += [f"    {line}" for line in body]
        lines.append(f"        sums = sums + np.array([{', '.join(added)}])")
    return "\n".join([*lines, "    return sums\n"])


def _body(
    program: Program, step: Sweeps, kernel: Kernel, code: Code, scope: Scope, gathered: Sequence[str] = ()
) -> list[str]:
    """What is read, and the assignments."""
    lines: list[str] = []
    for array, symbols in kernel.inputs.items():
        for i, s in enumerate(symbols):
            if s not in code.used:
                continue
            if isinstance(s, Symbol) and s.kind == GATHERED:
                scope.bind(s, f"gathered[{list(gathered).index(s)}]")
            elif isinstance(s, Symbol) and s.kind == CHOSEN:
                scope.bind(s, "sites.chosen()")
            elif isinstance(s, Symbol) and s.kind == BEGINS:
                scope.bind(s, f"sites.begins(window, {', '.join(map(str, s.key))})")
            elif isinstance(s, Symbol) and s.kind == INITIAL:
                scope.bind(s, f"start[{program.coordinates.index(str(s.key[0]))}]")
            elif isinstance(s, Symbol) and s.kind == VARIATION:
                lines.append(f"    {scope[s]} = {_read(program, step, str(s.key[0]), 'v')}")
            elif isinstance(s, Symbol) and s.kind == INCREMENT:
                lines.append(f"    {scope[s]} = {_read(program, step, s)}")
            elif isinstance(s, Symbol) and s.kind.endswith("_bar"):
                scope.bind(s, f"{s.kind}[{s.key[0]}]")
            elif isinstance(s, Symbol):
                bounds = ", ".join(map(str, s.key))
                scope.bind(s, f"coef[{i}]" if s.kind == COEFFICIENT else f"sites.present({bounds})")
            elif array == "bonds":
                lines.append(f'    {scope[s]} = sites.parameters["{s}"][bond]')
            elif array == "t":
                scope.bind(s, "sites.t")
            elif array == "params":
                lines.append(f'    {scope[s]} = parameters["{s}"]')
            else:
                lines.append(f"    {scope[s]} = {_read(program, step, s)}")
    show = LANGUAGE.printer(scope)
    return lines + [f"    {scope[a.target]} = {show(a.value)}" for a in code.assignments]


def _read(program: Program, step: Sweeps, name: str, array: str = "x") -> str:
    fields: Sequence[str] = program.coordinates
    if name in step.sites.ends:
        base, end = step.sites.ends[name]
        text = f"{array}[{fields.index(base)}]" if base in fields else f'sites.parameters["{base}"]'
        if step.others.graph:
            return f"{text}[{'here' if end == 'a' else 'there'}]"
        return f"{text}[:, None]" if end == "a" else text
    base, offset = step.sites.places[name]
    if base in step.sites.increments:
        return _shifted(f"sites.dw[{step.sites.increments.index(base)}]", offset)
    text = f"{array}[{fields.index(base)}]" if base in fields else f'sites.parameters["{base}"]'
    return _shifted(text, offset)


def _shifted(text: str, offset: Sequence[int]) -> str:
    return f"sites.shifted({text}, {', '.join(map(str, offset))})" if any(offset) else text
