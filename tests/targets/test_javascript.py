"""Generated JavaScript, run by Node, agrees with the other targets to round-off, including errors."""

import json
import re
import subprocess
from dataclasses import replace
from functools import cache
from pathlib import Path
from shutil import copy

import numpy as np
import pytest
from node import answers as answers_of
from node import asked
from support import (
    BODY,
    COMMAND,
    NAMES,
    QUICK,
    RATTLEBACK,
    compile_text,
    compiled,
    run,
    setting,
    slow_but,
    solver,
    spec_of,
    tool,
)  # fmt: skip

import phigen
from phigen import resources, spec
from phigen.compiler import compile_spec, emit
from phigen.scheme import steps as kinds
from phigen.spec.model import BirealisationChoice
from phigen.targets.header import is_edited
from phigen.targets.js.files import HOOKS, LATTICE_MODULES, MEMBERS, MODULES
from phigen.targets.js.runtime import resolved

pytestmark = pytest.mark.corpus

RUNTIME = sorted((resources.templates() / "js" / "runtime").glob("*.mjs"))
STEPS = 20

PENDULUM = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: p**2/2 - cos(q)\n"
EULER = f"{PENDULUM}birealisation: canonical-euler\nruns: {{r: {{initial: [1, 0.5], step: 0.1, steps: 20}}}}\n"
PENDULUM_RUN = "runs: {r: {initial: [1, 0.5], step: 0.1, steps: 20}}\n"
RUN = "runs: {r: {initial: [1, 0.5, -0.25], step: 0.1, steps: 20}}\n"

TURNING = """coordinates: [x, y, z]
poisson: {matrix: [[0, -z, y], [z, 0, -x], [-y, x, 0]]}
hamiltonian: 3*x - y + 2*z + (x**2 + y*z)/40
"""
TURNING_RUN = "runs: {r: {initial: [0.3, -0.8, 0.5], step: 1, steps: 20}}\n"
GAP = """coordinates: [x, y, z]
poisson: {brackets: {x: {y: 1, z: y**6}}}
hamiltonian: 4*x + y**2/2 + 2*z
runs: {r: {initial: [0.3, 0, 0.2], step: 0.1, steps: 20}}
"""
LARGE_RUN = "runs: {r: {initial: [0.1, 1, 0.1], step: 1.05, steps: 20}}\n"

TWO_BODIES = """coordinates: [x1, x2, x3, y1, y2, y3]
poisson: {brackets: {x1: {x2: -x3, x3: x2}, x2: {x3: -x1}, y1: {y2: -y3, y3: y2}, y2: {y3: -y1}}}
hamiltonian: x1**2/2 + x2**2/4 + x3**2/6 + y1**2/3 + y2**2/5 + y3**2/7 + x1*y1/2 + x2*y3
casimirs: {C: x1**2 + x2**2 + x3**2, D: y1**2 + y2**2 + y3**2}
order: 4
runs: {r: {initial: [0.4, -0.2, -0.7, 0.4, 0.1, -0.4], step: 0.1, steps: 20}}
"""

#: Cases that the corpus lacks: every kind of step, with one stage and with several, kicks, composed paths.
VARIANTS = {
    "splitting": lambda: compiled("toda3", 4, "splitting"),
    "flow": lambda: compiled("rigid_body_paper", 2, "splitting"),
    "kicks": lambda: compiled("kowalevski_top", 6, "splitting"),
    "path": lambda: _by_paths("rigid_body", 4),
    "path, composed": lambda: compile_text(f"{BODY}order: 6\nbirealisation: karasev\ncomposition: kahan-li\n{RUN}"),
    "newton, composed": lambda: compile_text(f"{BODY}order: 6\ncomposition: kahan-li\n{RUN}"),
    "newton, not symmetric": lambda: compiled("pendulum_euler", 3),
    "gauge": lambda: _gauged("fast"),
    "gauge by a formula": lambda: _gauged("small"),
    "gauge of two Casimirs": lambda: compile_spec(spec.loads(f"phigen: 1\nname: t\n{TWO_BODIES}")),
    "modified": lambda: _modified(spec_of("rigid_body"), 2),
    "modified, not symmetric": lambda: _modified(spec.loads(f"phigen: 1\nname: t\n{EULER}"), 1),
    # Paths that are divided into segments, a path whose expansion only seems to converge, and steps that need the exact
    # matrix.
    "path, in pieces": lambda: compile_text(f"{TURNING}birealisation: karasev\norder: 2\n{TURNING_RUN}"),
    "path, with a gap": lambda: compile_text(f"{GAP}birealisation: karasev\norder: 2\n"),
    "path, large steps": lambda: compile_text(f"{BODY}birealisation: karasev\norder: 4\n{LARGE_RUN}"),
}

