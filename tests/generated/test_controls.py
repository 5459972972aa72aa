"""Controls: wrong brackets, bi-realisations and methods fail the checks that generated solvers pass."""

import mpmath
import numpy as np
import pytest
from support import (
    BODY,
    SPECIES,
    PreciseStep,
    compile_text,
    compiled,
    defect_of_map,
    setting,
    slow_but,
    solver,
    tangent_by_differences,
    values,
)

from phigen.geometry.checks import check as check_geometry
from phigen.realisations.axioms import check as check_axioms
from phigen.symbolic.verdict import REFUTED

DRIFT, DEFECT = 1e-13, 1e-12


class Rates:
    """π, H and the vector field of a compilation, in many digits."""

    def __init__(self, compilation, parameters=None):
        self.system, self.parameters = compilation.system, dict(parameters or {})
        self._field = list(self.system.vector_field())
        self._poisson = [e for row in self.system.poisson for e in row]

    def at(self, x):
        return {**self.parameters, **dict(zip(self.system.coordinates, x, strict=True))}

    def field(self, x):
        return mpmath.matrix(values(self._field, self.at(x)))

    def poisson(self, x):
        n, entries = len(x), values(self._poisson, self.at(x))
        return mpmath.matrix([entries[i * n : (i + 1) * n] for i in range(n)])


def refuted(statements):
    """Return the names of the refuted statements."""
    return [s.name for s in statements if s.verdict == REFUTED]


def rk4(field, h):
    """Return a step of the classical Runge–Kutta method."""

    def step(x):
        k1 = field(x)
        k2 = field([a + h / 2 * b for a, b in zip(x, k1, strict=True)])
        k3 = field([a + h / 2 * b for a, b in zip(x, k2, strict=True)])
        k4 = field([a + h * b for a, b in zip(x, k3, strict=True)])
        return [a + h / 6 * (p + 2 * q + 2 * r + s) for a, p, q, r, s in zip(x, k1, k2, k3, k4, strict=True)]

    return step


def kahan(field, h):
    """Return a step of Kahan's method for a quadratic field f: x' = x + h (1 − ½h f'(x))⁻¹ f(x)."""

    def step(x):
        jacobian = tangent_by_differences(field, x)
        shift = mpmath.lu_solve(mpmath.eye(len(x)) - h / 2 * jacobian, mpmath.matrix(list(field(x))))
        return [a + h * b for a, b in zip(x, shift, strict=True)]

    return step


def flow(field, time):
    """Return the exact flow, by Taylor series of mpmath."""

    def step(x):
        return list(mpmath.odefun(lambda _, y: list(field(y)), 0, list(x), tol=mpmath.mpf(10) ** -30)(time))

    return step


# -- brackets that are not Poisson

PARTICLE = """coordinates: [x, y, z, u, v, w]
definitions: {{B1: {0}, B2: {1}, B3: {2}}}
poisson:
  brackets:
    x: {{u: 1}}
    y: {{v: 1}}
    z: {{w: 1}}
    u: {{v: B3, w: -B2}}
    v: {{w: B1}}
hamiltonian: (u**2 + v**2 + w**2)/2
birealisation: {{kind: custom, alpha: [x, y, z, u, v, w], beta: [x, y, z, u, v, w]}}
order: 1
"""


FIELDS = [(("x", "y", "z"), False), (("x", "y", "-2*z"), True)]


@pytest.mark.slow
@pytest.mark.parametrize(("field", "poisson"), slow_but(FIELDS[:1], FIELDS))
def test_magnetic_field_with_sources_gives_no_poisson_bracket(field, poisson):
    """With div B ≠ 0 the Jacobi identity is refuted, and the exact flow does not preserve the bracket either."""
    particle = compile_text(PARTICLE.format(*field))
    rates = Rates(particle)
    jacobi = [s for s in check_geometry(particle.system) if "Jacobi" in s.name]
    assert len(jacobi) == 1
    assert jacobi[0].holds == poisson
    with mpmath.workdps(40):
        start = [mpmath.mpf(v) / 10 for v in (3, -2, 5, 4, 7, -6)]
        defect = defect_of_map(flow(rates.field, mpmath.mpf(1) / 20), rates.poisson, start)
    assert defect < DEFECT if poisson else defect > 1e-3


# -- wrong bi-realisations


