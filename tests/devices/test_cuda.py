"""Generated code compiled as CUDA by NVIDIA's compilers, which need no graphics card."""

import nvrtc
import pytest
from support import COMMAND

from phigen.api import compilation_of
from phigen.compiler import emit

pytestmark = pytest.mark.skipif(not nvrtc.is_installed(), reason="the wheels of NVRTC and ptxas are not installed")


def resources_of(name, architecture, folder, order=None, *options):
    """Compile the device code of a system and return the resources of its ensemble kernel."""
    (text,) = emit(compilation_of(name, order=order, profile="small").program, "device", COMMAND).values()
    compiled = nvrtc.assembled(nvrtc.ptx(text, architecture, *options), architecture, folder)
    return compiled[f"{name}_ensemble_kernel"]


@pytest.mark.parametrize("architecture", nvrtc.ARCHITECTURES)
@pytest.mark.parametrize(
    "name",
    [
        "pendulum_euler",
        pytest.param("rigid_body", marks=pytest.mark.slow),
        pytest.param("kepler_eccentric", marks=pytest.mark.slow),
        pytest.param("kowalevski_gauss", marks=pytest.mark.slow),
        pytest.param("nambu_pendulum", marks=pytest.mark.slow),
    ],
)
def test_code_compiles_for_two_generations_of_cards(name, architecture, tmp_path):
    assert 0 < resources_of(name, architecture, tmp_path).registers <= 255


SMALL = ("rigid_body", "kepler", "henon_heiles", "toda3", "lotka_volterra")


@pytest.mark.parametrize("architecture", nvrtc.ARCHITECTURES)
@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) for n in SMALL])
def test_small_systems_stay_in_registers(name, architecture, tmp_path):
    used = resources_of(name, architecture, tmp_path, order=4)
    assert (used.spilled, used.stack) == (0, 0)
    common = resources_of(name, architecture, tmp_path, 4, f"-D{name}_COMMON")
    assert (common.spilled, common.stack) == (0, 0)
    assert common.registers < used.registers


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize("architecture", nvrtc.ARCHITECTURES)
def test_four_blocks_of_a_rigid_body_fit_into_the_registers_of_a_multiprocessor(architecture, tmp_path):
    """With the macro BLOCKS=4, four blocks of 128 threads fit into 65,536 registers without spills. With the default,
    only three fit.
    """
    options = ["-Drigid_body_COMMON", "-Drigid_body_BLOCKS=4"]
    used = resources_of("rigid_body", architecture, tmp_path, 4, *options)
    assert (used.spilled, used.stack) == (0, 0)
    assert 4 * 128 * used.registers <= 65_536
    assert 4 * 128 * resources_of("rigid_body", architecture, tmp_path, 4, options[0]).registers > 65_536
