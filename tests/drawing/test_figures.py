import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from phigen.cli import group
from phigen.drawing.error_curves import windowed_maxima
from phigen.drawing.figures import (
    error_figure,
    lyapunov_figure,
    run_figure,
    save,
    section_figure,
    svg,
    trajectory_figure,
)
from phigen.drawing.groups import groups
from phigen.drawing.leaf import leaf_of, net
from phigen.drawing.palette import PALETTE, SERIES
from phigen.drawing.section_plane import plane_of
from phigen.errors import MissingPackageError
from phigen.runtime.trajectory import Trajectory
from phigen.study.lyapunov import Spectrum
from phigen.symbolic.expression import power, symbol

CASIMIR = {"C": power(symbol("x1"), 2) + power(symbol("x2"), 2) + power(symbol("x3"), 2)}

SWING = """\
phigen: 1
name: swing
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - cos(q)
observables: {T: p**2/2, side: sign(q)}
runs: {a: {initial: [1, 0], step: 0.1, steps: 100}}
"""


def spiral(rows=50, names=("x1", "x2", "x3"), broken=None):
    """Return a trajectory on the unit sphere with oscillating errors. The states are NaN from row ``broken`` on."""
    t = np.linspace(0, 3, rows)
    circle = np.column_stack([np.cos(5 * t) * np.sin(t), np.sin(5 * t) * np.sin(t), np.cos(t)])
    x = np.resize(circle.T, (len(names), rows)).T.copy()
    x[broken if broken is not None else rows :] = np.nan
    error = 1e-9 * np.abs(np.sin(7 * t)) + 0 * x[:, 0]
    return Trajectory(t, x, 1 + error, {"C": 1 + 0 * error}, rows - 1, t[1], {}, tuple(names))


@pytest.mark.thin(3)
@pytest.mark.parametrize("dimension", [1, 2, 3, 4, 12, 30])
def test_trajectories_of_every_dimension_are_drawn(dimension):
    figure = trajectory_figure(spiral(names=[f"x{i + 1}" for i in range(dimension)]), CASIMIR)
    assert figure.axes
    assert svg(figure).startswith("<?xml")


def lettered(axes):
    """Return the labels of three-dimensional axes and of their ticks, each as text with its bounding box."""
    every = (axes.xaxis, axes.yaxis, axes.zaxis)
    texts = [axis.label for axis in every] + [tick.label1 for axis in every for tick in axis.get_major_ticks()]
    return [(text.get_text(), text.get_window_extent()) for text in texts]


@pytest.mark.parametrize(
    ("dimension", "size"),
    [(3, [1, 1, 1]), (6, [1e-2, 1e-2, 1e-4]), pytest.param(9, [0.3, 1, 0.05], marks=pytest.mark.slow)],
)
def test_names_and_ticks_in_space_do_not_meet_and_are_in_the_figure(dimension, size):
    curve = spiral(names=[f"speed{i}" for i in range(1, dimension + 1)])
    curve = replace(curve, x=np.tile(size, dimension // 3) * curve.x + [3.0, *[0.0] * (dimension - 1)])
    figure = trajectory_figure(curve, {})
    figure.draw_without_rendering()
    for axes in figure.axes:
        texts = lettered(axes)
        assert len(texts) >= 8
        for k, (text, box) in enumerate(texts):
            assert [other for other, place in texts[:k] if box.overlaps(place)] == [], text
            assert box.x0 >= 0, text
            assert box.x1 <= figure.bbox.x1, text
    assert ("speed5 / 10⁻³" in [name for name, _ in texts]) == (dimension == 6)


@pytest.mark.slow
def test_a_run_is_drawn_on_one_page():
    sections = {"x3 = 0": spiral().x}
    figure = run_figure({"a": spiral(), "b": spiral(broken=20)}, CASIMIR, sections, "title")
    assert [len(row.subfigs) for row in figure.subfigs] == [2, 1]  # first row: trajectory and section
    spectrum = Spectrum(np.array([0.1, -0.1]), np.array([1.0, 2.0]), np.array([[0.3, -0.3], [0.1, -0.1]]))
    assert len(list(run_figure({"a": spiral()}, CASIMIR, spectrum=spectrum).subfigs)) == 3
    assert len(lyapunov_figure(spectrum).axes[0].lines) == 3


@pytest.mark.slow
def test_svg_is_a_function_of_what_it_shows():
    first, second = (svg(error_figure({"a": spiral(), "b": spiral(broken=20)})) for _ in range(2))
    assert first == second
    assert not re.search(r"\b20\d\d-\d\d-\d\d|matplotlib v", first.lower())
    assert PALETTE["series-1"] in first
    assert PALETTE["series-2"] in first


@pytest.mark.slow
def test_drawing_leaves_the_settings_of_matplotlib_alone(tmp_path):
    code = (
        "import sys, matplotlib as m; m.rcParams['font.size'] = 31\n"
        "from test_figures import *\n"
        "save(error_figure({'a': spiral()}), sys.argv[1])\n"
        "assert m.rcParams['font.size'] == 31 and m.rcParams['svg.hashsalt'] is None\n"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    paths = {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "f.pdf")], check=True, env={**os.environ, **paths})
    assert (tmp_path / "f.pdf").read_bytes().startswith(b"%PDF")


def test_no_peak_is_lost_in_windows():
    values = np.full(100_000, 1e-14)
    values[[3, 77_777]] = 1e-3, 1e-5
    t = np.arange(100_000.0)
    times, errors = windowed_maxima(t, values)
    assert len(times) < 1000
    assert {(3.0, 1e-3), (77_777.0, 1e-5)} <= set(zip(times, errors, strict=True))


def test_a_window_with_a_failure_is_shown_as_one():
    values = np.zeros(10_000)
    values[5_000:] = np.nan
    _, errors = windowed_maxima(np.arange(10_000.0), values)
    assert np.isnan(errors[-1])
    assert errors[0] == 0


def test_zeros_of_an_error_are_drawn():
    figure = error_figure({"a": spiral()})
    labels = [label.get_text() for axes in figure.axes for label in axes.get_yticklabels()]
    assert labels.count("0") == 2


def test_the_net_of_a_leaf_lies_on_it():
    leaf = leaf_of(CASIMIR, ("x1", "x2", "x3"), {"x1": 0.6, "x2": 0.0, "x3": 0.8}, {})
    lines = net(leaf, np.array([[-1.1] * 3, [1.1] * 3]))
    assert len(lines) >= 27
    assert max(np.max(np.abs(np.sum(line**2, axis=1) - 1)) for line in lines) < 1e-6


def test_a_leaf_has_no_part_at_the_pole_of_its_casimir():
    casimir = {"C": symbol("x1") * symbol("x3") / symbol("x2")}
    leaf = leaf_of(casimir, ("x1", "x2", "x3"), {"x1": 1.0, "x2": 1.0, "x3": 1.0}, {})
    for line in net(leaf, np.array([[-2.0] * 3, [2.1] * 3])):
        assert np.allclose(line[:, 0] * line[:, 2], line[:, 1], atol=1e-4)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ("x y px py", ["x y", "px py"]),
        ("q1 p1 q2 p2", ["q1 q2", "p1 p2"]),
        ("q1 q2 q3 p1 p2 p3", ["q1 p1", "q2 p2", "q3 p3"]),
        ("P1 P2 P3 G1 G2 G3", ["P1 P2 P3", "G1 G2 G3"]),
        ("x1 y1 z1 x2 y2 z2", ["x1 y1 z1", "x2 y2 z2"]),
        ("a1 a2 b1 b2 b3", ["a1 a2", "b1 b2 b3"]),
        ("x y z u", ["x y z", "u"]),
        ("v1 v2 v3 v4 v5", ["v1 v2 v3", "v4 v5"]),
    ],
)
def test_coordinates_that_belong_together_are_drawn_together(names, expected):
    assert groups(names.split()) == [tuple(group.split()) for group in expected]