def species(sign):
    """Compile the Lotka–Volterra system with α_j = x_j exp(sign·u_j/2), and β_j with the opposite sign."""
    u = {"x1": "(-x2*p_x2 - x3*p_x3)", "x2": "(x1*p_x1 - x3*p_x3)", "x3": "(x1*p_x1 + x2*p_x2)"}
    alpha, beta = ([f"{x}*exp({s}*{e}/2)" for x, e in u.items()] for s in (sign, -sign))
    listed = f"alpha: [{', '.join(alpha)}], beta: [{', '.join(beta)}]"
    return compile_text(f"{SPECIES}birealisation: {{kind: custom, {listed}}}\norder: 2\n")


def body(quarter):
    """Compile the rigid body with the Cayley transform (1 + A/q) x (1 − A/q): q = 2 is right, the paper prints 4."""
    s, t = f"1/{quarter}", f"1/{quarter}**2"
    cross = ["(p_x2*x3 - p_x3*x2)", "(p_x3*x1 - p_x1*x3)", "(p_x1*x2 - p_x2*x1)"]
    dot = "(p_x1*x1 + p_x2*x2 + p_x3*x3)"
    maps = {}
    for name, sign in (("alpha", 1), ("beta", -1)):
        maps[name] = [f"x{i + 1} + {sign}*{s}*{c} + {t}*p_x{i + 1}*{dot}" for i, c in enumerate(cross)]
    listed = ", ".join(f"{name}: [{', '.join(m)}]" for name, m in maps.items())
    return compile_text(f"{BODY}birealisation: {{kind: custom, {listed}}}\norder: 2\n")


def observed_order(compilation, x0):
    """Return the order that is observed when the step is halved, compared with a method that is known to be right."""
    kind = "log-canonical" if "exp" in str(compilation.realisation.alpha[0]) else "cayley"
    source = SPECIES if kind == "log-canonical" else BODY
    exact = solver(compile_text(f"{source}birealisation: {kind}\norder: 8\n"), "c").integrate(x0, 1 / 64, 64).x[-1]
    solve = solver(compilation, "c")
    errors = [np.max(np.abs(solve.integrate(x0, 1 / n, n).x[-1] - exact)) for n in (32, 64)]
    return np.log2(errors[0] / errors[1])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("build", "right", "wrong", "x0"),
    [
        pytest.param(species, 1, -1, [0.3, 0.9, 0.6], marks=pytest.mark.slow),
        (body, 2, 4, [0.7, -1.1, 0.9]),
    ],
    ids=["the sign of the paper", "the Cayley transform of the paper"],
)
def test_misprints_of_the_paper_are_no_bi_realisations(build, right, wrong, x0):
    """The corrected bi-realisations are proved and have order 2. The axioms refute the misprinted ones, which do not
    converge.
    """
    good, bad = build(right), build(wrong)
    assert refuted(check_axioms(good.system, good.realisation)) == []
    assert observed_order(good, x0) == pytest.approx(2, abs=0.1)
    assert len(refuted(check_axioms(bad.system, bad.realisation))) >= 2
    assert observed_order(bad, x0) < 0.2


def midpoint(compilation):
    """Discretise a system by the implicit midpoint rule: α = x − ½π(x)p, β = x + ½π(x)p."""
    system = compilation.system
    products = [
        " + ".join(f"({e})*p_{c}" for e, c in zip(row, system.coordinates, strict=True) if not e.is_zero)
        for row in system.poisson
    ]
    alpha = [f"'{c} - ({f})/2'" for c, f in zip(system.coordinates, products, strict=True)]
    beta = [f"'{c} + ({f})/2'" for c, f in zip(system.coordinates, products, strict=True)]
    brackets = [f"[{', '.join(map(str, row))}]" for row in system.poisson]
    parameters = "".join(f"  {p.name}: {float(p.value)!r}\n" for p in system.parameters)
    casimirs = ", ".join(f"{k}: '{e}'" for k, e in system.casimirs.items())
    return compile_text(
        f"coordinates: [{', '.join(system.coordinates)}]\n"
        + (f"parameters:\n{parameters}" if parameters else "")
        + f"poisson: {{matrix: [{', '.join(brackets)}]}}\nhamiltonian: {system.hamiltonian}\ncasimirs: {{{casimirs}}}\n"
        + f"birealisation: {{kind: custom, alpha: [{', '.join(alpha)}], beta: [{', '.join(beta)}]}}\norder: 2\n"
    )