#: Cases with derivatives, for every kind of step.
VARIED = {
    "newton": lambda: _varied(f"{BODY}casimirs: {{C: x1**2 + x2**2 + x3**2}}\norder: 4\n{RUN}"),
    "newton, composed": lambda: _varied(f"{BODY}order: 6\ncomposition: kahan-li\n{RUN}"),
    "path": lambda: _varied(f"{BODY}order: 4\nbirealisation: karasev\n{RUN}"),
    "path, composed": lambda: _varied(f"{BODY}order: 4\nbirealisation: karasev\ncomposition: suzuki\n{RUN}"),
    "explicit": lambda: _varied(f"{PENDULUM}birealisation: canonical-euler\norder: 1\n{PENDULUM_RUN}"),
    "splitting": lambda: _varied(f"{PENDULUM}scheme: splitting\norder: 4\n{PENDULUM_RUN}"),
}
VARIANTS |= {f"{case}, varied": variant for case, variant in VARIED.items()}


def _by_paths(name, order):
    return compile_spec(replace(spec_of(name), birealisation=BirealisationChoice("karasev"), gauge="none"), order=order)


def _gauged(profile):
    text = f"phigen: 1\nname: t\n{BODY}casimirs: {{C: x1**2 + x2**2 + x3**2}}\norder: 4\nprofile: {profile}\n{RUN}"
    return compile_spec(spec.loads(text))


def _varied(text):
    return compile_spec(spec.loads(f"phigen: 1\nname: t\n{text}"), tangent=True)


def _modified(options, order):
    return compile_spec(options, order=order, modified_hamiltonian=1)


@cache
def compilation_of(case):
    return VARIANTS[case]() if case in VARIANTS else compiled(case)


def node(folder, jobs):
    """Return Node's answers to requests (compilation, options, h, steps)."""
    listed = []
    for k, (compilation, options, h, steps) in enumerate(jobs):
        (text,) = emit(compilation.program, "js", COMMAND).values()
        path = folder / f"{k}.mjs"
        path.write_text(text, encoding="utf-8")
        timed = bool(compilation.program.time)
        listed.append({"module": path.as_uri(), "options": options, "h": h, "steps": steps, "timed": timed})
    return answers_of(Path(__file__).with_name("javascript.mjs"), listed)


class Answers(dict):
    """Answers of the solvers of cases to the first run of their spec, computed when a test first needs them."""

    def __init__(self, folders, jobs):
        self.folders, self.jobs = folders, jobs

    def __missing__(self, case):
        compilation, h, steps = self.jobs(case)
        at = setting(compilation)
        job = compilation, {"x0": at.x, "params": at.parameters}, h or at.h, steps
        (self[case],) = node(self.folders.mktemp("javascript"), [job])
        return self[case]


@pytest.fixture(scope="session")  # with the scope of a module it would be computed for every system
def answers(tmp_path_factory):
    return Answers(tmp_path_factory, lambda case: (compilation_of(case), None, STEPS))


def apart(actual, expected):
    """Return the largest difference, relative to the largest expected number."""
    actual, expected = np.asarray(actual, dtype=float), np.asarray(expected, dtype=float)
    return float(np.max(np.abs(actual - expected), initial=0.0) / (np.max(np.abs(expected), initial=0.0) or 1.0))


@pytest.mark.thin(3)
@pytest.mark.parametrize("case", [*NAMES, *VARIANTS])
def test_steps_are_those_of_numpy_to_roundoff(case, answers):
    at, answer, numpy = setting(compilation_of(case)), answers[case], solver(compilation_of(case), "numpy")
    expected = numpy.integrate(at.x, at.h, STEPS, **at.parameters).x[-1]
    assert (answer["done"], answer["steps"]) == ({"value": STEPS}, STEPS)
    assert answer["t"] == STEPS * at.h
    assert apart(answer["x"], expected) < 1e-13
    assert np.max(np.abs(answer["carry"])) < 1e-15 * np.max(np.abs(expected))
    assert np.any(answer["carry"]) or case == "path, in pieces"  # sums are exact if changes are larger than the state


