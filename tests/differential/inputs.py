"""Checks of inputs of lattices: wrong values in specs, and tables of bonds; and a check that the generated C compiles
as C++.
"""

from __future__ import annotations

import json
import random
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from differential.reference import expect, expect_close
from differential.sites import Lattice
from solvers import COMMAND
from tools import run, tool, write

import phigen.spec
from phigen.compilation import Compilation
from phigen.compiler import emit
from phigen.errors import SpecError
from phigen.lattice.states import Start, start_of

#: Values that are invalid where a number or a seed is needed.
WRONG = ([1], [5, 6], {"x": 1}, "N_x", None)


def refusal(make: Callable[[], Any]) -> str:
    """Return the message of the error that ``make`` raises, or "" if it raises none."""
    try:
        make()
    except SpecError as error:
        return str(error)
    return ""


def malformed(system: Lattice) -> None:
    """Check that an invalid value in a mapping that draws random numbers is refused."""
    source = random.Random(f"malformed {system.seed}")
    drawn = list(_random_values(system))
    for key in source.sample(["seed", "scale", "mean", "random"], 2) if drawn else ():
        (where, value), wrong = source.choice(drawn), source.choice(WRONG)
        spoilt = system.text.replace(json.dumps(value), json.dumps(value | {key: wrong}), 1)
        message = refusal(lambda text=spoilt: _started(phigen.spec.loads(text)))  # type: ignore[misc]
        expect(bool(message), f"{where}: {key}: {json.dumps(wrong)} is accepted")


def _random_values(system: Lattice) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the mappings in a spec that draw random numbers, with a description."""
    for name, parameter in system.parameters.items():
        if isinstance(parameter.value, dict):
            yield f"parameter {name}", parameter.value
    if "random" in system.initial:
        yield "initial", system.initial


def _started(spec: phigen.spec.Spec) -> Start:
    return start_of(spec, spec.runs["r"])


def tables(system: Lattice) -> None:
    """Check that bonds and their parameters can be read from a table, and that errors in the table are refused."""
    bonds = [list(b) for b in system.bonds]
    values = np.random.default_rng(system.seed).uniform(0.5, 1.5, len(bonds)).round(3)
    right = {"a": [str(a) for a, _ in bonds], "b": [str(b) for _, b in bonds], "k": [str(v) for v in values]}
    begun = _of_table(system, ["a", "b", "k"], right)
    expect(begun.bonds.tolist() == bonds, f"bonds of a table: {begun.bonds.tolist()}")
    expect_close(np.asarray(begun.parameters["k"]), values, 0.0, "the column k of a table")
    message = refusal(lambda: _check_moved(system, right, bonds, values))
    expect(not message or "table.csv" in message or "bonds" in message, f"columns k, a, b: {message}")
    wrong = {
        "an unknown column": (["a", "b", "k", "zz"], right | {"zz": right["k"]}),
        "a column twice": (["a", "b", "k", "k"], right),
        "NaN": (["a", "b", "k"], right | {"k": ["nan", *right["k"][1:]]}),
        "a site that is too large": (["a", "b", "k"], right | {"a": ["9" * 22, *right["a"][1:]]}),
        "half a site": (["a", "b", "k"], right | {"a": ["0.5", *right["a"][1:]]}),
    }
    for what, (names, columns) in wrong.items():
        expect(
            bool(refusal(lambda n=names, c=columns: _of_table(system, n, c))), f"{what} in a table of bonds is accepted"
        )  # type: ignore[misc]


def _check_moved(system: Lattice, right: dict[str, list[str]], bonds: list[list[int]], values: Any) -> None:
    """Check that a table with columns in another order is read by the names of the columns."""
    begun = _of_table(system, ["k", "a", "b"], right)
    expect(begun.bonds.tolist() == bonds, f"columns k, a, b are read as bonds {begun.bonds.tolist()}")
    expect_close(np.asarray(begun.parameters["k"]), values, 0.0, "the column k of k, a, b")


def _of_table(system: Lattice, names: list[str], columns: dict[str, list[str]]) -> Start:
    """Return the start of a run whose bonds are read from a table with the given columns."""
    lines = [",".join(names), *(",".join(row) for row in zip(*(columns[n] for n in names), strict=True))]
    run = {"sizes": list(system.sizes), "initial": dict.fromkeys(system.fields, 1), "step": 0.1, "steps": 4}
    keys = [(k, v) for k, v in system.entries() if k != "runs"] + [("runs", {"r": run | {"bonds": "table.csv"}})]
    with tempfile.TemporaryDirectory() as folder:
        text = "".join(f"{key}: {json.dumps(value)}\n" for key, value in keys)
        write(Path(folder), {"table.csv": "\n".join(lines) + "\n", "spec.yaml": text})
        return _started(phigen.spec.load(Path(folder) / "spec.yaml"))


_MAIN = """#include "NAME.h"
int main() { return CALL == NAME_OK; }
"""


def as_cpp(compilation: Compilation, *, lattice: bool) -> None:
    """Check that the C compiles and links as C++, for lattices with OpenMP, and that its functions refuse a null
    pointer.
    """
    name, sources = compilation.program.name, emit(compilation.program, "c", COMMAND)
    resumed = f"{name}_resume(" in sources[f"{name}.h"]
    call = f"{name}_resume(nullptr, 0.1, nullptr, 0, 0)" if resumed else f"{name}_integrate(nullptr, 0.1, 1)"
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write(folder, sources)
        write(folder, {"main.cpp": _MAIN.replace("NAME", name).replace("CALL", call)})
        flags = ["-std=c++17", "-O0", "-Wall", "-Wextra", "-Werror", *(["-fopenmp"] if lattice else [])]
        run([tool("g++"), *flags, "-x", "c++", f"{name}.c", "main.cpp", "-o", "main"], folder)
        run([folder / "main"], folder)
