"""The modified Hamiltonian along a trajectory: each correction makes it more constant, which is measured where
round-off does not hide it.
"""

from dataclasses import replace

import numpy as np
import pytest
from support import compiled

from phigen import spec
from phigen.api import solver_of
from phigen.compiler import compile_spec
from phigen.errors import LimitError
from phigen.scheme.modified import corrections
from phigen.study import backward
from phigen.study.methods import of_classical, of_solver
from phigen.study.verification import gauge_at


def subject(name):
    """Return the modified Hamiltonian, the method, the start and the step size of the first run of a system of the
    corpus.
    """
    compilation = compiled(name)
    run = next(iter(compilation.spec.runs.values()))
    values = compilation.spec.parameters_of(run)
    x = np.array([float(v) for v in run.initial])
    gauge = gauge_at(compilation, x, values)
    method = of_solver(solver_of(compilation, "c"), values, gauge)
    return backward.modified(compilation, values, gauge), method, x, float(run.step)


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", ["rigid_body", "predator_prey"])
def test_each_correction_makes_the_modified_hamiltonian_two_orders_more_constant(name):
    corrections, method, x, h = subject(name)
    measured = backward.constancy(corrections, method, x, h)
    assert measured.powers == (corrections.powers[0], corrections.powers[0] + 2, corrections.powers[0] + 4)
    assert measured.observed == pytest.approx(measured.powers, abs=0.3)
    assert (measured.errors.max(axis=1)[1:] < 0.3 * measured.errors.max(axis=1)[:-1]).all()
    assert measured.times[-1] == pytest.approx(measured.end)


def test_wrong_corrections_are_noticed():
    corrections, method, x, h = subject("predator_prey")
    p, q = corrections.powers[:2]
    wrong = replace(corrections, terms=tuple(2 * t if p <= j < q else t for j, t in enumerate(corrections.terms)))
    assert backward.observed_powers(wrong, method, x, h)[1] < p + 0.5


def test_another_method_does_not_keep_it():
    corrections, _, x, h = subject("predator_prey")
    rk4 = of_classical("rk4", solver_of(compiled("predator_prey"), "numpy"), dict(corrections.values))
    assert backward.observed_powers(corrections, rk4, x, h)[1] < 5.5


def test_exactly_conserved_quantities_have_no_order():
    corrections, method, x, h = subject("harmonic_oscillator")
    assert backward.observed_powers(corrections, method, x, h) == [np.inf] * 3
    with pytest.raises(backward.NotOfferedError, match="rounding"):
        backward.constancy(corrections, method, x, h)


@pytest.mark.parametrize(
    ("options", "why"), [("order: 8", "orders up to 6"), ("order: 6\ncomposition: kahan-li", "several maps")]
)
def test_where_it_is_not_offered_it_says_why(options, why):
    text = "phigen: 1\nname: t\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
    compilation = compile_spec(spec.loads(f"{text}hamiltonian: p**2/2 - cos(q)\nbirealisation: constant\n{options}\n"))
    with pytest.raises(backward.NotOfferedError, match=why):
        backward.modified(compilation, {}, None)


GYROSTAT = """phigen: 1
name: t
coordinates: [m1, m2, m3]
parameters: {J1: 1, J2: 2, J3: 3.5, k: 0.7}
poisson: {brackets: {m1: {m2: -m3, m3: m2}, m2: {m3: -m1}}}
hamiltonian: m1**2/(2*J1) + m2**2/(2*J2) + (m3 - k)**2/(2*J3)
casimirs: {C: m1**2 + m2**2 + m3**2}
order: 6
"""


@pytest.mark.slow
def test_numbers_for_the_parameters_make_a_formula_that_would_be_too_large():
    compilation = compile_spec(spec.loads(GYROSTAT))
    with pytest.raises(LimitError):
        corrections(compilation.system, compilation.realisation, compilation.order, 2, compilation.gauge)
    values, x = {"J1": 1.0, "J2": 2.0, "J3": 3.5, "k": 0.7}, np.array([0.2, 1, 0.1])
    gauge = gauge_at(compilation, x, values)
    method = of_solver(solver_of(compilation, "c"), values, gauge)
    modified_series = backward.modified(compilation, values, gauge)
    assert backward.observed_powers(modified_series, method, x, 0.1) == pytest.approx([6, 8, 10], abs=0.7)