def test_sections_are_drawn_in_the_plane_that_varies():
    points = np.random.default_rng(1).normal(size=(40, 4))
    points[:, 0] = 1e-16
    axes = section_figure({"x = 0": points}, ("x", "y", "px", "py")).axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("y", "py")


def luminance(colour):
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize("colour", SERIES)
def test_colours_stand_out_on_light_and_dark_pages(colour):
    dark, light = luminance("#0d1117"), 1.0
    assert (light + 0.05) / (luminance(colour) + 0.05) > 3
    assert (luminance(colour) + 0.05) / (dark + 0.05) > 3


def test_without_matplotlib_the_error_names_the_command_that_installs_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingPackageError, match="not installed\n  hint: pip install matplotlib") as raised:
        error_figure({"a": spiral()})
    assert raised.value.exit_code == 2


def test_files_of_other_kinds_are_refused(tmp_path):
    with pytest.raises(ValueError, match="suffix"):
        save(error_figure({"a": spiral()}), tmp_path / "f.jpg")


def test_section_of_an_orbit_that_closes_is_not_drawn_against_the_coordinate_of_the_section():
    points = np.array([1e-13, -1.02, 0.06]) * (1 + 1e-14 * np.arange(5)[:, None])
    assert plane_of(("m1", "m2", "m3"), points) == (1, 2)


def test_observables_of_a_run_are_drawn_against_the_time_however_long_it_is(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("phigen.study.sketch.ROWS", 50)
    Path("swing.yaml").write_text(SWING, encoding="utf-8")
    drawn = []
    monkeypatch.setattr("phigen.drawing.figures.save", lambda figure, path, origin: drawn.append(figure))
    for more in ([], ["--extend", "--steps", "50"]):
        result = CliRunner().invoke(
            group, ["run", "swing.yaml", "-t", "numpy", "-o", "a.csv", "--plot", "a.svg", *more]
        )
        assert result.exit_code == 0, result.output
    rows = np.loadtxt("a.csv", delimiter=",", skiprows=1)
    known = {t: values for t, *values in rows[:, [0, 4, 5]].tolist()}
    panels = {axes.get_ylabel(): axes.lines[0] for axes in drawn[-1].axes if axes.get_ylabel() in ("T", "side")}
    assert list(panels) == ["T", "side"]
    for k, line in enumerate(panels.values()):
        t, values = line.get_data()
        assert len(t) >= 20
        assert (t[0], t[-1]) == (0, pytest.approx(15.0))
        assert values.tolist() == [known[time][k] for time in t.tolist()]