@pytest.mark.parametrize("case", [*NAMES, *VARIANTS])
def test_kicked_solvers_go_on_as_ones_that_start_there(case, answers):
    answer = answers[case]["moved"]
    assert apart(answer["x"], answer["fresh"]) < 1e-13
    assert (answer["failure"]["status"], answer["steps"]) == ("BAD_ARGUMENT", 3)


@pytest.mark.parametrize("case", [*NAMES, *VARIANTS, "duffing", "kepler_eccentric", "thruster_body"])
def test_copies_go_on_by_themselves(case, answers):
    answer = answers[case]["copied"]
    assert answer["alone"]
    assert apart(answer["ends"][1], answer["ends"][0]) < 1e-14


@pytest.mark.thin(2)
@pytest.mark.parametrize("case", slow_but(QUICK, [*NAMES, *VARIANTS, "duffing", "kepler_eccentric", "thruster_body"]))
def test_parts_of_steps_find_events_where_sections_do(case, answers):
    """Cases with time, a monitor, forces, attitudes, and every kind of step."""
    at, answer = setting(compilation_of(case)), answers[case]["crossings"]

    def g(x, *_):
        return x[:, 0] - answer["level"]

    numpy = solver(compilation_of(case), "numpy")
    expected = numpy.section(at.x, at.h, 12, g, direction="both", parameters=at.parameters)
    assert len(answer["found"]) == len(expected) > 0
    for there, t, x in zip(answer["found"], expected.t, expected.x, strict=True):
        assert abs(there["t"] - t) < 1e-11 * abs(12 * at.h)
        assert apart(there["x"], x) < 1e-13


@pytest.mark.parametrize("case", [*NAMES, *VARIANTS])
def test_a_step_of_another_size_is_guessed_from_none_before(case, answers):
    answer = answers[case]["remembered"]
    assert set(answer) == ({1} if isinstance(compilation_of(case).program.step, kinds.Newton | kinds.Path) else set())


@pytest.mark.parametrize("case", [*NAMES, *VARIANTS])
def test_what_rounding_took_from_the_state_is_part_of_it(case, answers):
    """If the equation for y ignored the compensation term, the error would be of the order of the step: here 1e-2 of
    the term, and more.
    """
    if isinstance(compilation_of(case).program.step, kinds.Newton):
        assert answers[case]["carried"] <= 1e-7


def test_a_step_that_leads_elsewhere_is_tried_again(tmp_path):
    """The equation of step 12 has a second solution of 280 times the energy, to which its predictor leads."""
    (answer,) = node(tmp_path, [(compile_text(RATTLEBACK), {"x0": [0.02, 0.3, -1]}, 0.42, 15)])
    assert answer["done"] == {"value": 15}
    assert answer["growth"] < 2


@pytest.mark.slow
@pytest.mark.parametrize("case", QUICK)
def test_steps_are_those_of_c_to_roundoff(case, answers):
    """Another test compares C with NumPy in all cases."""
    at = setting(compilation_of(case))
    expected = solver(compilation_of(case), "c").integrate(at.x, at.h, STEPS, **at.parameters).x[-1]
    assert apart(answers[case]["x"], expected) < 1e-13


@pytest.mark.parametrize("case", NAMES)
def test_observables_and_facts_are_those_of_the_system(case, answers):
    at, answer, numpy = setting(compilation_of(case)), answers[case], solver(compilation_of(case), "numpy")
    program, x = compilation_of(case).program, np.array(answer["x"])
    backend = numpy.backend
    scale = 1e-13 * np.max(np.abs(x))
    assert answer["energy"] == pytest.approx(backend.hamiltonian(x[np.newaxis], at.parameters)[0], rel=1e-13, abs=scale)
    assert answer["casimirs"] == pytest.approx(backend.casimirs(x[np.newaxis], at.parameters)[0], rel=1e-13, abs=scale)
    assert apart(answer["field"], backend.vector_field(x[np.newaxis], at.parameters)[0]) < 1e-13
    assert answer["facts"] == {
        "NAME": program.name,
        "VERSION": phigen.__version__,
        "SPEC_SHA256": program.about.spec_sha256,
        "DIM": program.dimension,
        "ORDER": program.order,
        "COORDINATES": list(program.coordinates),
        "CASIMIRS": list(program.casimirs),
        "DEFAULT_PARAMETERS": {p.name: float(p.value) for p in program.parameters},
    }


