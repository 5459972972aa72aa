"""Benchmark of lattices: generated splittings against kernels written by hand, and against Runge–Kutta methods."""

from __future__ import annotations

import ctypes
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

import phigen
from benchmarks import lammps_peer
from benchmarks.solvers import tables, texts
from benchmarks.tables import table
from phigen import spec as specs
from phigen.runtime import cache

os.environ["OMP_NUM_THREADS"] = "1"  # the kernels written by hand use one thread

_SPINS = "coordinates: [x, y, z]\npoisson: {lie_algebra: {name: so(3)}}\ncasimirs: {C: x**2 + y**2 + z**2}\n"
_PAIRS = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
_RING, _CUBE = "lattice: {axes: [i], boundary: periodic}\n", "lattice: {axes: [i, j, k], boundary: periodic}\n"
_NEXT = "x*x[{0}+1] + y*y[{0}+1] + {1}*z*z[{0}+1]"


@dataclass(frozen=True)
class Sites:
    """Lattice of identical sites: its spec without the order, and the constants of the hand-written C for it."""

    name: str
    title: str
    spec: str
    constants: Mapping[str, float | str]
    fields: int
    axes: int = 1

    def solver(self, order: int) -> Any:
        text = f"phigen: 1\nname: bench\n{self.spec}order: {order}\nscheme: splitting\n"
        return phigen.compile(specs.loads(text, "bench.yaml"), target="c")

    def start(self, size: int) -> np.ndarray:
        """Return an initial state: random unit spins if a site has three coordinates, else sums of waves."""
        if self.fields == 3:
            found = np.random.default_rng(1).normal(size=(3, *[size] * self.axes))
            return found / np.linalg.norm(found, axis=0)
        angle = 2 * np.pi * np.arange(size) / size
        return np.array([np.sin(angle) + 0.5 * np.sin(7 * angle), 0.3 * np.cos(3 * angle)])


XXZ = Sites(
    "XXZ",
    "XXZ chain",
    f"{_RING}{_SPINS}hamiltonian: {_NEXT.format('i', 1.3)}\n",
    {"DELTA": 1.3, "FIRST": "Y", "SECOND": "X", "THIRD": "Z"},
    3,
)
FPUT = Sites(
    "FPUT",
    "FPUT chain",
    f"{_RING}{_PAIRS}definitions: {{r: 'q[i+1] - q'}}\nhamiltonian: p**2/2 + r**2/2 + r**3/12 + r**4/40\n",
    {"ALPHA": 0.25, "BETA": 0.1},
    2,
)
DNLS = Sites(
    "DNLS",
    "discrete nonlinear Schrödinger equation",
    f"{_RING}{_PAIRS}hamiltonian: (q**2 + p**2)**2/8 - q*q[i+1] - p*p[i+1]\n",
    {"BETA": 1.0},
    2,
)
CUBE = Sites(
    "CUBE",
    "cubic Heisenberg lattice",
    f"{_CUBE}{_SPINS}hamiltonian: {' + '.join(_NEXT.format(axis, 1) for axis in 'ijk')}\n",
    {"DELTA": 1.0, "FIRST": "Y", "SECOND": "Z", "THIRD": "X"},
    3,
    axes=3,
)

Advance = Callable[[np.ndarray, float, int], tuple[np.ndarray, float]]
"""Function of a state, a step size and a number of steps, which returns the final state and the CPU seconds."""


