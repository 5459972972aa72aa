"""Small lattices that several tests use: grids of one, two and three axes with both kinds of boundary, graphs, and
pairs.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from phigen.lattice.cell import Cell
from phigen.lattice.states import Start
from phigen.symbolic.arrays import evaluate
from phigen.symbolic.expression import Expression

SPINS = """\
phigen: 1
name: spins
lattice: {{axes: [{axes}], boundary: [{boundary}]}}
coordinates: [x, y, z]
parameters: {{J: 1.5, D: 0.3, B: {{value: 0.2 + i/N_i, at: sites}}}}
poisson: {{lie_algebra: {{name: so(3)}}}}
hamiltonian: -J*({bonds}) - B*z + D*z**2
casimirs: {{C: x**2 + y**2 + z**2}}
invariants: {{M: z}}
runs:
  quench: {{sizes: [{sizes}], initial: {{random: sphere, seed: 1}}, step: 0.02, steps: 50}}
"""


def spins(axes: str, boundary: str, sizes: str) -> str:
    """Return the spec of Heisenberg spins in a field along z, with anisotropy."""
    bonds = " + ".join(f"{c}*{c}[{a}+1]" for a in axes.split(", ") for c in "xyz")
    return SPINS.format(axes=axes, boundary=boundary, bonds=bonds, sizes=sizes)


TODA = """\
phigen: 1
name: toda
lattice: {axes: [i], boundary: BOUNDARY}
coordinates: [a, b]
poisson: {brackets: {a: {b: a/2, "b[i+1]": -a/2}}}
hamiltonian: b**2/2 + 2*a**2
casimirs: {B: {value: b, at: sum}, A: {value: a, at: product}}
invariants: {K: "b**3/3 + 2*a**2*(b + b[i+1])"}
runs:
  waves: {sizes: [4], initial: {a: 1 + i/N_i, b: cos(2*pi*i/N_i)}, step: 0.02, steps: 50}
"""
VOLTERRA = """\
phigen: 1
name: volterra
lattice: {axes: [i], boundary: BOUNDARY}
coordinates: [a]
poisson: {brackets: {a: {"a[i+1]": "a*a[i+1]"}}}
hamiltonian: a
invariants: {I2: "a**2/2 + a*a[i+1]", L: {log}}
runs:
  hill: {sizes: [5], initial: {a: 1 + i/10}, step: 0.02, steps: 50}
""".replace(", L: {log}", ", L: log(a)")
FPUT = """\
phigen: 1
name: fput
lattice: {axes: [i], boundary: BOUNDARY}
coordinates: [q, p]
parameters: {alpha: 0.25, beta: 0.5}
definitions: {r: "q[i+1] - q"}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + r**2/2 + alpha*r**3/3 + beta*r**4/4
invariants: {P: p}
runs:
  mode: {sizes: [5], initial: {q: sin(2*pi*i/N_i), p: {random: normal, seed: 2, scale: 0.1}}, step: 0.02, steps: 50}
"""
#: A constant bracket with a stencil.
KDV = """\
phigen: 1
name: kdv
lattice: {axes: [i], boundary: periodic}
coordinates: [u]
parameters: {d: {value: 0.5, positive: true}}
poisson: {brackets: {u: {"u[i+1]": 1/(2*d)}}}
hamiltonian: -u**3/6 + (u[i+1] - u)**2/(2*d**2)
casimirs: {M: {value: u, at: sum}}
runs:
  wave: {sizes: [5], initial: {u: cos(2*pi*i/N_i)}, step: 0.02, steps: 50}
"""
FAR = """\
phigen: 1
name: far
lattice: {axes: [i, j], boundary: [BOUNDARY, periodic]}
coordinates: [q, p]
parameters: {w: {value: 1 + 0.1*i*j, at: sites}}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + w*cos(q[i-1,j+1] - q) + w[i+1]*q*q[i+2] + q**4
runs:
  some: {sizes: [4, 3], initial: {q: {random: uniform, seed: 2}, p: i - j/3}, step: 0.02, steps: 50}
