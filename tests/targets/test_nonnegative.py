"""Parameters that may be 0 but not negative, in every target, of ordinary systems and lattices."""

from __future__ import annotations

import numpy as np
import pytest
from node import asked

import phigen
import phigen.spec
from phigen.api import emit
from phigen.compiler import compile_spec
from phigen.geometry.system import system_from_spec
from phigen.proofs.statements import monitor

SPRING = """\
phigen: 1
name: spring
coordinates: [q, p]
parameters: {k: {value: 0, nonnegative: true}, m: {value: 1, positive: true}}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/(2*m) + k*q**2/2 + k*q**4
order: 2
runs: {a: {initial: [1, 0.2], step: 0.1, steps: 3}}
"""
CHAIN = """\
phigen: 1
name: chain
coordinates: [q, p]
lattice: {axes: [i], boundary: periodic}
parameters: {k: {value: 0, nonnegative: true}, w: {value: 0, at: sites, nonnegative: true}}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + k*(q[i+1] - q)**2/2 + w*q**2
order: 2
runs: {a: {sizes: [4], initial: {q: 0.1*i, p: 1}, step: 0.1, steps: 3, parameters: {w: i/N_i}}}
"""


def start(text, target):
    solver = phigen.compile(phigen.spec.loads(text), target=target)
    return solver, np.array([1.0, 0.2]) if text is SPRING else np.array([[0.0, 0.1, 0.2, 0.3], [1.0] * 4])


@pytest.mark.parametrize("target", ["numpy", "c"])
@pytest.mark.parametrize("text", [SPRING, CHAIN], ids=["ordinary", "lattice"])
def test_zero_is_allowed_and_less_is_not(text, target):
    solver, x = start(text, target)
    moved = x + 0.1 * np.array([x[1], 0 * x[1]])  # without a force
    np.testing.assert_allclose(solver.step(x, 0.1, k=0.0), moved, atol=1e-15)
    with pytest.raises(ValueError, match="'k' must be nonnegative, not -1"):
        solver.step(x, 0.1, k=-1.0)
    backend = solver.backend  # generated code refuses the value too
    values = solver.values({}, {}, (4,)) if text is CHAIN else {"k": 0.0, "m": 1.0}
    for name in ("k", "w") if text is CHAIN else ("k",):
        negative = -1e-300 * np.ones_like(values[name])
        with pytest.raises(Exception, match="BAD_ARGUMENT"):
            backend.start(x, {**values, name: negative[()]})
    if text is CHAIN:
        with pytest.raises(ValueError, match="'w' must be nonnegative at all sites"):
            solver.step(x, 0.1, w=[0.0, 0.0, -1.0, 0.0])


@pytest.mark.parametrize("text", [SPRING, CHAIN], ids=["ordinary", "lattice"])
def test_javascript_refuses_negative_values(text, tmp_path):
    spec = phigen.spec.loads(text)
    path = tmp_path / f"{spec.name}.mjs"
    (module,) = emit(compile_spec(spec).program, "js", "").values()
    path.write_text(module, encoding="utf-8")
    x0 = [1, 0.2] if text is SPRING else [0, 0.1, 0.2, 0.3, 1, 1, 1, 1]
    body = "try {{ return new module.Solver({{x0: {x0}, params: {{k: {k}}}}}).steps }} catch (e) {{ return e.message }}"
    if text is CHAIN:
        body = body.replace("k: {k}", "w: 0, k: {k}")
    assert asked(path, body.format(x0=x0, k=0)) == 0
    assert "the parameter k is -1" in asked(path, body.format(x0=x0, k=-1))


def test_a_factor_that_may_be_zero_is_no_positive_monitor():
    for bound, verdict in (("positive", True), ("nonnegative", False)):
        text = SPRING.replace("value: 0, nonnegative", f"value: 0.5, {bound}")
        spec = phigen.spec.loads(text.replace("order: 2", "order: 2\nmonitor: k"))
        (statement,) = monitor(system_from_spec(spec), spec)["Monitor"]
        assert (statement.verdict == "proved") is verdict


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("value: 0, nonnegative: true", "value: -1, nonnegative: true", "'k' is nonnegative by declaration, but its"),
        ("nonnegative: true", "nonnegative: true, positive: true", "'k' is positive, so it is nonnegative too"),
        ("steps: 3", "steps: 3, parameters: {k: -2}", "'k' is nonnegative by declaration, but its value is -2"),
    ],
)
def test_specs_say_where_values_are_negative(old, new, message):
    with pytest.raises(phigen.SpecError, match=message):
        phigen.spec.loads(SPRING.replace(old, new, 1))
