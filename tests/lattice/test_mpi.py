"""Lattices on several processes of Open MPI have the bits of one process."""

from __future__ import annotations

import json
import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from lattice import test_forcing as forcing
from lattice.test_sweeps import UNEVEN, disorder, solver, start, with_default

from phigen.runtime import toolchain

pytest.importorskip("mpi4py")
MPIRUN = shutil.which("mpirun", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}")
SCRIPT = Path(__file__).with_name("on_processes.py")
#: Sizes of lattices: chains, one with colours, whose run is interrupted and resumed; a box with open ends, distributed
#: by planes.
SIZES = {"xxz": (37,), "volterra": (34,), "cube": (9, 3, 4)}
#: Further lattices: a plane with noise at every site, and a chain with a parameter at sites whose default is a formula
#: in the position along the whole chain.
NAMES = (*SIZES, "hot", "uneven")


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with solvers, states and parameters for the script, and the frames of one process without MPI."""
    folder = tmp_path_factory.mktemp("mpi")
    (folder / "flags.json").write_text(json.dumps(toolchain.BASE_FLAGS))
    for name, sizes in SIZES.items():
        x, integrator = start(name, sizes), solver(name, 4, "c")
        values = disorder(name, x)
        with (folder / f"{name}.pickle").open("wb") as file:
            pickle.dump((integrator, x, values), file)
        # The steps are so large that some need full-range functions.
        run = integrator.integrate(x, 0.2, 50, 20, **values)
        np.savez(folder / f"{name}_alone.npz", x=run.x, energy=run.energy)
    integrator, x = forcing.solver("hot", 2, "c"), np.random.default_rng(1).normal(size=(3, 9, 5))
    with (folder / "hot.pickle").open("wb") as file:
        pickle.dump((integrator, x, {"T": 0.3}), file)
    run = integrator.integrate(x, 0.2, 50, 20, seed=7, T=0.3)
    np.savez(folder / "hot_alone.npz", x=run.x, energy=run.energy)
    integrator, x = with_default(UNEVEN, "c"), start("dnls", (34,))
    with (folder / "uneven.pickle").open("wb") as file:
        pickle.dump((integrator, x, {}), file)
    run = integrator.integrate(x, 0.2, 50, 20)
    np.savez(folder / "uneven_alone.npz", x=run.x, energy=run.energy)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("processes", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_any_number_of_processes_makes_the_bits_of_one(run_folder: Path, processes: int) -> None:
    assert MPIRUN, "mpi4py is there, but no mpirun"
    allowed = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMP_NUM_THREADS": "1"}
    command = [MPIRUN, "--oversubscribe", "-n", str(processes), sys.executable, str(SCRIPT), str(run_folder), *NAMES]
    environment = {**os.environ, **allowed}
    process = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=240, check=False)
    assert process.returncode == 0, process.stdout + process.stderr
    for name in NAMES:
        with np.load(run_folder / f"{name}_alone.npz") as alone:
            assert np.load(run_folder / f"{name}_{processes}.npy").tobytes() == alone["x"].tobytes(), name
            energy = np.load(run_folder / f"{name}_{processes}_energy.npy")
            np.testing.assert_allclose(energy, alone["energy"], rtol=1e-13, atol=1e-13)
    assert not list(run_folder.glob("*.part")) + list(run_folder.glob("*state*"))
