"""Bindings: the programs of docs/bindings.md run, and the bindings of systems with all features compile."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from tools import run, tool

import phigen
from phigen import resources
from phigen import spec as specs
from phigen.bindings.emitter import LANGUAGES, binding
from phigen.cli import bindings, group
from phigen.compiler import compile_proved, emit

ROOT = Path(__file__).parents[2]
MEX = Path(__file__).parent

#: A spec with awkward names: its name is that of a libc function, and its parameters are keywords of languages, or only
#: differ in case. It has a time and an observable, but no Casimirs.
AWKWARD = """phigen: 1
name: div
title: "a title, */ and <b>"
time: t
coordinates: [q, p]
parameters: {fn: 1, end: {value: 2, description: "*/ fn main() {}"}, a: 0.5, A: 0.25, _b: 1}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: fn*p**2/2 + end*q**2/2 + a*A*q*sin(t)*_b
observables: {speed: p}
profile: small
"""


@pytest.fixture(scope="module")
def tumbler(tmp_path_factory):
    """Return a folder with all bindings of the body in README.md."""
    folder = tmp_path_factory.mktemp("tumbler")
    text = (ROOT / "README.md").read_text(encoding="utf-8").split("```yaml\n")[1].split("```")[0]
    (folder / "tumbler.yaml").write_text(text, encoding="utf-8")
    words = [word for language in bindings.LANGUAGES for word in ("--binding", language)]
    place = ["-o", str(folder / "generated"), "-t", "numpy", "--profile", "small"]
    command = ["build", str(folder / "tumbler.yaml"), *place, *words]
    result = CliRunner().invoke(group, command)
    assert result.exit_code == 0, result.output
    return folder


def example(language):
    """Return the program in this language from docs/bindings.md."""
    return (ROOT / "docs/bindings.md").read_text(encoding="utf-8").split(f"```{language}\n")[1].split("```")[0]


def commands(after):
    """Return the shell commands under the program in this language in docs/bindings.md, as lists of words."""
    text = (ROOT / "docs/bindings.md").read_text(encoding="utf-8").split(f"```{after}\n")[1]
    return [line.split() for line in text.split("```sh\n")[1].split("```")[0].splitlines()]


def expected(folder):
    """Return the output that a program must print, computed by the NumPy solver in the same folder."""
    code = "import tumbler as b; x = b.integrate([0.01, 1, 0.01], 0.1, 300)[-1]"
    code += "; print(f'{x[0]:.6f} {b.casimirs(x)[0]:.12f}')"
    return run([sys.executable, "-c", code], folder / "generated/tumbler")


@pytest.mark.thin(2)
@pytest.mark.parametrize(
    ("language", "file", "compiler"), [("cpp", "main.cpp", "g++"), ("fortran", "main.f90", "gfortran")]
)
def test_program_of_the_page_runs(language, file, compiler, tumbler):
    tool(compiler)
    (tumbler / file).write_text(example(language), encoding="utf-8")
    for command in commands(language):
        run(command, tumbler)
    assert re.sub(r"^\.", "0.", run([tumbler / "main"], tumbler).strip()) == expected(tumbler).strip()


@pytest.mark.slow
def test_program_in_rust_runs(tumbler):
    cargo, folder = tool("cargo"), tumbler / "program"
    (folder / "src").mkdir(parents=True)
    (folder / "src/main.rs").write_text(example("rust"), encoding="utf-8")
    manifest = '[package]\nname = "program"\nversion = "0.1.0"\nedition = "2021"\n[dependencies]\n'
    (folder / "Cargo.toml").write_text(
        f'{manifest}tumbler = {{ path = "../generated/tumbler/rust" }}\n', encoding="utf-8"
    )
    assert run([cargo, "run", "--quiet", "--offline"], folder, RUSTFLAGS="-Dwarnings") == expected(tumbler)


def cell(language):
    """Return the pieces of code for a language in the table of parameters of docs/bindings.md."""
    row = re.search(
        rf"^\| {re.escape(language)} \| (.*) \|$", (ROOT / "docs/bindings.md").read_text("utf-8"), re.MULTILINE
    )
    return re.findall(r"`([^`]*)`", row[1])


@pytest.mark.slow
def test_parameters_are_set_as_the_page_says(tumbler):
    """The code of the table of parameters works in the C++ and Fortran programs of the page, and compiles in Rust."""
    run([tool("cc"), "-std=c99", "-c", "generated/tumbler/tumbler.c"], tumbler)
    declare, assign, start = cell("Fortran")
    fortran = re.sub(r"  call body%init.*", f"  {assign}\n  {start}", example("fortran"))
    (tumbler / "set.f90").write_text(fortran.replace("  real(", f"  {declare}\n  real(", 1), encoding="utf-8")
    run([tool("gfortran"), "generated/tumbler/tumbler.f90", "set.f90", "tumbler.o", "-lm", "-o", "set"], tumbler)
    (tumbler / "set.cpp").write_text(re.sub(r"    tumbler_phigen::Solver body.*", cell("C++")[0], example("cpp")))
    cpp = [tool("g++"), "-std=c++11", "-Igenerated/tumbler", "set.cpp", "tumbler.o", "-lm", "-o", "set_cpp"]
    run(cpp, tumbler)
    code = "import tumbler as b; x = b.integrate([0.01, 1, 0.01], 0.1, 300, I2=2.5)[-1]"
    code += "; print(f'{x[0]:.6f} {b.casimirs(x)[0]:.12f}')"
    moved = run([sys.executable, "-c", code], tumbler / "generated/tumbler").strip()
    assert moved != expected(tumbler).strip()
    assert {re.sub(r"^\.", "0.", run([tumbler / p], tumbler).strip()) for p in ("set", "set_cpp")} == {moved}
    declared, call = cell("Rust")
    rust = f"pub fn f() -> Result<(), tumbler::Error> {{ use tumbler::*; {declared} let _ = {call}; Ok(()) }}"
    folder = tumbler / "set_rust"
    (folder / "src").mkdir(parents=True)
    (folder / "src/lib.rs").write_text(rust, encoding="utf-8")
    manifest = '[package]\nname = "set"\nversion = "0.1.0"\nedition = "2021"\n[dependencies]\n'
    place = 'tumbler = { path = "../generated/tumbler/rust" }\n'
    (folder / "Cargo.toml").write_text(f"{manifest}{place}", encoding="utf-8")
    run([tool("cargo"), "check", "--quiet", "--offline"], folder)


#: Calls of the MEX gateway: the states of the page, omitted outputs, and refused arguments. `ANSWERS` is what Octave
#: prints.
GATEWAY = """format long
[x, H, C] = tumbler_mex([0.01 1 0.01], 0.1, 300, 10);
printf("%d %d %d %d\\n", size(x), size(H, 2), size(C, 2));
printf("%.6f %.12f\\n", x(1, end), C(end));
again = tumbler_mex([0.01 1 0.01], 0.1, 300, 300, struct("I2", 2, "I3", 3));
printf("%d\\n", isequal(again(:, end), x(:, end)));
moved = tumbler_mex([0.01 1 0.01], 0.1, 300, 300, struct("I2", 2.5));
printf("%d\\n", isequal(moved(:, end), x(:, end)));
parts = tumbler_mex([0.01 1 0.01], 0.1, [100 200], 100, struct("I2", {2, 2.5}));
first = tumbler_mex([0.01 1 0.01], 0.1, 100, 100);
second = tumbler_mex(first(:, end), 0.1, 200, 200, struct("I2", 2.5));
printf("%d %d\\n", columns(parts), norm(parts(:, end) - second(:, end)) < 1e-13);
function refused(varargin)
  try, tumbler_mex(varargin{:}); catch e, disp(e.message), end
