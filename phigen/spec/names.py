"""Tables of names in specs: reserved names, and the words that keys such as ``scheme`` accept."""

from __future__ import annotations

import re
from collections.abc import Callable

from phigen.symbolic.functions import FUNCTIONS

#: Functions that expressions may use, with their number of arguments.
SPEC_FUNCTIONS: dict[str, int] = {"sqrt": 1} | {f.name: f.arity for f in FUNCTIONS.values() if not f.own}

#: Piecewise functions with their number of arguments. Only observables and ``stop`` may use them, because
#: observables and ``stop`` are not differentiated.
PIECEWISE_FUNCTIONS: dict[str, int] = {"sign": 1, "heaviside": 1, "min": 2, "max": 2, "if": 3}

SPEC_NAME = r"[a-z][a-z0-9_]{0,30}"
IDENTIFIER = r"[A-Za-z_][A-Za-z0-9_]*"

#: Names of arguments of the generated functions. Parameters are passed by keyword too, so they must have other names.
ARGUMENTS = frozenset(["x", "x0", "X0", "h", "steps", "stride", "gauge", "cotangent", "attitude0", "position0"])
#: Names of arguments of the generated functions if the equations depend on the time.
TIMED_ARGUMENTS = ARGUMENTS | {"t", "t0"}
#: Names of further arguments of the generated functions if there is noise.
NOISY_ARGUMENTS = frozenset(["seed", "member", "step0", "increments"])


def argument_hint(name: str) -> str:
    """Return the hint for a parameter that has the ``name`` of an argument of generated functions."""
    proposed = f"{name}_0" if len(name) > 1 else f"{name}{name}"
    return f"parameters are passed by name in Python, where {name}= is an argument of solvers; call it {proposed}, say"


#: Words that users of other programs may write as a key, with the key that specs have instead.
MEANT = {
    "friction": "damping", "dissipation": "damping", "drag": "damping", "force": "forces", "torque": "forces",
    "forcing": "forces", "drive": "forces", "driving": "forces", "control": "forces",
    "energy": "hamiltonian", "H": "hamiltonian", "pi": "poisson",
    "variables": "coordinates", "state": "coordinates", "constants": "parameters", "t": "time", "times": "time",
    "dt": "step", "h": "step", "x0": "initial", "t0": "start", "t_start": "start", "t_end": "until",
    "end": "until", "to": "until", "adaptive": "monitor", "event": "stop", "events": "stop",
    "t_eval": "every", "saveat": "every", "tol": "tolerance",
    "algebra": "lie_algebra",
    "conserved": "invariants", "temperature": "noise", "thermal": "noise", "thermostat": "noise",
    "langevin": "noise", "diffusion": "noise",
    "stochastic": "noise", "noises": "noise", "sigma": "amplitude", "g": "hamiltonian", "random_seed": "seed",
    "realisations": "members", "paths": "members", "samples": "members",
    "attitude": "reconstruct", "attitudes": "reconstruct", "orientation": "reconstruct", "pose": "reconstruct",
    "quaternion": "reconstruct", "rotation": "reconstruct",
    "default": "value", "shape": "sizes",
    "precision": "order", "float": "real", "accuracy": "order", "rtol": "tolerance", "atol": "tolerance",
    "method": "scheme", "integrator": "scheme",
}  # fmt: skip

#: Words that users of other programs may write as a value, with the value that specs have instead.
MEANT_WORDS = {
    "python": "numpy", "javascript": "js", "JavaScript": "js", "cuda": "device", "opencl": "device", "gpu": "device",
    "single": "float", "float32": "float", "float64": "double", "misra": "certified",
    "-": "minus", "-1": "minus", "negative": "minus", "+": "plus", "1": "plus", "+1": "plus", "positive": "plus",
    "RK4": "rk4", "RK45": "dop853", "midpoint": "implicit-midpoint",
    "up": "rising", "down": "falling", "increasing": "rising", "decreasing": "falling",
}  # fmt: skip

#: Languages and formats that are not allowed under ``targets`` → hint: the option of ``phigen build`` that writes them.
OTHER_TARGETS = {
    **dict.fromkeys(
        ("cpp", "c++", "C++", "fortran", "Fortran", "julia", "Julia", "matlab", "MATLAB", "rust", "Rust"),
        "phigen build --binding NAME writes modules that call the C, where NAME is cpp, fortran, julia, matlab or rust",
    ),
    **dict.fromkeys(("fmu", "FMU"), "phigen build --fmu writes FMUs, which contain the C"),
}

_LICENSES = """0BSD AFL-3.0 AGPL-3.0-only AGPL-3.0-or-later Apache-2.0 Artistic-2.0 BSD-1-Clause BSD-2-Clause
BSD-2-Clause-Patent BSD-3-Clause BSD-3-Clause-Clear BSD-4-Clause BSL-1.0 CC-BY-4.0 CC-BY-SA-4.0 CC0-1.0 CECILL-2.1
CECILL-B CECILL-C ECL-2.0 EPL-1.0 EPL-2.0 EUPL-1.1 EUPL-1.2 GPL-2.0-only GPL-2.0-or-later GPL-3.0-only
GPL-3.0-or-later ISC LGPL-2.1-only LGPL-2.1-or-later LGPL-3.0-only LGPL-3.0-or-later LPPL-1.3c MIT MIT-0 MPL-2.0
MS-PL MS-RL MulanPSL-2.0 NCSA OFL-1.1 OSL-3.0 PostgreSQL Python-2.0 Unlicense UPL-1.0 Vim WTFPL X11 Zlib
zlib-acknowledgement ZPL-2.1"""
LICENSES = tuple(_LICENSES.split())
LICENSE_REFERENCE = re.compile(r"LicenseRef-[A-Za-z0-9.-]{1,60}")