@pytest.mark.thin(2)
@pytest.mark.parametrize(
    ("name", "keeps_casimirs"),
    [("volterra5", False), ("lagrange_top", True)],
    ids=["log-canonical", "se(3)"],
)
def test_midpoint_rule_is_not_a_poisson_map(name, keeps_casimirs):
    """The midpoint rule keeps quadratic Casimirs and is not Poisson: only the Poisson defect shows this."""
    compilation = compiled(name)
    at = setting(compilation)
    rule = midpoint(compilation)
    assert "bi-realisation: {α_i, α_j} = π_ij∘α" in refuted(check_axioms(rule.system, rule.realisation))
    assert PreciseStep(rule, at.parameters, at.h).defect(at.x) > 1e-9
    assert PreciseStep(compilation, at.parameters, at.h).defect(at.x) <= DEFECT
    trajectory = solver(rule, "c").integrate(at.x, at.h, 2000, stride=10, parameters=at.parameters)
    drift = max(np.max(np.abs(c - c[0])) / abs(c[0]) for c in trajectory.casimirs.values())
    assert (drift <= DRIFT) == keeps_casimirs


def test_midpoint_rule_on_a_constant_bracket_is_a_poisson_map():
    compilation = compiled("pendulum", 2)
    at = setting(compilation)
    rule = midpoint(compilation)
    assert refuted(check_axioms(rule.system, rule.realisation)) == []
    assert PreciseStep(rule, at.parameters, at.h).defect(at.x) <= DEFECT


# -- classical methods


@pytest.mark.slow
@pytest.mark.parametrize("name", slow_but(["rigid_body"], ["rigid_body", "volterra5", "lagrange_top", "so4_manakov"]))
def test_runge_kutta_fails_every_check(name):
    """With Runge–Kutta, Casimirs and energy drift, the bracket is not preserved, and a step with −h does not return to
    the start.
    """
    compilation = compiled(name)
    at, solve = setting(compilation), solver(compilation, "c")
    rates = Rates(compilation, at.parameters)
    speed = np.max(np.abs(solve.vector_field(at.x, parameters=at.parameters)))
    h = 0.1 * float(np.max(np.abs(at.x)) / speed)
    with mpmath.workdps(50):
        assert defect_of_map(rk4(rates.field, mpmath.mpf(h)), rates.poisson, at.x) > 1e-9
    step = rk4(lambda x: solve.vector_field(x, parameters=at.parameters), h)
    back = rk4(lambda x: solve.vector_field(x, parameters=at.parameters), -h)
    assert np.max(np.abs(np.array(back(step(at.x))) - at.x)) > 1e-9
    x, states = list(at.x), []
    for _ in range(5_000):
        x = step(x)
        states.append(x)
    casimirs = solve.casimirs(np.array(states), parameters=at.parameters)
    assert max(np.max(np.abs(c - c[0])) / abs(c[0]) for c in casimirs.values()) > 1e3 * DRIFT
    energy = solve.hamiltonian(np.array(states), parameters=at.parameters)
    error = np.abs(energy - energy[0])
    windows = [w.max() for w in np.array_split(error[1:], 10)]
    assert windows[-1] > 1.5 * windows[0]


@pytest.mark.parametrize(
    ("species", "poisson"),
    [(lambda: compile_text(SPECIES + "order: 2\n"), True), (lambda: compiled("volterra5"), False)],
    ids=["{x_i, x_j} = x_i x_j", "periodic lattice"],
)
def test_kahans_method_is_poisson_for_one_lattice_only(species, poisson):
    """Kahan's method preserves the bracket {x_i, x_j} = x_i x_j with H = Σx, and does not preserve that of the periodic
    Volterra lattice.
    """
    compilation = species()
    rates = Rates(compilation)
    with mpmath.workdps(50):
        start = [mpmath.mpf(v) for v in ("0.3", "0.9", "0.6", "0.5", "1.1")[: compilation.system.dimension]]
        defect = defect_of_map(kahan(rates.field, mpmath.mpf(1) / 20), rates.poisson, start)
    assert (defect <= DEFECT) == poisson
    assert poisson or defect > 1e-7