@pytest.mark.parametrize("case", ["gauge", "gauge by a formula", "gauge of two Casimirs"])
def test_the_gauge_is_chosen_as_in_numpy_or_given(case, answers, tmp_path):
    compilation = compilation_of(case)
    at = setting(compilation)
    module = solver(compilation, "numpy").backend.module
    assert answers[case]["gauge"] == pytest.approx(module.gauge(at.x, **at.parameters), rel=1e-12)
    multiples = [0.25, -0.5][: len(answers[case]["gauge"])]
    jobs = [{"x0": at.x, "gauge": multiples}, {"x0": [1e200] * len(at.x)}]
    prescribed, far = node(tmp_path, [(compilation, options, at.h, 3) for options in jobs])
    assert apart(prescribed["x"], module.integrate(at.x, at.h, 3, gauge=multiples)[-1]) < 1e-14
    if "formula" not in case:  # for such large states the leading error is infinite
        assert not np.any(far["gauge"])
        assert not np.any(module.gauge([1e200] * len(at.x)))


@pytest.mark.parametrize("case", ["modified", "modified, not symmetric"])
def test_the_modified_hamiltonian_is_that_of_numpy(case, answers):
    compilation, answer = compilation_of(case), answers[case]
    at = setting(compilation)
    module = solver(compilation, "numpy").backend.module
    assert answer["modified"] == pytest.approx(module.modified_hamiltonian(at.x, at.h, **at.parameters), rel=1e-14)


@pytest.mark.parametrize("case", [f"{case}, varied" for case in VARIED])
def test_the_derivative_of_a_step_is_that_of_numpy(case, answers):
    compilation, answer = compilation_of(case), answers[case]["tangent"]
    at, integrator = setting(compilation), solver(compilation, "numpy")
    image, tangent = integrator.step_tangent(at.x, at.h, parameters=at.parameters)
    assert apart(np.reshape(answer["derivative"], tangent.shape), tangent) < 1e-14
    assert (apart(answer["x"], image) < 1e-15, answer["t"]) == (True, at.h)
    assert (answer["failure"]["name"], answer["untouched"]) == ("StepError", True)


def test_code_that_was_not_asked_for_derivatives_has_none(answers):
    assert answers["gauge"]["tangent"] is None


@pytest.mark.thin(2)
@pytest.mark.parametrize("case", NAMES)
def test_an_ensemble_is_its_members_one_by_one(case, answers):
    answer, at = answers[case]["many"], setting(compilation_of(case))
    assert answer["status"] == ["OK", "OK", "BAD_ARGUMENT"]
    assert answer["x"][0] == answers[case]["x"]
    members = np.multiply.outer([1.0, 1.01], at.x)
    expected = solver(compilation_of(case), "numpy").ensemble(members, at.h, STEPS, **at.parameters)
    assert apart(answer["x"][:2], expected) < 1e-13


@pytest.mark.parametrize("case", NAMES)
def test_members_may_have_parameters_steps_and_times_of_their_own(case, answers):
    compilation, answer = compilation_of(case), answers[case]["each"]
    at, factors = setting(compilation), np.array([1, 1.01, 1.02])
    defaults = {p.name: float(p.value) * factors for p in compilation.spec.parameters}
    more = {"t0": factors - 1} if compilation.program.time else {}
    assert answer["status"] == ["OK"] * 3
    expected = solver(compilation, "numpy").ensemble([at.x] * 3, at.h / factors, 5, **defaults, **more)
    assert apart(answer["x"], expected) < 1e-13


#: Systems and step sizes that fail: far too large steps for each kind of step, and a solution at another energy.
FAILING = [("rigid_body", 40.0), ("sir_epidemic", 300.0), ("pendulum_euler", 1e200), ("toda3", 1e3), ("kepler", 30.0)]
FAILING += [("a splitting that runs to infinity", 0.5), ("a composition, too large", 5.0)]
ENDING = {
    "a splitting that runs to infinity": "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
    "hamiltonian: p**2/2 - exp(q)\nscheme: splitting\norder: 4\nruns: {r: {initial: [0, 1], step: 0.5, steps: 50}}\n",
    "a composition, too large": f"{BODY}order: 6\ncomposition: kahan-li\n{RUN}",
}


