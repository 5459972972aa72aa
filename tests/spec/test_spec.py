"""Reading of valid spec files: the values in the `Spec` objects."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from phigen.errors import Location, SpecError
from phigen.spec import load, loads, starter
from phigen.spec.model import CanonicalForm, LieAlgebraForm, LogCanonicalForm, MatrixForm, NambuForm, PoissonForm, Spec
from phigen.spec.names import FAMILIES
from phigen.symbolic.expression import ONE, ZERO, call, mul, neg, number, power, symbol, text
from phigen.symbolic.symbols import ELAPSED, initial, momentum

X1, X2, X3 = (symbol(f"x{i}") for i in (1, 2, 3))


def spec(**keys: str) -> Spec:
    """Return the minimal spec with some keys replaced or added."""
    minimal = {
        "phigen": "1",
        "name": "minimal",
        "coordinates": "[x1, x2, x3]",
        "poisson": "{lie_algebra: {name: so(3)}}",
        "hamiltonian": "x1**2",
    }
    return loads("".join(f"{k}: {v}\n" for k, v in (minimal | keys).items()))


def form(written: str) -> PoissonForm:
    return spec(poisson=written, parameters="{k: 2}").poisson


def test_defaults() -> None:
    specification = spec()
    assert (specification.order, specification.terms, specification.license, specification.targets) == (
        4,
        None,
        "0BSD",
        ("c", "numpy"),
    )
    assert (specification.composition, specification.gauge, specification.scheme, specification.birealisation.kind) == (
        "auto",
        "auto",
        "series",
        "auto",
    )
    assert (specification.solver.method, specification.solver.tolerance, specification.solver.max_iterations) == (
        "auto",
        None,
        20,
    )
    assert not specification.runs
    assert specification.dimension == 3


def test_terms_replace_order() -> None:
    specification = spec(terms="3")
    assert (specification.order, specification.terms) == (None, 3)


def test_matrix_is_pi() -> None:
    structure = form('[[0, -x3, "x2"], [x3, 0, -x1], [-x2, x1, 0]]'.join(["{matrix: ", "}"]))
    assert structure == MatrixForm(((ZERO, neg(X3), X2), (X3, ZERO, neg(X1)), (neg(X2), X1, ZERO)))


def test_brackets_are_completed_by_skew_symmetry() -> None:
    structure = form("{brackets: {x1: {x2: -x3}, x3: {x1: k*x2}}}")
    kx2 = mul(symbol("k"), X2)
    assert structure == MatrixForm(((ZERO, neg(X3), neg(kx2)), (X3, ZERO, ZERO), (kx2, ZERO, ZERO)))


def test_brackets_may_be_stated_twice_as_exact_negatives() -> None:
    assert form("{brackets: {x1: {x2: x3 - x1}, x2: {x1: x1 - x3}}}") == form("{brackets: {x1: {x2: x3 - x1}}}")


def test_canonical_pairs() -> None:
    assert form("{canonical: {q: [x3], p: [x1]}}") == CanonicalForm(("x3",), ("x1",))


def test_a_mapping_in_place_of_a_matrix_has_a_hint() -> None:
    with pytest.raises(SpecError, match=r"expected a list, found a mapping[^$]*a matrix is a list of its rows"):
        form("{log_canonical: {xy: 1, yz: 2}}")


def test_log_canonical_matrix_with_parameters() -> None:
    structure = form("{log_canonical: [[0, k, 1], [-k, 0, 0], [-1, 0, 0]]}")
    k, one = symbol("k"), number(1)
    assert structure == LogCanonicalForm(((ZERO, k, one), (neg(k), ZERO, ZERO), (neg(one), ZERO, ZERO)))


def test_nambu_casimirs() -> None:
    assert form("{nambu: [x1*x2]}") == NambuForm((mul(X1, X2),))


@pytest.mark.parametrize(("written", "sign"), [("", 1), (", sign: plus", 1), (", sign: minus", -1)])
def test_sign_of_a_lie_algebra(written: str, sign: int) -> None:
    assert form(f"{{lie_algebra: {{name: so(3){written}}}}}") == LieAlgebraForm(sign, "so", 3)


def test_lie_algebra_by_its_name_alone() -> None:
    assert form("{lie_algebra: so(3)}") == form("{lie_algebra: {name: so(3)}}")


def test_structure_constants_count_from_0_and_stay_as_given() -> None:
    structure = form("{lie_algebra: {structure_constants: {E1: {E2: {E3: 1}}, E3: {E1: {E2: k}}}}}")
    assert structure == LieAlgebraForm(structure_constants={0: {1: {2: ONE}}, 2: {0: {1: symbol("k")}}})


def test_matrices_of_a_lie_algebra() -> None:
    rows = ((ZERO, ONE), (ZERO, ZERO))
    structure = form("{lie_algebra: {matrices: [[[0, 1], [0, 0]], [[0, 1], [0, 0]], [[0, 1], [0, 0]]]}}")
    assert structure == LieAlgebraForm(matrices=(rows, rows, rows))


@pytest.mark.parametrize(
    ("name", "dimension"),
    [
        ("so(2)", 1), ("so(3)", 3), ("so(4)", 6), ("so(5)", 10), ("se(2)", 3), ("se(3)", 6), ("se(4)", 10),
        ("sl(2)", 3), ("sl(3)", 8), ("gl(1)", 1), ("gl(2)", 4), ("su(2)", 3), ("su(3)", 8), ("sp(2)", 3), ("sp(4)", 10),
        ("sp(6)", 21), ("heisenberg(1)", 3), ("heisenberg(2)", 5), ("aff(1)", 2), ("aff(2)", 6),
    ],
)  # fmt: skip
def test_dimension_of_a_family_is_the_number_of_coordinates(name: str, dimension: int) -> None:
    coordinates = ", ".join(f"x{i + 1}" for i in range(dimension))
    structure = spec(coordinates=f"[{coordinates}]", poisson=f"{{lie_algebra: {{name: {name}}}}}").poisson
    assert isinstance(structure, LieAlgebraForm)
    assert structure.family in FAMILIES


def test_definitions_are_substituted() -> None:
    specification = spec(definitions="{a: b**2, b: x1 + x2}", hamiltonian="a*x3")
    assert specification.hamiltonian is mul(power(X1 + X2, 2), X3)


def test_momenta_of_a_custom_birealisation_are_symbols_of_their_own() -> None:
    halves = "[x1 - p_x1/2, x2, x3]", "[x1 + p_x1/2, x2, x3]"
    choice = spec(birealisation=f"{{kind: custom, alpha: {halves[0]}, beta: {halves[1]}}}").birealisation
    assert choice.alpha == (X1 - symbol(momentum("x1")) / 2, X2, X3)
    assert choice.beta == (X1 + symbol(momentum("x1")) / 2, X2, X3)


def test_a_spray_is_a_name_or_quadratic_forms_in_the_momenta() -> None:
    assert spec(birealisation="spray").birealisation.spray == "auto"
    assert spec(birealisation="{kind: spray, spray: flat, degree: 5}").birealisation.degree == 5
    forces = spec(birealisation="{kind: spray, spray: [p_x1*p_x2, 0, x3*p_x3**2]}").birealisation.spray
    assert [str(f) for f in forces] == ["p:x1*p:x2", "0", "x3*p:x3**2"]


def test_names_with_p_are_free_without_a_custom_birealisation() -> None:
    specification = spec(coordinates="[x, p_x]", poisson="{canonical: {q: [x], p: [p_x]}}", hamiltonian="p_x**2")
    assert specification.hamiltonian is power(symbol("p_x"), 2)


RUN = "step: 0.1, initial: [1, 1/3, sqrt(2)/2]"


def test_run_numbers_are_exact() -> None:
    run = spec(runs=f"{{a: {{{RUN}, duration: 0.7, stride: 7, parameters: {{}}}}}}").runs["a"]
    assert run.initial == (1, Fraction(1, 3), Fraction(0.7071067811865476))
    assert (run.step, run.steps, run.stride) == (Fraction(1, 10), 7, 7)


def test_duration_may_be_off_by_rounding() -> None:
    keys = "initial: [1, 1, 1], step: 0.3333333333333333, duration: 1"
    assert spec(runs=f"{{a: {{{keys}}}}}").runs["a"].steps == 3


def test_initial_values_by_name_are_put_in_order() -> None:
    run = spec(runs="{a: {step: 1, steps: 1, initial: {x3: 3, x1: 1, x2: 2}}}").runs["a"]
    assert run.initial == (1, 2, 3)


def test_exact_solution_uses_time_and_initial_values() -> None:
    run = spec(parameters="{w: 1}", runs=f"{{a: {{{RUN}, steps: 1, exact: {{x1: x0_x1*cos(w*t)}}}}}}").runs["a"]
    assert run.exact == {"x1": mul(symbol(initial("x1")), call("cos", mul(symbol("w"), symbol(ELAPSED))))}


def test_references_may_be_one_or_many() -> None:
    assert spec(references="Euler 1758").references == ("Euler 1758",)
    assert spec(references="[Euler 1758, Lagrange 1788]").references == ("Euler 1758", "Lagrange 1788")


def test_text_keeps_what_comments_of_c_would_end() -> None:
    assert spec(title='"*/ int main() {"').title == "*/ int main() {"


def test_locations_are_those_of_the_parts() -> None:
    specification = loads(starter("body"), "body.yaml")
    lines = specification.source.split("\n")

    def there(*path: Any) -> str:
        place = specification.locations[path]
        assert place.file == "body.yaml"
        return lines[place.line - 1][place.column - 1 :]

    assert there("casimirs", "C").startswith("x1**2 + x2**2")
    assert there("hamiltonian") == "kinetic"
    assert there("coordinates", 1).startswith("x2")
    assert there("poisson").startswith("poisson:")
    assert there("poisson", "brackets", "x1", "x3").startswith("x2}")
    assert there("runs", "tumbling", "step").startswith("0.05")


def test_diagnostic_cites_the_nearest_part() -> None:
    specification = spec()
    exact = specification.diagnostic(("hamiltonian",), "wrong", "mend it")
    assert (exact.location, exact.source_line) == (Location(5, 14, "<string>"), "hamiltonian: x1**2")
    assert specification.diagnostic(("hamiltonian", "anything"), "wrong", "mend it") == exact
    assert specification.diagnostic(("casimirs", "C"), "wrong").location is None


def test_digest_does_not_depend_on_line_ends(tmp_path: Path) -> None:
    unix, windows = tmp_path / "unix.yaml", tmp_path / "windows.yaml"
    data = starter("body").encode()
    unix.write_bytes(data)
    windows.write_bytes(data.replace(b"\n", b"\r\n"))
    one, two = load(unix), load(windows)
    assert one.source_sha256 == two.source_sha256 == hashlib.sha256(data).hexdigest()
    assert [str(p)[-12:] for p in one.locations] == [str(p)[-12:] for p in two.locations]
    assert text(one.hamiltonian) == text(two.hamiltonian)


def test_caret_points_into_long_lines_and_past_tabs() -> None:
    from phigen.errors import Diagnostic

    line = "hamiltonian: " + "x1 + " * 100 + "\ty" + " + x2" * 100
    shown = str(Diagnostic("wrong", Location(1, line.index("y") + 1), source_line=line)).split("\n")
    assert shown[1][shown[2].index("^")] == "y"
    assert len(shown[1]) < 120


def test_reading_a_spec_imports_no_numerical_library() -> None:
    program = (
        "import sys; from phigen.spec import loads, schema, starter; loads(starter('body')); schema();"
        "print([m for m in ('numpy', 'sympy', 'mpmath', 'jinja2', 'flint') if m in sys.modules])"
    )
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"