end
refused([1 2], 0.1, 3, 1);
refused([1 2 3], 0.1, 3, 1, struct("Q", 2));
refused([1 2 3], 0.1, 3, 1, struct("I1", [1 2]));
refused([1 2 3], 0.1, 3, 0);
refused([1 2 3], 0.1, [3 3], 1, struct("I1", 2));
refused([1 2 3], 0.1, [3 3], 2, struct("I1", {2, 3}));
refused([NaN 2 3], 0.1, 3, 1);
refused([1 2 3], 100, 30, 1);
"""
ANSWERS = """3 31 31 31
{expected}1
0
4 1
tumbler_mex: x0 has 3 real numbers
tumbler_mex: there is no parameter Q: the spec has I1, I2, I3
tumbler_mex: I1 is one real number
tumbler_mex: stride is a whole number, at least 1
tumbler_mex: parameters needs as many structs as steps has numbers
tumbler_mex: each number of steps is a multiple of stride
tumbler_mex: bad argument: a null pointer, or values that are not allowed
tumbler_mex: no convergence: the step is too large, after 0 steps
"""


@pytest.mark.slow
def test_gateway_runs_in_octave(tumbler):
    """Octave has the MEX interface of MATLAB."""
    octave = tool("octave-cli")
    place = "generated/tumbler"
    gateway = [tool("mkoctfile"), "--mex", f"-I{place}", f"{place}/tumbler_mex.c", f"{place}/tumbler.c"]
    run(gateway, tumbler)
    (tumbler / "gateway.m").write_text(GATEWAY, encoding="utf-8")
    answers = run([octave, "--quiet", "--no-gui", "--eval", "source('gateway.m')"], tumbler)
    assert answers == ANSWERS.format(expected=expected(tumbler))


MORE = [pytest.param(name, marks=pytest.mark.slow) for name in ("satellite", "thermal_spin", "kepler_eccentric")]


@pytest.mark.parametrize("source", [AWKWARD, *MORE])
def test_bindings_compile_for_systems_of_all_kinds(source, tmp_path):
    spec = specs.loads(source) if "\n" in source else specs.load(resources.file_of(source))
    compilation = compile_proved(spec, profile="small").including("parameters")
    name = spec.name
    for file, text in emit(compilation.program, "c", "x").items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    for language in LANGUAGES:
        for file, text in binding(compilation, language).items():
            (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / file).write_text(text, encoding="utf-8")
    warnings = ["-Wall", "-Wextra", "-Werror", "-fsyntax-only"]
    run([tool("g++"), "-std=c++11", "-x", "c++", *warnings, f"{name}.hpp"], tmp_path)
    run([tool("gcc"), "-std=c99", *warnings, f"-I{MEX}", f"{name}_mex.c"], tmp_path)
    run(
        [tool("rustc"), "--edition=2021", "--crate-type=rlib", "--emit=metadata", "-Dwarnings", "rust/src/lib.rs"],
        tmp_path,
    )
    run(
        [
            tool("gfortran"),
            "-std=f2018",
            "-Wall",
            "-Werror",
            "-Wno-unused-dummy-argument",
            "-fsyntax-only",
            f"{name}.f90",
        ],
        tmp_path,
    )
    julia = (tmp_path / f"{name}.jl").read_text(encoding="utf-8")
    symbols = set(re.findall(rf":({name}_\w+), library", julia))
    assert symbols <= set(re.findall(rf"\b{name}_\w+", (tmp_path / f"{name}.h").read_text(encoding="utf-8")))


#: A body in a fluid, whose attitude is a quaternion followed by a position.
FLUID = """phigen: 1
name: hull
coordinates: [m1, m2, m3, p1, p2, p3]
poisson: {lie_algebra: {name: se(3), sign: minus}}
hamiltonian: m1**2/2 + m2**2/4 + m3**2/6 + p1**2/2 + p2**2/3 + p3**2/4
order: 2
profile: small
reconstruct: quaternion
"""
#: Programs by language that set an attitude and a position, print them, and print whether a quaternion of 0 is refused.
SETTERS = {
    "cpp": """#include <cstdio>
