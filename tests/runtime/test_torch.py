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

    propagate = propagator(solver, h=H, steps=STEPS, stride=stride)
    x, i2 = torch.tensor(X, requires_grad=True), torch.tensor(2.2, dtype=torch.float64, requires_grad=True)
    states = propagate(x, {"I2": i2})
    (states**3).sum().backward()
    slope = 0.0
    for m in range(2):
        width = STEPS if stride is None else stride
        rows = solver.integrate(X[m], H, STEPS, width, I2=2.2).x
        rows = rows[-1] if stride is None else rows
        assert states[m].detach().numpy() == pytest.approx(rows, abs=1e-15)
        _, x0_bar, parameters_bar = solver.pullback(X[m], H, STEPS, 3 * rows**2, stride, I2=2.2)
        assert x.grad[m].numpy() == pytest.approx(x0_bar, rel=1e-13)
        slope += parameters_bar["I2"]
    assert i2.grad.item() == pytest.approx(slope, rel=1e-12)
    assert propagate(x.float()).dtype == torch.float32


@pytest.mark.parametrize("stride", [None, 3])
def test_lattices_have_gradients_along_disorder(stride):
    """Each member has its own field B at the sites. The parameter J is shared."""
    from phigen.torch import propagator

    chain, random = phigen.compile("xxz_disorder", target="numpy", adjoint=True), np.random.default_rng(1)
    many, fields = random.normal(size=(2, 3, 5)), random.normal(size=(2, 5))
    x, field = torch.tensor(many, requires_grad=True), torch.tensor(fields, requires_grad=True)
    j = torch.tensor(0.9, dtype=torch.float64, requires_grad=True)
    (propagator(chain, h=H, steps=STEPS, stride=stride)(x, {"B": field, "J": j}) ** 3).sum().backward()
    slope = 0.0
    for m in range(2):
        frames = chain.integrate(many[m], H, STEPS, stride or STEPS, B=fields[m], J=0.9).x
        bar = 3 * (frames if stride else frames[-1]) ** 2
        _, x0_bar, parameters_bar = chain.pullback(many[m], H, STEPS, bar, stride, B=fields[m], J=0.9)
        assert x.grad[m].numpy() == pytest.approx(x0_bar, rel=1e-12)
        assert field.grad[m].numpy() == pytest.approx(parameters_bar["B"], rel=1e-12)
        slope += parameters_bar["J"]
    assert j.grad.item() == pytest.approx(slope, rel=1e-12)
