"""Functional mock-up units (FMUs): valid descriptions, the same bits as the C, any communication steps, states, events,
and what is refused.
"""

import os
import re
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from fmu.units import fmpy, running, unit, written
from support import BODY
from tools import WARNINGS, run, tool

import phigen
from phigen import resources
from phigen.cli import group
from phigen.fmu.archive import archive, binaries
from phigen.fmu.platforms import FLAGS, PLATFORMS, compilers

DRIVE = Path(__file__).with_name("drive.c")
validate_fmu = pytest.importorskip("fmpy.validation").validate_fmu
HEADERS = Path(fmpy.__file__).parent / "c-code"


def body_spec(name, more="", *, title="a body", inputs="[torque]"):
    """Return the text of a spec of a rigid body with a torque as input."""
    return f"""phigen: 1
name: {name}
title: '{title}'
coordinates: [m1, m2, m3]
parameters:
  I1: {{value: 2, positive: true, unit: 'kg.m2 <&">', description: "least & <first>\\n\\"moment\\" */ of inertia ??/"}}
  I2: {{value: 3, positive: true, unit: kg.m2}}
  I3: {{value: 4, positive: true}}
  torque: 0.2
inputs: {inputs}
poisson: {{lie_algebra: {{name: so(3), sign: minus}}}}
hamiltonian: m1**2/(2*I1) + m2**2/(2*I2) + m3**2/(2*I3)
forces: {{vector: {{m3: torque}}}}
casimirs: {{C: m1**2 + m2**2 + m3**2}}
observables: {{spin: m3/I3}}
profile: small
{more}
runs: {{r: {{initial: [1, 0.8, 0.1], step: 0.1, steps: 100, parameters: {{I3: 5}}}}}}
"""


FREE = """phigen: 1
name: free
coordinates: [m1, m2, m3]
parameters: {I1: 1, I2: 2, I3: 3}
poisson: {lie_algebra: {name: so(3), sign: minus}}
hamiltonian: m1**2/(2*I1) + m2**2/(2*I2) + m3**2/(2*I3)
casimirs: {C: m1**2 + m2**2 + m3**2}
reconstruct: quaternion
profile: small
runs: {r: {initial: [0.4, 1, 0.3], step: 0.05, steps: 100}}
"""
X0 = "0.4, 1, 0.3"
NAMES = ("m1", "m2", "m3")
ATTITUDE = tuple(f"attitude.{c}" for c in "wxyz")


@pytest.fixture(scope="module")
def free(tmp_path_factory):
    return written(FREE, tmp_path_factory.mktemp("free"))


@pytest.fixture(scope="module")
def body(tmp_path_factory):
    return written(body_spec("body"), tmp_path_factory.mktemp("body"))


NASTY = body_spec("nasty", title='a "title" <b>&amp; ]]> ?>')
MORE = ["satellite", "seasonal_predator_prey", "kepler_eccentric", "thermal_spin", "so4_manakov", "lagrange_top"]


@pytest.mark.thin(2)
@pytest.mark.parametrize("source", [FREE, NASTY, *(pytest.param(s, marks=pytest.mark.slow) for s in MORE)])
def test_descriptions_and_declarations_are_those_of_the_standard(source, tmp_path):
    """The descriptions are valid for fmpy. The C compiles without warnings, and also after the headers of the FMI
    standard.
    """
    compilation, files = unit(source)
    for version in (2, 3):
        path = tmp_path / f"{version}.fmu"
        path.write_bytes(archive(files, version, {}))
        assert validate_fmu(str(path)) == []
        assert path.read_bytes() == archive(files, version, {})
    for file, text in files.sources.items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    headers = "".join(f'#include "fmi{v}Functions.h"\n' for v in (3, 2))
    name = compilation.spec.name
    (tmp_path / "all.c").write_text(f'{headers}#include "{name}_fmi.c"\n', encoding="utf-8")
    run([tool("gcc"), "-std=c99", *WARNINGS, "-fsyntax-only", f"{name}_fmi.c"], tmp_path)
    run([tool("gcc"), "-std=c99", f"-I{HEADERS}", "-fsyntax-only", "all.c"], tmp_path)
    run([tool("g++"), "-x", "c++", "-fsyntax-only", f"{name}_fmi.c"], tmp_path)


