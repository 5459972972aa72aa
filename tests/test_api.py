"""The Python API: `load`, `compile`, solvers and formulas."""

import numpy as np
import pytest
import sympy
from systems import slow_but

import phigen
from phigen import resources, spec
from phigen.api import compilation_of
from phigen.compiler import compile_spec
from phigen.geometry.system import system_from_spec
from phigen.spec import json_schema
from phigen.spec.model import Extras

OSCILLATOR = """phigen: 1
name: oscillator
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + q**4/4
order: 2
"""
RIGID_BODY = resources.bundled_specs() / "rigid_body.yaml"


@pytest.mark.parametrize("target", slow_but(["c"], ["c", "numpy"]))
def test_example_of_the_documentation(target):
    system = phigen.load(RIGID_BODY)
    solver = phigen.compile(system, target=target, order=4)
    trajectory = solver.integrate([1, 1, 1], h=0.05, steps=2_000, stride=10, I2=2.5)
    assert trajectory.t.shape == (201,)
    assert trajectory.x.shape == (201, 3)
    assert trajectory.x[0].tolist() == [1, 1, 1]
    assert trajectory.t[-1] == pytest.approx(100)
    assert np.ptp(trajectory.energy) < 1e-5 * trajectory.energy[0]
    assert np.ptp(trajectory.casimirs["C"]) < 1e-13 * 3
    one = solver.step([1, 1, 1], h=0.05, I2=2.5)
    assert one.shape == (3,)
    members = solver.ensemble(np.array([[1, 1, 1], [1, 0, 0.5]]), h=0.05, steps=2_000, I2=2.5)
    assert members.shape == (2, 3)
    assert members[0] == pytest.approx(trajectory.x[-1], rel=1e-12)


def test_load_gives_a_system_that_knows_its_spec():
    system = phigen.load(RIGID_BODY)
    assert isinstance(system, phigen.System)
    assert system.spec is not None
    assert system.spec.runs["reference"].steps == 200
    assert phigen.compile(system).order == system.spec.order


@pytest.mark.parametrize("source", [str(RIGID_BODY), RIGID_BODY, spec.load(RIGID_BODY)], ids=["text", "path", "spec"])
def test_compile_accepts_files_names_specs_and_systems(source):
    assert phigen.compile(source, target="numpy", order=2).order == 2


def test_lattices_compile_anew_to_another_order_and_are_no_system():
    compilation = phigen.api.compilation_of("fput", order=2)
    assert phigen.api.compilation_of(compilation, order=4).order.order == 4
    lattice = phigen.load("fput")
    assert isinstance(lattice, phigen.LatticeSystem)
    assert phigen.api.compilation_of(lattice, order=2).cell == compilation.cell
    with pytest.raises(phigen.SpecError, match=r"phigen\.compile accepts it"):
        system_from_spec(lattice.spec)


def from_sympy(**more):
    (x, y), k = sympy.symbols("x y"), sympy.Symbol("k", positive=True)
    return phigen.System.from_sympy(
        [x, y], [[0, x * y], [-x * y, 0]], x + k * y - sympy.log(x * y), {k: 2}, name="lv", **more
    )


def test_system_from_sympy_compiles_and_takes_parameters():
    solver = phigen.compile(from_sympy(), target="numpy", order=4)
    trajectory = solver.integrate([1, 1.5], h=0.01, steps=500, k=1)
    assert np.ptp(trajectory.energy) < 1e-7
    with pytest.raises(ValueError, match="positive"):
        solver.step([1, 1], h=0.1, k=-1)


def test_default_order_is_the_same_everywhere(tmp_path):
    """The default order is 4 for specs in files, for specs in Python, in the JSON schema and for a splitting."""
    text = "phigen: 1\nname: lv\ncoordinates: [x, y]\npoisson: {log_canonical: [[0, 1], [-1, 0]]}\nhamiltonian: x + y\n"
    (tmp_path / "lv.yaml").write_text(text)
    sources = [tmp_path / "lv.yaml", spec.loads(text), phigen.load(tmp_path / "lv.yaml"), from_sympy()]
    sources.append(spec.loads(f"{text}scheme: splitting\n"))
    orders = {phigen.compile(source, target="numpy").order for source in sources}
    assert orders == {json_schema.schema()["properties"]["order"]["default"]} == {4}
    three = spec.loads(f"{text}terms: 3\n")
    assert phigen.compile(three, target="numpy").order == phigen.compile(three, "numpy", scheme="splitting").order == 4


