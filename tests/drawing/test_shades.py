"""Colour maps of fields: symmetric about 0 if values have both signs, otherwise over the range of the values."""

from __future__ import annotations

import numpy as np
import pytest

import phigen

pytest.importorskip("matplotlib")

from phigen.drawing.lattice_figures import lattice_figure
from phigen.drawing.shades import DIVERGING, SEQUENTIAL, shades_of


@pytest.mark.parametrize(
    ("values", "name", "bounds"),
    [
        ([-1, 3], DIVERGING, (-3, 3)),
        ([1, 3], SEQUENTIAL, (1, 3)),
        ([0, 3], SEQUENTIAL, (0, 3)),
        ([-3, 0], SEQUENTIAL, (-3, 0)),
        ([2, 2], SEQUENTIAL, (1, 3)),
        ([0, 0], DIVERGING, (-0.5, 0.5)),
    ],
)
def test_only_values_of_both_signs_have_colours_on_both_sides_of_0(values, name, bounds):
    shades = shades_of(np.array(values, dtype=float))
    assert (shades["cmap"].name.partition("_resampled")[0], shades["vmin"], shades["vmax"]) == (name, *bounds)


def test_a_diagram_of_a_positive_field_uses_all_colours():
    run = phigen.compile("volterra", "numpy").integrate(1 + np.arange(8.0).reshape(1, 8), h=0.001, steps=2)
    errors = {"energy": np.full(len(run), 1e-9)}
    images = [image for part in lattice_figure(run, errors, "").subfigs for axes in part.axes for image in axes.images]
    assert [image.get_clim() for image in images] == [(run.x.min(), run.x.max())]
