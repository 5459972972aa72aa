"""Run by mpirun: integrates lattices on all processes, one of them interrupted and gone on with."""

import contextlib
import json
import pickle
import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI

from phigen.mpi import DistributedLattice
from phigen.runtime import toolchain


def interrupt(done: int) -> None:
    if done == 20:
        raise KeyboardInterrupt


folder, count = Path(sys.argv[1]), MPI.COMM_WORLD.size
toolchain.BASE_FLAGS = tuple(json.loads((folder / "flags.json").read_text()))  # those of the tests
for name in sys.argv[2:]:
    solver, x0, values = pickle.loads((folder / f"{name}.pickle").read_bytes())
    lattice = DistributedLattice(solver)
    output = folder / f"{name}_{count}.npy"
    asked = {"output": output, "parameters": values, "checkpoints": folder / f"state_{name}"}
    if name == "cube":

        def planes(first: int, end: int, x0: np.ndarray = x0) -> np.ndarray:
            return x0[:, first:end]

        asked["sizes"], x0 = x0.shape[1:], planes
    if name == "hot":
        asked["seed"] = 7
    if name == "volterra":
        with contextlib.suppress(KeyboardInterrupt):
            lattice.integrate(x0, 0.2, 50, 20, progress=interrupt, **asked)
    run = lattice.integrate(x0, 0.2, 50, 20, **asked)
    if MPI.COMM_WORLD.rank == 0:
        np.save(folder / f"{name}_{count}_energy.npy", run.energy)
