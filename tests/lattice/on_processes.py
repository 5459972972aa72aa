"""Script for mpirun: integrate lattices on all processes. One of the runs is interrupted and resumed."""

import contextlib
import json
import pickle
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from phigen.errors import StepError
from phigen.mpi import DistributedLattice
from phigen.runtime import toolchain


def interrupt(steps_done: int) -> None:
    if steps_done == 20:
        raise KeyboardInterrupt


def expect_refused(why: str, **asked: Any) -> None:
    """Check that all processes refuse a run that would overwrite another one or repeat it, and that no file changes."""
    before = {path: path.read_bytes() for path in sorted(folder.iterdir())}
    MPI.COMM_WORLD.barrier()
    with pytest.raises(ValueError, match=why):
        lattice.integrate(x0, 0.2, 50, 20, **asked)
    MPI.COMM_WORLD.barrier()
    assert before == {path: path.read_bytes() for path in sorted(folder.iterdir())}
    MPI.COMM_WORLD.barrier()  # otherwise a fast process changes files that a slow one still reads


def expect_failing_run_leaves_nothing() -> None:
    """Check that a run with a failing step leaves neither frames nor a checkpoint, as it cannot be resumed."""
    files = folder / f"failing_{count}.npy", folder / f"failing_{count}.state"
    with pytest.raises(StepError):
        lattice.integrate(x0, 1e300, 50, 1, output=files[0], checkpoints=files[1], parameters=values)
    MPI.COMM_WORLD.barrier()
    assert not list(folder.glob(f"failing_{count}*"))
    MPI.COMM_WORLD.barrier()


folder, count = Path(sys.argv[1]), MPI.COMM_WORLD.size
toolchain.BASE_FLAGS = tuple(json.loads((folder / "flags.json").read_text()))  # the flags of the tests
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
        expect_refused("to an interrupted run: continue it with resume=True, or remove the file", resume=False, **asked)
        expect_refused("the frames of an interrupted run", output=output, parameters=values)
    run = lattice.integrate(x0, 0.2, 50, 20, **asked)
    if name == "volterra":
        expect_refused("its run is complete, and there is nothing to resume", **asked)
        lattice.integrate(x0, 0.2, 50, 20, resume=False, **asked)
        expect_failing_run_leaves_nothing()
    if MPI.COMM_WORLD.rank == 0:
        np.save(folder / f"{name}_{count}_energy.npy", run.energy)
