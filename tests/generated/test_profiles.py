"""Code of the profile small makes the steps of fast code, and is short."""

import re
from dataclasses import replace

import numpy as np
import pytest
from support import RawC, compile_text, compiled, files, setting, small, solver

import phigen
from phigen import resources, spec
from phigen.compiler import compile_spec

#: One system for each kind of step, with the allowed difference after 300 steps of a regular motion, relative to the
#: size of the state.
KINDS = {
    ("rigid_body", None): 1e-14,
    ("lotka_volterra", None): 1e-14,
    ("nambu_pendulum", None): 1e-13,
    ("pendulum_euler", None): 0.0,
    ("kepler", "splitting"): 0.0,
}


@pytest.mark.thin(2)
@pytest.mark.parametrize(("name", "scheme"), KINDS)
def test_small_code_makes_the_steps_of_fast_code(name, scheme):
    fast = compiled(name, 4 if scheme else None, scheme)
    short, at = small(fast), setting(fast)
    ends = []
    for compilation in (fast, short):
        raw = RawC(compilation)
        assert raw.init(at.x, at.parameters) == 0
        for _ in range(300):
            assert raw.step(at.h) == 0
        ends.append(raw.x + raw.carry)
        assert raw.counters[0] == 300
    near = KINDS[name, scheme] * np.max(np.abs(ends[0]))
    np.testing.assert_allclose(ends[1], ends[0], rtol=0, atol=near)
    members = np.multiply.outer([1.0, 1.001, 1.002], at.x)
    many = [solver(c, "c").ensemble(members, at.h, 300, **at.parameters) for c in (fast, short)]
    np.testing.assert_allclose(many[1], many[0], rtol=0, atol=max(near, 4e-16 * np.max(np.abs(many[0]))))


@pytest.mark.parametrize(
    ("name", "order", "lines", "runtime", "row"),
    [
        ("rigid_body", 4, 578, 296, "rigid body, order 4"),
        ("pendulum_euler", 1, 246, 115, "pendulum, explicit, order 1"),
        ("kowalevski_gauss", 16, 661, 439, "Kowalevski top, Gauss collocation, order 16"),
    ],
)
def test_small_code_is_short(name, order, lines, runtime, row):
    """The code includes the choice of the gauge, which most tests leave out. docs/generated.md lists the figures in a
    table.
    """
    specification = spec.load(resources.bundled_specs() / f"{name}.yaml")
    compilation = compile_spec(replace(specification, profile="small"), order=order)
    texts = files(compilation, "c").values()
    length = sum(text.count("\n") for text in texts)
    assert length <= lines
    _, _, *chapters = re.split(r"^(?=/\* ---- )", files(compilation, "c")[f"{name}.c"], flags=re.M)
    assert sum(text.count("\n") for text in chapters) <= runtime
    table = (resources.templates().parent / "docs/generated.md").read_text(encoding="utf-8")
    assert f"| {row} | {length} | {RawC(compilation).memory.size} |" in table
    assert not any(word in text for word in ("_LANES", "_block", "_group", "recurrence") for text in texts)


#: For each part that can be left out, a word that occurs in code with the part; tests/lattice has the parts of
#: lattices.
WORDS = {
    "ensemble": "_ensemble(",
    "gauge-search": "_guide(",
    "kicks": "_kick(",
    "lanes": "_LANES",
    "members": "_ensemble_each(",
    "parameters": "_set_parameters(",
    "recurrences": "_RIDGE",
}


def described(name, profile, without=()):
    """Compile a system of the corpus with its gauge, without some parts."""
    specification = spec.load(resources.bundled_specs() / f"{name}.yaml")
    return compile_spec(specification, order=4, profile=profile, without=without)


@pytest.mark.thin(3)
@pytest.mark.parametrize("part", WORDS)
def test_a_part_can_be_left_out_of_fast_code(part):
    """The steps agree with those of NumPy, which leaves out the part too if it has it."""
    compilation = described("rigid_body", "fast", [part])
    texts = files(compilation, "c").values()
    has = {other: any(word in text for text in texts) for other, word in WORDS.items()}
    needed = [("recurrences", "lanes"), ("ensemble", "members")]
    assert has == {other: other != part and (part, other) not in needed for other in WORDS}
    at = setting(compilation)
    ends = [solver(compilation, t).integrate(at.x, at.h, 200, **at.parameters).x[-1] for t in ("c", "numpy")]
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=2e-14)
    if part == "ensemble":
        with pytest.raises(TypeError, match="compiled without ensembles"):
            solver(compilation, "c").ensemble([at.x], at.h, 1)
    if part == "parameters":
        with pytest.raises(TypeError, match="compiled without set_parameters"):
            solver(compilation, "c").session(at.x).set_parameters(I1=2)
    if part == "kicks":
        with pytest.raises(TypeError, match="compiled without kicks"):
            solver(compilation, "c").session(at.x).kick(at.x)


@pytest.mark.parametrize("profile", ["small", "certified"])
def test_short_code_changes_parameters_where_the_spec_has_inputs(profile):
    """Bindings and FMUs include this function even if the spec leaves it out; Python always needs it."""
    text = "coordinates: [q, p]\nparameters: {k: 1}\npoisson: {canonical: {q: [q], p: [p]}}\n"
    text += "hamiltonian: p**2/2 + k*q**2/2\n"
    for more, has in [("", False), ("inputs: [k]\n", True), ("inputs: [k]\nwithout: [parameters]\n", False)]:
        compilation = compile_text(text + more, profile=profile)
        for variant, expected in [(compilation, has), (compilation.including("parameters"), True)]:
            assert any("_set_parameters(" in code for code in files(variant, "c").values()) is expected
    session = phigen.compile(compile_text(text).system, "c", profile=profile).session([1, 0])
    assert session.set_parameters(k=4).parameters == {"k": 4}


def test_timed_code_without_ensembles_can_be_loaded():
    text = "coordinates: [q, p]\ntime: t\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: p**2/2 + q**2*cos(t)\n"
    compilation = compile_text(text + "without: [ensemble]\n")
    ends = [solver(compilation, t).integrate([1, 0.5], 0.1, 20).x[-1] for t in ("c", "numpy")]
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=2e-14)
    with pytest.raises(TypeError, match="compiled without ensembles"):
        solver(compilation, "c").ensemble([[1, 0.5]], 0.1, 1)


def test_small_code_has_no_part_that_serves_speed_and_carries_nothing_for_one():
    texts = files(described("rigid_body", "small"), "c").values()
    assert {part: any(word in text for text in texts) for part, word in WORDS.items()} == {
        part: part in ("ensemble", "kicks") for part in WORDS
    }
    paths = [described("nambu_pendulum", profile).program.step for profile in ("fast", "small")]
    assert paths[0].lanes
    assert not paths[1].lanes