def test_functions_of_fmi_are_short():
    """The templates for both versions of FMI have fewer than 600 lines that are not blank, comments included."""
    texts = [path.read_text(encoding="utf-8") for path in (resources.templates() / "c/runtime").glob("fmu*.c")]
    assert len(texts) == 3
    assert sum(line.strip() != "" for text in texts for line in text.split("\n")) < 600


def test_text_of_the_spec_arrives_as_it_is(body):
    description = fmpy.read_model_description(body[1][3])
    of = {v.name: v for v in description.modelVariables}
    assert of["I1"].unit == 'kg.m2 <&">'
    assert of["I1"].description == 'least & <first> "moment" */ of inertia ??/'
    assert (of["torque"].causality, of["I2"].variability, of["I3"].start) == ("input", "tunable", "5.0")


BACKWARD = "back: {initial: [9, 9, 9], step: -0.1, steps: 10}"


def test_description_takes_a_run_that_goes_forward_and_leaves_out_blank_units():
    """The default experiment is the first run with a positive step, because communication steps go forward in time.
    Units and descriptions without visible characters are omitted.
    """
    text = body_spec("body").replace("runs: {r:", f"runs: {{{BACKWARD}, r:")
    # U+0378 is not assigned to a character, so nothing of it is left in the XML.
    blank = 'unit: "\u0378", description: "\u0378"}'
    text = text.replace("unit: kg.m2}", blank).replace("title: 'a body'", "title: ' '")
    _, files = unit(text)
    for description in files.descriptions.values():
        root = ET.fromstring(description)
        experiment = root.find("DefaultExperiment").attrib
        assert [float(experiment[key]) for key in ("startTime", "stepSize", "stopTime")] == [0, 0.1, 10]
        attributes = [value for element in root.iter() for value in element.attrib.values()]
        assert "" not in attributes
        assert [e.get("name") for e in root.iter("Unit")] == ['kg.m2 <&">']


def test_spec_with_backward_runs_only_is_refused_at_the_step():
    text = re.sub(r"runs: .*", f"runs: {{{BACKWARD}}}", body_spec("body"))
    refused = r"\d+:\d+: error: an FMU of body needs a run that goes forward in time, and the step of back is -1/10"
    with pytest.raises(phigen.SpecError, match=refused):
        unit(text)


def states_of_c(steps, folder):
    """Return the states of the free body after each pair (step size, number of steps), computed by the generated C
    without an FMU, compiled with the flags of the FMU.
    """
    calls = "".join(
        f"if (free_integrate(&s, {h!r}, {n}) != free_OK) return 1;"
        'for (int i = 0; i < free_DIM; i++) printf("%a ", s.x[i]);'
        for h, n in steps
    )
    begin = f"const double x0[] = {{{X0}}}; free_solver s; free_init(&s, &free_default_params, x0);"
    text = f'#include <stdio.h>\n#include "free.h"\nint main(void) {{ {begin} {calls} }}'
    (folder / "main.c").write_text(text, encoding="utf-8")
    for file, code in unit(FREE)[1].sources.items():
        (folder / file).write_text(code, encoding="utf-8")
    run([tool("gcc"), "-std=c99", "-O1", *FLAGS, "main.c", "free.c", "-lm", "-o", "main"], folder)
    printed = [float.fromhex(word) for word in run([folder / "main"], folder).split()]
    return [printed[k : k + 3] for k in range(0, len(printed), 3)]


@pytest.mark.thin(2)
@pytest.mark.parametrize("version", [2, 3])
def test_bits_are_those_of_the_c(free, version, tmp_path):
    """Communication steps of whole solver steps have the bits of the C. So has one that ends with a shorter step."""
    with running(free[1][version], tmp_path) as instance:
        by_unit = []
        for k in range(3):
            instance.step(0.2 * k, 0.2)
            by_unit.append(instance.get(*NAMES))
        instance.step(0.6, 0.173)
        by_unit.append(instance.get(*NAMES))
    part = 0.6 + 0.173 - 15 * 0.05
    expected = states_of_c([(0.05, 4), (0.05, 4), (0.05, 4), (0.05, 3), (part, 1)], tmp_path)
    assert by_unit == [*expected[:3], expected[4]]


