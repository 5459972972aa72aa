"""Methods for H = A + εB: order conditions in exact arithmetic, measured errors in ε and h, and the systems to which
they apply.
"""

from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from support import compile_text, solver

from phigen import SpecError
from phigen.scheme.near_integrable import METHODS
from phigen.spec.names import CORRECTED, NEAR_INTEGRABLE

PLANE = "coordinates: [x, y, px, py]\npoisson: {canonical: {q: [x, y], p: [px, py]}}\n"
KEPLER = "hamiltonian: (px**2 + py**2)/2 - 1/sqrt(x**2 + y**2) - eps*x**2\nscheme: splitting\n"
SMALL = PLANE + "parameters: {eps: {value: 0.001, small: true}}\n" + KEPLER
RUN = "runs: {one: {initial: [1, 0, 0, 1.1], step: 0.1, steps: 10}}\n"
START = [1, 0, 0, 1.1]


def defects(method):
    """Return the residuals of the conditions of the generalised order of a method, in ε and in ε²."""
    c = [sum(method.a[: k + 1]) for k in range(len(method.b))]
    powers = range(method.generalised[0])
    linear = [sum(b * x**k for b, x in zip(method.b, c, strict=True)) - Fraction(1, k + 1) for k in powers]
    squared = []
    for k, m in combinations(range(method.generalised[1]), 2):
        if k + m + 2 <= method.generalised[1]:
            pairs = combinations(zip(method.b, c, strict=True), 2)
            weighted_sum = sum(b * d * (x**k * y**m - x**m * y**k) for (b, x), (d, y) in pairs)
            squared.append(weighted_sum - (Fraction(1, k + 1) - Fraction(1, m + 1)) / (k + m + 2))
    return linear, squared


@pytest.mark.parametrize("method", [m for m in METHODS if m.name not in CORRECTED], ids=lambda m: m.name)
def test_conditions_hold_to_50_digits_and_the_next_one_does_not(method):
    linear, squared = defects(method)
    assert sum(method.a) == sum(method.b) == 1
    assert method.a == method.a[::-1]
    assert method.b == method.b[::-1]
    assert max(map(abs, [*linear, *squared])) < Fraction(1, 10**50)
    further = METHODS[0].__class__(
        **{**vars(method), "generalised": (method.generalised[0] + 1, *method.generalised[1:])}
    )
    assert abs(defects(further)[0][-1]) > Fraction(1, 10**7)
    assert {m.name for m in METHODS} == {*NEAR_INTEGRABLE}


def worst_energy(name, order, eps, h):
    integrator = solver(compile_text(SMALL + f"composition: {name}\n", order), "c")
    energy = integrator.integrate(START, h, round(24 / h), eps=eps).energy
    return np.abs(energy - energy[0]).max()


FIRST = {"saba-4-2": (2, 4, 1e-7, 1.2), "aba-8-4": (4, 8, 1e-7, 1.2), "aba-10-6-4": (4, 10, 1e-5, 1.8)}


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", FIRST)
def test_the_error_in_the_first_power_of_epsilon_has_its_order(name):
    order, power, eps, h = FIRST[name]
    coarse, fine = (worst_energy(name, order, eps, size) for size in (h, h / 1.5))
    assert np.log(coarse / fine) / np.log(1.5) > power - 1.3
    assert worst_energy(name, order, 10 * eps, h) / coarse == pytest.approx(10, rel=0.05)


def test_the_error_in_the_second_power_of_epsilon_has_its_order():
    """For small h, the error of (8, 2) is ε²h², and that of (8, 4) is below rounding."""
    second = [worst_energy("saba-8-2", 2, eps, 0.1) for eps in (0.01, 0.001)]
    assert second[0] / second[1] == pytest.approx(100, rel=0.1)
    assert worst_energy("aba-8-4", 4, 0.01, 0.1) < second[0] / 100


