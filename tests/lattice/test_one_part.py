"""Gradients of lattices whose H is one part: a step is one flow, unless H depends on the time, and no flows of
successive steps are merged.

The systems are random: spins that rotate about z and momenta that are kicked, along axes, along bonds, and of all
pairs.
"""

import random

import numpy as np
import pytest

import phigen
import phigen.spec
from phigen.compiler import compile_spec, emit
from phigen.scheme import sweep_inverse

H, STEPS, STRIDE, SITES = 0.1, 5, 2, 6
KINDS = ("axes", "graph", "pairs")


def drawn(kind, seed):
    """Return a random spec of a kind, and the parameters of a run."""
    source = random.Random(f"{kind} {seed}")
    spins = source.random() < 0.5
    fields, moved = ("x, y, z", "z") if spins else ("q, p", "q")
    structure = "lie_algebra: {name: so(3)}" if spins else "canonical: {q: [q], p: [p]}"
    strength = source.choice(["J", "J*cos(w*t)", "J*B"])
    site = f"B*{moved}**{source.choice([2, 3, 4])}/{source.randint(2, 5)}"
    other = {"axes": f"{moved}[i+{source.choice([1, 2])}]", "graph": f"{moved}[b]", "pairs": f"{moved}[b]"}[kind]
    here = moved if kind == "axes" else f"{moved}[a]"
    if kind != "axes":
        strength = strength.replace("*B", "")
    meeting = source.choice([f"{here}*{other}", f"({here} - {other})**4/4", f"cos({here} - {other})"])
    text = f"phigen: 1\nname: t\ncoordinates: [{fields}]\npoisson: {{{structure}}}\norder: {source.choice([2, 4])}\n"
    text += "parameters: {J: 0.6, w: 1.3, B: {value: 0.8, at: sites}}\n" + "time: t\n" * ("cos(w" in strength)
    if kind == "axes":
        boundary = source.choice(["periodic", "open"])
        text += f"lattice: {{axes: [i], boundary: {boundary}}}\nhamiltonian: {site} + {strength}*{meeting}\n"
    else:
        text += "lattice: " + ("{graph: links}" if kind == "graph" else "{pairs: all}") + "\n"
        text += f'hamiltonian: {{sites: {site}, {"bonds" if kind == "graph" else "pairs"}: "{strength}*{meeting}"}}\n'
    links = np.array([[k, (k + 1) % SITES] for k in range(SITES)] + [[0, 3]])
    disorder = 0.5 + np.random.default_rng(seed).random(SITES)
    return text, {"J": 0.9, "B": disorder} | ({"bonds": links} if kind == "graph" else {})


def slope(integrator, x, bar, along, parameters, changed=""):
    """Return the derivative of Σ bar·frames in a direction of the state, or of a parameter."""

    def weighed(e):
        state, arguments = (
            (x, parameters | {changed: parameters[changed] + e * along}) if changed else (x + e * along, parameters)
        )
        return np.sum(bar * integrator.integrate(state, H, STEPS, STRIDE, **arguments).x)

    return (weighed(1e-4) - weighed(-1e-4)) / 2e-4


def cases():
    """Return kinds with seeds and profiles; one case of each kind is not slow."""
    each = [
        (kind, seed, ("fast", "small")[(seed + place) % 2]) for place, kind in enumerate(KINDS) for seed in range(4)
    ]
    return [pytest.param(*case, marks=[pytest.mark.slow] * (case[1] > 0)) for case in each]


@pytest.mark.thin(2)
@pytest.mark.parametrize(("kind", "seed", "profile"), cases())
def test_gradients_of_lattices_of_one_part_are_differences(kind, seed, profile):
    text, parameters = drawn(kind, seed)
    expect_gradients(phigen.spec.loads(text), parameters, seed, profile)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_gradients_of_one_part_are_differences_where_fields_are_stored(kind, monkeypatch):
    """Here the reverse pass reads stored fields, although all these flows have inverses that could recompute them."""
    monkeypatch.setattr(sweep_inverse, "_changes", lambda *_: {})
    text, parameters = drawn(kind, 1)
    assert "t_make_steps_with_tape(" in expect_gradients(phigen.spec.loads(text), parameters, 1, "fast")


def expect_gradients(spec, parameters, seed, profile):
    """Compare pullbacks in C with differences and with NumPy, and return the solver in C."""
    program = compile_spec(spec, adjoint=True, profile=profile).program
    assert len(program.step.parts) == 1
    assert len(program.step.schedule.flows) == 1 or spec.time
    in_c, numpy = (phigen.compile(spec, target=t, adjoint=True, profile=profile) for t in ("c", "numpy"))
    rng = np.random.default_rng(seed)
    x, along = rng.uniform(-1, 1, (2, len(in_c.interface.coordinates), SITES))
    bar = rng.normal(size=(4, *x.shape))
    _, x0_bar, parameters_bar = in_c.pullback(x, H, STEPS, bar, STRIDE, **parameters)
    assert np.sum(x0_bar * along) == pytest.approx(slope(in_c, x, bar, along, parameters), rel=1e-6)
    assert parameters_bar["J"] == pytest.approx(slope(in_c, x, bar, 1.0, parameters, "J"), rel=1e-6)
    assert parameters_bar["B"] @ along[0] == pytest.approx(slope(in_c, x, bar, along[0], parameters, "B"), rel=1e-6)
    expected = numpy.pullback(x, H, STEPS, bar, STRIDE, **parameters)
    assert x0_bar == pytest.approx(expected.x0_bar, rel=1e-12, abs=1e-12)
    return emit(program, "c", "phigen build")["t.c"]