#: Families of matrix Lie algebras: for each, the smallest n, and the dimension of the algebra as a function of n. The
#: argument of sp is the size of its matrices, 2n.
FAMILIES: dict[str, tuple[int, Callable[[int], int]]] = {
    "so": (2, lambda n: n * (n - 1) // 2),
    "se": (2, lambda n: n * (n + 1) // 2),
    "sl": (2, lambda n: n * n - 1),
    "gl": (1, lambda n: n * n),
    "su": (2, lambda n: n * n - 1),
    "sp": (2, lambda n: n * (n + 1) // 2),
    "heisenberg": (1, lambda n: 2 * n + 1),
    "aff": (1, lambda n: n * n + n),
}
FAMILY_HELP = "so(n), se(n), sl(n), gl(n), su(n), sp(2n), heisenberg(n) or aff(n)"
FAMILY_NAME = re.compile(r"([a-z]+)\(([1-9][0-9]{0,2})\)")

#: Kinds of bi-realisations, the pairs of maps α, β from which the step of the series is built.
BIREALISATIONS = (
    "auto",
    "constant",
    "canonical-euler",
    "log-canonical",
    "gauged",
    "cayley",
    "exponential",
    "group-map",
    "karasev",
    "spray",
    "product",
    "pullback",
    "custom",
)
POISSON_FORMS = ("matrix", "brackets", "canonical", "log_canonical", "lie_algebra", "nambu", "product", "pullback")
#: Profiles of the generated C: for speed, for small code, and for certified bounds of the error.
PROFILES = ("fast", "small", "certified")

#: Number types of the C.
REALS = ("double", "float")

#: PARTS: parts of the generated code that can be left out one by one. LEFT_OUT: the parts that each profile leaves out.
PARTS = ("by-hand", "ensemble", "gauge-search", "kicks", "lanes", "members", "parameters", "recurrences")
LEFT_OUT = {
    "fast": frozenset[str](),
    "small": frozenset(["by-hand", "gauge-search", "lanes", "members", "parameters", "recurrences"]),
    "certified": frozenset(PARTS),
}

#: Directions of crossings of a section.
DIRECTIONS = ("rising", "falling", "both")

#: SWEEP_NAMES: quantities that a sweep may vary besides parameters and initial values. KEPT: quantities that a sweep
#: may store.
SWEEP_NAMES = ("step", "start", "seed")
KEPT = ("final", "energy_error", "casimir_error", "lyapunov", "crossings")
#: REDUCTIONS: ways to reduce a density on a lattice to one number. ADDITIVE: the linear ones among them.
REDUCTIONS = ("mean", "sum", "max", "min")
ADDITIVE = ("mean", "sum")
#: Elements of a lattice over which the density of an observable may be reduced.
OVER = ("sites", "bonds", "pairs")
#: Statistics that a sweep may store for an observable M: the mean mean(M) over a run, the standard deviation std(M),
#: and the standard error error(M) of the mean.
STATISTICS = ("mean", "std", "error")

#: Representations of an attitude (the rotation of a rigid body) that ``reconstruct:`` may name.
RECONSTRUCTIONS = ("quaternion", "matrix")

#: CORRECTED: Wisdom–Holman compositions; all except the first have a corrector. NEAR_INTEGRABLE: all compositions for
#: near-integrable systems. FLOW_COMPOSITIONS: all compositions that need a splitting of H into two parts.
#: COMPOSITIONS: all compositions.
CORRECTED = (
    *(f"wisdom-holman{order}" for order in ("", "-3", "-5", "-7", "-11", "-17")),
    *(f"wisdom-holman-modified-{order}" for order in (7, 11, 17)),
)
NEAR_INTEGRABLE = ("saba-4-2", "saba-6-2", "saba-8-2", "saba-10-2", *CORRECTED, "aba-8-4", "aba-8-6-4", "aba-10-6-4")
FLOW_COMPOSITIONS = ("blanes-moan", "blanes-moan-rkn", "nystrom", "force-gradient", *NEAR_INTEGRABLE)
COMPOSITIONS = (
    "auto",
    "none",
    "suzuki",
    "triple-jump",
    "kahan-li",
    "yoshida",
    "sofroniou-spaletta",
    *FLOW_COMPOSITIONS,
)
#: Name of the monitor for splittings of H = A + B. With this monitor, the splitting integrates K = log(A + e) −
#: log(−B), where e = −H(x₀).
LOGARITHMIC = "log"
SCHEMES = ("auto", "series", "splitting", "gauss")
#: Words for ``structure:`` of a Gauss method: its step is a Poisson map exactly, or up to the truncation error.
STRUCTURES = ("exact", "to truncation")
#: Relative coordinates for attracting bodies; a splitting divides H into parts in these coordinates.
RELATIVE = ("jacobi", "democratic_heliocentric")
#: Classical methods with which a run can be compared.
CLASSICAL_METHODS = ("euler", "rk2", "rk4", "implicit-midpoint", "dop853")
