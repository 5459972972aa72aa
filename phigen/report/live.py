"""Live panel of a page. It runs the generated JavaScript beside RK4, with sliders for all settings."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from markupsafe import Markup

from phigen.compilation import Compilation
from phigen.compiler import compile_spec
from phigen.drawing.groups import Group, groups
from phigen.errors import PhigenError
from phigen.geometry.conservation import ENERGY, moving
from phigen.geometry.system import System
from phigen.report import page
from phigen.scheme.lowering import assign, expand_powers
from phigen.spec.model import NO_EXTRAS, Extras, Parameter, Run, Spec
from phigen.symbolic.expression import Expression, symbols_of
from phigen.targets.js.emitter import emit
from phigen.targets.js.printing import LANGUAGE
from phigen.targets.names import Scope

#: ORDERS: orders that the panel offers in addition to the order of the page. MOST: largest number of characters of the
#: JavaScript for all orders together.
ORDERS, MOST = (2, 4), 200_000
#: FEW: groups with at most this number of sliders are shown unfolded. COORDINATES: largest number of coordinates with
#: sliders. STEP, SPEED, PARAMETER: largest factors by which sliders change the step, the speed and a parameter.
FEW, COORDINATES = 4, 15
STEP, SPEED, PARAMETER = 16, 20, 8

HELP = """To turn both three-dimensional pictures, drag one of the two, or use the arrow keys; + and − zoom; 0 resets
the view. Between steps the curves are interpolated. The panel chooses the {} at its start: at equal work, the errors of
RK4 should become visibly larger than those of phigen within ten seconds, and phigen should also work with twice the
step. With smaller steps both methods come closer to the exact solution, and over short times RK4 is often closer."""

NOISE = "it would compare the solver with RK4, which does not apply to systems with noise"
NOTHING = "Nothing is conserved, because this system depends on the time or has forces: no errors are shown."

_COMMENT = re.compile(r"^[ \t]*(/\*.*?\*/|//[^\n]*)[ \t]*\n", re.MULTILINE | re.DOTALL)
_PRIVATE = Extras(without=frozenset({"ensemble"}))


@dataclass(frozen=True)
class Live:
    """Content of the live panel of a run: a solver in JavaScript for each order, parameters, and functions that compute
    the invariants.

    If there is no panel, ``why_not`` is the reason.
    """

    solvers: Mapping[int, str]
    run: Run | None = None
    parameters: Mapping[str, float] | None = None
    why_not: str = ""
    invariants: str = ""


@dataclass(frozen=True)
class Slider:
    """Slider of the panel. The slider changes one setting.

    On the scale "log", the ends of the slider stand for the default value multiplied and divided by ``reach``. On the
    scale "linear", they stand for the default value plus and minus ``reach``. ``low`` and ``high`` are the positions of
    the ends.
    """

    label: Markup | str
    kind: str
    name: str | int = ""
    scale: str = "log"
    reach: float = 1.0
    low: int = -100
    high: int = 100


def gathered(
    compilation: Compilation,
    scheme: str | None,
    run: Run,
    parameters: Mapping[str, float],
    orders: Sequence[int] = ORDERS,
) -> Live:
    """Return the panel for a run, with solvers in JavaScript for the order of the compilation and for ``orders``."""
    if compilation.system.noise:
        return Live({}, why_not=NOISE)
    by_order, why_not = solvers(compilation, scheme, orders)
    return Live(by_order, run, parameters, why_not, _invariants(compilation.system))


def solvers(
    compilation: Compilation, scheme: str | None, orders: Sequence[int], spec: Spec | None = None
) -> tuple[dict[int, str], str]:
    """Return the solvers in JavaScript as {order: text}, and the reason if there are none. The reason is "" if there
    are solvers.

    There is a solver for the order of the compilation, and for each of ``orders`` if it can be compiled and the page
    does not become too large. ``spec`` replaces the spec of the compilation, from which it may differ only in its
    observables.
    """
    page_order, is_own = compilation.order.order, spec is None
    spec = replace(spec or compilation.spec, reconstruct="", extras=_PRIVATE)
    by_order: dict[int, str] = {}
    for order in (page_order, *(o for o in orders if o != page_order)):
        try:
            if order == page_order and is_own and emits(compilation):
                variant = compilation
            else:
                variant = compile_spec(spec, order=order, scheme=scheme, system=compilation.known_system)
            (text,) = emit(variant.program, "").values()
        except PhigenError as error:
            if order == page_order:
                return {}, str(error).splitlines()[0]
            continue
        by_order[order] = enclosed(text)
        if sum(map(len, by_order.values())) > MOST:
            del by_order[order]
    why_not = "" if by_order else f"its JavaScript would take more than {MOST // 1000} kB of this page"
    return dict(sorted(by_order.items())), why_not


def emits(compilation: Compilation) -> bool:
    """Return whether the panel can run the solver of the page without changes. If not, the panel needs another
    compilation.
    """
    extras = replace(compilation.program.extras, included=frozenset())
    return not compilation.spec.reconstruct and extras in (NO_EXTRAS, _PRIVATE)


def enclosed(module: str) -> str:
    """Return the text of a JavaScript function that contains a generated module.

    The function returns the parts of the module that the panel uses. Comments of the module are left out.
    """
    code = _COMMENT.sub("", module).replace("export class", "class")
    lines = (line.strip() for line in code.splitlines())
    body = "\n".join(line for line in lines if line)
    rate = "typeof rateAt === 'undefined' ? null : rateAt"
    return f"() => {{\n{body}\nreturn {{ Solver, rateAt: {rate} }};\n}}".replace("</", "<\\/").replace("<!--", "<\\!--")


def script(live: Live) -> str:
    """Return the JavaScript of the solvers and of the invariants, for the script of the page."""
    invariants = f"const liveInvariants = [ {live.invariants} ];\n"
    by_order = ", ".join(f"{order}: {text}" for order, text in live.solvers.items())
    return f"{invariants}const liveSolvers = {{ {by_order} }};"


def function_of(formula: Expression, names: Sequence[str]) -> str:
    """Return a formula as a JavaScript arrow function, whose arguments are the symbols ``names``."""
    assignments, (value,) = assign(expand_powers([formula]))
    scope = Scope(LANGUAGE.reserved | set(LANGUAGE.functions.values()))
    arguments = [scope[name] for name in names]
    show = LANGUAGE.printer(scope)
    lines = [f"const {scope[a.target]} = {show(a.value)};" for a in assignments]
    return f"({', '.join(arguments)}) => {{ {' '.join(lines)} return {show(value)}; }}"


def _invariants(system: System) -> str:
    """Return the JavaScript functions (x, params, t) of the declared invariants, separated by commas."""
    parameters = [p.name for p in system.parameters]
    names = [*system.coordinates, *parameters, *system.times]
    values = ["...x", *(f"params.{name}" for name in parameters), *(["t"] if system.time else [])]
    functions = (function_of(invariant, names) for invariant in system.invariants.values())
    return ", ".join(f"(x, params, t) => ({function})({', '.join(values)})" for function in functions)


def live_section(compilation: Compilation, live: Live) -> Markup:
    """Return the section of the page with the live panel. If there is no live panel, the section says why."""
    run, system = live.run, compilation.system
    if not live.solvers or run is None:
        return page.paragraph(f"There is no live panel: {live.why_not}.", "note")
    parameters = live.parameters or {}
    quantities, panels = _quantities(system), _groups(system)
    start, leaves = [float(v) for v in run.initial], [_leaf(system, group) for group in panels]
    settings = {
        "coordinates": list(system.coordinates),
        "start": start,
        "t0": float(run.start) if system.time else None,
        "step": float(run.step),
        "order": compilation.order.order,
        "orders": list(live.solvers),
        "parameters": [
            {"name": p.name, "value": parameters[p.name], "positive": p.positive, "nonnegative": p.nonnegative}
            for p in system.parameters
        ],
        "groups": [
            {"axes": [system.coordinates.index(n) for n in group], "leaf": leaf}
            for group, leaf in zip(panels, leaves, strict=True)
        ],
        "quantities": quantities,
        "observed": list(system.observables),
        "sizes": None,
        "site": None,
    }
    return page.block(
        "live",
        observed=list(system.observables),
        say=_caption(system, quantities, any(leaf is not None for leaf in leaves)),
        sides=sides(compilation),
        kind="",
        label=f"The motion of {', '.join(panels[0])}",
        quantities=[q["name"] for q in quantities],
        sliders=map(slid, general(live)),
        choice=len(panels) > 1,
        groups=list(enumerate(", ".join(g) for g in panels)),
        folds=[(title, unfolded, map(slid, sliders)) for title, unfolded, sliders in _folds(system, start, parameters)],
        help=HELP.format("order and the step" if len(live.solvers) > 1 else "step"),
        data=page.data("live-data", settings),
    )


def slid(slider: Slider) -> Markup:
    """Return the slider as HTML."""
    return page.block("slider", **vars(slider))


def sides(compilation: Compilation) -> list[tuple[int, str, str, str, str]]:
    """Return a tuple for each half of the panel: one for phigen, one for RK4.

    A tuple has the number of the colour, the id of the canvas, the name of the method, and two texts for the label: its
    HTML attribute ``id=…`` and its content.
    """
    return [
        (1, "ours", "phigen", "id=live-order", f"order {compilation.order.order}"),
        (2, "theirs", "RK4", "id=live-cost", ""),
    ]


def quantity(
    name: str, casimirs: Sequence[int] | None = None, invariants: Sequence[int] | None = None
) -> dict[str, object]:
    """Return a conserved quantity as data for the page.

    The quantity is the energy, unless indices of ``casimirs`` or of ``invariants`` select another quantity.
    """
    return {"name": name, "casimirs": casimirs, "invariants": invariants}


def _quantities(system: System) -> list[dict[str, object]]:
    """Return the conserved quantities: energy, one entry for all Casimirs, one entry for all invariants."""
    changing = moving(system)
    quantities: list[dict[str, object]] = [] if ENERGY in changing else [quantity("energy error")]
    casimirs = {name: i for i, name in enumerate(system.casimirs) if name not in changing}
    if casimirs:
        quantities.append(quantity(_casimir_label(system, casimirs), casimirs=[*casimirs.values()]))
    invariants = {} if system.noise else {name: i for i, name in enumerate(system.invariants)}
    if invariants:
        name = f"error{'s' * (len(invariants) > 1)} of {', '.join(invariants)}"
        if len(invariants) > 3:
            name = f"error of {len(invariants)} invariants"
        quantities.append(quantity(name, invariants=[*invariants.values()]))
    return quantities


def _casimir_label(system: System, casimirs: Mapping[str, int]) -> str:
    """Return the label for errors of Casimirs. ``casimirs`` maps their names to indices."""
    names = ", ".join(casimirs)
    if len(casimirs) > 1:
        return f"Casimir errors ({names})" if len(casimirs) <= 3 else f"error of {len(casimirs)} Casimirs"
    is_leaf_drawn = any(_leaf(system, group) == casimirs[names] for group in _groups(system))
    return f"distance from the surface (Casimir {names})" if is_leaf_drawn else f"Casimir error ({names})"


def _groups(system: System) -> list[Group]:
    """Return the groups of coordinates that are drawn together, the largest groups first."""
    several = [group for group in groups(system.coordinates) if len(group) > 1]
    return sorted(several or [(system.coordinates[0],) * 2], key=len, reverse=True)


def _leaf(system: System, group: Group) -> int | None:
    """Return the index of the Casimir whose level surface is drawn; None if no surface is drawn.

    ``group`` lists the coordinates that are drawn together. A surface is drawn if there are three of these coordinates,
    and a conserved Casimir depends on these coordinates only. If the system has only two coordinates and conserves its
    energy, the level curve of the energy is drawn instead, and the result is −1.
    """
    if len(group) == 2:
        return -1 if system.dimension == 2 and ENERGY not in moving(system) else None
    coordinates = set(system.coordinates)
    changing, used_coordinates = moving(system), [set(symbols_of(c)) & coordinates for c in system.casimirs.values()]
    casimirs = zip(system.casimirs, used_coordinates, strict=True)
    return next(
        (i for i, (name, names) in enumerate(casimirs) if name not in changing and names and names <= set(group)), None
    )


def _caption(system: System, conserved: Sequence[Mapping[str, object]], is_leaf_drawn: bool) -> str:
    """Return a description of the picture, as text above the panel."""
    introduction = "Two solvers integrate the motion from the same start, in your browser. "
    properties = ["conserves its energy"] if any(q["name"] == "energy error" for q in conserved) else []
    if is_leaf_drawn:
        properties.append(f"never leaves the {'curve' if system.dimension == 2 else 'surface'} drawn here")
    elif len(conserved) > len(properties):
        properties.append("conserves its Casimirs")
    if not properties:
        return f"{introduction}{NOTHING}"
    return (
        f"{introduction}The exact solution {' and '.join(properties)}. The numbers are the errors of the two solvers."
    )


def general(live: Live) -> Iterable[Slider]:
    """Yield the sliders that every panel has."""
    yield Slider("Step", "h", reach=STEP)
    if len(live.solvers) > 1:
        yield Slider("Order", "order", low=0, high=len(live.solvers) - 1)
    yield Slider("Steps per second", "speed", reach=SPEED)


def _folds(
    system: System, start: list[float], parameters: Mapping[str, float]
) -> Iterable[tuple[str, bool, list[Slider]]]:
    """Yield groups of sliders: title, whether the group is unfolded, and the sliders."""
    sliders = [slider_of(p, parameters[p.name]) for p in system.parameters]
    if sliders:
        yield "Parameters", len(sliders) <= FEW, sliders
    reach = max(map(abs, start)) or 1.0
    coordinates = [Slider(name, "start", i, "linear", reach) for i, name in enumerate(system.coordinates)][:COORDINATES]
    yield "Start", len(coordinates) <= FEW, coordinates


def slider_of(p: Parameter, value: float) -> Slider:
    """Return the slider of a parameter."""
    if p.positive and value > 0:
        return Slider(p.name, "params", p.name, reach=PARAMETER)
    return Slider(p.name, "params", p.name, "linear", 2 * abs(value) or 1.0)
