"""Layout of graphs in a plane: where possible, distances of sites are proportional to the numbers of bonds between
them.
"""

from __future__ import annotations

import numpy as np
import pytest

from phigen.lattice.placing import MOST_PLACED, placed


def lengths(bonds: np.ndarray, places: np.ndarray) -> np.ndarray:
    return np.linalg.norm(places[bonds[:, 0]] - places[bonds[:, 1]], axis=1)


def square(side: int) -> np.ndarray:
    sites = np.arange(side * side).reshape(side, side)
    across, upwards = np.stack([sites[:, :-1], sites[:, 1:]], -1), np.stack([sites[:-1], sites[1:]], -1)
    return np.concatenate([across.reshape(-1, 2), upwards.reshape(-1, 2)])


def test_a_square_grid_is_drawn_as_one_whatever_the_order_of_its_sites() -> None:
    shuffled = np.random.default_rng(1).permutation(36)
    bonds = shuffled[square(6)]
    positions = placed(bonds, 36)
    assert positions is not None
    drawn = lengths(bonds, positions)
    assert drawn.max() < 1.6 * drawn.min()
    apart = np.linalg.norm(positions[:, None] - positions[None], axis=2) + np.eye(36)
    assert apart.min() > 0.9 * drawn.min()
    assert (positions.min(), positions.max()) == (0.0, 1.0)
    np.testing.assert_array_equal(positions, placed(bonds, 36))


@pytest.mark.parametrize(
    ("bonds", "sites"), [([[0, k] for k in range(1, 7)], 7), ([[0, 1], [2, 3], [3, 4]], 6), ([], 1), ([[0, 1]], 2)]
)
def test_no_two_sites_lie_on_one_another(bonds: list[list[int]], sites: int) -> None:
    """Cases: a star, whose distances do not determine a layout; graphs of several components; one site."""
    positions = placed(np.array(bonds, dtype=np.int64).reshape(-1, 2), sites)
    assert positions is not None
    assert np.isfinite(positions).all()
    apart = np.linalg.norm(positions[:, None] - positions[None], axis=2) + np.eye(sites)
    assert apart.min() > 0.1


def test_graphs_of_many_sites_are_not_placed() -> None:
    assert placed(np.array([[0, 1]]), MOST_PLACED + 1) is None


def test_graphs_are_drawn_with_their_bonds() -> None:
    pytest.importorskip("matplotlib")
    from matplotlib.collections import LineCollection, PathCollection
    from matplotlib.figure import Figure

    from phigen.drawing.lattice_figures import draw_sites
    from phigen.drawing.shades import shades_of

    axes, bonds = Figure().add_subplot(), square(3)
    places = placed(bonds, 9)
    assert places is not None
    shown = draw_sites(axes, bonds, places, np.arange(9.0), shades_of(np.arange(9.0)))
    lines, sites = axes.collections
    assert (type(lines), type(sites)) == (LineCollection, PathCollection)
    np.testing.assert_array_equal(np.array(lines.get_segments())[:, 0], places[bonds[:, 0]])
    np.testing.assert_array_equal(sites.get_offsets(), places)
    assert (shown.get_array().tolist(), shown.get_clim()) == (list(range(9)), (0.0, 8.0))
