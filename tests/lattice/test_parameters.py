"""Parameters of lattices that are replaced between steps, in C and JavaScript.

A solver with replaced parameters makes the steps, bit for bit, of a solver that is initialised with them at its state.
"""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lattice import test_forcing as forcing
from lattice import test_javascript as javascript
from lattice import test_monitor as monitored
from lattice import test_relative_bodies as relative
from lattice.lattices import SPIN_GRAPH
from node import asked
from tools import WARNINGS, run, tool, write

import phigen
from phigen.compilation import Compilation
from phigen.compiler import compile_spec, emit

RING = """\
phigen: 1
name: ring
lattice: {axes: [i], boundary: periodic}
coordinates: [q, p]
parameters: {k: {value: 1, at: sites}, m: {value: 2, positive: true}, a: 0.3}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/(2*m) + k*q**4/4 + a*(q[i+1] - q)**2 + exp(m)*q/50
"""
#: Statements that save a run and resume it in another solver.
SAVED = """\
static double arrays[3 * sizeof x / sizeof *x];
    size_t far;
    const size_t count = NAME_saved(&s, arrays, &far);
    if (NAME_resume(&fresh, H, arrays, count, far)) return 5;
"""
#: Specs with the number of sites; in C the bonds are a ring.
SPECS = {
    "ring": (RING, 5),
    "timed": (RING.replace("name: ring", "name: timed\ntime: t").replace("exp(m)*q/50", "exp(m)*q*cos(3*t)/50"), 5),
    "graph": (SPIN_GRAPH, 4),
    "langevin": (forcing.compiled("langevin").spec.source, 4),
    "stiff": (javascript.STIFF.replace("200*", "K*").replace("scheme", "parameters: {K: 200}\nscheme"), 12),
    "compensated": (RING.replace("name: ring", "name: summed\nsolver: {compensated: true}"), 5),
    "monitor": (monitored.BODIES, 3),
    "relative": (relative.text("jacobi", "xy").replace("bound: true, ", ""), 4),
    "heliocentric": (relative.text("democratic_heliocentric", "xy").replace("bound: true, ", ""), 4),
}
BODIES = ("relative", "heliocentric")


@cache
def compilation(name: str) -> Compilation:
    return compile_spec(phigen.spec.loads(SPECS[name][0]))


def values_of(name: str, seed: int) -> dict[str, Any]:
    """Return values of all parameters: numbers, and arrays over the sites or the bonds."""
    random, sites = np.random.default_rng(seed), SPECS[name][1]
    values = {
        p.name: random.uniform(0.5, 1.5, () if p.at == "all" else sites) for p in compilation(name).spec.parameters
    }
    if name in BODIES:
        values["m"] *= [1, 1e-3, 0, 1e-3]
    return {key: value.tolist() for key, value in values.items()}


def start_of(name: str) -> np.ndarray:
    """Return a state (coordinates, sites)."""
    sites = SPECS[name][1]
    if name == "monitor":
        return monitored.X0
    return np.random.default_rng(5).uniform(0.2, 1.2, (len(compilation(name).spec.coordinates), sites))


def in_c(values: dict[str, Any], number: int) -> tuple[str, str]:
    """Return the arrays of a set of parameters, and statements that put the set into ``params``."""
    arrays, statements = [], []
    for name, value in values.items():
        if isinstance(value, list):
            arrays.append(f"static const double {name}_{number}[] = {{ {', '.join(map(repr, value))} }};")
            statements.append(f"params.{name} = {name}_{number};")
        else:
            statements.append(f"params.{name} = {value!r};")
    return "\n".join(arrays), "\n    ".join(statements)


