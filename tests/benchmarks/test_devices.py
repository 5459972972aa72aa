"""The program that measures graphics cards, tested without a card: by OpenCL on the processor, and by an imitation of
CuPy.
"""

import sys

import numpy as np
import pytest
from devices import cupy_by_hand

pytest.importorskip("scipy")

from benchmarks import __main__ as command
from benchmarks import devices
from phigen.runtime.devices import cuda, ensembles


@pytest.fixture
def small(monkeypatch):
    """Shorten the measurement from a minute to a few seconds."""
    monkeypatch.setattr(devices, "CASES", devices.CASES[:1])
    monkeypatch.setattr(devices, "STEPS", 3)
    monkeypatch.setattr(devices, "members_of", lambda run, seconds: 300)
    monkeypatch.setattr(devices, "Effort", lambda *settings: Effort(1e-4, 1, 4))
    monkeypatch.setattr(devices, "BLOCKS", (1, 4))


Effort = devices.Effort


def cells(text, title):
    """Return the rows of the table below a title, as dictionaries by column."""
    lines = text.split(title, 1)[1].split("\n\n")[1].splitlines()
    table = [[cell.strip() for cell in line[1:-1].split("|")] for line in lines]
    return [dict(zip(table[0], row, strict=True)) for row in table[2:]]


def test_times_of_steps_exclude_the_constant_part_of_a_run():
    """The time of a step excludes the part that does not depend on the number of steps. Here a run takes 0.5 s for
    copies, plus 70 ps for each member and step; 7,143 steps of a million members take another 0.5 s.
    """
    runs = []

    def run(members, steps):
        runs.append(steps)
        return 0.5 + 70e-12 * members * steps

    ps, whole = devices.per_step(run, 10**6, Effort(0.5, 3, 4))
    assert ps == pytest.approx(70)
    assert whole == pytest.approx(70 + 0.5e12 / 1e6 / runs[-1])
    assert runs[-6:] == 3 * [6_400, 19_200]


@pytest.mark.parametrize(("cost", "members"), [(1e-9, 1_000_000), (1e-13, devices.MOST_MEMBERS), (1e-3, 256)])
def test_ensembles_are_as_large_as_seconds_allow(cost, members):
    seconds = 1e-9 * 1_000_000 * devices.STEPS
    assert devices.members_of(lambda m, steps: cost * m * steps, seconds) == pytest.approx(members, rel=1e-6)


@pytest.mark.slow
def test_a_card_is_measured_by_one_command(small, monkeypatch, tmp_path):
    """One command measures a card, for each number of blocks, which is passed to the compiler."""
    cupy = cupy_by_hand.module()
    monkeypatch.setitem(sys.modules, "cupy", cupy)
    monkeypatch.setattr(cuda, "_OPENED", {})
    options = ["benchmarks", "--only", "devices", "--quick", "--output", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", options)
    monkeypatch.setenv("PHIGEN_CACHE_DIR", str(tmp_path / "cache"))
    compiled, compile_text = [], cuda.CUDADevice.compiled
    monkeypatch.setattr(cuda.CUDADevice, "compiled", lambda self, *a: compiled.append(a[1]) or compile_text(self, *a))
    assert command.main() == 0
    text = (tmp_path / "devices.md").read_text()
    assert "target cuda, beside one core of" in text
    assert [row["blocks"] for row in cells(text, "### Ensembles")] == ["1", "4"]
    assert {d["bench_BLOCKS"] for d in compiled if "bench_BLOCKS" in d} == {1, 4}
    for title, counted, rates, ratio in (
        ("### Ensembles", "members", ("one core, ps", "ps a member and step"), "core / device"),
        ("### Cubic", "spins", ("steps of spins a second", "one core"), "device / core"),
    ):
        for row in cells(text, title):
            assert int(row[counted].replace(",", "")) > 0
            core_over_device = float(row[rates[0]]) / float(row[rates[1]])
            assert float(row[ratio]) == pytest.approx(core_over_device, rel=0.02)
            assert float(row["difference from C"]) < 1e-12


@pytest.mark.slow
def test_steps_that_differ_from_those_of_c_are_not_timed(small, monkeypatch, tmp_path):
    pytest.importorskip("pyopencl")
    ensemble = ensembles.DeviceSolver.ensemble
    monkeypatch.setattr(ensembles.DeviceSolver, "ensemble", lambda *a: ensemble(*a) + 1e-9)
    monkeypatch.setattr(
        sys, "argv", ["benchmarks", "--only", "devices", "--target", "opencl", "--output", str(tmp_path)]
    )
    monkeypatch.setenv("PHIGEN_CACHE_DIR", str(tmp_path / "cache"))
    assert command.main() == 1
    (row,) = cells((tmp_path / "devices.md").read_text(), "### Ensembles")
    assert row["ps a member and step"] == "failed: steps differ from those of C by 1.0e-09"
    assert not row["core / device"]


def test_errors_of_the_energy_are_relative_to_the_largest():
    starts = devices.oscillators(50)
    assert devices.energy_error(starts, starts) == 0
    assert devices.energy_error(starts, np.zeros((50, 4))) == 1
