"""Names for the common subexpressions of formulas that are printed as text."""

import cmath
import math
import re
from dataclasses import replace

import pytest

from phigen import resources
from phigen.compiler import compile_spec
from phigen.notation import flows, named_parts
from phigen.spec import load, loads
from phigen.symbolic.expression import call, symbol, total
from phigen.symbolic.numeric import evaluate
from phigen.symbolic.symbols import STEP

POINT = {"x": 0.48, "y": -0.6, "z": 0.64, "h": 0.3, "K": 1.3, "B": 0.7, "damping_rate": 0.2}

MEANINGS = {
    "sqrt": math.sqrt,
    "tanh": math.tanh,
    "sin": math.sin,
    "cos": math.cos,
    "inv0": lambda s: 1 / s,
    "cosroot": lambda s: cmath.cos(cmath.sqrt(s)).real,
    "sinroot": lambda s: (cmath.sin(cmath.sqrt(s)) / cmath.sqrt(s)).real,
}


@pytest.fixture(scope="module")
def damped_spin():
    specification = replace(load(resources.bundled_specs() / "landau_lifshitz.yaml"), scheme="splitting")
    return compile_spec(specification)


def test_long_flows_are_printed_with_names_for_common_parts(damped_spin):
    """The formulas of a flow are printed in lines of less than 160 characters: the images, then the names of common
    subexpressions, each defined by earlier names. Together they have the values of the flow.
    """
    listed = flows.formulas(damped_spin, None)
    for k, flow in enumerate(damped_spin.splitting.flows, 1):
        lines = [(name.removeprefix(f"Φ_{k}: "), text) for name, text in listed if name.startswith(f"Φ_{k}: ")]
        images = flows.images(damped_spin, flow)
        assert max(len(text) for _, text in lines) < 160
        assert [name for name, _ in lines[: len(images)]] == [*images]
        known = dict(POINT)
        for name, text in lines[len(images) :]:
            known[name] = eval(text, dict(MEANINGS), known)
        evaluated = [eval(text, dict(MEANINGS), known) for _, text in lines[: len(images)]]
        assert evaluated == pytest.approx(evaluate([*images.values()], POINT | {STEP: POINT["h"]}), rel=1e-13)


def test_parts_that_only_hidden_terms_mention_are_left_out():
    a, b, c = map(symbol, "abc")
    angles = [call("sin", call("cos", a * k + b * c + call("exp", a * b - k * c))) for k in range(2, 8)]
    sums = {
        name: total(factor**k * angle for k, angle in enumerate(angles, 1)) for name, factor in (("f", a), ("g", b))
    }
    everything, some = (named_parts.texts(sums, most) for most in (None, 4))
    mentioned = {name for _, text in some for name in re.findall(r"σ_\d+", text)}
    assert 2 < len(some) < len(everything)
    assert [name for name, _ in some[2:]] == [f"σ_{k}" for k in range(1, len(mentioned) + 1)]


PENCIL = """phigen: 1
name: pencil
coordinates: [a1, a2, b1, b2, b3]
parameters: {mu: 0.7}
poisson:
  brackets:
    a1: {a2: -a1*a2/2, b1: a1*b1 + mu*a1, b2: -a1*b2 - mu*a1}
    a2: {b2: a2*b2 + mu*a2, b3: -a2*b3 - mu*a2}
    b1: {b2: -2*a1**2}
    b2: {b3: -2*a2**2}
hamiltonian: b1**2/2 + b2**2/2 + b3**2/2 + a1**2 + a2**2
order: 2
"""


@pytest.mark.parametrize("most", [2, 3, 8])
def test_terms_that_are_left_out_are_not_the_leading_ones(most):
    """The terms that are printed give α(x, 0) = x, so the leading terms are among them."""
    compilation = compile_spec(loads(PENCIL))
    names = compilation.system.coordinates
    maps = {f"α_{c}": e for c, e in zip(names, compilation.realisation.alpha, strict=True)}
    listed = named_parts.texts(maps, most)
    assert any("…" in text for _, text in listed)
    known = {name: 0.3 + k for k, name in enumerate((*names, "mu"))} | {f"p_{c}": 0.0 for c in names}
    for name, text in reversed(listed):
        known[name] = eval(re.sub(r" \+ … \(\d+ terms\)", "", text), {}, known)
    assert [known[f"α_{c}"] for c in names] == pytest.approx([known[c] for c in names])