def failing(name):
    return compile_text(ENDING[name]) if name in ENDING else compiled(name)


@pytest.fixture(scope="session")
def failures(tmp_path_factory):
    return Answers(tmp_path_factory, lambda name: (failing(name), dict(FAILING)[name], 50))


@pytest.mark.parametrize(("name", "h"), FAILING)
def test_a_failing_step_is_an_exception_and_keeps_the_state(name, h, failures):
    answer, at, numpy = failures[name], setting(failing(name)), solver(failing(name), "numpy")
    with pytest.raises(phigen.StepError) as expected:
        numpy.integrate(at.x, h, 50, **at.parameters)
    assert answer["done"]["name"] == "StepError"
    assert answer["done"]["status"] == expected.value.status
    assert answer["done"]["steps"] == answer["steps"] == expected.value.step
    if answer["steps"] == 0:
        assert answer["x"] == list(at.x)
        assert not np.any(answer["carry"])
    else:
        assert apart(answer["x"], expected.value.trajectory.x[-1]) < 1e-9


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"x0": [1, 2]}, "x0 must be 3 finite numbers"),
        ({}, "x0 must be 3 finite numbers"),
        ({"x0": [1, 2, "a"]}, "x0 must be 3 finite numbers"),
        ({"x0": [1, 2, 3], "parameters": {"I1": 1}}, "there is no option parameters; options are x0, params"),
        ({"x0": [1, 2, 3], "seed": 1}, "there is no option seed; options are x0, params"),
        ({"x0": [1, 2, 3], "t0": 1}, "there is no option t0"),
        ({"x0": [1, 2, 3], "sizes": [1]}, "there is no option sizes"),
        ({"x0": [1, 2, 3], "params": {"J": 1}}, "there is no parameter J"),
        ({"x0": [1, 2, 3], "params": {"toString": 1}}, "there is no parameter toString"),
        ({"x0": [1, 2, 3], "params": {"I1": "2"}}, "the parameter I1 is 2"),
        ({"x0": [1, 2, 3], "params": {"I1": -1}}, "the parameter I1 is -1"),
        ({"x0": [1, 2, 3], "params": {"I1": 1e-320}}, "no step can be made with these parameters"),
    ],
)
def test_bad_arguments_are_told(options, said, tmp_path):
    (answer,) = node(tmp_path, [(compiled("rigid_body"), options, 0.1, 1)])
    assert answer["isStepError"]
    assert answer["made"]["status"] == "BAD_ARGUMENT"
    assert said in answer["made"]["message"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("{params: {I1: [1, 2, 3]}}", "I1 must be one number, or 2"),
        ("{parameters: {I1: 1}}", "there is no option parameters"),
        ("{member: 1}", "there is no option member; options are params"),
        ("{x0: [1, 1, 1]}", "there is no option x0"),
    ],
)
def test_bad_arguments_of_ensembles_are_told(options, said, tmp_path):
    (text,) = emit(compiled("rigid_body").program, "js", "phigen").values()
    (tmp_path / "rigid_body.mjs").write_text(text, encoding="utf-8")
    call = f"module.Solver.ensemble([[1, 1, 1], [1, 2, 1]], 0.1, 1, {options})"
    assert said in asked(tmp_path / "rigid_body.mjs", f"try {{ {call} }} catch (error) {{ return error.message }}")


@pytest.mark.parametrize(("h", "steps"), [("NaN", 1), (0.1, -1), (0.1, 1.5)])
def test_bad_steps_are_told(h, steps, tmp_path):
    (answer,) = node(tmp_path, [(compiled("rigid_body"), {"x0": [1, 1, 1]}, h, steps)])
    assert answer["done"]["status"] == "BAD_ARGUMENT"
    assert answer["x"] == [1, 1, 1]


def test_names_of_the_user_may_be_words_of_javascript(tmp_path):
    names = ["class", "Math", "arguments"]
    pi = [[0, f"-{names[2]}", names[1]], [names[2], 0, f"-{names[0]}"], [f"-{names[1]}", names[0], 0]]
    text = f"coordinates: {json.dumps(names)}\nparameters: {{__proto__: 2, constructor: 3, Solver: 1, NaN: 2}}\n"
    text += f"poisson: {{matrix: {json.dumps(pi)}}}\norder: 4\nhamiltonian: "
    text += "class**2/__proto__ + Math**2/constructor + Solver*arguments**4/NaN\n"
    compilation = compile_text(text)
    (answer,) = node(tmp_path, [(compilation, {"x0": [1, 0.5, -0.25], "params": {"NaN": 4}}, 0.1, 5)])
    expected = solver(compilation, "numpy").integrate([1, 0.5, -0.25], 0.1, 5, NaN=4)
    assert apart(answer["x"], expected.x[-1]) < 1e-14


