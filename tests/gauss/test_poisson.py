"""Gauss steps with `structure: exact` are Poisson maps for steps of any size. Steps with `structure: to truncation` are
Poisson maps only up to the truncation error, and phigen says so.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
from support import BODY, SCALED, SPECIES, compile_text, compiled, first_run, slow_but, solver, spec_of

from phigen.compiler import compile_spec, emit, examine
from phigen.errors import SpecError
from phigen.geometry.families import named
from phigen.spec import loads

#: Systems with each kind of algebra: so(3), se(3), two copies of so(3), so(3) ⋉ 2R³, nilpotent, affine, direct sums,
#: constant brackets, and brackets that are constant in logarithms.
EXACT = (
    "rigid_body", "kowalevski_gauss", "so4_manakov", "satellite", "toda3", "engel_geodesics", "maxwell_bloch",
    "spin_chain5", "henon_heiles", "volterra5",
)  # fmt: skip

MIXED = """coordinates: [x, y, z, q, p]
poisson: {brackets: {x: {y: z, z: -y}, y: {z: x}, q: {p: 1}}}
hamiltonian: x**2/2 + y**2/3 + z**2/5 + p**2/2 + q**2/2 + cos(q)*x + sin(q)*y*z/4
casimirs: {C: x**2 + y**2 + z**2}
"""
SHIFTED = """coordinates: [x, y, z]
poisson: {brackets: {x: {y: z + 2, z: -y}, y: {z: x - 1}}}
hamiltonian: exp(x/3) + y**2*z/5 + sin(z)
casimirs: {C: (x - 1)**2 + y**2 + (z + 2)**2}
"""
OSCILLATOR = """coordinates: [n, q, p]
poisson: {brackets: {n: {q: p, p: -q}, q: {p: 1}}}
hamiltonian: n**2/2 + q**3/5 + n*p/3
casimirs: {C: n + (q**2 + p**2)/2}
"""
#: Brackets that are constant in logarithms, combined with constant brackets and so(3). In the start one coordinate is
#: negative, and one is 0.
LOGARITHMS = """coordinates: [x, y, n, w, u, q, p, a, b, c]
poisson:
  brackets: {x: {y: x*y, n: x*n/3}, y: {n: y*n}, w: {u: -w}, q: {p: 1}, a: {b: -c, c: b}, b: {c: -a}}
hamiltonian: >-
  x - log(x) - y - log(-y) + n + u**2/2 + w - log(w) + p**2/2 + q**2/2 + a**2/2 + b**2/4 + c**2/6 + (a + x)*q/5
