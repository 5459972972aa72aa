"""Spectra and correlations of lattices."""

import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import phigen
import phigen.spec
from phigen.cli import group
from phigen.runtime.spectra import spectrum

#: A ferromagnetic chain near its ground state; linear spin-wave theory has ω(q) = B + 2J(1 − cos q).
FERROMAGNET = """\
phigen: 1
name: ferromagnet
coordinates: [x, y, z]
parameters: {J: 1, B: 0.1}
lattice: {axes: [i], boundary: periodic}
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: -J*(x*x[i+1] + y*y[i+1] + z*z[i+1]) - B*z
order: 4
runs: {r: {initial: {x: 0, y: 0, z: 1}, sizes: [32], step: 0.1, steps: 10}}
"""


def near_the_ground_state(sites: int, size: float) -> np.ndarray:
    rng = np.random.default_rng(1)
    x, y = size * rng.normal(size=(2, sites))
    return np.array([x, y, np.sqrt(1 - x**2 - y**2)])


@pytest.mark.slow
def test_spin_waves_of_the_page_have_the_dispersion_of_linear_theory():
    page = (Path(__file__).parents[2] / "docs" / "lattices.md").read_text(encoding="utf-8")
    (text,) = (block for block in re.findall(r"```yaml\n(.*?)```", page, re.DOTALL) if "name: waves" in block)
    text = (
        text.replace("sizes: [64]", "sizes: [16]")
        .replace("steps: 10000", "steps: 2560")
        .replace("after: 100", "after: 0")
    )
    run = phigen.compile(phigen.spec.loads(text.replace("up to: 32", "up to: 8")), target="numpy").run()
    structure_factor = run.structure_factor
    assert len(repr(structure_factor)) < 120
    assert structure_factor.values.shape == (16, 513)
    apart = structure_factor.omega[1] - structure_factor.omega[0]
    for q, values in zip(structure_factor.q[0], structure_factor.values, strict=True):
        peak = abs(structure_factor.omega[np.argmax(values)])
        assert peak == pytest.approx(0.2 + 2 * (1 - np.cos(q)), abs=0.6 * apart)


def test_a_wave_has_its_wave_number_and_frequency():
    solver = phigen.compile(phigen.spec.loads(FERROMAGNET), target="numpy")
    run = solver.integrate(near_the_ground_state(8, 0.1), 0.1, 64)
    t, r = run.t[:, None], np.arange(8.0)[None]
    run.x[:, 0] = 0.7 * np.cos(2 * np.pi / 8 * 3 * r - 2.0 * t)
    exponents = spectrum(run, "x")
    k, n = np.unravel_index(np.argmax(exponents.values), exponents.values.shape)
    assert np.sign(exponents.q[0][k]) == np.sign(exponents.omega[n])
    assert abs(exponents.q[0][k]) == pytest.approx(2 * np.pi / 8 * 3)
    assert abs(exponents.omega[n]) == pytest.approx(2.0, abs=np.pi / (65 * 0.1))
    window = np.hanning(len(run) + 2)[1:-1] ** 2
    weighted = (run.x[:, 0] ** 2 * (window / window.mean())[:, None]).mean()
    assert exponents.values.sum() == pytest.approx(weighted, rel=1e-12)


@pytest.mark.parametrize("boundary", ["periodic", "open"])
def test_correlations_are_those_of_the_definition(boundary):
    text = FERROMAGNET.replace("boundary: periodic", f"boundary: {boundary}")
    run = phigen.compile(phigen.spec.loads(text), target="numpy").integrate(near_the_ground_state(6, 0.3), 0.1, 4)
    correlation = run.correlation("x", "y", up_to=3, after=0.1)
    f, g = run.x[1:, 0], run.x[1:, 1]
    for d in range(4):
        places = range(6) if boundary == "periodic" else range(6 - d)
        products = [f[:, r] * g[:, (r + d) % 6] for r in places]
        assert correlation[d] == pytest.approx(np.mean(products) - f.mean() * g.mean(), rel=1e-12, abs=1e-15)


def test_spectra_that_are_not_defined_are_refused():
    run = phigen.compile(phigen.spec.loads(FERROMAGNET), target="numpy").integrate(
        near_the_ground_state(6, 0.3), 0.1, 4
    )
    with pytest.raises(ValueError, match="'w' is not a coordinate; there are x, y, z"):
        run.spectrum(["w"])
    with pytest.raises(ValueError, match="needs 4 frames at equal intervals of time, not 2"):
        run.spectrum(["x"], after=0.3)
    with pytest.raises(ValueError, match="up_to must be from 0 to 5"):
        run.correlation("x", up_to=6)
    with pytest.raises(ValueError, match="'j' is no axis; there are i"):
        run.correlation("x", axis="j", up_to=1)