@pytest.mark.parametrize("version", [2, 3])
def test_communication_points_between_steps_do_not_change_the_state(free, version, tmp_path):
    """One run has communication points between two steps of the solver. At the last point, which both runs have, the
    states are equal. Casimir and norm of the quaternion are constant at all points.
    """
    with running(free[1][version], tmp_path / "a") as even, running(free[1][version], tmp_path / "b") as odd:
        even.step(0.0, 1.0)
        t = 0.0
        for size in (0.173, 0.173, 0.02, 0.2, 0.434):
            odd.step(t, size)
            t += size
            assert odd.get("time") == [t]
            assert odd.get("casimirs.C")[0] == pytest.approx(1.25, abs=1e-15)
            assert np.linalg.norm(odd.get(*ATTITUDE)) == pytest.approx(1, abs=1e-15)
        assert odd.get(*NAMES, *ATTITUDE) == even.get(*NAMES, *ATTITUDE)


@pytest.mark.parametrize("version", [2, 3])
def test_inputs_act_from_the_communication_point_on(body, version, tmp_path):
    _, paths = body
    with running(paths[version], tmp_path) as instance:
        instance.step(0.0, 0.93)
        instance.set({"torque": -0.5})
        instance.step(0.93, 1.0)
        outputs = instance.get("m1", "m2", "m3", "casimirs.C", "observables.spin", "torque")
    solver = phigen.compile(body[0].spec, order=8)
    x = solver.integrate([1, 0.8, 0.1], h=0.01, steps=93, I3=5).x[-1]
    x = solver.integrate(x, h=0.01, steps=100, I3=5, torque=-0.5).x[-1]
    assert np.abs(np.array(outputs[:3]) - x).max() < 2e-6
    assert outputs[3:] == pytest.approx([x @ x, x[2] / 5, -0.5], abs=1e-5)


def test_initial_values_parameters_and_step_can_be_set(body, tmp_path):
    _, paths = body
    values = {"m1": 0.3, "I3": 7.0, "torque": 0.0, "solver.step": 0.02}
    with running(paths[3], tmp_path, start=5.0, values=values) as instance:
        assert instance.get("time", "m1", "system.hamiltonian") == [5.0, 0.3, 0.3**2 / 4 + 0.8**2 / 6 + 0.1**2 / 14]
        instance.step(5.0, 0.4)
        outputs = instance.get("m1", "m2", "m3")
    exact = phigen.compile(body[0].spec, order=8).integrate([0.3, 0.8, 0.1], h=0.01, steps=40, I3=7, torque=0).x[-1]
    assert np.abs(np.array(outputs) - exact).max() < 1e-9


@pytest.mark.parametrize("version", [2, 3])
def test_a_step_that_fails_is_discarded_and_leaves_the_state(free, version, tmp_path):
    _, paths = free
    with running(paths[version], tmp_path, values={"solver.step": 40.0}) as instance:
        before = instance.get("m1", "m2", "m3", "time")
        with pytest.raises(Exception, match=r"status 2|\(discard\)"):
            instance.step(0.0, 80.0)
        assert instance.get("m1", "m2", "m3", "time") == before
        instance.step(0.0, 0.02)  # a shorter step, for which the iteration converges
        assert instance.get("time") == [0.02]


@pytest.mark.parametrize("version", [2, 3])
def test_steps_beyond_the_stop_time_are_errors_and_leave_the_state(free, version, tmp_path):
    """The FMI standard requires this error. A step that passes the stop time only by rounding is accepted."""
    with running(free[1][version], tmp_path, start=1.0, stop=1.3) as instance:
        for k in range(2):
            instance.step(1.0 + 0.1 * k, 0.1)
        before = instance.get("m1", "time")
        with pytest.raises(Exception, match=r"status 3|\(error\)"):
            instance.step(1.2, 0.11)
        assert instance.get("m1", "time") == before
        instance.step(1.2, 0.1 + 1e-14)


