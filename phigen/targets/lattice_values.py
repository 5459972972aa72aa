"""Values and switches that the templates for lattices need, in every language."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from phigen.scheme.program import Program
from phigen.scheme.steps import Sweeps


def tables(program: Program, step: Sweeps, listed: Callable[[Sequence[object]], str]) -> dict[str, object]:
    """Return the tables of sites, colours and flows as template values; ``listed`` prints a sequence in the
    language.
    """
    sites, schedule = step.sites, step.schedule
    return {
        "axes": listed(sites.axes),
        "at_sites": listed(sites.parameters),
        "at_bonds": listed(sites.at_bonds),
        "open": listed(sites.open_axes),
        "least": listed(sites.min_sizes),
        "periods": listed(sites.periods),
        "parted": sites.colours > 1,
        "colours": sites.colours,
        "colour_weights": listed(sites.weights),
        "seamed": bool(sites.seams),
        "seams": listed([[seam.period, seam.min_length, seam.margin] for seam in sites.seams]),
        "row": step.row,
        "renewed": step.refresh is not None,
        "prepared": step.prepared,
        "times": listed(schedule.times),
        "time": program.time,
        "moments": listed(program.midpoints if step.equation else schedule.moments),
        "kicks": bool(schedule.multiples),
        "multiples": listed(schedule.multiples),
        "coloured": bool(step.by_colour),
        "by_colour": listed(step.by_colour),
        "split": step.equation is None,
        "tangent": program.extras.tangent,
        "most_sweeps": step.equation.most_sweeps if step.equation else 0,
        "graph": step.others.graph,
        "monitored": step.rates is not None,
        "negative": step.rates.negative if step.rates else 0,
    }


def switches(step: Sweeps) -> dict[str, bool]:
    """Return a map from the names of switches for lattices to their values. The runtime of every language has these
    switches.
    """
    return {
        "COLOURS": step.sites.colours > 1,
        "SEAMS": bool(step.sites.seams),
        "GATHER": step.partners is not None,
        "GRAPH": step.others.graph,
        "BY_COLOUR": bool(step.by_colour),
        "MONITOR": step.rates is not None,
        "LATE": step.rates is not None and bool(step.rates.slopes),
        "BODIES": step.relative is not None,
        "JACOBI": step.relative is not None and step.relative.jacobi,
        "MOMENTA": step.relative is not None and step.relative.momenta,
    }
