"""Options ``--expand`` and ``--lattice`` of ``phigen show``: a small lattice as a spec without lattice, and back."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import click

from phigen.errors import Diagnostic, LimitError, SpecError

if TYPE_CHECKING:
    from phigen.lattice.cell import Cell
    from phigen.lattice.expansion import Expansion
    from phigen.spec.model import Run, Spec

OPTION = "--expand"


def expanded_text(spec: Spec, sizes: str) -> str:
    """Return the text of a spec that describes a small lattice site by site, without the key ``lattice``.

    ``sizes`` are sizes such as ``3x3``, or the name of a run with the sizes.
    """
    from phigen.lattice.cell_building import cell_from_spec
    from phigen.spec.yaml_text import spec_text

    if spec.lattice is None:
        message = f"{spec.name} is not a lattice, so there is nothing to expand"
        raise click.BadParameter(message, param_hint=OPTION)
    cell = cell_from_spec(spec)
    expansion = _expansion(spec, cell, sizes)
    runs = {
        name: expanded_run
        for name, run in spec.runs.items()
        for expanded_run in [_run(spec, expansion, run)]
        if expanded_run
    }
    title = f"{spec.title or spec.name}, {' × '.join(map(str, expansion.sizes))}"
    return spec_text(replace(expansion.spec(), title=title, runs=runs, order=spec.order))


def lattice_text(spec: Spec) -> str:
    """Return the text of a lattice spec, from a spec that describes identical sites one by one."""
    from phigen.lattice.recognition import MIN_SITES_PER_AXIS, recognised_lattice
    from phigen.spec.yaml_text import spec_text

    lattice_spec = None if spec.lattice else recognised_lattice(spec, least=MIN_SITES_PER_AXIS)
    if lattice_spec is None:
        message = f"{spec.name} is not recognised as a lattice"
        least = MIN_SITES_PER_AXIS
        names = "a lattice has names such as x1, x2, … or x_0_0, …"
        hint = f"{names}, and along each axis {least} or more sites with the same terms"
        raise SpecError([spec.diagnostic(("coordinates",), message, hint)])
    return spec_text(lattice_spec)


def typed_sizes(text: str) -> tuple[int, ...] | None:
    """Return the sizes in a text such as ``3x3``; None for other texts."""
    match = re.fullmatch(r"[1-9][0-9]{0,9}(x[1-9][0-9]{0,9})*", text)
    return tuple(map(int, text.split("x"))) if match else None


def too_small(cell: Cell, sizes: Sequence[int], text: str) -> str:
    """Return the error message for sizes that are too small for the stencil; "" if they are large enough."""
    from phigen.lattice.cell_building import least_sizes

    least = least_sizes(cell)
    if all(size >= room for size, room in zip(sizes, least, strict=False)):
        return ""
    return f"{text} is too small for the stencil; sizes are at least {'x'.join(map(str, least))}"


def _expansion(spec: Spec, cell: Cell, choice: str) -> Expansion:
    from phigen.lattice.expansion import expand, ring
    from phigen.lattice.states import start_of
    from phigen.spec import limits

    if choice in spec.runs:
        start = start_of(spec, spec.runs[choice])
        sizes, bonds = start.sizes, [(int(a), int(b)) for a, b in start.bonds]
    elif typed := typed_sizes(choice):
        sizes = typed
        bonds = ring(sizes[0]) if cell.relation == "graph" else []
    else:
        runs = f", or the name of a run: {', '.join(spec.runs)}" if spec.runs else ""
        raise click.BadParameter(f"{choice!r} does not state sizes, such as 3x3{runs}", param_hint=OPTION)
    count = len(cell.fields)
    for size in sizes:
        count *= size
    if count > limits.COORDINATES:
        message = f"{count} coordinates; an ordinary spec has at most {limits.COORDINATES}"
        raise LimitError([Diagnostic(f"{spec.file}: {OPTION} {choice}: {message}")])
    if complaint := too_small(cell, sizes, choice):
        raise SpecError([Diagnostic(f"{spec.file}: {complaint}")])
    try:
        return expand(cell, sizes, bonds)
    except ValueError as error:
        raise click.BadParameter(str(error), param_hint=OPTION) from None


def _run(spec: Spec, expansion: Expansion, run: Run) -> Run | None:
    """Return a run of the lattice as a run of the expanded spec.

    Returns None if the initial values of the run do not fit the sizes of the expansion.
    """
    from phigen.lattice.expansion import run_of
    from phigen.lattice.states import start_of

    assert run.lattice is not None
    bonds = expansion.bonds if expansion.cell.relation == "graph" else ()
    resized = replace(run, lattice=replace(run.lattice, sizes=expansion.sizes, bonds=bonds))
    try:
        start = start_of(spec, resized)
    except SpecError:
        return None
    return run_of(expansion, run, start.state, expansion.numbers(start.parameters))
