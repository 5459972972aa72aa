"""Runs of solvers as functions of PyTorch: values and gradients."""

import numpy as np
import pytest

import phigen

torch = pytest.importorskip("torch")

H, STEPS = 0.1, 7
X = np.array([[1.0, 0.5, 0.3], [0.9, -0.2, 0.4]])


@pytest.fixture(scope="module")
def solver():
    return phigen.compile("rigid_body", target="numpy", adjoint=True, order=2)


@pytest.mark.parametrize("stride", [None, 3])
def test_values_and_gradients_are_those_of_the_solver(solver, stride):
    from phigen.torch import propagator

    made = propagator(solver, h=H, steps=STEPS, stride=stride)
    x, i2 = torch.tensor(X, requires_grad=True), torch.tensor(2.2, dtype=torch.float64, requires_grad=True)
    states = made(x, {"I2": i2})
    (states**3).sum().backward()
    slope = 0.0
    for m in range(2):
        width = STEPS if stride is None else stride
        rows = solver.integrate(X[m], H, STEPS, width, I2=2.2).x
        rows = rows[-1] if stride is None else rows
        assert states[m].detach().numpy() == pytest.approx(rows, abs=1e-15)
        _, x0_bar, found = solver.pullback(X[m], H, STEPS, 3 * rows**2, stride, I2=2.2)
        assert x.grad[m].numpy() == pytest.approx(x0_bar, rel=1e-13)
        slope += found["I2"]
    assert i2.grad.item() == pytest.approx(slope, rel=1e-12)
    assert made(x.float()).dtype == torch.float32
