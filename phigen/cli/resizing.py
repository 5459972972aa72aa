"""``--sizes``: a run of a lattice at other sizes than the spec gives it."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import click

from phigen.cli.experiment import run_of
from phigen.spec.problems import counted

if TYPE_CHECKING:
    from phigen.spec.model import Spec

OPTION = "--sizes"

sizes_option = click.option(
    OPTION, metavar="SIZES", help="Of a lattice: other sizes than those of the run, such as 64x64."
)

#: Sizes as they are typed.
SIZES = re.compile(r"[1-9][0-9]{0,9}(x[1-9][0-9]{0,9})*")


def resized(spec: Spec, name: str | None, given: str | None) -> Spec:
    """The spec with other sizes in the run of that name, the first by default; the same spec without sizes.

    Raises `click.BadParameter` for what is no size, for systems that have none, and for sizes that the stencil does
    not fit in.
    """
    if given is None:
        return spec
    if not spec.lattice:
        raise click.BadParameter(f"{spec.name} is no lattice, and has no sizes", param_hint=OPTION)
    if spec.lattice.graph:
        raise click.BadParameter(f"{spec.name} is a graph, whose sites are those of its bonds", param_hint=OPTION)
    if not SIZES.fullmatch(given):
        raise click.BadParameter(f"{given!r} is not sizes such as 64x64", param_hint=OPTION)
    run, sizes = run_of(spec, name), tuple(map(int, given.split("x")))
    assert run.lattice is not None
    axes = spec.lattice.axes
    if len(sizes) != len(axes or ("sites",)):
        wanted = f"the axes {', '.join(axes)}" if len(axes) > 1 else "one axis" if axes else "sites alone"
        many = counted(len(sizes), "size")
        raise click.BadParameter(f"{given} has {many}; {spec.name} has {wanted}", param_hint=OPTION)
    _expect_room(spec, sizes, given)
    other = replace(run, lattice=replace(run.lattice, sizes=sizes))
    # what is said of these sizes points at no line of the spec, which has others
    elsewhere = {("runs",), ("runs", run.name), ("runs", run.name, "sizes")}
    locations = {path: at for path, at in spec.locations.items() if path not in elsewhere}
    return replace(spec, runs={**spec.runs, run.name: other}, locations=locations)


def _expect_room(spec: Spec, sizes: tuple[int, ...], given: str) -> None:
    from phigen.lattice.building import cell_from_spec, least_sizes

    least = least_sizes(cell_from_spec(spec))
    if any(size < room for size, room in zip(sizes, least, strict=False)):
        message = f"{given} is too small for the stencil; sizes are at least {'x'.join(map(str, least))}"
        raise click.BadParameter(message, param_hint=OPTION)
