"""``scheme: auto`` chooses the scheme with the least expected cost, and compiles the program that this scheme gives if
the spec names it.
"""

from dataclasses import replace

import pytest
from support import BODY, compile_text, slow_but, spec_of

from phigen.compiler import compile_spec
from phigen.errors import SpecError
from phigen.spec import loads

#: The fastest scheme for an orbit error of 10^(−order), by measurement. In each of these cases the other schemes take
#: more than 1.3 times as long.
FASTEST = {
    ("rigid_body", 4): "splitting", ("henon_heiles", 4): "splitting", ("henon_heiles", 8): "splitting",
    ("henon_heiles", 12): "gauss", ("so4_manakov", 4): "splitting", ("so4_manakov", 8): "gauss",
    ("kowalevski_top", 8): "splitting", ("kowalevski_top", 12): "gauss", ("pendulum", 8): "series",
    ("maxwell_bloch", 4): "splitting", ("predator_prey", 4): "splitting", ("vortices3", 8): "gauss",
}  # fmt: skip
FAST = [("rigid_body", 4), ("henon_heiles", 8), ("henon_heiles", 12), ("predator_prey", 4)]


def automatic(name, order, **more):
    spec = replace(spec_of(name), scheme="auto", composition="auto", **more)
    return compile_spec(spec.overridden(order=order))


@pytest.mark.parametrize(("name", "order"), slow_but(FAST, FASTEST))
def test_the_choice_is_the_fastest(name, order):
    assert automatic(name, order).scheme_name == FASTEST[name, order]


def test_the_program_is_that_of_the_scheme():
    compilation = automatic("henon_heiles", 8)
    named = compile_spec(replace(compilation.spec, scheme="splitting"))
    assert compilation.program == named.program
    assert compilation.choice.startswith("splitting; expected: ")
    assert "times the time for gauss" in compilation.choice
    assert any("auto chose splitting" in note for note in compilation.notes)
    assert named.notes == []


def test_the_exact_flow_is_the_cheapest():
    for name in ("kepler", "rigid_body"):
        assert automatic(name, 4).choice == "splitting: one exact flow"


OF_SERIES = ("terms: 3\n", "birealisation: cayley\n", "modified_hamiltonian: 1\n")


@pytest.mark.parametrize("option", OF_SERIES)
def test_options_of_the_series_choose_it(option):
    compilation = compile_text(f"{BODY}{option}scheme: auto\n", None)
    assert compilation.scheme_name == "series"
    assert compilation.choice == "series, the only scheme with the options of the spec"


def test_schemes_that_do_not_apply_are_left_out():
    """No exact Gauss method is known for the bracket of the first spec. The options of the second spec exclude all
    three schemes.
    """
    curved = "coordinates: [x, y, z]\npoisson: {brackets: {x: {y: x*y + z**2}}}\nhamiltonian: x**2 + y**2\n"
    compilation = compile_text(f"{curved}scheme: auto\n", 4)
    assert "gauss does not apply" in compilation.choice
    text = "coordinates: [x, y, z]\npoisson: {brackets: {x: {y: z}}}\nhamiltonian: x**2 + exp(y*x) + sin(x*z*y)\n"
    spec = loads(f"phigen: 1\nname: t\n{text}scheme: auto\ncomposition: suzuki\nmonitor: log\n")
    with pytest.raises(SpecError):
        compile_spec(spec)


def test_the_series_is_the_default():
    """A spec without the key ``scheme`` uses the series. For a lattice the default is auto."""
    assert loads(f"phigen: 1\nname: t\n{BODY}").scheme == "series"
    assert spec_of("toda3").scheme == "series"
    text = "coordinates: [q, p]\nlattice: {axes: [i]}\npoisson: {canonical: {q: [q], p: [p]}}\n"
    assert loads(f"phigen: 1\nname: t\n{text}hamiltonian: p**2/2 + (q[i+1] - q)**2/2\n").scheme == "auto"


@pytest.mark.slow
def test_noise_and_attitudes_are_taken_by_those_who_have_them():
    noisy = compile_text(f"{BODY}noise: {{w: {{hamiltonian: x1}}}}\nscheme: auto\n", 2)
    assert "gauss does not apply" in noisy.choice
    turning = compile_text(f"{BODY}reconstruct: quaternion\nscheme: auto\n", 4)
    assert "gauss does not apply" not in turning.choice
    assert turning.program.attitude is not None