#include "hull.hpp"
int main()
{
    hull_phigen::Solver hull({1, 2, 3, 4, 5, 6});
    hull.set_attitude({0, 3, 0, 4, 5, 6, 7});
    for (double value : hull.attitude()) std::printf("%.1f ", value);
    try { hull.set_attitude({0, 0, 0, 0, 5, 6, 7}); } catch (const hull_phigen::Error &) { std::printf("refused"); }
}
""",
    "fortran": """program main
  use hull_phigen
  type(hull_solver) :: hull
  integer :: status
  call hull%init([1, 2, 3, 4, 5, 6]*1.0_hull_real)
  call hull%set_attitude([0, 3, 0, 4, 5, 6, 7]*1.0_hull_real)
  write (*, "(*(f3.1, 1x))", advance="no") hull%attitude()
  call hull%set_attitude([0, 0, 0, 0, 5, 6, 7]*1.0_hull_real, status)
  if (status /= hull_ok) print "(a)", "refused"
end program
""",
    "rust": """include!("rust/src/lib.rs");
extern crate std;
fn main() {
    let mut hull = Solver::new(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], &Parameters::default()).unwrap();
    hull.set_attitude(&[0.0, 3.0, 0.0, 4.0, 5.0, 6.0, 7.0]).unwrap();
    for value in hull.attitude() { std::print!("{value:.1} ") }
    if hull.set_attitude(&[0.0, 0.0, 0.0, 0.0, 5.0, 6.0, 7.0]).is_err() { std::print!("refused") }
}
""",
}


def written(source, programs, folder):
    """Write the C and the bindings of a system, compile a program for each language to ``by_LANGUAGE``, and return the
    compilation.
    """
    compilation = compile_proved(specs.loads(source)).including("parameters")
    name = compilation.spec.name
    for file, text in emit(compilation.program, "c", "x").items():
        (folder / file).write_text(text, encoding="utf-8")
    for language, program in programs.items():
        for file, text in binding(compilation, language).items():
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            (folder / file).write_text(text.replace("//! ", "// ").replace("#![", "// #!["), encoding="utf-8")
        (folder / f"main.{language}").write_text(program, encoding="utf-8")
    run([tool("gcc"), "-std=c99", "-ffp-contract=off", "-c", f"{name}.c"], folder)
    library = [f"{name}.o", "-lm", "-o"]
    run([tool("g++"), "-std=c++11", "-x", "c++", "main.cpp", "-x", "none", *library, "by_cpp"], folder)
    run([tool("gfortran"), "-x", "f95", f"{name}.f90", "main.fortran", "-x", "none", *library, "by_fortran"], folder)
    linked = [f"-Clink-arg={name}.o", "-Clink-arg=-lm", "-o", "by_rust"]
    run([tool("rustc"), "--edition=2021", "-Adead_code", "main.rust", *linked], folder)
    return compilation


@pytest.mark.slow
def test_attitudes_and_positions_can_be_set(tmp_path):
    written(FLUID, SETTERS, tmp_path)
    for language in SETTERS:
        assert run([tmp_path / f"by_{language}"], tmp_path).strip() == "0.0 0.6 0.0 0.8 5.0 6.0 7.0 refused"


SWING = """phigen: 1
name: swing
coordinates: [q, p]
parameters: {g: {value: 1, positive: true}}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - g*cos(q)
scheme: gauss
order: 4
profile: small
"""
#: Programs by language that change a parameter of a running solver, interpolate, and print whether wrong calls are
#: refused.
CHANGES = {
    "cpp": """#include <cstdio>
