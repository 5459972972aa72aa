"""Gauss steps for Lie algebras with a square-zero ideal, in which all products vanish, such as the translations in
se(3). Instead of the part of a group element in the ideal, a stage has linear functionals on the subalgebra as
unknowns. The step is the same, with fewer unknowns.
"""

import random
from dataclasses import replace

import numpy as np
import pytest
import sympy
from support import compile_text, compiled, small, solver, spec_of

from phigen.compiler import compile_spec, examine
from phigen.gauss import realisation, statements
from phigen.gauss.quaternionic import quaternionic
from phigen.gauss.square_zero import square_zero_ideal
from phigen.gauss.stage_map import at_unknowns, stage_map, vector_field
from phigen.geometry.families import named
from phigen.geometry.sympy_bridge import to_sympy
from phigen.spec import loads
from phigen.symbolic.verdict import REFUTED

#: A heavy top whose order of coordinates mixes momenta and gravity, with terms of H in which both occur.
TOP = """coordinates: [g2, m3, g1, m1, g3, m2]
poisson:
  brackets:
    m1: {m2: -m3, m3: m2, g2: -g3, g3: g2}
    m2: {m3: -m1, g1: g3, g3: -g1}
    m3: {g1: -g2, g2: g1}
hamiltonian: m1**2/2 + m2**2/3 + m3**2/5 + g1 + g2**2/4 + m1*g3/5 + m2**2*m3/7
casimirs: {A: g1**2 + g2**2 + g3**2, B: m1*g1 + m2*g2 + m3*g3}
scheme: gauss
"""
START = np.array([0.3, -0.5, 0.8, 1.0, -0.4, 0.6])


def _satellite():
    return compile_spec(replace(spec_of("satellite"), composition="auto").overridden(order=8, scheme="gauss"))


CASES = {
    "kowalevski_gauss": lambda: compiled("kowalevski_gauss", 8, "gauss"),
    "top": lambda: compile_text(TOP, 8),
    "satellite": _satellite,
}
#: Families and sizes of Lie algebras, with the number of unknowns of a stage.
NAMED = [("se", 3, 8), ("se", 2, 4), ("so", 4, 8), ("heisenberg", 2, 6)]


@pytest.mark.parametrize(("family", "size", "unknowns"), NAMED)
def test_ideals_of_named_algebras(family, size, unknowns):
    """In se(n) the translations are a square-zero ideal. so(4) has no such ideal, and the ideal of a Heisenberg algebra
    is not square-zero.
    """
    algebra = quaternionic(named(family, size))
    ideal = square_zero_ideal(algebra)
    assert bool(ideal) == (family == "se")
    assert (2 * (algebra.dimension - len(ideal)) if ideal else algebra.dimension) == unknowns


def test_a_product_in_the_ideal_is_noticed():
    algebra = quaternionic(named("se", 3))
    i, j = square_zero_ideal(algebra)[:2]
    assert square_zero_ideal(replace(algebra, table={**algebra.table, (i, j): {i: algebra.field.one}})) == ()


def test_bodies_in_several_fields_have_the_unknowns_of_one():
    """For so(3) ⋉ 2R³, a body in two fields, the 12 components of a group element reduce to 8 unknowns, as for a body
    in one field.
    """
    compilation = CASES["satellite"]()
    assert [group.algebra.dimension for group in compilation.gauss.groups] == [12]
    assert compilation.program.step.unknowns == 8


@pytest.mark.thin(3, of_all=1)
@pytest.mark.parametrize("name", CASES)
def test_momenta_follow_the_equations_at_any_unknowns(name):
    """The vector field of the unknowns makes the momenta x obey ẋ = π∇H at any values of the unknowns; sympy compares
    both in exact arithmetic.
    """
    compilation = CASES[name]()
    points, source = stage_map(compilation.discretised, compilation.gauss), random.Random(1)
    system = points.system.to_sympy()
    symbols = {str(s): s for s in (*system.coordinates, *system.parameters)}
    symbols |= {z: sympy.Symbol(f"z{k}") for k, z in enumerate(points.unknowns)}
    place = {s: sympy.Rational(source.randint(-9, 9), source.randint(1, 9)) for s in symbols.values()}
    values = at_unknowns(points)
    momenta = sympy.Matrix([to_sympy(values[c], symbols) for c in points.system.coordinates])
    field = sympy.Matrix([to_sympy(e, symbols) for e in vector_field(points, values)]).subs(place)
    rates = momenta.jacobian([symbols[z] for z in points.unknowns]).subs(place) * field
    there = dict(zip(system.coordinates, momenta.subs(place), strict=True))
    slopes = sympy.Matrix([sympy.diff(system.hamiltonian, c) for c in system.coordinates])
    expected = (system.poisson * slopes).subs({s: place[s] for s in system.parameters}).subs(there, simultaneous=True)
    assert all(v != 0 for v in expected)
    assert list(rates) == list(expected)


@pytest.mark.parametrize("target", ["numpy", "c", "small"])
def test_steps_are_those_of_group_elements(target, monkeypatch):
    """States at the ends of steps and in between agree with those of steps that iterate whole group elements."""
    states = []
    for ideal in (square_zero_ideal, lambda algebra: ()):
        monkeypatch.setattr(realisation, "square_zero_ideal", ideal)
        compilation = compile_text(TOP, 8)
        method = solver(small(compilation) if target == "small" else compilation, "numpy" if target == "numpy" else "c")
        session = method.backend.start(START, method.backend.interface.parameters)
        session.advance(0.3, 20)
        before = session.state()
        session.advance(0.3, 1)
        start, middle = session.interpolated([0.0, 0.4])
        assert start == pytest.approx(before, abs=4e-15)
        states.append([session.state(), middle])
    assert np.abs(np.subtract(*states)).max() <= 2e-14


def test_check_proves_that_functionals_make_the_step(monkeypatch):
    name = "g and λ(b) = x̃(gb) + 2x̃(nb) give the same step as G = g + n"
    spec = loads(f"phigen: 1\nname: t\n{TOP}")
    for checked in (spec_of("kowalevski_gauss"), spec):
        assert next(s for s in examine(checked).statements if s.name == name).verdict == "proved"
    monkeypatch.setattr(statements, "functional_offsets", lambda group, x, w: [w[k] for k in group.subalgebra])
    assert next(s for s in examine(spec).statements if s.name == name).verdict == REFUTED