@dataclass(frozen=True)
class Kernel:
    """Library of hand-written methods for a lattice of one size: splittings, or else Runge–Kutta methods."""

    sites: Sites
    size: int
    splitting: bool

    @cached_property
    def library(self) -> ctypes.CDLL:
        lines = ["#define _POSIX_C_SOURCE 199309L", f"#define N {self.size}", f"#define AXES {self.sites.axes}"]
        lines += [f"#define {name} {value}" for name, value in self.sites.constants.items()]
        if self.splitting:
            lines += ['#include "common.h"', '#include "lattice_spins.h"', "enum { FIELDS = 3 };"]
            methods, row = "splitting2, splitting4", "(spins[f][r])"
        else:
            lines += ['#include "common.h"', f"#define {self.sites.name}", '#include "lattice_fields.h"']
            lines += ["enum { ROWS = 1 };", tables(("rk4", "dop853")), '#include "lattice_runge_kutta.h"']
            methods, row = "rk4, dop853", "(x[f])"
        lines += [f"#define row(f, r) {row}", f"static void (*const methods[])(double, long) = {{ {methods} }};"]
        return cache.load({"main.c": "\n".join([*lines, '#include "run_lattice.h"\n']), **texts()})

    def method(self, index: int) -> Advance:
        function = self.library.bench_lattice
        function.restype = ctypes.c_double
        function.argtypes = (ctypes.c_int, ctypes.c_void_p, ctypes.c_double, ctypes.c_long)

        def advance(x: np.ndarray, h: float, steps: int) -> tuple[np.ndarray, float]:
            state = np.ascontiguousarray(x).copy()
            return state, function(index, state.ctypes.data, h, steps)

        return advance


def ours(solver: Any) -> Advance:
    """Return the function that runs a phigen solver from Python; its time includes some microseconds for each call."""

    def advance(x: np.ndarray, h: float, steps: int) -> tuple[np.ndarray, float]:
        began = time.thread_time()
        found = solver.integrate(x, h, steps, steps).x[-1]
        return found, time.thread_time() - began

    return advance


# kernels -----------------------------------------------------------------------------------------------------------