DRIVER = """\
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "NAME.h"

ARRAYS
static double x[] = { X0 };
static double y[sizeof x / sizeof *x];

/* Return a solver that starts at x, with memory of its own. */
static NAME_solver begun(const NAME_params *params, double t, size_t step)
{
    const size_t sizes[] = { SIZES };
    BONDS
    NAME_solver s;
    (void)t, (void)step;
    if (START) exit(1);
    NOISE
    return s;
}

/* Make steps of both solvers, and return whether they are at the same state. */
static int alike(NAME_solver *a, NAME_solver *b)
{
    if (NAME_integrate(a, H, 4) || NAME_integrate(b, H, 4)) exit(2);
    NAME_state(a, x);
    NAME_state(b, y);
    return memcmp(x, y, sizeof x) == 0 && NAME_hamiltonian(a) == NAME_hamiltonian(b);
}

int main(void)
{
    NAME_params params;
    FIRST
    NAME_solver s = begun(&params, 0.3, 2);
    if (NAME_integrate(&s, H, 3)) return 3;
    SECOND
    if (NAME_set_parameters(&s, &params)) return 4;
    NAME_state(&s, x);
    NAME_solver fresh = begun(&params, s.t, 5);
    SAVED
    printf("%d ", alike(&s, &fresh));
    WRONG
    printf("%d ", NAME_set_parameters(&s, &params) == NAME_BAD_ARGUMENT);
    printf("%d ", alike(&s, &fresh));
    printf("%d\\n", (int)s.steps);
    return 0;
}
"""


@pytest.mark.thin(3, of_all=1)
@pytest.mark.parametrize("name", SPECS)
def test_c_goes_on_as_a_solver_that_starts_with_the_new_parameters(name: str, tmp_path: Path) -> None:
    program, sites = compilation(name).program, SPECS[name][1]
    graph, timed, noise = name == "graph", bool(program.time), bool(program.noise)
    first, second = values_of(name, 1), values_of(name, 2)
    wrong = next(p for p in second if name not in BODIES or p != "m")
    arrays, assign = zip(*(in_c(v, k) for k, v in enumerate((first, second))), strict=True)
    bad = {wrong: [float("nan")] * sites if isinstance(second[wrong], list) else float("nan")}
    bad = {"m": 800.0} if name == "ring" else bad  # exp(m) is infinite
    bad_arrays, bad_assign = in_c(bad, 2)
    ends = ", ".join(f"{i}, {(i + 1) % sites}" for i in range(sites))
    bonds = f"static const size_t ends[] = {{ {ends} }}; const NAME_bonds bonds = {{ {sites}, ends }};" if graph else ""
    tail = f"sizes, {'&bonds, ' * graph}x, {'t, ' * timed}work"
    size = f"NAME_work_size(sizes{f', {sites}' * graph})"
    text = DRIVER
    for word, value in {
        "ARRAYS": "\n".join([*arrays, bad_arrays]).replace("nan", "0.0 / 0.0"),
        "X0": ", ".join(map(repr, start_of(name).reshape(-1).tolist())),
        "SIZES": "3, 4" if name == "stiff" else str(sites),
        "BONDS": f"{bonds}\n    void *work = malloc({size});",
        "START": f"work == NULL || NAME_init{'_at' * timed}(&s, params, {tail})",
        "NOISE": "NAME_set_noise(&s, 7, 0, step);" if noise else "",
        "SAVED": SAVED * (name in BODIES or name in ("ring", "timed", "graph")),
        "FIRST": assign[0], "SECOND": assign[1], "WRONG": bad_assign.replace("nan", "0.0 / 0.0"),
        "H": "0.02", "NAME": program.name,
    }.items():  # fmt: skip
        text = re.sub(rf"\b{word}(?=\b|_)", lambda _, v=value: v, text)
    write(tmp_path, {**emit(program, "c", ""), "main.c": text})
    flags = ["-std=c99", *WARNINGS, "-g", "-fsanitize=address,undefined"]
    run([tool("gcc"), *flags, "main.c", f"{program.name}.c", "-lm", "-o", "a"], tmp_path)
    assert run(["./a"], tmp_path, ASAN_OPTIONS="detect_leaks=0").split() == ["1", "1", "1", "11"]