def test_phigen_runs_the_profile_fast_unless_the_call_names_another(tmp_path):
    """The profile of a spec concerns code that users build. With single precision there is only the profile
    ``small``.
    """
    text = "phigen: 1\nname: lv\ncoordinates: [x, y]\npoisson: {log_canonical: [[0, 1], [-1, 0]]}\nhamiltonian: x + y\n"
    (tmp_path / "lv.yaml").write_text(f"{text}profile: small\n")
    short, plain = spec.load(tmp_path / "lv.yaml"), spec.loads(text)
    assert [compile_spec(s).program.profile for s in (short, plain)] == ["small", "fast"]
    sources = [short, str(tmp_path / "lv.yaml"), phigen.load(tmp_path / "lv.yaml"), plain]
    assert {compilation_of(source).program.profile for source in sources} == {"fast"}
    assert {compilation_of(source, profile="small").program.profile for source in sources} == {"small"}
    built = compile_spec(short)
    assert compilation_of(built) is built
    assert compilation_of(built, tangent=True).program.profile == "small"
    assert compilation_of(spec.loads(f"{text}real: float\n"), profile="fast").program.profile == "small"
    with pytest.raises(ValueError, match="unknown profile 'tiny'; there are fast, small"):
        phigen.compile(plain, profile="tiny")


def test_options_of_a_call_add_to_what_the_spec_asks_for():
    text = f"{OSCILLATOR}adjoint: true\nwithout: [ensemble]\nmodified_hamiltonian: 1\nreal: float\n"
    chosen = spec.loads(text)
    parameters = frozenset({"parameters"})  # solvers in Python can change parameters
    assert compilation_of(chosen, tangent=True).program.extras == Extras(
        True, 1, frozenset({"ensemble"}), True, "float", parameters
    )
    chosen = spec.loads(f"{OSCILLATOR}tangent: true\n")
    compilation = compilation_of(chosen, adjoint=True, without=("kicks",), real="float", modified_hamiltonian=2)
    assert compilation.program.extras == Extras(True, 2, frozenset({"kicks"}), True, "float", parameters)
    again = compilation_of(compilation, order=4)
    assert (again.order.order, again.program.extras) == (4, compilation.program.extras)
    assert again.spec.written is chosen


def test_an_order_takes_the_place_of_terms_and_reaches_truncations():
    text = "coordinates: [x, y, z]\npoisson: {nambu: [x**2 + y**2 + z**4]}\nhamiltonian: x*y + z\n"
    truncated = spec.loads(f"phigen: 1\nname: t\nterms: 3\nbirealisation: {{kind: spray, spray: flat}}\n{text}")
    chosen = [compile_spec(truncated), compile_spec(truncated, order=2)]
    assert [(c.order.order, c.order.terms, c.realisation.degree) for c in chosen] == [(4, 3, 5), (2, 1, 3)]


def test_refuted_mathematics_is_not_compiled():
    x, y, z = sympy.symbols("x y z")
    system = phigen.System.from_sympy([x, y, z], [[0, z, -y * z], [-z, 0, x], [y * z, -x, 0]], x)
    with pytest.raises(phigen.CheckError, match="Jacobi identity"):
        phigen.compile(system)
    with pytest.raises(phigen.CheckError, match="F is invariant"):
        phigen.compile(from_sympy(invariants={"F": x}))


def test_name_that_is_no_c_prefix_is_refused():
    x, y = sympy.symbols("x y")
    system = phigen.System.from_sympy([x, y], [[0, 1], [-1, 0]], x * y, name="My System")
    with pytest.raises(phigen.SpecError, match="My System"):
        phigen.compile(system)


@pytest.mark.parametrize(
    ("arguments", "error"),
    [({"target": "fortran"}, ValueError), ({"order": 0}, ValueError), ({"order": 2.5}, ValueError)],
)
def test_wrong_arguments_are_refused(arguments, error):
    with pytest.raises(error):
        phigen.compile(RIGID_BODY, **arguments)
    with pytest.raises(TypeError):
        phigen.compile(3.0)


def test_auto_is_numpy_with_a_warning_without_compiler_and_c_with_one(request):
    assert phigen.compile(RIGID_BODY, order=2).target == "c"
    request.getfixturevalue("without_compiler")
    with pytest.warns(RuntimeWarning, match="using NumPy, .* no C compiler works: none of cc, gcc, clang was found"):
        assert phigen.compile(RIGID_BODY, order=2).target == "numpy"
    with pytest.raises(phigen.ToolchainError):
        phigen.compile(RIGID_BODY, target="c", order=2)


