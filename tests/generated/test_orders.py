"""Observed orders equal the stated ones, on non-linear problems."""

from itertools import product

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import BODY, SPECIES, compile_text, slow_but, solver

from phigen.scheme.steps import Explicit, Newton

#: Errors below this are due to the reference and to rounding.
FLOOR = 1e-13

PAIR = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
ROD = PAIR + "hamiltonian: p**2/2 - cos(q)\n"
BEAD = PAIR + "hamiltonian: p**2*(1 + q**2)/2 - cos(q)\n"  # not separable

#: A system whose bi-realisation is one-sided in the logarithms of x and y, where the bracket is canonical: it is not
#: symmetric, and not in the catalogue.
GRAZING = """coordinates: [x, y]
poisson: {log_canonical: [[0, 1], [-1, 0]]}
hamiltonian: x + y - 2*log(x) - log(y) + x*y/5
birealisation: {kind: custom, alpha: [x, y*exp(x*p_x)], beta: [x*exp(y*p_y), y]}
"""


def order_of(compilation, x0, time):
    """Return the slope of the error between n and 2n steps, with n as large as rounding permits."""
    solve = solver(compilation, "c")
    flow = solve_ivp(lambda _, x: solve.vector_field(x), (0, time), x0, method="DOP853", rtol=2.3e-14, atol=1e-16)

    def error(steps):
        end = solve.integrate(x0, time / steps, steps, stride=steps).x[-1]
        return np.max(np.abs(end - flow.y[:, -1]))

    steps = 8
    errors = [error(steps), error(2 * steps)]
    while errors[-1] / 2**compilation.order.order > FLOOR and steps < 256:
        steps *= 2
        errors.append(error(2 * steps))
    assert 10 * FLOOR < errors[-2] < 1e-2, "the test needs another time"
    return np.log2(errors[-2] / errors[-1])


SYMMETRIC = {
    "rigid body by Cayley": (BODY + "birealisation: cayley\n", [0.7, -1.1, 0.9], 6.0),
    "rigid body by exponential": (BODY + "birealisation: exponential\n", [0.7, -1.1, 0.9], 6.0),
    "Lotka–Volterra": (SPECIES, [0.3, 0.9, 0.6], 3.0),
}
QUICK_SYMMETRIC = [*zip(2 * list(SYMMETRIC), [2, 4, 6, 8, 10, 12], strict=True)][:-1]


@pytest.mark.thin(2)
@pytest.mark.parametrize(("name", "order"), slow_but(QUICK_SYMMETRIC, product(SYMMETRIC, [2, 4, 6, 8, 10, 12])))
def test_symmetric_methods_have_even_orders(name, order):
    text, x0, time = SYMMETRIC[name]
    compilation = compile_text(f"{text}order: {order}\ncomposition: none\n")
    assert compilation.order.order == order
    assert order_of(compilation, x0, time) == pytest.approx(order, abs=0.25)


ONE_SIDED = {"separable": ROD, "not separable": BEAD}
QUICK_ONE_SIDED = [("separable", "q", 1), ("separable", "p", 2), ("not separable", "q", 4), ("not separable", "p", 3)]


@pytest.mark.thin(2)
@pytest.mark.parametrize(("kind", "side", "order"), slow_but(QUICK_ONE_SIDED, product(ONE_SIDED, "qp", [1, 2, 3, 4])))
def test_one_sided_methods_have_every_order(kind, side, order):
    text = ONE_SIDED[kind]
    compilation = compile_text(f"{text}birealisation: {{kind: canonical-euler, side: {side}}}\norder: {order}\n")
    assert isinstance(compilation.program.step, Explicit if text == ROD and order == 1 else Newton)
    assert order_of(compilation, [0.5, 0.8], 1.0) == pytest.approx(order, abs=0.25)


@pytest.mark.thin(2)
@pytest.mark.parametrize("order", slow_but([1, 4], [1, 2, 3, 4]))
def test_a_custom_realisation_that_is_not_symmetric_has_every_order(order):
    compilation = compile_text(f"{GRAZING}order: {order}\n")
    assert not compilation.realisation.symmetric
    assert order_of(compilation, [1.5, 0.8], 1.0) == pytest.approx(order, abs=0.25)


@pytest.mark.thin(2)
@pytest.mark.parametrize("text", [BODY, SPECIES], ids=["rigid body", "Lotka–Volterra"])
def test_one_term_of_a_symmetric_method_is_the_second_order_already(text):
    """For a symmetric method, PHI-1 of the paper is equal to its PHI-2: both have order 2."""
    one, two = (solver(compile_text(f"{text}terms: {k}\n"), "c") for k in (1, 2))
    assert one.order == two.order == 2
    x0 = [0.3, 0.9, 0.6]
    assert (one.integrate(x0, 0.1, 20).x == two.integrate(x0, 0.1, 20).x).all()