#include "swing.hpp"
int main()
{
    swing_phigen::Solver s({1, 0});
    s.integrate(0.1, 3);
    swing_phigen::Parameters p = s.parameters();
    p.g = 2;
    s.set_parameters(p);
    try { s.interpolate({0.5}); } catch (const swing_phigen::Error &) { std::printf("refused "); }
    s.integrate(0.1, 3);
    for (const auto &x : s.interpolate({0.5, 1})) std::printf("%.12f %.12f ", x[0], x[1]);
    std::printf("%.12f %.12f %.12f %zu ", s.state()[0], s.state()[1], s.hamiltonian(), s.steps_done());
    p.g = -1;
    try { s.set_parameters(p); } catch (const swing_phigen::Error &) { std::printf("refused"); }
}
""",
    "fortran": """program main
  use swing_phigen
  type(swing_solver) :: s
  type(swing_params) :: p
  integer :: status
  real(swing_real) :: x(2, 2)
  call s%init([1, 0]*1.0_swing_real)
  call s%integrate(0.1_swing_real, 3)
  p%g = 2
  call s%set_parameters(p)
  call s%interpolate([0.5_swing_real], x(:, :1), status)
  if (status /= swing_ok) write (*, "(a)", advance="no") "refused "
  call s%integrate(0.1_swing_real, 3)
  call s%interpolate([0.5_swing_real, 1.0_swing_real], x)
  write (*, "(7(f15.12, 1x), i0, 1x)", advance="no") x, s%state(), s%hamiltonian(), s%steps_done()
  p%g = -1
  call s%set_parameters(p, status)
  if (status /= swing_ok .and. s%hamiltonian() < -1) print "(a)", "refused"
end program
""",
    "rust": """include!("rust/src/lib.rs");