def test_a_compiler_that_is_named_is_used_or_refused(monkeypatch):
    monkeypatch.setenv("CC", "/there/is/none")
    with pytest.raises(phigen.ToolchainError, match="/there/is/none, was not found"):
        phigen.compile(RIGID_BODY, order=2)


def test_error_of_load_shows_the_line(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("phigen: 1\nname: a\ncoordinates: [x, y]\npoisson: {lie_algebra: {name: so(3)}}\nhamiltonian: x\n")
    with pytest.raises(phigen.SpecError, match=r"a\.yaml:4:"):
        phigen.load(path)


@pytest.mark.parametrize("lines", [2, 2000])
def test_error_for_a_text_in_place_of_a_file_name_names_the_right_function(lines):
    """`phigen.compile` takes a file name. If it receives the text of a spec, the error names the function for texts,
    also for a text that is too long to be a file name.
    """
    with pytest.raises(phigen.SpecError, match=r"hint: phigen\.spec\.loads"):
        phigen.compile("phigen: 1\n" * lines)


def test_formulas_are_those_of_the_method():
    """`phigen.formulas` returns α, β and S_i for log-canonical brackets as sympy expressions, which can be
    differentiated and simplified.
    """
    formulas = phigen.formulas(from_sympy(), order=4)
    (x, y), (a, b) = formulas.system.coordinates, formulas.covector
    assert formulas.degree is None
    assert formulas.hamiltonian == formulas.series[0] == formulas.system.hamiltonian
    bracket = sum(
        f.diff(q) * g.diff(p) - f.diff(p) * g.diff(q) for f, g in [formulas.alpha] for q, p in [(x, a), (y, b)]
    )
    assert sympy.simplify(bracket - formulas.alpha[0] * formulas.alpha[1]) == 0
    assert [m.subs({a: -a, b: -b}, simultaneous=True) for m in formulas.alpha] == list(formulas.beta)
    assert formulas.series[1] == 0
    assert len(phigen.formulas(from_sympy(), terms=5).series) == 5


def test_formulas_know_the_gauge_and_the_closed_form_of_phi():
    formulas = phigen.formulas(RIGID_BODY)
    (free,) = formulas.gauge.values()
    assert sympy.expand(formulas.hamiltonian - formulas.system.hamiltonian + free * formulas.system.casimirs["C"]) == 0
    x, p = sympy.Matrix(formulas.system.coordinates), sympy.Matrix(formulas.covector)
    at = dict(zip([*x, *p], [0.3, 0.5, -0.2, 0.1, -0.3, 0.2], strict=True))
    root = sympy.sqrt(p.dot(p))
    even = p.cross(p.cross(x)) * (1 - root / 2 * sympy.cot(root / 2)) / root**2
    turned = formulas.system.poisson * p
    for maps, sign in ((formulas.alpha, -1), (formulas.beta, 1)):
        assert max(abs((sympy.Matrix(maps) - x - even - sign * turned / 2).subs(at))) < 1e-15


def test_formulas_of_paths_are_series_to_a_degree():
    formulas = phigen.formulas(resources.bundled_specs() / "sir_epidemic.yaml", terms=4)
    assert formulas.degree == 3
    degrees = {sum(m) for a in formulas.alpha for m in sympy.Poly(a, *formulas.covector).monoms()}
    assert degrees == {0, 1, 2, 3}


def test_formulas_of_a_splitting_do_not_exist(tmp_path):
    (tmp_path / "lv.yaml").write_text(
        "phigen: 1\nname: lv\ncoordinates: [x, y]\npoisson: {log_canonical: [[0, 1], [-1, 0]]}\nhamiltonian: x + y\n"
        "scheme: splitting\n"
    )
    with pytest.raises(phigen.SpecError, match="no S_i"):
        phigen.formulas(tmp_path / "lv.yaml")
    with pytest.raises(ValueError, match="terms must be"):
        phigen.formulas(RIGID_BODY, terms=99)


def test_bundled_specs_have_names_here_too(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert phigen.load("rigid_body").name == "rigid_body"
    (tmp_path / "rigid_body").write_text("phigen: 1\n")  # a file has priority over a bundled spec
    with pytest.raises(phigen.SpecError):
        phigen.load("rigid_body")


@pytest.mark.parametrize("name", ["pendulum", "dnls"])
def test_a_system_says_that_runs_are_those_of_its_solver(name):
    with pytest.raises(AttributeError, match=r"phigen\.compile\(system\) has runs"):
        phigen.load(name).runs  # noqa: B018
    assert not hasattr(phigen.load(name), "no_such_name")
