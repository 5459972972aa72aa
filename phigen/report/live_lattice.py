"""Live panel of a lattice. It shows the fields of the sites, which the generated JavaScript and RK4 advance in time."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from markupsafe import Markup

from phigen.compilation import CompiledLattice
from phigen.lattice.cell import PAIRS
from phigen.lattice.placing import MOST_PLACED, placed
from phigen.lattice.states import Start
from phigen.report import page
from phigen.report.live import (
    FEW,
    NOISE,
    NOTHING,
    ORDERS,
    Live,
    Slider,
    function_of,
    general,
    quantity,
    script,
    sides,
    slid,
    slider_of,
    solvers,
)
from phigen.spec.model import LieAlgebraForm, Parameter, Reduction, Run, Spec, Values
from phigen.symbolic.expression import Expression, call, total

#: The panel offers the sizes of the run, and smaller and larger sizes within these limits. FEWEST: smallest number of
#: sites along an axis. MOST_PAIRS, MOST_IN_CHAIN and MOST_SITES: largest numbers of sites in systems of pairs, in
#: chains and in other lattices.
FEWEST, MOST_PAIRS, MOST_IN_CHAIN, MOST_SITES = 8, 160, 1024, 10_000
#: Largest total number of values in the lists that a page contains: initial values, parameters and bonds.
MOST_NUMBERS = 20_000

HELP = {
    "diagram": "Sites are drawn upwards, the time to the right. A full picture drops every second column.",
    "plane": "Each square is a site; for three axes the middle plane of the first is drawn.",
    "graph": "Each point is a site; lines are bonds. Distances are close to the number of bonds between sites.",
    "moving": "Each point is a site, with its recent path.",
}
_DRAWN = " The random start is drawn in the page, from the seed of the spec."
_DIRECTION = " The hue is the direction in the plane of {}, {}; lighter colours mean larger {}."


@dataclass(frozen=True)
class LatticeLive(Live):
    """Content of the live panel of a lattice.

    ``start`` is the start of the run. ``formulas`` is JavaScript for initial values: functions of site indices and
    sizes. With these functions, the panel can start with other sizes.
    """

    start: Start | None = None
    formulas: str = ""


def gathered_lattice(
    compilation: CompiledLattice, scheme: str | None, run: Run, start: Start, orders: Sequence[int] = ORDERS
) -> LatticeLive:
    """Return the panel for a run of a lattice."""
    if compilation.spec.noise:
        return LatticeLive({}, why_not=NOISE)
    if _numbers(compilation.spec, run, start) > MOST_NUMBERS:
        return LatticeLive({}, why_not="the lists of initial values, parameters and bonds are too long for a page")
    by_order, why_not = solvers(compilation, scheme, orders, _with_invariants(compilation))
    return LatticeLive(by_order, run, None, why_not, start=start, formulas=_formulas(compilation.spec, run))


def _with_invariants(compilation: CompiledLattice) -> Spec | None:
    """Return a spec whose observables include the invariants and the magnitudes of their terms; None if there are no
    invariants.
    """
    spec, cell = compilation.spec, compilation.cell
    assert spec.lattice is not None
    densities: dict[str, Expression] = {}
    for name, density in cell.invariants.items():
        # the suffix makes the new names longer than all names of the spec
        apart = "_" * (1 + max(map(len, spec.observables), default=0))
        densities[f"{name}{apart}"] = density
        densities[f"terms_{name}{apart}"] = total(call("abs", term) for term in cell.additive_terms(density))
    if not densities:
        return None
    reductions = {**spec.lattice.reductions, **dict.fromkeys(densities, Reduction("sum"))}
    lattice = replace(spec.lattice, reductions=reductions)
    return replace(spec, observables={**spec.observables, **densities}, lattice=lattice)


def lattice_script(live: LatticeLive) -> str:
    """Return the JavaScript for the script of the page: the solvers, and the formulas of initial values."""
    return f"{script(live)}\nconst liveValues = {{ {live.formulas} }};"


def lattice_live_section(compilation: CompiledLattice, live: LatticeLive) -> Markup:
    """Return the section of the page with the live panel. If there is no live panel, the section says why."""
    run, start, cell = live.run, live.start, compilation.cell
    if not live.solvers or run is None or start is None:
        return page.paragraph(f"There is no live panel: {live.why_not}.", "note")
    spec, picture = compilation.spec, _picture(compilation, start)
    positions = placed(start.bonds, start.sizes[0]) if picture == "graph" else None
    sizes, panels = _sizes(compilation, run, start), _groups(compilation, picture)
    slider_parameters = [p for p in spec.parameters if isinstance(_values(spec, run, start, p.name), float)]
    settings = {
        "picture": picture,
        "axes": list(cell.axes),
        "coordinates": list(spec.coordinates),
        "start": [],
        "t0": float(run.start) if spec.time else None,
        "step": float(run.step),
        "order": compilation.order.order,
        "orders": list(live.solvers),
        "sizes": sizes,
        "site": sizes.index(list(start.sizes)),
        "bonds": start.bonds.reshape(-1).tolist() if start.graph else None,
        "places": None if positions is None else np.round(positions, 4).reshape(-1).tolist(),
        "parameters": [
            {
                "name": p.name,
                "value": _values(spec, run, start, p.name),
                "positive": p.positive,
                "nonnegative": p.nonnegative,
            }
            for p in slider_parameters
        ],
        "arrays": {p.name: _array(spec, run, start, p) for p in spec.parameters if p not in slider_parameters},
        "initial": {name: _given(v, start, name, spec) for name, v in _initial(spec, run).items()},
        "groups": [{"kind": kind, "fields": fields} for _, kind, fields in panels],
        "quantities": _quantities(compilation),
        "observed": list(spec.recorded),
        "names": list(run.lattice.names) if run.lattice else [],
        "sign": _sign(spec, start),
    }
    direction_note = _DIRECTION.format(*spec.coordinates) if panels[0][1] == "direction" else ""
    direction_note += _DRAWN if any(v.random for v in _initial(spec, run).values()) else ""
    return page.block(
        "live",
        kind="fields",
        observed=list(spec.recorded),
        say=_caption(compilation),
        sides=sides(compilation),
        label=f"{panels[0][0]} at the sites",
        quantities=[q["name"] for q in _quantities(compilation)],
        sliders=map(slid, _general(live, sizes)),
        choice=len(panels) > 1,
        groups=[(k, name) for k, (name, _, _) in enumerate(panels)],
        folds=[
            ("Parameters", len(slider_parameters) <= FEW, map(slid, _parameters(spec, run, start, slider_parameters)))
        ]
        if slider_parameters
        else [],
        help=HELP[picture] + direction_note,
        data=page.data("live-data", settings),
    )


def _picture(compilation: CompiledLattice, start: Start) -> str:
    """Return the kind of picture for a lattice: "diagram", "plane", "graph" or "moving", as in fields.js."""
    cell = compilation.cell
    if start.graph and start.sizes[0] <= MOST_PLACED:
        return "graph"
    if cell.relation == PAIRS and len(cell.fields) > 1:
        return "moving"
    return "plane" if len(cell.axes) > 1 else "diagram"


def _groups(compilation: CompiledLattice, picture: str) -> list[tuple[str, str, list[int]]]:
    """Return the quantities that can be drawn, as entries of name, kind and indices.

    The kind is "field", "direction", "observed" or "energy". The indices select fields or observables.
    """
    fields = compilation.spec.coordinates
    if picture == "moving":
        return [(f"{fields[0]}, {fields[1]}", "field", [0, 1])]
    views = [(name, "field", [k]) for k, name in enumerate(fields)]
    form = compilation.spec.poisson
    if isinstance(form, LieAlgebraForm) and (form.family, form.size) == ("so", 3):
        views.insert(0, ("directions of the spins", "direction", [0, 1, 2]))
    observed = [name for name in compilation.spec.observables if name not in compilation.spec.recorded]
    views += [(name, "observed", [k]) for k, name in enumerate(observed)]
    return [*views, ("energy of each site", "energy", [])]


def _sizes(compilation: CompiledLattice, run: Run, start: Start) -> list[list[int]]:
    """Return the sizes that the panel offers, in ascending order.

    The panel offers only the sizes of the run if the lattice is a graph, or if a list or a file defines initial values
    or parameters.
    """
    choices, cell = [list(start.sizes)], compilation.cell
    arrays = (*_initial(compilation.spec, run).values(), *(_source(run, p) for p in compilation.spec.parameters))
    if start.graph or any(v and (v.listed or v.file) for v in arrays):
        return choices
    step = compilation.program.step
    periods = step.sites.periods  # type: ignore[union-attr]
    max_sites = MOST_PAIRS if cell.relation == PAIRS else MOST_IN_CHAIN if len(cell.axes) == 1 else MOST_SITES
    while all(n % (2 * p) == 0 and n >= 2 * FEWEST for n, p in zip(choices[0], periods, strict=True)):
        choices.insert(0, [n // 2 for n in choices[0]])
    while math.prod(2 * n for n in choices[-1]) <= max_sites:
        choices.append([2 * n for n in choices[-1]])
    return choices


def _general(live: Live, sizes: Sequence[Sequence[int]]) -> Iterator[Slider]:
    yield from general(live)
    if len(sizes) > 1:
        yield Slider("Sites", "sites", low=0, high=len(sizes) - 1)


def _parameters(spec: Spec, run: Run, start: Start, slider_parameters: Sequence[Parameter]) -> Iterator[Slider]:
    for p in slider_parameters:
        value = _values(spec, run, start, p.name)
        assert isinstance(value, float)
        yield slider_of(p, value)


# -- start of a run


def _initial(spec: Spec, run: Run) -> Mapping[str, Values]:
    return run.lattice.state if run.lattice else {}


def _source(run: Run, p: Parameter) -> Values | None:
    return run.lattice.arrays.get(p.name, p.values) if run.lattice else p.values


def _values(spec: Spec, run: Run, start: Start, name: str) -> float | None:
    """Return the value of a scalar parameter; None for other parameters."""
    array = np.asarray(start.parameters[name])
    p = next(p for p in spec.parameters if p.name == name)
    if array.ndim == 0 or (_source(run, p) is None and array.size and np.all(array == array.flat[0])):
        return float(array.flat[0])
    return None


def _array(spec: Spec, run: Run, start: Start, p: Parameter) -> dict[str, Any]:
    """Return a parameter with values at sites or bonds as data for the page: a list, a formula, or random values."""
    source = _source(run, p)
    if source is None:  # the values come from a column of the file of bonds
        return {"at": p.at, "listed": _listed(start.parameters[p.name])}
    return {"at": p.at, **_given(source, start, p.name, spec)}


def _given(values: Values, start: Start, name: str, spec: Spec) -> dict[str, Any]:
    if values.random and values.formula is None:
        return {"random": values.random, "seed": values.seed, "scale": float(values.scale)}
    if values.formula is not None and not values.random:
        return {"formula": True}
    if name in start.parameters:
        return {"listed": _listed(start.parameters[name])}
    return {"listed": _listed(start.state[spec.coordinates.index(name)] if name else start.state)}


def _listed(array: Any) -> list[float]:
    return [float(v) for v in np.asarray(array, dtype=float).reshape(-1)]


def _numbers(spec: Spec, run: Run, start: Start) -> int:
    """Return the total length of the lists that the page needs for the run: initial values, parameters and bonds."""
    arrays = [_given(v, start, name, spec) for name, v in _initial(spec, run).items()]
    arrays += [_array(spec, run, start, p) for p in spec.parameters if _values(spec, run, start, p.name) is None]
    return sum(len(g.get("listed", ())) for g in arrays) + start.bonds.size


def _formulas(spec: Spec, run: Run) -> str:
    """Return JavaScript functions of site indices and sizes, one for each array that is defined by a formula."""
    arrays = {**{p.name: _source(run, p) for p in spec.parameters}, **_initial(spec, run)}
    assert spec.lattice is not None
    indices = spec.lattice.indices
    formula_texts = {
        n: v.formula for n, v in arrays.items() if v is not None and v.formula is not None and not v.random
    }
    names = (*indices, *(f"N_{i}" for i in indices))
    return ", ".join(f"{json.dumps(name)}: {function_of(formula, names)}" for name, formula in formula_texts.items())


def _sign(spec: Spec, start: Start) -> str:
    """Return the name of a parameter whose values at the sites have both signs; "" if there is none.

    Sites with negative values are drawn as rings.
    """
    arrays = {p.name: np.asarray(start.parameters[p.name]) for p in spec.parameters if p.at == "sites"}
    return next((name for name, a in arrays.items() if a.size and a.min() < 0 < a.max()), "")


# -- texts


def _quantities(compilation: CompiledLattice) -> list[dict[str, Any]]:
    """Return the conserved quantities as data: the energy, and one entry for all Casimirs.

    The energy is left out if H depends on the time or forces act.
    """
    cell, pushed = compilation.cell, compilation.program.pushed
    quantities: list[dict[str, Any]] = [] if cell.driven else [quantity("energy error")]
    casimirs = {name: k for k, name in enumerate(cell.casimirs) if name not in pushed}
    if casimirs:
        label = f"Casimir error{'s' * (len(casimirs) > 1)} ({', '.join(casimirs)})"
        quantities.append(quantity(label, casimirs=[*casimirs.values()]))
    invariants, first = list(cell.invariants), len(compilation.spec.recorded)
    if invariants:
        label = f"error{'s' * (len(invariants) > 1)} of {', '.join(invariants)}"
        label = label if len(invariants) <= 3 else f"error of {len(invariants)} invariants"
        quantities.append(quantity(label, invariants=[first + 2 * k for k in range(len(invariants))]))
    return quantities


def _caption(compilation: CompiledLattice) -> str:
    introduction = "Two solvers integrate the motion from the same start, in your browser. "
    conserved = ["its invariants" if q["invariants"] else "its Casimirs" if q["casimirs"] else "its energy"
            for q in _quantities(compilation)]  # fmt: skip
    conserved_words = " and ".join([", ".join(conserved[:-1]), conserved[-1]] if len(conserved) > 1 else conserved)
    if not conserved_words:
        return f"{introduction}{NOTHING}"
    return (
        f"{introduction}The exact solution conserves {conserved_words}. The numbers are the errors of the two solvers."
    )
