from pathlib import Path

import pytest

from phigen.runtime.c_solver import CSolver
from phigen.runtime.interface import Interface
from phigen.runtime.numpy_solver import NumpySolver
from phigen.runtime.solver import Solver

HERE = Path(__file__).parent

OSCILLATOR = Interface(
    name="oscillator",
    coordinates=("q", "p", "c"),
    order=2,
    parameters={"omega": 1.0, "limit": 1e300},
    positive=frozenset({"omega"}),
    casimirs=("c", "c2"),
)


@pytest.fixture(scope="session")
def oscillator_files():
    return {name: (HERE / name).read_text(encoding="utf-8") for name in ("oscillator.c", "oscillator.h")}


@pytest.fixture
def cache_directory(tmp_path, monkeypatch):
    folder = tmp_path / "cache"
    monkeypatch.setenv("PHIGEN_CACHE_DIR", str(folder))
    return folder


@pytest.fixture(scope="session")
def solvers(oscillator_files, tmp_path_factory):
    """Return the solvers of the oscillator by target: in C and in NumPy."""
    source = (HERE / "oscillator_module.py").read_text(encoding="utf-8")
    by_target = {"numpy": Solver(NumpySolver(source, OSCILLATOR), OSCILLATOR)}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PHIGEN_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))
        by_target["c"] = Solver(CSolver(oscillator_files, OSCILLATOR), OSCILLATOR)
    return by_target


@pytest.fixture(params=["c", "numpy"])
def solver(request, solvers):
    return solvers[request.param]