@pytest.mark.parametrize("version", [2, 3])
def test_states_can_be_copied_and_serialised(free, version, tmp_path):
    _, paths = free
    with running(paths[version], tmp_path) as instance:
        raw, end = instance.raw, "FMUState" if version == 3 else "FMUstate"
        get, put, free_, write = (getattr(raw, f"{verb}{end}") for verb in ("get", "set", "free", "serialize"))
        read = raw.deserializeFMUState if version == 3 else raw.deSerializeFMUstate
        instance.step(0.0, 0.33)
        state = get()
        data = write(state)
        instance.step(0.33, 1.0)
        after = instance.get("m1", "attitude.x", "time")
        other = read(data)
        for saved in (state, other):
            put(saved)
            instance.step(0.33, 1.0)
            assert instance.get("m1", "attitude.x", "time") == after
            free_(saved)


def test_environment_in_c_under_sanitizers(tmp_path):
    """A C program that includes the FMU tests modes, early return, states, corrupted bytes and refused values."""
    _, files = unit(body_spec("body"))
    for file, text in files.sources.items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    defined = {"UNIT": '"body_fmi.c"', "TOKEN": "body_token", "STEP": "0.1", "FMU(kind)": "body_FMU_##kind"}
    defined["LAST_TIME"] = "body_fmi2GetRealStatus"
    defined |= {"PREFIXED(name)": "body_fmi3##name", "FMI3_FUNCTION_PREFIX": "body_", "FMI2_FUNCTION_PREFIX": "body_"}
    options = [f"-D{name}={value}" for name, value in defined.items()]
    sanitised = ["-O0", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover"]
    command = [tool("gcc"), "-std=c99", "-Wall", *sanitised, *options, DRIVE, "body.c", "-o", "drive", "-lm"]
    run([*command[:-4], f"-I{tmp_path}", *command[-4:]], tmp_path)
    assert run([tmp_path / "drive"], tmp_path) == "ok\n"


@pytest.mark.slow
def test_steps_equal_in_tau_meet_physical_times(tmp_path):
    compilation, paths = written("kepler_eccentric", tmp_path)
    names = compilation.spec.coordinates
    run_ = next(iter(compilation.spec.runs.values()))
    reference = phigen.compile("kepler_eccentric", profile=compilation.program.profile)
    run, h = reference.integrate([float(x) for x in run_.initial], h=float(run_.step), steps=60), 0.37
    with running(paths[3], tmp_path) as instance:
        for k in range(int(run.t[-1] / h) - 1):
            instance.step(k * h, h)
            at = run.at([(k + 1) * h])[0]
            assert np.abs(np.array(instance.get(*names)) - at).max() < 1e-8
    with running(paths[3], tmp_path / "still", start=1.0, values={"solver.step": 1e-30}) as instance:
        with pytest.raises(Exception, match="discard"):  # 1 + 1e-30 is 1: the time stands still
            instance.step(1.0, 0.1)
        assert instance.get("time") == [1.0]


@pytest.mark.slow
def test_noise_takes_its_seed_and_whole_steps_only(tmp_path):
    compilation, paths = written("thermal_spin", tmp_path)
    names, step = compilation.spec.coordinates, float(next(iter(compilation.spec.runs.values())).step)

    def after(seed):
        with running(paths[3], tmp_path / str(seed)) as instance:
            instance.raw.reset()
            number = instance.numbers["solver.seed"]
            instance.raw.setInt32([number], [seed])
            assert instance.raw.getInt32([number]) == [seed]
            for put, value in [(instance.raw.setInt32, -1), (instance.raw.setFloat64, 3.0)]:
                with pytest.raises(Exception, match="error"):
                    put([number], [value])
            instance.raw.enterInitializationMode(startTime=0.0)
            instance.raw.exitInitializationMode()
            with pytest.raises(Exception, match="discard"):
                instance.step(0.0, 1.5 * step)
            instance.step(0.0, 8 * step)
            return instance.get(*names)

    assert after(1) == after(1)
    assert after(1) != after(2)


@pytest.mark.slow
def test_satellite_keeps_quaternion_and_casimirs_for_many_steps(tmp_path):
    _, paths = written("satellite", tmp_path, (3,))
    casimirs = ["casimirs.N", "casimirs.G", "casimirs.A"]
    with running(paths[3], tmp_path) as instance:
        start, worst = np.array(instance.get(*casimirs)), 0.0
        for k in range(15):
            instance.step(k * 1000.0, 1000.0)
            worst = max(worst, np.abs(np.array(instance.get(*casimirs)) - start).max())
            worst = max(worst, abs(np.linalg.norm(instance.get(*ATTITUDE)) - 1))
    assert worst < 1e-13


def build(*words):
    return CliRunner().invoke(group, ["build", *map(str, words)])


def test_command_refuses_lattices_and_specs_without_runs(tmp_path):
    (tmp_path / "t.yaml").write_text(f"phigen: 1\nname: t\n{BODY}order: 4\n", encoding="utf-8")
    result = build(tmp_path / "t.yaml", "toda", "--fmu", "-t", "numpy", "-o", tmp_path)
    assert result.exit_code == 1
    assert "t.yaml:2:7: error: an FMU of t needs initial values and a step" in result.output
    assert "there are no FMUs yet" in result.output
    assert not list(tmp_path.rglob("*.fmu"))
    assert build(tmp_path / "t.yaml", "--platform", "x86_64-linux").exit_code == 2
    assert build(tmp_path / "t.yaml", "--fmu", "--check").exit_code == 2


def test_command_writes_both_versions_without_a_compiler(tmp_path, monkeypatch):
    monkeypatch.setattr("phigen.fmu.platforms.compilers", dict)
    (tmp_path / "body.yaml").write_text(body_spec("body"), encoding="utf-8")
    result = build(tmp_path / "body.yaml", "--fmu", "-t", "numpy", "-o", tmp_path)
    assert result.exit_code == 0, result.output
    assert "sources only" in result.output
    for file, version in (("body.fmu", "3.0"), ("body-fmi2.fmu", "2.0")):
        with zipfile.ZipFile(tmp_path / "body" / file) as unit_:
            assert f'fmiVersion="{version}"' in unit_.read("modelDescription.xml").decode()
            assert {"sources/body.c", "sources/body.h", "sources/body_fmi.c"} <= set(unit_.namelist())


@pytest.mark.slow
@pytest.mark.skipif(
    "PHIGEN_ALL_PLATFORMS" not in os.environ, reason="zig first compiles C libraries, which takes minutes"
)
def test_zig_makes_libraries_for_other_platforms():
    pytest.importorskip("ziglang")
    _, files = unit("satellite")
    begins = {".so": b"\x7fELF", ".dll": b"MZ", ".dylib": b"\xcf\xfa\xed\xfe"}
    assert set(compilers()) == set(PLATFORMS)
    libraries = binaries(files, PLATFORMS)
    assert set(libraries) == set(PLATFORMS)
    for name, library in libraries.items():
        assert library.startswith(begins[PLATFORMS[name].suffix])
        assert b"fmi3DoStep" in library
        assert b"fmi2DoStep" in library


def test_inputs_are_parameters(tmp_path):
    with pytest.raises(phigen.SpecError, match=r"inputs: 'torqe' is not a parameter\n(.*\n)*.*did you mean 'torque'"):
        unit(body_spec("body", inputs="[torqe]"))


@pytest.mark.slow
def test_example_of_the_page_runs_as_it_stands(tmp_path, monkeypatch):
    page = (Path(phigen.__file__).parents[1] / "docs/fmu.md").read_text(encoding="utf-8")
    example = page.split("```python\n")[1].split("```")[0]
    _, paths = written("satellite", tmp_path, (3,))
    (tmp_path / "generated/satellite").mkdir(parents=True)
    paths[3].rename(tmp_path / "generated/satellite/satellite.fmu")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(example, names)
    assert np.ptp(names["result"]["casimirs.G"]) < 1e-14
    assert len(names["result"]) == 41