#: Script that parses modules without executing them.
PARSED = """
const vm = require("node:vm"), fs = require("node:fs");
for (const identifier of process.argv.slice(1))
  new vm.SourceTextModule(fs.readFileSync(identifier, "utf8"), { identifier });
"""


def test_the_runtime_is_javascript_as_it_lies_there(tmp_path):
    run([tool("node"), "--experimental-vm-modules", "-e", PARSED, *RUNTIME], tmp_path)
    for path in RUNTIME:
        assert max(map(len, path.read_text(encoding="utf-8").splitlines())) <= 110


def test_modules_of_the_runtime_import_what_others_export():
    texts = {path.stem: path.read_text(encoding="utf-8") for path in RUNTIME}
    exported = {m: set(re.findall(r"^export \w+ (\w+)", text, re.MULTILINE)) for m, text in texts.items()}
    for text in texts.values():
        for names, module in re.findall(r'import \{ (.*) \} from "\./(\w+)\.mjs"', text):
            if module in exported:
                assert set(names.split(", ")) <= exported[module], names


def test_tables_of_modules_and_hooks_name_what_is_there():
    text = "\n".join(path.read_text(encoding="utf-8") for path in RUNTIME)
    members = {f"members_{name}" for name in MEMBERS}
    assert {path.stem for path in RUNTIME} == {*MODULES, *LATTICE_MODULES, *members}
    for function in HOOKS:
        assert re.search(rf"^export function {function}\(", text, re.MULTILINE), function
        assert re.search(rf"^ +{function}\(.*\);$", text, re.MULTILINE), function


def test_modules_that_meet_declare_no_name_twice():
    declared = {
        path.stem: set(re.findall(r"^(?:export )?(?:const|function|class) (\w+)", path.read_text(), re.MULTILINE))
        for path in RUNTIME
    }
    lattices = [["errors", "lattice", "sites", *step] for step in (["flows"], ["sweeps", "krylov"])]
    others = ["tangent", "errors", "solver", "gauge", "predictor_checks", "algebra", "linear", "saving", "autonomous"]
    steps = [[s, f"tangent_{s}", *others] for s in ("newton", "path", "explicit", "splitting")]
    turned = [[*met, "attitude", f"attitude_{kind}"] for met in steps for kind in ("matrices", "quaternions")]
    for met in [*lattices, *turned]:
        every = [name for module in met for name in declared[module]]
        assert len(every) == len(set(every)), sorted(n for n in set(every) if every.count(n) > 1)


def test_parts_are_left_out_by_lines_in_comments():
    text = (
        "a\n// #if X\nb\n  // #if Y\n  c\n  // #else\n  d\n  // #endif\n// #endif\n/**\n * #if !Y\n * e\n * #endif\n */"
    )
    assert resolved(text, {"X": True, "Y": False}) == ["a", "b", "  d", "/**", " * e", " */"]
    assert resolved(text, {"X": False, "Y": True}) == ["a", "/**", " */"]
    with pytest.raises(KeyError):
        resolved(text, {"X": True})


def test_edits_are_noticed():
    (text,) = emit(compiled("rigid_body").program, "js", COMMAND).values()
    assert not is_edited(text)
    assert is_edited(text.replace("const DIM = 3", "const DIM = 4"))


@pytest.mark.parametrize(("example", "name"), [(0, "rigid_body"), (1, "rigid_body"), (2, "toda")])
def test_an_example_of_the_documentation_prints_what_it_says(example, name, tmp_path):
    root = resources.bundled_specs().parent
    text = (root / "docs" / "javascript.md").read_text(encoding="utf-8")
    examples = (re.findall(rf"```{kind}\n(.*?)```", text, re.DOTALL) for kind in ("js", "text"))
    code, printed = (blocks[example] for blocks in examples)
    (tmp_path / "example.mjs").write_text(code, encoding="utf-8")
    copy(root / "generated" / name / f"{name}.mjs", tmp_path)
    process = subprocess.run([tool("node"), "example.mjs"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert process.stdout == printed
