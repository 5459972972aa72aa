"""The velocity ξ of a group element, Ġ = Gξ, is written as sums over the momenta x̃(G f G*) of a few frame elements f.
The values are the same as if ξ is computed from the coordinates, with fewer products.
"""

import pytest
from support import compile_text, compiled

from phigen.gauss.stage_map import at_unknowns, stage_map, vector_field
from phigen.symbolic.verdict import PROVED, decide_zero

#: Specs with constant and linear brackets together, with shifted momenta, and with a central element that has no
#: coordinate.
WRITTEN = {
    "mixed": "coordinates: [x, y, z, q, p]\nparameters: {a: 3}\n"
    "poisson: {brackets: {x: {y: z, z: -y}, y: {z: x}, q: {p: 1}}}\n"
    "hamiltonian: x**2/a + (x + y)**2/5 + p**2/2 + q**2/2 + q*z\n",
    "shifted": "coordinates: [x, y, z]\npoisson: {brackets: {x: {y: z + 2, z: -y}, y: {z: x - 1}}}\n"
    "hamiltonian: (x + y)**2/3 + z**2/2 + y\n",
    "oscillator": "coordinates: [n, q, p]\npoisson: {brackets: {n: {q: p, p: -q}, q: {p: 1}}}\n"
    "hamiltonian: n**2/2 + q**3/5 + n*p/3\n",
}


def maps(name):
    compilation = compile_text(WRITTEN[name] + "scheme: gauss\n", 4) if name in WRITTEN else compiled(name, 4, "gauss")
    return stage_map(compilation.discretised, compilation.gauss)


@pytest.mark.parametrize("name", ["rigid_body", "so4_manakov", "spin_chain5", *WRITTEN])
def test_collected_velocities_are_those_by_coordinates(name):
    points = maps(name)
    by_coordinates, collected = (
        vector_field(points, at_unknowns(points), collected=chosen) for chosen in (False, True)
    )
    residuals = [(u, a - b) for u, a, b in zip(points.unknowns, by_coordinates, collected, strict=True)]
    assert decide_zero("equal", residuals).verdict == PROVED


def test_products_of_a_stage_are_few():
    """On so(4) the collected sums leave at most 91 products in a stage; computed from the coordinates there are 95."""
    assert compiled("so4_manakov", 8, "gauss").program.about.operations["multiplications"] <= 91
