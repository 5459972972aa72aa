"""Address spaces in the generated code for devices; these tests need no driver."""

import re

import pytest
from support import COMMAND, compile_text
from systems import as_given, slow_but, small

from phigen.compiler import emit
from phigen.targets.device.dialect import DEVICES_ONLY, qualified

#: Systems: one for each kind of step, with time, with noise and with a monitor, and a lattice.
KINDS = (
    *("pendulum_euler", "lotka_volterra", "kepler_eccentric", "nambu_pendulum", "kowalevski_gauss"),
    *("seasonal_predator_prey", "thermal_spin", "fput"),
)
CORPUS = (*KINDS, "comet_jupiter", "kepler", "satellite", "food_web", "kdv", "tilted_film")


@pytest.mark.parametrize("name", slow_but(KINDS, dict.fromkeys(CORPUS)))
def test_all_objects_of_a_file_have_an_address_space(name):
    """In the generated code each function has the qualifier of functions, and each table that of constants. Emission
    raises `ValueError` for other objects at file scope.
    """
    (text,) = emit(small(as_given(name)).program, "device", COMMAND).values()
    assert "PHI_" not in text
    objects = text[text.index(DEVICES_ONLY) :]
    spelt = re.findall(rf"^{name}_(CONSTANT|FUNCTION) [^=;{{]*([=;{{])", objects, re.MULTILINE)
    for qualifier, end in spelt:
        assert (qualifier == "CONSTANT") == (end == "=")


@pytest.mark.parametrize("line", ["double n_last;", "const double *n_rows[2] = { 0, 0 };", "static int n_calls = 0;"])
def test_objects_without_an_address_space_are_errors(line):
    with pytest.raises(ValueError, match="without an address space"):
        qualified([DEVICES_ONLY, line], "n")


def test_a_static_table_in_a_function_is_an_error():
    with pytest.raises(ValueError, match="without an address space"):
        qualified([DEVICES_ONLY, "static int n_f(void)", "{", "    static const int a[1] = { 0 };", "}"], "n")


def test_tables_whose_sizes_have_casts_are_no_functions():
    lines = [DEVICES_ONLY, "static const double n_a[2 * (int)n_B][3] = { { 0.0 } };", "static int n_f(void);"]
    assert qualified(lines, "n")[1:] == [
        "n_CONSTANT double n_a[2 * (int)n_B][3] = { { 0.0 } };",
        "n_FUNCTION int n_f(void);",
    ]


SPINS = """
lattice: {axes: [i], boundary: periodic}
coordinates: [x, y, z]
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: y**2/3 + x*x[i+1]
scheme: series
order: 2
"""


@pytest.mark.parametrize("real", ["", "real: float\n"])
def test_no_phrase_of_the_runtime_is_left_in_functions_of_lattices(real):
    """No macro of the C runtime (PHI_…) is left in the code of implicit steps of spins, which has local tables and
    unrolled loops.
    """
    (text,) = emit(compile_text(SPINS + real).program, "device", COMMAND).values()
    assert "t_phi0" in text
    assert "PHI_" not in text
    assert bool(re.search(r"\bdouble\b", text.split("*/", 1)[1])) == (not real)