"""
SPIN_GRAPH = """\
phigen: 1
name: spin_graph
lattice: {graph: bonds}
coordinates: [x, y, z]
parameters: {J: {value: [1, 2, 3, -1], at: bonds}, B: {value: 0.3, at: sites}, D: 0.2}
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: {sites: -B*z, bonds: "-J*(x[a]*x[b] + y[a]*y[b] + z[a]*z[b]) - D*(x[a]*y[b] - y[a]*x[b])"}
casimirs: {C: x**2 + y**2 + z**2}
invariants: {M: z}
runs:
  knot: {bonds: [[0, 1], [1, 2], [2, 0], [2, 3]], initial: {random: sphere, seed: 4}, step: 0.02, steps: 50}
"""
FOOD_WEB = """\
phigen: 1
name: food_web
lattice: {graph: eats}
coordinates: [x]
parameters: {A: {value: [1, 2, 0.5, 1, 3], at: bonds}, r: {value: [0.5, 1, 0.7, 0.2], at: sites}}
poisson: {bonds: {"x[a]": {"x[b]": "A*x[a]*x[b]"}}}
hamiltonian: {sites: x - r*log(x)}
runs:
  four: {bonds: [[0, 1], [1, 2], [2, 3], [0, 2], [2, 0]], initial: {x: [1, 2, 1.5, 0.7]}, step: 0.02, steps: 50}
"""
VORTICES = """\
phigen: 1
name: vortices
lattice: {pairs: all}
coordinates: [x, y]
parameters: {G: {value: [1, 2, -1, 0.5], at: sites, positive: false}}
poisson: {brackets: {x: {y: 1/G}}}
hamiltonian: {pairs: "-G[a]*G[b]*log((x[a] - x[b])**2 + (y[a] - y[b])**2)/(4*pi)"}
invariants: {X: G*x, Y: G*y, L: G*(x**2 + y**2)}
runs:
  four: {initial: {x: [0, 1, 1.2, -0.5], y: [0, 0.1, 1, -1]}, step: 0.02, steps: 50}
"""

#: Specs of lattices by name.
LATTICES = {
    "spins_1": spins("i", "periodic", "4"),
    "spins_1_open": spins("i", "open", "4"),
    "spins_2": spins("i, j", "open, periodic", "3, 2"),
    "spins_3": spins("i, j, k", "periodic, open, periodic", "2, 2, 2"),
    "toda": TODA.replace("BOUNDARY", "periodic"),
    "volterra": VOLTERRA.replace("BOUNDARY", "periodic"),
    "fput": FPUT.replace("BOUNDARY", "periodic"),
    "fput_open": FPUT.replace("BOUNDARY", "open"),
    "kdv": KDV,
    "far": FAR.replace("BOUNDARY", "periodic"),
    "far_open": FAR.replace("BOUNDARY", "open"),
    "spin_graph": SPIN_GRAPH,
    "food_web": FOOD_WEB,
    "vortices": VORTICES,
}


def on_grid(cell: Cell, start: Start, expression: Expression) -> np.ndarray:
    """Return an expression at every site of a periodic grid; the values at neighbours are shifted arrays."""
    parameters = {n: v for n, v in start.parameters.items() if n not in cell.neighbours.names}
    fields = dict(zip(cell.fields, start.state, strict=True))
    for symbol, (base, offset) in cell.places(expression).items():
        array = fields[base] if base in fields else start.parameters[base]
        parameters[symbol] = np.roll(array, [-o for o in offset], axis=tuple(range(len(offset))))
    return np.broadcast_to(evaluate([expression], parameters)[0], start.sizes)


def with_threads(compute: Callable[[], np.ndarray]) -> Iterator[np.ndarray]:
    """Yield the result with one thread of OpenMP, then with more threads than cores, which wait for one another by
    sleeping.
    """
    try:
        library = ctypes.CDLL("libgomp.so.1")
    except OSError:
        pytest.skip("no OpenMP")
    for threads in (1, 3, 4):
        library.omp_set_num_threads(threads)
        yield compute()
    library.omp_set_num_threads(2)
