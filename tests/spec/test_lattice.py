"""Specs of lattices: the objects that are read from their keys."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from phigen.errors import LimitError, SpecError
from phigen.lattice.states import start_of
from phigen.spec import loads
from phigen.spec.model import MatrixForm, Values
from phigen.spec.quoting import quoted
from phigen.symbolic.expression import ONE, ZERO, number, symbol

TODA = """\
phigen: 1
name: toda
lattice: {axes: [i], boundary: open}
coordinates: [a, b]
definitions: {kinetic: b**2/2}
poisson: {brackets: {a: {b: a/2, "b[i-1]": -a/2}}}
hamiltonian: kinetic + kinetic[i+1] + 2*a**2
casimirs: {B: {value: b, at: sum}, A: a, AA: "a*a[i+1]", P: {value: a, at: product}}
runs:
  waves: {sizes: [16], initial: {a: 1 + i/N_i, b: {random: normal, seed: 3, scale: 0.1}}, step: 0.1, steps: 10}
"""
FOOD = """\
phigen: 1
name: food_web
lattice: {graph: eats}
coordinates: [x]
parameters: {A: {value: [1, 2], at: bonds}, r: {value: 0.5, at: sites}, c: 2}
poisson: {bonds: {"x[a]": {"x[b]": "A*x[a]*x[b]"}}}
hamiltonian: {sites: x - r*log(x), bonds: "c*r[a]*x[b]"}
runs:
  three: {bonds: [[0, 1], [1, 2]], initial: {x: [1, 2, 3]}, parameters: {r: r.csv}, step: 0.1, steps: 10}