extern crate std;
fn main() {
    let mut s = Solver::new(&[1.0, 0.0], &Parameters::default()).unwrap();
    s.integrate(0.1, 3).unwrap();
    s.set_parameters(&Parameters { g: 2.0 }).unwrap();
    if s.interpolate(&[0.5]).is_err() { std::print!("refused ") }
    s.integrate(0.1, 3).unwrap();
    for x in s.interpolate(&[0.5, 1.0]).unwrap() { std::print!("{:.12} {:.12} ", x[0], x[1]) }
    let (x, g) = (s.state(), Parameters { g: 2.0 });
    std::print!("{:.12} {:.12} {:.12} {} ", x[0], x[1], hamiltonian(&g, &x), s.steps_done());
    if s.set_parameters(&Parameters { g: -1.0 }).is_err() { std::print!("refused") }
}
""",
}


@pytest.mark.slow
def test_parameters_of_a_running_solver_can_be_changed(tmp_path):
    compilation = written(SWING, CHANGES, tmp_path)
    solver = phigen.compile(compilation.spec)
    before = solver.integrate([1, 0], h=0.1, steps=3).x[-1]
    x = solver.integrate(before, h=0.1, steps=3, g=2).x
    half = solver.integrate(x[-2], h=0.05, steps=1, g=2).x[-1]
    energy = x[-1, 1] ** 2 / 2 - 2 * np.cos(x[-1, 0])
    for language in CHANGES:
        first, *numbers, steps, last = run([tmp_path / f"by_{language}"], tmp_path).split()
        assert (first, steps, last) == ("refused", "6", "refused"), language
        printed_numbers = np.array([float(number) for number in numbers])
        assert np.abs(printed_numbers - [*half, *x[-1], *x[-1], energy]).max() < 1e-6, language
        assert np.abs(printed_numbers[2:] - [*x[-1], *x[-1], energy]).max() < 3e-12, language


def test_hand_edits_stay_and_lattices_are_refused(tumbler):
    path = tumbler / "generated/tumbler/tumbler.hpp"
    text = path.read_text(encoding="utf-8")
    path.write_text(text + "// mine\n", encoding="utf-8")
    words = [
        "build",
        str(tumbler / "tumbler.yaml"),
        "-o",
        str(tumbler / "generated"),
        "-t",
        "numpy",
        "--profile",
        "small",
    ]
    result = CliRunner().invoke(group, [*words, "--binding", "cpp"])
    path.write_text(text, encoding="utf-8")
    assert result.exit_code == 5
    assert "edited by hand" in result.output
    refused = CliRunner().invoke(group, ["build", "toda", "-o", str(tumbler), "-t", "numpy", "--binding", "rust"])
    assert refused.exit_code == 1
    assert "there are no bindings yet" in refused.output


def test_bindings_are_refused_without_the_function_that_they_call(tmp_path):
    (tmp_path / "div.yaml").write_text(AWKWARD + "without: [parameters]\n", encoding="utf-8")
    command = ["build", str(tmp_path / "div.yaml"), "-o", str(tmp_path), "-t", "c", "--binding", "rust"]
    refused = CliRunner().invoke(group, command)
    assert refused.exit_code == 1
    assert "div.yaml:11:1: error: --binding rust needs div_set_parameters, which `without` leaves out" in refused.output
    assert "hint: leave out --binding, or the parameters of `without`" in refused.output
    assert not (tmp_path / "div").exists()


def test_check_is_about_bindings_and_the_function_that_they_call(tmp_path):
    """With --binding, the C of the profile small has set_parameters, and its header names the command with this option.
    So --check must be called with the same option.
    """
    (tmp_path / "swing.yaml").write_text(SWING, encoding="utf-8")
    words = ["build", str(tmp_path / "swing.yaml"), "-o", str(tmp_path)]

    def outcome(*more):
        return CliRunner().invoke(group, [*words, *more]).exit_code

    assert outcome("--binding", "julia") == 0
    c, module = tmp_path / "swing/swing.c", tmp_path / "swing/swing.jl"
    assert "phigen build swing.yaml --binding julia" in c.read_text(encoding="utf-8")
    assert "swing_set_parameters(" in c.read_text(encoding="utf-8")
    assert outcome("--binding", "julia", "--check") == 0
    assert outcome("--check") == 5
    module.write_text(module.read_text(encoding="utf-8") + "# more\n", encoding="utf-8")
    assert outcome("--binding", "julia", "--check") == 5
    assert outcome() == 0
    assert "swing_set_parameters(" not in c.read_text(encoding="utf-8")


def test_command_line_knows_all_languages():
    assert set(bindings.LANGUAGES) == set(LANGUAGES)