def test_a_spectrum_goes_to_zarr_and_pictures(tmp_path):
    xarray = pytest.importorskip("xarray")
    run = phigen.compile(phigen.spec.loads(FERROMAGNET), target="numpy").integrate(
        near_the_ground_state(6, 0.3), 0.1, 9
    )
    computed = run.spectrum(["x"])
    computed.save(tmp_path / "s.zarr")
    stored = xarray.open_zarr(tmp_path / "s.zarr", consolidated=False)
    np.testing.assert_array_equal(stored.S.transpose("q_i", "omega"), computed.values)
    np.testing.assert_array_equal(stored.q_i, computed.q[0])
    computed.plot("chain").savefig(tmp_path / "s.png")


#: The ferromagnetic chain with a run that asks for a spectrum and a correlation; it starts with a plane spin wave.
ASKING = (
    FERROMAGNET.replace("steps: 10", "steps: 640, stride: 5, spectrum: {of: [x, y], after: 2.5}")
    .replace("x: 0, y: 0, z: 1}", "x: 0.001*cos(2*pi*3*i/N_i), y: -0.001*sin(2*pi*3*i/N_i), z: 1}")
    .replace("after: 2.5}", "after: 2.5}, correlation: {of: x, with: y, up to: 5, after: 60}")
)


@pytest.mark.slow
def test_a_run_puts_what_it_asks_for_into_its_files(tmp_path, monkeypatch):
    xarray = pytest.importorskip("xarray")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "waves.yaml").write_text(ASKING)
    run = phigen.compile("waves.yaml", target="numpy").run()
    spectrum, correlation = run.spectrum(["x", "y"], after=2.5), run.correlation("x", "y", up_to=5, after=60)
    k, n = np.unravel_index(np.argmax(spectrum.values), spectrum.values.shape)
    assert abs(spectrum.q[0][k]) == pytest.approx(2 * np.pi * 3 / 32)
    assert abs(spectrum.omega[n]) == pytest.approx(0.1 + 2 * (1 - np.cos(2 * np.pi * 3 / 32)), abs=np.pi / 60)
    np.testing.assert_array_equal(run.structure_factor.values, spectrum.values)
    np.testing.assert_array_equal(run.correlated.values, correlation)
    # The third run replaces the store of the second.
    for name, plot in (("a.npz", ["--plot", "a.svg"]), ("a.zarr", []), ("a.zarr", [])):
        result = CliRunner().invoke(group, ["run", "waves.yaml", "-t", "numpy", "-o", name, *plot])
        assert result.exit_code == 0, result.output
    with np.load("a.npz") as arrays, xarray.open_zarr("a.zarr", consolidated=False) as stored:
        for name, values in (("spectrum", spectrum.values), ("correlation", correlation), ("x", run.x)):
            np.testing.assert_array_equal(arrays[name], values)
            np.testing.assert_array_equal(stored[name], values)
        assert stored.spectrum.dims == ("spectrum_q_i", "spectrum_omega")
        np.testing.assert_array_equal(stored.spectrum_omega, arrays["spectrum_omega"])
    assert (tmp_path / "a.svg").read_text().count("S(q, ω)") >= 1
    assert not [*tmp_path.glob("*.part"), *tmp_path.glob("*.checkpoint")]


def test_times_that_give_no_spectrum_are_refused_before_the_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "waves.yaml").write_text(ASKING)
    (tmp_path / "folder.zarr").mkdir()
    for options, message in (
        (["--at", "3,4,6,7"], "a spectrum needs frames at equal intervals of time"),
        (["--until", "3"], "needs 4 frames at equal intervals of time, not 2"),
        (["--until", "50"], "there are no frames from t = 60.0 on"),
        (["-o", "folder.zarr"], "folder.zarr exists, and is not a Zarr store"),
    ):
        result = CliRunner().invoke(group, ["run", "waves.yaml", "-t", "numpy", *options])
        assert (result.exit_code, message in " ".join(result.output.split())) == (2, True), result.output
    with pytest.raises(ValueError, match="needs 4 frames"):
        phigen.compile("waves.yaml", target="numpy").run(until=3)