"""


def test_axes_and_boundaries() -> None:
    assert (loads(TODA).lattice.axes, loads(TODA).lattice.boundary) == (("i",), ("open",))
    both = loads(
        TODA.replace("{axes: [i], boundary: open}", "{axes: [i, j], boundary: [periodic, open]}").replace(
            "[16]", "[4, 4]"
        )
    )
    assert both.lattice.boundary == ("periodic", "open")
    assert loads(TODA.replace(", boundary: open", "")).lattice.boundary == ("periodic",)


def test_brackets_of_one_site_and_of_neighbours_are_distinguished() -> None:
    spec, half = loads(TODA), symbol("a") / 2
    assert spec.poisson == MatrixForm(((ZERO, half), (-half, ZERO)))
    assert spec.lattice.brackets == {("a", "b[i-1]"): -half}


def test_a_definition_moves_with_its_index() -> None:
    spec = loads(TODA)
    assert spec.hamiltonian is symbol("b") ** 2 / 2 + symbol("b[i+1]") ** 2 / 2 + 2 * symbol("a") ** 2


def test_a_casimir_is_one_of_each_site_unless_it_names_neighbours_or_says_so() -> None:
    assert loads(TODA).lattice.kinds == {"B": "sum", "A": "sites", "AA": "sum", "P": "product"}


@pytest.mark.parametrize("scale", [0, -2, 0.5])
def test_random_values_have_their_scale_and_mean(scale: float) -> None:
    random_entry = f"{{random: uniform, seed: 3, scale: {scale}, mean: 1 + i}}"
    spec = loads(
        TODA.replace("{a: 1 + i/N_i, b: {random: normal, seed: 3, scale: 0.1}}", f"{{a: {random_entry}, b: 0}}")
    )
    drawn = np.random.default_rng(3).uniform(-1, 1, 16)
    assert np.array_equal(start_of(spec, spec.runs["waves"]).state[0], scale * drawn + 1 + np.arange(16))


def test_initial_values_are_formulas_of_the_indices_or_random() -> None:
    run = loads(TODA).runs["waves"].lattice
    assert run.sizes == (16,)
    assert run.state["a"] == Values(formula=number(1) + symbol("i") / symbol("N_i"))
    assert run.state["b"] == Values(random="normal", seed=3, scale=Fraction(1, 10))
    around = loads(TODA.replace("scale: 0.1", "scale: 0.1, mean: 2*i"))
    assert around.runs["waves"].lattice.state["b"] == replace(run.state["b"], formula=2 * symbol("i"))
    drawn = [start_of(spec, spec.runs["waves"]).state[1] for spec in (loads(TODA), around)]
    np.testing.assert_allclose(drawn[1] - drawn[0], 2 * np.arange(16))


def test_graphs_have_densities_of_sites_and_bonds_and_brackets_along_bonds() -> None:
    spec = loads(FOOD)
    assert spec.lattice.relation == "graph"
    assert spec.lattice.brackets == {("x[a]", "x[b]"): symbol("A") * symbol("x[a]") * symbol("x[b]")}
    assert spec.lattice.bonds is symbol("c") * symbol("r[a]") * symbol("x[b]")
    assert [p.at for p in spec.parameters] == ["bonds", "sites", "all"]
    assert spec.parameters[0].values == Values(listed=(Fraction(1), Fraction(2)))


def test_a_run_of_a_graph_has_bonds_and_arrays() -> None:
    run = loads(FOOD).runs["three"].lattice
    assert (run.bonds, run.arrays) == (((0, 1), (1, 2)), {"r": Values(file="r.csv")})


def test_pairs_are_of_sites_a_and_b() -> None:
    text = FOOD.replace("{graph: eats}", "{pairs: all}").replace("A: {value: [1, 2], at: bonds}, ", "")
    text = text.replace('{bonds: {"x[a]": {"x[b]": "A*x[a]*x[b]"}}}', "{brackets: {}}").replace(
        "bonds: [[0, 1], [1, 2]], ", ""
    )
    spec = loads(text.replace("bonds:", "pairs:"))
    assert spec.lattice.pairs
    assert spec.lattice.bonds is symbol("c") * symbol("r[a]") * symbol("x[b]")
    assert spec.poisson == MatrixForm(((ZERO,),))


def test_zero_offsets_and_spaces_are_read() -> None:
    spec = loads(TODA.replace("2*a**2", "a[i]*a[ i - 1 ] + 1"))
    assert spec.hamiltonian is symbol("b") ** 2 / 2 + symbol("b[i+1]") ** 2 / 2 + symbol("a") * symbol("a[i-1]") + ONE


def test_a_lattice_larger_than_the_limit_has_an_exit_code_of_its_own() -> None:
    with pytest.raises(LimitError, match="not between 1 and"):
        loads(TODA.replace("[16]", "[20000000000]"))


def test_a_lattice_is_no_ordinary_system() -> None:
    from phigen.geometry.system import system_from_spec

    with pytest.raises(SpecError, match="toda is a lattice"):
        system_from_spec(loads(TODA))


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("a: {C: x*x[i+1]}", 'a: {C: "x*x[i+1]"}'),
        ("{a: {b: a/2, b[i-1]: -a/2}}", '{a: {b: a/2, "b[i-1]": -a/2}}'),
        ("[x[i+1], y*(x + x[i-1,j+1])]", '["x[i+1]", "y*(x + x[i-1,j+1])"]'),
        ('{a: "x[i+1]", b: y[i]}', '{a: "x[i+1]", b: "y[i]"}'),
        ("{a: [1, 2], b: atan2(x[i+1], y)}", '{a: [1, 2], b: "atan2(x[i+1], y)"}'),
    ],
)
def test_quotes_are_put_about_what_has_an_index(line: str, expected: str) -> None:
    assert quoted(line) == expected


@pytest.mark.parametrize("name", ["eats", "bonds"])
def test_nothing_else_is_called_as_the_bonds_of_a_graph(name: str) -> None:
    with pytest.raises(SpecError, match=f"'{name}' has the name of the bonds"):
        loads(FOOD.replace("parameters: {", f"parameters: {{{name}: 1, "))