CHOICES = {
    "declared": (SMALL, "aba-10-6-4", 2),
    "by its size": (SMALL.replace(", small: true", ""), "aba-10-6-4", 2),
    "not small": (SMALL.replace("0.001, small: true", "0.5"), "force-gradient", 2),
    "a pendulum": (
        "coordinates: [q, p]\nparameters: {eps: {value: 0.1, small: true}}\npoisson: {canonical: {q: [q], p: [p]}}\n"
        "hamiltonian: p**2/2 + eps*cos(q)\nscheme: splitting\n",
        "aba-10-6-4",
        2,
    ),
    "nothing else": (SMALL.replace(" - eps*x**2", ""), "blanes-moan", 1),
}


@pytest.mark.parametrize("case", CHOICES)
def test_what_is_small_chooses_the_method(case):
    text, name, parts = CHOICES[case]
    compilation = compile_text(text, 4)
    assert (len(compilation.splitting.flows), compilation.program.step.composition) == (parts, name)
    if name == "aba-10-6-4":
        assert compilation.splitting.small == 1
        assert any("ε h^10" in fact for fact in compilation.program.about.facts)


def test_a_time_in_the_perturbation_is_allowed_and_one_in_the_motion_is_not():
    dated = "time: t\n" + SMALL.replace("eps*x**2", "eps*x**2*cos(t)")
    compilation = compile_text(dated, 4)
    assert compilation.program.step.composition == "aba-10-6-4"
    ends = [solver(compilation, "c").integrate(START, h, round(6 / h)).x[-1] for h in (0.5, 0.25, 0.05)]
    errors = [np.abs(end - ends[-1]).max() for end in ends[:2]]
    assert errors[0] < 1e-6
    assert errors[0] / errors[1] > 2**5


REFUSED = {
    "no perturbation": (SMALL.replace(" - eps*x**2", ""), "none is known to be small"),
    "none small": (SMALL.replace("0.001, small: true", "0.5"), "none is known to be small"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_without_a_small_part_the_names_are_errors_at_their_place(case):
    text, said = REFUSED[case]
    with pytest.raises(SpecError, match=said) as refused:
        compile_text(text + "composition: aba-8-4\n", 4)
    (diagnostic,) = refused.value.diagnostics
    assert diagnostic.location is not None
    assert "small: true" in diagnostic.hint


def planets(count, mass="0.00001"):
    """Return the spec of planets about a star of mass 1 in democratic heliocentric coordinates."""
    bodies = range(1, count + 1)
    alone = " + ".join(f"(px{i}**2 + py{i}**2)/(2*m{i}) - m{i}/sqrt(x{i}**2 + y{i}**2)" for i in bodies)
    star = " + ".join(f"({' + '.join(f'p{axis}{i}' for i in bodies)})**2/2" for axis in "xy")
    pairs = [f"m{i}*m{j}/sqrt((x{i} - x{j})**2 + (y{i} - y{j})**2)" for i in bodies for j in range(1, i)]
    q, p = ([f"{a}{i}" for i in bodies for a in axes] for axes in (("x", "y"), ("px", "py")))
    return (
        f"coordinates: [{', '.join([*q, *p])}]\nparameters: {{{', '.join(f'm{i}: {mass}' for i in bodies)}}}\n"
        f"poisson: {{canonical: {{q: [{', '.join(q)}], p: [{', '.join(p)}]}}}}\n"
        f"hamiltonian: {alone} + {star} - {' - '.join(pairs)}\nscheme: splitting\n"
    )


@pytest.mark.parametrize("mass", ["0.00001", "{value: 0.00001, small: true}"])
def test_planets_about_a_star_are_motions_and_a_perturbation_that_is_one_part(mass):
    """The kinetic energy of the star, a square of the sum of momenta, remains one term: it commutes with
    distances.

    A mass that is declared small divides p²/2m, so the potential of the star is not a small part in comparison.
    """
    compilation = compile_text(planets(3, mass), 4)
    assert [len(flow.pieces) for flow in compilation.splitting.flows] == [3, 0]
    assert compilation.program.step.composition == "aba-10-6-4"
