"""Option ``--sizes``: a run of a lattice with other sizes than those in the spec."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import click

from phigen.cli.expanding import too_small, typed_sizes
from phigen.cli.experiment import run_of
from phigen.spec.problems import counted

if TYPE_CHECKING:
    from phigen.spec.model import Spec

OPTION = "--sizes"

sizes_option = click.option(
    OPTION, metavar="SIZES", help="For a lattice: other sizes than those of the run, such as 64x64."
)


def resized(spec: Spec, name: str | None, text: str | None) -> Spec:
    """Return the spec with other sizes of the lattice in the run called ``name``, by default in the first run.

    ``text`` states the sizes, such as 64x64. If ``text`` is None, the spec is returned unchanged. Raises
    `click.BadParameter` if ``text`` does not state sizes, if sizes cannot be chosen for this system, or if a size is
    too small for the stencil.
    """
    if text is None:
        return spec
    if not spec.lattice:
        raise click.BadParameter(f"{spec.name} is not a lattice, so it has no sizes", param_hint=OPTION)
    if spec.lattice.graph:
        message = f"{spec.name} is a graph, whose size follows from its bonds and cannot be chosen"
        raise click.BadParameter(message, param_hint=OPTION)
    sizes = typed_sizes(text)
    if sizes is None:
        raise click.BadParameter(f"{text!r} does not state sizes, such as 64x64", param_hint=OPTION)
    run = run_of(spec, name)
    assert run.lattice is not None
    axes = spec.lattice.axes
    if len(sizes) != len(axes or ("sites",)):
        expected = f"the axes {', '.join(axes)}" if len(axes) > 1 else "one axis" if axes else "sites alone"
        size_count = counted(len(sizes), "size")
        raise click.BadParameter(f"{text} has {size_count}; {spec.name} has {expected}", param_hint=OPTION)
    from phigen.lattice.cell_building import cell_from_spec

    if complaint := too_small(cell_from_spec(spec), sizes, text):
        raise click.BadParameter(complaint, param_hint=OPTION)
    resized_run = replace(run, lattice=replace(run.lattice, sizes=sizes))
    # An error about the new sizes must not point to a line of the spec, because this line contains the old sizes.
    elsewhere = {("runs",), ("runs", run.name), ("runs", run.name, "sizes")}
    locations = {path: location for path, location in spec.locations.items() if path not in elsewhere}
    return replace(spec, runs={**spec.runs, run.name: resized_run}, locations=locations)