"""
STARTS = {
    "logarithms": (LOGARITHMS, [0.4, -0.8, 0.0, 0.6, 0.3, 0.7, 0.2, 0.5, -0.4, 0.6]),
    "mixed": (MIXED, [0.4, -0.8, 0.5, 0.3, 0.7]),
    "shifted": (SHIFTED, [0.4, -0.8, 0.5]),
    "oscillator": (OSCILLATOR, [0.4, -0.8, 0.5]),
    "scaled": (SCALED, [0.3, -0.2, 0.4]),
}


def of(spec, order, target="numpy", **more):
    """Return a Gauss solver with tangent maps for a spec."""
    variant = replace(spec, reconstruct="", composition="auto", **more)
    return solver(compile_spec(variant.overridden(order=order, scheme="gauss", tangent=True)), target)


def defect(method, x, h, poisson):
    """Return the largest entry of DΦ π DΦᵀ − π∘Φ relative to that of π∘Φ, for one step Φ from x. It is at round-off for
    a Poisson map.
    """
    following, tangent = method.step_tangent(x, h)
    after = poisson(following)
    return np.abs(tangent @ poisson(x) @ tangent.T - after).max() / np.abs(after).max()


def poisson_of(spec):
    """Return π as a function of x that returns a NumPy array."""
    import sympy

    from phigen.geometry.system import system_from_spec

    system = system_from_spec(spec).to_sympy()
    matrix = system.poisson.subs(system.parameters)
    f = sympy.lambdify([list(system.coordinates)], matrix, "numpy")
    return lambda x: np.array(f(x), dtype=float)


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", slow_but(("rigid_body", "so4_manakov", "toda3", "maxwell_bloch"), EXACT))
def test_step_of_any_size_is_a_poisson_map(name):
    spec = spec_of(name)
    run = next(iter(spec.runs.values()))
    x = np.array([float(v) for v in run.initial]) + 0.1 * np.sin(np.arange(1, spec.dimension + 1))
    h = float(run.step) * (1 if name == "kowalevski_gauss" else 8)
    for order in (2, 8):
        assert defect(of(spec, order), x, h, poisson_of(spec)) <= 2e-13


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", STARTS)
def test_written_systems_step_by_poisson_maps(name):
    text, start = STARTS[name]
    spec = loads(f"phigen: 1\nname: t\n{text}scheme: gauss\n")
    method = of(spec, 2)
    assert defect(method, np.array(start), 0.5, poisson_of(spec)) <= 2e-14
    moved = method.integrate(start, 0.25, 80)
    for values in moved.casimirs.values():
        assert np.ptp(values) <= 2e-13
    # the energy error of a symplectic method of order 2 oscillates: it is not zero and does not grow
    assert 1e-6 < np.ptp(moved.energy) < 0.3 * (1 + np.abs(moved.energy).max())


#: Matrix algebras with their dimensions. so(5) preserves a symmetric form and sp(4) a skew one, su(3) is complex, sl(3)
#: and gl(3) preserve no form.
MATRICES = {"sl(3)": 8, "su(3)": 8, "sp(4)": 10, "so(5)": 10, "gl(3)": 9}


@pytest.mark.thin(1)
@pytest.mark.parametrize("name", slow_but(("su(3)",), MATRICES))
def test_matrix_algebras_step_by_poisson_maps(name):
    n = MATRICES[name]
    names = [f"x{i}" for i in range(1, n + 1)]
    energy = " + ".join([f"{c}**2/{k + 2}" for k, c in enumerate(names)] + ["x1*x2*x3/4 + sin(x4)"])
    text = f"coordinates: {names}\npoisson: {{lie_algebra: {{name: {name}, sign: minus}}}}\nhamiltonian: {energy}\n"
    spec = loads(f"phigen: 1\nname: t\n{text}scheme: gauss\n")
    x = 0.5 * np.sin(1.0 + np.arange(n))
    assert defect(of(spec, 2), x, 0.15, poisson_of(spec)) <= 1e-13


@pytest.mark.slow
def test_algebras_without_known_matrices_step_by_poisson_maps():
    """In a scaled basis of so(5) phigen does not recognise the matrices; it uses a quotient of the enveloping algebra
    instead, and steps are still Poisson maps.
    """
    lie, factors = named("so", 5), [1, 2, -1, 3, 1, 2, 1, -1, 3, 2]
    brackets = {
        f"x{i + 1}": {
            f"x{j + 1}": " + ".join(
                f"({c.value * factors[i] * factors[j] / factors[k]})*x{k + 1}" for k, c in lie.bracket(i, j).items()
            )
            for j in range(i + 1, 10)
            if lie.bracket(i, j)
        }
        for i in range(9)
    }
    names = [f"x{k}" for k in range(1, 11)]
    energy = " + ".join([f"{c}**2/{k + 2}" for k, c in enumerate(names)] + ["x1*x2*x3/4"])
    text = f"coordinates: {names}\npoisson: {{brackets: {brackets}}}\nhamiltonian: {energy}\nscheme: gauss\n"
    spec = loads(f"phigen: 1\nname: t\n{text}".replace("'", '"'))
    assert defect(of(spec, 2), 0.3 * np.sin(1.0 + np.arange(10)), 0.1, poisson_of(spec)) <= 1e-14


def test_direct_step_is_no_poisson_map_and_says_so():
    """For the rigid body the defect DΦ π DΦᵀ − π∘Φ is far above rounding, and label and generated code say that the
    step is no Poisson map.
    """
    spec = replace(spec_of("rigid_body"), structure="to truncation")
    compilation = compile_spec(spec.overridden(order=4, scheme="gauss", tangent=True))
    x = np.array([0.4, -0.8, 0.5])
    assert defect(solver(compilation, "numpy"), x, 0.8, poisson_of(spec)) > 1e-7
    assert not compilation.poisson
    assert "no Poisson map" in compilation.label or "truncation" in compilation.label
    (text,) = [t for n, t in _emitted(compilation).items() if n.endswith(".c")]
    assert "A Poisson" not in text
    assert "no Poisson map" in text


@pytest.mark.parametrize("monitor", ["", "monitor: 1 + x1**2\n"])
def test_nothing_that_is_written_calls_steps_to_truncation_poisson_maps(monitor):
    from phigen.notation.collocation import lines

    compilation = compile_spec(loads(f"phigen: 1\nname: t\n{BODY}{monitor}scheme: gauss\nstructure: to truncation\n"))
    texts = [compilation.label, *compilation.notes, *lines(compilation)]
    for target in ("c", "numpy", "js"):
        texts += emit(compilation.program, target, "phigen build").values()
    written = " ".join(" ".join(texts).split())
    denied = len(re.findall(r"\b(?:no|not a) Poisson map", written))
    assert 0 < denied == written.count("Poisson map")
    assert "measures it" in compilation.notes[-1]


def _emitted(compilation):
    return emit(compilation.program, "c", "phigen build")


def test_direct_step_keeps_quadratic_casimirs():
    spec = replace(spec_of("rigid_body"), structure="to truncation")
    run = solver(compile_spec(spec.overridden(order=4, scheme="gauss")), "numpy").integrate([0.4, -0.8, 0.5], 0.5, 100)
    assert np.ptp(run.casimirs["C"]) <= 5e-15


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", ["numpy", "c"])
def test_casimirs_do_not_drift(target):
    """Over many long steps the errors of Casimirs grow like the square root of the number of steps, as rounding errors
    do.
    """
    steps = 300 if target == "numpy" else 20_000
    method = solver(compiled("so4_manakov", 8, "gauss"), target)
    x0 = [float(v) for v in first_run(compiled("so4_manakov", 8, "gauss")).initial]
    run = method.integrate(x0, 4.0, steps, stride=10)
    for values in run.casimirs.values():
        assert np.ptp(values) <= 2e-15 * np.sqrt(steps) * np.abs(values).max()


@pytest.mark.thin(2)
@pytest.mark.parametrize("order", [2, 4, 6, 8])
def test_order_is_that_of_the_method(order):
    """Errors on a nonlinear problem decrease by 2^order if the step is halved, for steps with errors far above
    rounding.
    """
    text, start = STARTS["shifted"]
    compilation = compile_text(f"{text}scheme: gauss\n", order)
    method = solver(compilation, "c")
    exact = solver(compile_text(f"{text}scheme: gauss\n", 16), "c").integrate(start, 0.05, 48).x[-1]
    errors = [np.abs(method.integrate(start, 2.4 / n, n).x[-1] - exact).max() for n in (256 // order, 512 // order)]
    assert errors[1] > 1e-15
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.25)


def test_signs_stay_and_zeros_stay_with_logarithms():
    text, start = STARTS["logarithms"]
    run = of(loads(f"phigen: 1\nname: t\n{text}scheme: gauss\n"), 4).integrate(start, 0.1, 50)
    assert np.all(run.x[:, 0] > 0)
    assert np.all(run.x[:, 1] < 0)
    assert np.all(run.x[:, 2] == 0)
    assert np.ptp(run.x[:, 0]) > 0.1


def test_check_proves_that_brackets_of_logarithms_are_constant():
    spec = replace(spec_of("volterra5"), scheme="gauss", composition="auto")
    statements = examine(spec).groups["Gauss collocation, in logarithms"]
    assert any("log v1" in s.name and s.verdict == "proved" for s in statements)


def test_check_proves_the_momentum_map_of_a_step():
    statements = examine(spec_of("kowalevski_gauss")).groups["Gauss collocation, collective"]
    assert {s.verdict for s in statements} == {"proved", "checked numerically"}
    assert any("quadratic momentum map" in s.name and s.verdict == "proved" for s in statements)


def test_a_vector_force_moves_a_coordinate_without_brackets():
    compiled_system = compile_text(
        "coordinates: [q, p, z]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: q**2/2 + p**2/2 + z*q\n"
        "forces: {vector: {z: -z/2}}\nscheme: gauss\norder: 16\n"
    )
    assert {s.verdict for s in examine(compiled_system.spec).statements} <= {"proved", "checked numerically"}
    end = solver(compiled_system, "c").integrate([0.3, 0.2, 0.8], 0.25, 4).x[-1]
    assert end[2] == pytest.approx(0.8 * np.exp(-0.5), rel=1e-13)


#: A bracket that is neither constant nor linear, and not constant in logarithms of the coordinates either.
CURVED = "coordinates: [x, y, z]\npoisson: {brackets: {x: {y: x*y + z**2}}}\nhamiltonian: x**2 + y**2\n"
#: The bracket {u, v} = uv of u = x + y and v = x − y, written in x and y: it is constant in log u and log v, but phigen
#: does not find this linear change of coordinates.
HIDDEN = (
    "coordinates: [x, y]\npoisson: {brackets: {x: {y: (y**2 - x**2)/2}}}\nhamiltonian: x**2 + y**4\nscheme: gauss\n"
)
#: A solvable Lie algebra for which phigen knows no associative algebra with an involution.
SOLVABLE = "coordinates: [x, y, z]\npoisson: {brackets: {x: {y: y + z, z: z}}}\nhamiltonian: x**2 + y\nscheme: gauss\n"
REFUSED = {
    "hidden logarithms": (HIDDEN, "no exact Poisson map is known", "use linear combinations"),
    "solvable": (SOLVABLE, "no exact Poisson map is known", "a basis with fewer structure constants"),
    "structure": (f"{CURVED}scheme: gauss\n", "no exact Poisson map is known", "to truncation"),
    "noise": (f"{BODY}noise: {{w: {{hamiltonian: x1}}}}\nscheme: gauss\n", "not with noise", "series"),
    "monitor": (f"{BODY}monitor: log\nscheme: gauss\n", "log needs H = A + B split in two", "splitting"),
    "modified": (f"{BODY}modified_hamiltonian: 1\nscheme: gauss\n", "belongs to scheme: series", "remove"),
    "attitude to truncation": (
        f"{BODY}reconstruct: quaternion\nscheme: gauss\nstructure: to truncation\n",
        "needs the rotation that a step makes",
        "exact",
    ),
    "matrix": (f"{BODY}reconstruct: matrix\nscheme: gauss\n", "a quaternion, not a matrix", "quaternion"),
    "attitude with covectors": (
        f"{BODY}reconstruct: quaternion\nforces: {{covector: {{x1: x2}}}}\nscheme: gauss\n",
        "covector",
        "series",
    ),
    "composition": (f"{BODY}composition: suzuki\nscheme: gauss\n", "compositions are not offered", "order"),
    "terms": (f"{BODY}terms: 3\nscheme: gauss\n", "belongs to scheme: series", "remove"),
    "birealisation": (f"{BODY}birealisation: cayley\nscheme: gauss\n", "belongs to scheme: series", "remove"),
    "tolerance": (f"{BODY}solver: {{tolerance: 1e-9}}\nscheme: gauss\n", "round-off", "remove"),
    "force": (f"{BODY}forces: {{vector: {{x1: -x1}}}}\nscheme: gauss\n", "vector force on x1", "to truncation"),
    "structure of another scheme": (f"{BODY}structure: exact\nscheme: series\n", "belongs to scheme: gauss", "remove"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_not_offered_is_refused_with_its_place_and_a_hint(case):
    text, message, hint = REFUSED[case]
    with pytest.raises(SpecError) as refused:
        compile_spec(loads(f"phigen: 1\nname: t\n{text}"))
    (diagnostic,) = refused.value.diagnostics
    assert message in diagnostic.message
    assert hint in diagnostic.hint
    assert diagnostic.location is not None


def test_lattices_are_refused():
    text = "coordinates: [q, p]\nlattice: {axes: [i]}\npoisson: {canonical: {q: [q], p: [p]}}\n"
    text += "hamiltonian: p**2/2 + (q[i+1] - q)**2/2\nscheme: gauss\n"
    with pytest.raises(SpecError, match="not for lattices"):
        compile_spec(loads(f"phigen: 1\nname: t\n{text}"))


def test_verify_measures_the_defect_of_a_step_to_truncation(tmp_path):
    """For `structure: to truncation`, `phigen verify` reports that the defect DΦ π DΦᵀ − π∘Φ is O(h^(order+1)), and
    requires no Poisson map.
    """
    from click.testing import CliRunner

    from phigen.cli import group

    file = tmp_path / "t.yaml"
    run = "runs: {r: {initial: [1, 0.5, 0.8], step: 0.2, steps: 60}}\n"
    method = "scheme: gauss\nstructure: to truncation\norder: 4\ntargets: [numpy]\n"
    text = f"phigen: 1\nname: t\n{SPECIES}{method}{run}"
    file.write_text(text, encoding="utf-8")
    result = CliRunner().invoke(group, ["verify", str(file)])
    assert result.exit_code == 0, result.output
    assert "O(h^5)" in result.output