@pytest.mark.parametrize("name", SPECS)
def test_javascript_goes_on_as_a_solver_that_starts_with_the_new_parameters(name: str, tmp_path: Path) -> None:
    program, sites = compilation(name).program, SPECS[name][1]
    write(tmp_path, emit(program, "js", ""))
    options: dict[str, Any] = {"sizes": [3, 4] if name == "stiff" else [sites]}
    if name == "graph":
        options["bonds"] = [end for i in range(sites) for end in (i, (i + 1) % sites)]
    first, second = values_of(name, 1), values_of(name, 2)
    x0 = start_of(name).reshape(-1).tolist()
    timed, noise = ", t0: s.t" * bool(program.time), ", seed: 7, step0: STEP" * bool(program.noise)
    infinite = "{ m: 800.0 }" if name == "ring" else "{ none: 2 }"  # exp(m) is infinite
    body = f"""
        const given = {json.dumps(options)}
        const s = new module.Solver({{ ...given, x0: {x0}, params: {json.dumps(first)}{noise.replace("STEP", "2")} }})
        s.integrate(0.02, 3)
        const t = s.t
        const carry = s.tCarry  // of steps in tau
        const same = s.setParameters({json.dumps(second)}) === s && s.t === t && s.tCarry === carry
        const fresh = new module.Solver({{
          ...given, x0: s.x, params: {json.dumps(second)}{timed}{noise.replace("STEP", "5")}
        }})
        const alike = () => {{
          s.integrate(0.02, 2), fresh.integrate(0.02, 2)
          return s.x.every((v, i) => v === fresh.x[i]) && s.hamiltonian() === fresh.hamiltonian()
        }}
        const first = alike()
        const refused = [{{ {next(iter(second))}: NaN }}, {{ none: 1 }}, {infinite}].map((changes) => {{
          try {{ s.setParameters(changes) }} catch (error) {{ return error.status }}
        }})
        return [same, first, ...refused, alike(), s.steps]
    """
    answer = asked(tmp_path / f"{program.name}.mjs", body)
    assert answer == [True, True, *["BAD_ARGUMENT"] * 3, True, 7]


#: Large angles at the start need full-range functions for some steps; the state after it does not.
SINES = """\
phigen: 1
name: sines
lattice: {axes: [i], boundary: periodic}
coordinates: [q, p]
parameters: {b: 0.7, a: 0.3}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + b*cos(q) + a*sin(q[i+1] - q)
"""
FAR = """\
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "sines.h"

enum { SITES = 400, VALUES = 2 * SITES };
static double large[VALUES], small[VALUES], x[VALUES], y[VALUES];

int main(void)
{
    const size_t sizes[] = { SITES };
    sines_params params = sines_default_params;
    void *work = malloc(sines_work_size(sizes)), *other = malloc(sines_work_size(sizes));
    for (int i = 0; i < VALUES; ++i) {
        large[i] = i < SITES ? 1e4 + i : 0.1;
        small[i] = 0.6 * (i * 131 % 397) / 397.0 - 0.3;
    }
    sines_solver s, fresh;
    if (work == NULL || other == NULL || sines_init(&s, &params, sizes, large, work)) return 1;
    if (sines_integrate(&s, 0.05, 2) || s.full_range == 0) return 2;
    if (sines_set_state(&s, small)) return 3;
    params.b = 0.9;
    if (sines_set_parameters(&s, &params) || sines_init(&fresh, &params, sizes, small, other)) return 4;
    if (sines_integrate(&s, 0.05, 10) || sines_integrate(&fresh, 0.05, 10)) return 5;
    sines_state(&s, x);
    sines_state(&fresh, y);
    printf("%d", memcmp(x, y, sizeof x) == 0);
    return 0;
}
"""


def test_c_begins_with_functions_for_small_arguments_again(tmp_path: Path) -> None:
    program = compile_spec(phigen.spec.loads(SINES)).program
    write(tmp_path, {**emit(program, "c", ""), "main.c": FAR})
    run([tool("gcc"), "-std=c99", *WARNINGS, "-O1", "main.c", "sines.c", "-lm", "-o", "a"], tmp_path)
    assert run(["./a"], tmp_path) == "1"


def test_javascript_keeps_the_level_of_parameters_that_it_refuses(tmp_path: Path) -> None:
    write(tmp_path, emit(compilation("monitor").program, "js", ""))
    options = json.dumps({"sizes": [3], "params": values_of("monitor", 1), "x0": start_of("monitor").ravel().tolist()})
    body = f"""
        const [s, twin] = [1, 2].map(() => new module.Solver({options}).integrate(0.02, 3))
        const refused = [1e200, -1].map((m) => {{
          try {{ s.setParameters({{ m }}) }} catch (error) {{ return error.status }}
        }})
        const same = ["level", "t", "tCarry"].every((name) => s[name] === twin[name])
        s.integrate(0.02, 3), twin.integrate(0.02, 3)
        return [...refused, same, s.x.every((v, i) => v === twin.x[i])]
    """
    answer = asked(tmp_path / "bodies.mjs", body)
    assert answer == ["BAD_ARGUMENT", "BAD_ARGUMENT", True, True]
