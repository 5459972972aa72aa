"""Specs with one value replaced by a wrong one. The specs together use every key of the format, and each value is
replaced by values of all kinds.
"""

from __future__ import annotations

import copy
import random
from collections.abc import Iterator
from typing import Any

from phigen.spec.problems import Problems
from phigen.spec.yaml_source import Mapping, Node, Scalar, Sequence, decode, read

#: Replacements, as YAML text. Most keys refuse each of them.
VALUES = (
    "[]", "{}", "0", "-1", "nan", ".nan", ".inf", "1e400", "x", '""', "true", "null", "[[]]", "{a: {}}", "[null]",
    "1.5", "'7'", "²", "[1, [2]]", "{random: normal}", "2026-01-01", "missing.csv", "missing.npy", "-.inf", "1/0",
    "99999999999999999999", "q", "[q]", "{q: 1}", "'q['", "1e-400", "~", "{0: 0}", "random", "auto", "sqrt(-1)",
)  # fmt: skip

#: Specs that together use every key of the format; each compiles.
BASES = {
    "ordinary": """\
phigen: 1
name: oscillator
title: An oscillator
description: It swings.
references: [somebody]
license: MIT
coordinates: [q, p]
time: t
parameters: {k: {value: 2, positive: true, at: all, description: stiffness, unit: N/m}, g: {value: 0.1, small: true}}
inputs: [g]
definitions: {kinetic: p**2/2}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: kinetic + k*q**2/2 + g*q*sin(t)
forces: {covector: {q: g*p/10}, vector: {p: -g*q/10}}
damping: g/100
order: 2
composition: auto
scheme: series
profile: small
real: double
without: [ensemble]
solver: {method: newton, tolerance: 1e-12, max_iterations: 30, lanes: false, compensated: false}
tangent: true
targets: [c, numpy]
runs:
  a:
    initial: [1, 0]
    step: 0.1
    steps: 10
    start: 0.5
    stride: 2
    parameters: {k: 3}
    section: q
    direction: falling
    description: it swings
  b: {initial: {q: 1, p: 0}, step: 0.1, duration: 1, every: 0.2, compare: [rk4], stop: q + 5, box: {q: [-1, 2]}}
  c: {initial: [1, 0], step: 0.1, until: 0.95}
sweeps:
  s:
    run: a
    over: {k: {from: 1, to: 2, count: 3, scale: log}, q: [1, 2]}
    keep: [final, crossings]
    frames: 5
    description: many
  r: {run: a, over: {random: 5, seed: 3, k: {from: 1, to: 2}}}
""",
    "autonomous": """\
phigen: 1
name: pendulum
coordinates: [q, p]
parameters: {k: 2}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - k*cos(q)
birealisation: {kind: canonical-euler, side: q}
terms: 2
monitor: 1/(1 + p**2)
adjoint: true
modified_hamiltonian: 0
runs:
  a: {initial: [1, 0], step: 0.1, steps: 10, exact: {q: x0_q}}
  b: {initial: [1, 0], step: 0.1, steps: 5, at: [0.2]}
""",
    "splitting": """\
phigen: 1
name: split
coordinates: [q, p]
poisson: {matrix: [[0, 1], [-1, 0]]}
hamiltonian: p**2/2 - cos(q)
invariants: {H2: p**2/2 - cos(q)}
observables: {A: "sign(q) + if(q < p, q, p)"}
scheme: splitting
order: 4
composition: yoshida
runs: {a: {initial: [1, 0], step: 0.1, steps: 10, average: {after: 0.2, blocks: 2}}}
sweeps: {s: {over: {step: [0.1, 0.2]}, keep: [final, energy_error, mean(A)]}}
""",
    "bodies": """\
phigen: 1
name: binary
coordinates: [x0, y0, x1, y1, u0, v0, u1, v1]
parameters: {G: 1, m0: {value: 3, positive: true}, m1: {value: 0.1, positive: true}}
poisson: {canonical: {q: [x0, y0, x1, y1], p: [u0, v0, u1, v1]}}
hamiltonian: (u0**2 + v0**2)/(2*m0) + (u1**2 + v1**2)/(2*m1) - G*m0*m1/sqrt((x0 - x1)**2 + (y0 - y1)**2)
scheme: splitting
coordinates_from: jacobi
order: 2
""",
    "rigid": """\
phigen: 1
name: rigid
coordinates: [x, y, z]
parameters: {I: 2}
poisson: {lie_algebra: {name: so(3), sign: minus}}
hamiltonian: (x**2 + y**2/I + z**2/3)/2
casimirs: {C: x**2 + y**2 + z**2}
gauge: {C: 1/2}
reconstruct: quaternion
modified_hamiltonian: 1
birealisation: {kind: group-map, tau: (1 + P/2)/(1 - P/2)}
runs: {a: {initial: [1, 0, 0.1], step: 0.1, steps: 10}}
""",
    "constants": """\
phigen: 1
name: constants
coordinates: [x, y, z]
poisson: {lie_algebra: {structure_constants: {E1: {E2: {E3: 1}}, E2: {E3: {E1: 1}}, E3: {E1: {E2: 1}}}}}
hamiltonian: (x**2 + y**2/2 + z**2/3)/2
birealisation: {kind: spray, spray: natural, degree: 4}
runs: {a: {initial: [1, 0, 0.1], step: 0.1, steps: 10}}
""",
    "matrices": """\
phigen: 1
name: matrices
coordinates: [x, y]
poisson: {lie_algebra: {matrices: [[[1, 0], [0, 0]], [[0, 1], [0, 0]]]}}
hamiltonian: x**2 + y**2
order: 2
runs: {a: {initial: [1, 0.1], step: 0.01, steps: 10}}
""",
    "volterra": """\
phigen: 1
name: volterra
coordinates: [x, y]
poisson: {log_canonical: [[0, 1], [-1, 0]]}
hamiltonian: x - log(x) + y - log(y)
birealisation: auto
runs: {a: {initial: [1, 0.5], step: 0.1, steps: 10}}
""",
    "nambu": """\
phigen: 1
name: nambu
coordinates: [x, y, z]
poisson: {nambu: [x**2/2 + y]}
hamiltonian: x**2 + y**2/2 + z**2/3
order: 2
runs: {a: {initial: [1, 0, 0.1], step: 0.1, steps: 10}}
""",
    "gauss": """\
phigen: 1
name: body
coordinates: [x, y, z]
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: x**2 + y**2/2 + z**2/3
scheme: gauss
structure: exact
order: 4
runs: {a: {initial: [1, 0, 0.1], step: 0.1, steps: 10}}
""",
    "product": """\
phigen: 1
name: blocks
coordinates: [q, p, x, y, z]
poisson:
  product:
    - {coordinates: [q, p], canonical: {q: [q], p: [p]}}
    - {coordinates: [x, y, z], lie_algebra: {name: so(3)}}
hamiltonian: p**2/2 + q**2/2 + x**2/2 + y**2 + z**2/3 + q*x
birealisation: {kind: product, of: auto}
order: 2
runs: {a: {initial: [1, 0, 1, 0, 0.1], step: 0.1, steps: 10}}
""",
    "pullback": """\
phigen: 1
name: pulled
coordinates: [q, p]
poisson:
  pullback:
    of: {canonical: {q: [u], p: [v]}}
    map: {u: q, v: p + q**2}
    inverse: {q: u, p: v - u**2}
hamiltonian: (p + q**2)**2/2 + q**2/2
order: 2
runs: {a: {initial: [1, 0], step: 0.1, steps: 10}}
""",
    "custom": """\
phigen: 1
name: by_hand
coordinates: [q, p]
poisson: {brackets: {q: {p: 1}}}
hamiltonian: q**2/2 + p**2/2
birealisation: {kind: custom, alpha: [q - p_p/2, p + p_q/2], beta: [q + p_p/2, p - p_q/2]}
order: 2
runs: {a: {initial: [1, 0], step: 0.1, steps: 10}}
""",
    "noisy": """\
phigen: 1
name: thermal
coordinates: [q, p]
time: t
parameters: {s: 0.1}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + q**2/2
noise: {w: {hamiltonian: q, amplitude: s*cos(t)}}
damping: s/10
runs: {a: {initial: [1, 0], step: 0.1, steps: 10, seed: 3, members: 5}}
sweeps: {s: {run: a, over: {seed: {count: 3}, s: [0.1, 0.2]}}}
""",
    "chain": """\
phigen: 1
name: chain
lattice: {axes: [i], boundary: open}
coordinates: [q, p]
time: t
parameters:
  B: {value: {random: normal, seed: 1, scale: 0.1, mean: 1}, at: sites}
  k: {value: 1, at: sites}
  g: {value: 0.1, nonnegative: true}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + k*(q[i+1] - q)**2/2 + B*q**2 + g*q*sin(t)
casimirs: {}
invariants: {}
forces: {covector: {q: g*p/10}}
damping: g/100
observables: {M: {mean: q}, E: {sum: "p*q[i+1]"}, L: {max: q}, S: {min: "q - q[i+1]"}, F: "if(q > t, q, 0)"}
solver: {compensated: true}
order: 2
runs:
  a: {sizes: [6], initial: {q: {random: normal, seed: 1, scale: 0.5, mean: i/2}, p: 0}, step: 0.1, steps: 4, start: 1}
  e: {sizes: [6], initial: {q: 1, p: 0}, step: 0.1, until: 0.55, every: 0.1, stop: M - 5, section: E - t,
      direction: both, spectrum: {of: [q, p], after: 0.1}, correlation: {of: q, with: p, axis: i, up to: 2, after: 0.2}}
  b: {sizes: [6], initial: {random: uniform, seed: 1, scale: 0.5, mean: i/2}, step: 0.1, steps: 4, stride: 2,
      record: [M, energy]}
  c: {sizes: [6], initial: [1, 2], step: 0.1, duration: 0.4, parameters: {B: [1, 2, 3, 4, 5, 6], k: i + 1, g: 0}}
sweeps: {s: {run: a, over: {g: [1, 2], seed: {count: 2}}, target: numpy}}
""",
    "plane": """\
phigen: 1
name: plane
lattice: {axes: [i, j], boundary: [periodic, open]}
coordinates: [x, y, z]
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: -(x*x[i+1] + y*y[i+1] + z*z[i+1]) - (x*x[j+1] + y*y[j+1] + z*z[j+1])
casimirs: {S: {value: x**2 + y**2 + z**2, at: sites}}
noise: {w: {hamiltonian: z, amplitude: 0.1}}
order: 2
runs: {a: {sizes: [4, 4], initial: {random: sphere, seed: 3, scale: 1}, step: 0.1, steps: 2, seed: 3}}
""",
    "ring": """\
phigen: 1
name: ring
lattice: {axes: [i], boundary: periodic}
coordinates: [a, b]
poisson: {brackets: {a: {b: a/2, "b[i-1]": -a/2}}}
hamiltonian: b**2/2 + 2*a**2
order: 4
runs: {a: {sizes: [4], initial: {a: 1 + i/N_i, b: 0}, step: 0.1, steps: 2}}
""",
    "graph": """\
phigen: 1
name: graph
lattice: {graph: bonds}
coordinates: [q, p]
parameters: {k: {value: [1, 2, 3], at: bonds}, m: {value: 2, at: sites, positive: true}}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: {sites: p**2/(2*m), bonds: "k*(q[a] - q[b])**2/2"}
observables: {E: {mean: "k*q[a]*q[b]", over: bonds}}
order: 2
runs:
  a: {sizes: [4], bonds: [[0, 1], [1, 2], [2, 3]], initial: {q: [1, 0, 0, 0], p: 0}, step: 0.1, steps: 4}
  b: {bonds: [[0, 1], [1, 2], [2, 3]], initial: {q: [1, 0, 0, 0], p: {random: normal}}, step: 0.1, steps: 4,
      parameters: {k: {random: uniform, seed: 2, scale: 0.1, mean: 2}, m: [1, 2, 3, 4]}}
""",
    "eaters": """\
phigen: 1
name: eaters
lattice: {graph: eats}
coordinates: [x]
poisson: {bonds: {"x[a]": {"x[b]": "x[a]*x[b]"}}}
hamiltonian: {sites: x - log(x)}
order: 2
runs: {a: {bonds: [[0, 1], [1, 2]], initial: {x: [1, 2, 1]}, step: 0.1, steps: 4}}
""",
    "pairs": """\
phigen: 1
name: vortices
lattice: {pairs: all}
coordinates: [x, y]
parameters: {G: {value: 1 + i, at: sites}}
poisson: {brackets: {x: {y: 1/G}}}
hamiltonian: {pairs: "-G[a]*G[b]*log((x[a] - x[b])**2 + (y[a] - y[b])**2)"}
order: 2
runs: {a: {sizes: [4], names: [a, b, c, "d e"], initial: {x: [1, 0, 0, 2], y: [0, 1, 2, 0]}, step: 0.01, steps: 4}}
""",
}


