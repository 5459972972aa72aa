"""Schemes: each compiles what the spec asks for, or refuses it; none compiles a spec and ignores an option."""

import pytest
from support import compile_text

from phigen.compilation import Compilation
from phigen.compiler import SCHEME_COMPILERS, compile_proved, examine
from phigen.errors import PhigenWarning, SpecError
from phigen.proofs.examination import unused_keys
from phigen.scheme.program import Program
from phigen.spec import loads
from phigen.spec.names import SCHEMES
from phigen.spec.validate import WITHOUT_SERIES

#: All schemes except auto, which chooses one of these.
NAMED = [scheme for scheme in SCHEMES if scheme != "auto"]

#: A body whose Hamiltonian is not quadratic, so that the flow of the whole of H has no closed form.
BODY = """coordinates: [x1, x2, x3]
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: x1**2/2 + x2**2/4 + x3**2/6 + x1**3/9
casimirs: {C: x1**2 + x2**2 + x3**2}
"""
#: Options of a spec that change the step of the body or are refused.
OPTIONS = [
    "adjoint: true", "birealisation: spray", "composition: triple-jump", "forces: {covector: {x1: -0.1*x1}}",
    "forces: {vector: {x1: -0.1*x1}}", "gauge: {C: 2}", "modified_hamiltonian: 1", "monitor: 1 + x1**2",
    "noise: {w: {hamiltonian: x1}}", "order: 6", "reconstruct: quaternion", "terms: 5",
]  # fmt: skip

CHAIN = """lattice: {axes: [i], boundary: periodic}
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + (q[i+1] - q)**2/2 + q**4/4
"""


def attempted(text: str, scheme: str) -> Compilation | str:
    """Return the compilation of a spec with a scheme, or the message of the error that refuses it."""
    try:
        return compile_text(f"{text}scheme: {scheme}\n")
    except SpecError as error:
        return str(error)


def method(program: Program) -> str:
    """Return the parts of a program that make a step as text, without the description of the system and the options
    themselves.
    """
    parts = ("step", "fractions", "monitor", "noise", "modified", "attitude")
    return repr([getattr(program, part) for part in parts])


def test_each_scheme_has_a_compiler():
    assert SCHEME_COMPILERS.keys() == set(SCHEMES)


def test_each_scheme_but_one_refuses_keys_of_the_series():
    assert WITHOUT_SERIES.keys() == {*NAMED} - {"series"}


@pytest.mark.parametrize("option", OPTIONS, ids=lambda option: option.partition(":")[0])
@pytest.mark.parametrize("scheme", NAMED)
def test_an_option_changes_the_step_or_is_refused(scheme, option):
    key = option.partition(":")[0]
    order = "" if key in ("order", "terms") else "order: 4\n"
    compilation = attempted(f"{BODY}{order}{option}\n", scheme)
    if isinstance(compilation, str):
        assert key in compilation
    else:
        unchanged = compile_text(f"{BODY}order: 4\nscheme: {scheme}\n")
        assert method(compilation.program) != method(unchanged.program)


@pytest.mark.parametrize("scheme", ["series", "splitting", "auto"])
@pytest.mark.parametrize("setting", ["max_iterations: 7", "tolerance: 1e-8"])
def test_lattices_refuse_settings_of_the_inner_solve(setting, scheme):
    refusal = attempted(f"{CHAIN}solver: {{{setting}}}\n", scheme)
    assert f"solver: {setting.partition(':')[0]} is not for lattices" in str(refusal)
    assert "<string>:7:" in str(refusal)


@pytest.mark.parametrize("setting", ["max_iterations: 7", "tolerance: 1e-8"])
def test_splittings_refuse_settings_of_the_inner_solve(setting):
    text = BODY.replace(" + x1**3/9", "")
    refusal = attempted(f"{text}solver: {{{setting}}}\n", "splitting")
    assert f"solver: {setting.partition(':')[0]} belongs to steps that solve equations" in str(refusal)
    assert f"hint: remove {setting.partition(':')[0]}, or remove scheme:" in str(refusal)
    compile_text(f"{text}scheme: splitting\n")


def test_auto_leaves_out_schemes_without_the_settings_that_are_named():
    text = BODY.replace(" + x1**3/9", "")
    assert not compile_text(f"{text}scheme: auto\n").program.step.kind.implicit
    assert compile_text(f"{text}scheme: auto\nsolver: {{tolerance: 1e-8}}\n").program.step.kind.implicit


def test_the_usual_tolerance_may_be_named():
    usual = "solver: {tolerance: auto}\n"
    assert compile_text(f"{CHAIN}{usual}scheme: series\n").program.step.equation
    assert compile_text(f"{BODY.replace(' + x1**3/9', '')}{usual}scheme: splitting\n").program.step.kind.flows


@pytest.mark.parametrize("scheme", NAMED)
def test_a_lattice_is_compiled_by_the_scheme_that_it_names_or_refused(scheme):
    compilation = attempted(CHAIN, scheme)
    if isinstance(compilation, str):
        assert f"scheme {scheme}: not for lattices" in compilation
    else:
        assert compilation.scheme_name == scheme


def test_keys_that_a_replaced_scheme_does_not_use_are_warned_of():
    """An option that replaces the scheme of the spec leaves keys of the former scheme without effect. Warnings say so,
    with the place of each key.
    """
    text = (
        "phigen: 1\nname: t\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
        "hamiltonian: p**2/2 - cos(q)\n"
        "order: 2\nbirealisation: canonical-euler\n"
    )
    tolerance = "solver: {tolerance: 1.0e-9}\n"
    assert unused_keys(examine(loads(text + tolerance))) == []
    (gauss,) = unused_keys(examine(loads(text), scheme="gauss"))
    assert str(gauss).startswith("<string>:7:16: warning: birealisation has no effect with scheme: gauss")
    with pytest.warns(PhigenWarning) as caught:
        compile_proved(loads(text + tolerance), scheme="splitting")
    assert [str(w.message).split("\n")[0] for w in caught] == [
        "<string>:7:16: warning: birealisation has no effect with scheme: splitting",
        "<string>:8:21: warning: solver: tolerance has no effect with scheme: splitting",
    ]