def kernels(quick: bool) -> list[dict[str, Any]]:
    """Return rows with the times of generated and hand-written splittings, in nanoseconds for a site and step.

    Each time is the least of several runs, in which the two splittings take turns.
    """
    rows = []
    for sites, size, order in ((XXZ, 1024, 2), (XXZ, 1024, 4), (CUBE, 32, 2), (CUBE, 96, 2)):
        if quick and size > 32 and sites is CUBE:
            continue
        x, count = sites.start(size), size**sites.axes
        generated, written = ours(sites.solver(order)), Kernel(sites, size, True).method(order // 4)
        if order == 2:
            expect_same(generated, written, x)
        steps = max(4, round((2e6 if quick else 2e7) / count))
        found = [[advance(x, 0.05, steps)[1] for advance in (written, generated)] for _ in range(3 if quick else 9)]
        by_hand, mine = (1e9 * min(column) / steps / count for column in zip(*found, strict=True))
        rows.append({"title": f"{sites.title}, {size}{'³' if sites.axes == 3 else ''}", "order": order,
                     "by hand": by_hand, "generated": mine})  # fmt: skip
    lammps = lammps_peer.nanoseconds(32, 20 if quick else 200)
    if lammps is not None:
        rows.append({"title": "cubic Heisenberg lattice, 32³, LAMMPS", "order": 2, "by hand": lammps,
                     "generated": next(r["generated"] for r in rows if r["title"].endswith("32³"))})  # fmt: skip
    return rows


def expect_same(one: Advance, other: Advance, x: np.ndarray) -> None:
    """Raise `AssertionError` if two methods make different steps, since a comparison of their times would be
    meaningless."""
    difference = np.abs(one(x, 0.05, 10)[0] - other(x, 0.05, 10)[0]).max()
    if not difference < 1e-12:
        raise AssertionError(f"the kernels make different steps: {difference:.1e}")


# rings -------------------------------------------------------------------------------------------------------------

#: Step sizes of phigen's methods by order, and of the Runge–Kutta methods by name.
_SIZES = {2: (0.1, 0.05, 0.02), 4: (0.2, 0.1, 0.05), 6: (0.25, 0.125), 8: (0.4, 0.2)}
_PEERS = {"RK4": (0.1, 0.05, 0.025), "DOP853": (0.4, 0.2, 0.1)}


def rings(quick: bool) -> list[dict[str, Any]]:
    """Return rows for rings of 1,024 sites over a long time: cost for a site and unit of time, errors of H and
    Casimirs."""
    rows = []
    for sites in (XXZ, FPUT, DNLS):
        size, horizon = (128, 40.0) if quick else (1024, 1e4)
        x, judge = sites.start(size), sites.solver(2)
        peers = Kernel(sites, size, False)
        methods = [(f"phigen {order}", ours(sites.solver(order)), hs) for order, hs in _SIZES.items()]
        methods += [(name, peers.method(i), hs) for i, (name, hs) in enumerate(_PEERS.items())]
        exact = methods[-1][1](x, 0.01, 100)[0]
        for label, advance, hs in methods:
            if np.abs(advance(x, 0.01, 100)[0] - exact).max() > 1e-3:
                raise AssertionError(f"{label} solves another equation than DOP853")
            about = {"sites": sites.title, "method": label}
            rows += [{**about, "h": h, **followed(judge, advance, x, h, horizon)} for h in hs]
    return rows


def followed(judge: Any, advance: Advance, x: np.ndarray, h: float, horizon: float, chunks: int = 50) -> dict[str, Any]:
    """Return the measurements of one run: cost, largest energy error, its growth, and the change of the spins' lengths.

    The energy is computed after each of ``chunks`` parts of the run. The growth is the mean error in the last fifth
    over that in the first.
    """
    steps = max(1, round(horizon / h / chunks))
    scale = float(np.abs(judge.density(x)).sum())
    energies, seconds, state = [judge.hamiltonian(x)], 0.0, x
    for _ in range(chunks):
        state, spent = advance(state, h, steps)
        seconds += spent
        if not np.isfinite(state).all():
            return {"ns": np.nan, "energy": np.inf, "late": np.inf, "casimir": np.inf}
        energies.append(judge.hamiltonian(state))
    errors = np.abs(np.array(energies) - energies[0]) / scale
    change = np.abs(np.linalg.norm(state, axis=0) - np.linalg.norm(x, axis=0)).max() if len(x) == 3 else np.nan
    early, late = (float(part.mean()) for part in (errors[1 : chunks // 5 + 1], errors[-chunks // 5 :]))
    return {"ns": 1e9 * seconds / x[0].size / (steps * chunks * h), "energy": float(errors.max()),
            "late": late / early if early else np.inf, "casimir": float(change)}  # fmt: skip


# as Markdown -------------------------------------------------------------------------------------------------------


def shown(found: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    """Return the Markdown of the table of kernels and of the tables of rings."""
    head = ("", "order", "by hand, ns", "generated, ns", "generated / by hand")
    first = [
        (r["title"], str(r["order"]), f"{r['by hand']:.3g}", f"{r['generated']:.3g}",
         f"{r['generated'] / r['by hand']:.2f}") for r in found["kernels"]
    ]  # fmt: skip
    text = (
        "Processor time of a step, divided by the number of sites. "
        "Runs of both programs alternate, and the smallest time counts."
        f"\n\n{table(head, first)}\n"
    )
    head = (
        "method",
        "h",
        "ns for a site and unit of time",
        "largest error of H",
        "last fifth / first",
        "change of lengths",
    )
    for title in dict.fromkeys(r["sites"] for r in found["rings"]):
        rows = [
            (r["method"], f"{r['h']:g}", f"{r['ns']:.3g}", f"{r['energy']:.1e}", f"{r['late']:.1f}",
             "" if np.isnan(r["casimir"]) else f"{r['casimir']:.0e}") for r in found["rings"] if r["sites"] == title
        ]  # fmt: skip
        text += f"\n### {title[0].upper()}{title[1:]}, 1,024 sites, T = 10,000\n\n{table(head, rows)}\n"
    return text