def tree_of(text: str) -> Node:
    """Return the YAML tree of a spec."""
    return read(decode(text.encode(), "<base>"), Problems("<base>", text))


def written(node: Node | str) -> str:
    """Return a node as YAML in flow style, on one line. A replacement is text already and is returned unchanged."""
    match node:
        case Scalar():
            bare = node.plain and not set(node.text) & set(",[]{}")  # these characters separate values in flow style
            return node.text if bare else "'" + node.text.replace("'", "''") + "'"
        case Sequence():
            return "[" + ", ".join(map(written, node.items)) + "]"
        case Mapping():
            return "{" + ", ".join(f"{written(key)}: {written(value)}" for key, value in node.entries.values()) + "}"
    assert isinstance(node, str)
    return node


def document(tree: Node) -> str:
    """Return the text of a spec, with each top-level key on a line."""
    assert isinstance(tree, Mapping)
    return "".join(f"{written(key)}: {written(value)}\n" for key, value in tree.entries.values())


def places(node: Node, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the path of each value below a node, as a tuple of keys and indices."""
    items: Any = ()
    if isinstance(node, Mapping):
        items = [(key, value) for key, (_, value) in node.entries.items()]
    elif isinstance(node, Sequence):
        items = enumerate(node.items)
    for key, value in items:
        yield (*path, key)
        yield from places(value, (*path, key))


def replaced(tree: Node, path: tuple[Any, ...], value: str | None) -> Node:
    """Return a copy of the tree with the value at ``path`` replaced by a text, or removed if the text is None."""
    tree = copy.deepcopy(tree)
    node: Any = tree
    for part in path[:-1]:
        node = node.entries[part][1] if isinstance(node, Mapping) else node.items[part]
    last = path[-1]
    if isinstance(node, Mapping):
        if value is None:
            del node.entries[last]
        else:
            node.entries[last] = node.entries[last][0], value
    elif value is None:
        del node.items[last]
    else:
        node.items[last] = value
    return tree


def mutants(base: str, rng: random.Random, count: int) -> list[tuple[tuple[Any, ...], str]]:
    """Return a random sample of pairs: the path of a value in the spec ``BASES[base]``, and a replacement."""
    return rng.sample([(path, value) for path in places(tree_of(BASES[base])) for value in VALUES], count)
