"""Displays of systems, compilations and trajectories in notebooks."""

from xml.etree import ElementTree

import numpy as np
import pytest
from sympy import sympify

import phigen
from phigen import resources
from phigen.compiler import compile_spec
from phigen.spec import load

SPECS = resources.bundled_specs()


@pytest.fixture(scope="module")
def body():
    return compile_spec(load(SPECS / "rigid_body.yaml"))


def test_latex_of_a_system_has_bracket_energy_and_casimirs(body):
    shown = body.system._repr_latex_()
    assert "\\pi = \\begin{pmatrix} 0 & -x_{3} & x_{2}" in shown
    assert "C &= x_{1}^{2} + x_{2}^{2} + x_{3}^{2}" in shown
    assert "\\alpha" in body._repr_latex_()


def test_html_is_well_formed_and_says_the_values_of_parameters(body):
    shown = body.system._repr_html_()
    lines = ElementTree.fromstring(shown.replace("&#x2062;", "")).findall("div")
    assert len(lines) == 1 + 3 + 1  # H, three brackets, C
    assert "I1 = 2, I2 = 1, I3 = 0.666667" in shown
    assert f"compiled to order {body.program.order}" in body._repr_html_()


def test_names_are_escaped():
    hostile = phigen.System.from_sympy(["q", "p"], [[0, 1], [-1, 0]], sympify("p**2/2"), name="a<b>&c")
    assert "a&lt;b&gt;&amp;c" in hostile._repr_html_()


def test_a_trajectory_says_what_was_conserved(body):
    trajectory = phigen.compile(body, target="numpy").integrate([1, 1, 1], h=0.1, steps=10)
    table = ElementTree.fromstring(trajectory._repr_html_())
    rows = [[cell.text or "" for cell in row] for row in table.iter("tr")]
    assert rows[0] == ["", "t", "x1", "x2", "x3", "energy", "C"]
    assert [row[:2] for row in rows[1:]] == [["start", "0"], ["end", "1"], ["spread", ""]]
    assert float(rows[3][6]) < 1e-14


def test_lattices_show_themselves_as_other_systems_do():
    compilation = compile_spec(load(SPECS / "lattices" / "xxz_disorder.yaml"))
    assert "\\sum_{i}" in compilation._repr_latex_()
    assert "compiled to order" in ElementTree.fromstring(compilation._repr_html_().replace("&#x2062;", ""))[-1].text
    states, field = np.random.default_rng(1).normal(size=(3, 4)), np.arange(4.0)
    trajectory = phigen.compile(compilation, target="numpy").integrate(states, 0.05, steps=6, stride=3, B=field)
    rows = [[cell.text or "" for cell in row] for row in ElementTree.fromstring(trajectory._repr_html_()).iter("tr")]
    assert rows[0] == ["", "t", "mean x", "mean y", "mean z", "energy", "C"]
    assert [row[:2] for row in rows[1:]] == [["start", "0"], ["end", "0.3"], ["largest change", ""]]
    assert float(rows[3][6]) < 1e-14
    # Three diagrams with a colour scale each, and a diagram of what is conserved.
    assert len(trajectory.plot().axes) == 3 * 2 + 1
    dataset = trajectory.to_xarray()
    assert dict(dataset.sizes) == {"t": 3, "coordinate": 3, "i": 4}
    assert (dataset.x.sel(coordinate="y").values[0] == states[1]).all()
    assert (dataset.casimir_C.dims, dataset.parameter_B.values.tolist()) == (("t", "i"), field.tolist())


def test_representations_fit_on_a_line(body):
    assert repr(body.system) == "<System rigid_body: (x1, x2, x3), H = 1/2*(x3**2/I3 + (x2**2/I2 + x1**2/I1))>"
    assert repr(body) == f"<Compilation of rigid_body: order {body.order.order}, {body.label}>"
