"""The specs that ``phigen new NAME`` prints: working systems with comments on what to change."""

from __future__ import annotations

from phigen.spec import loads

_TEMPLATE = """\
# A Poisson system for phigen. This one is the free rigid body: change it into yours, then run
#   phigen check {name}.yaml    # the mathematics: skew symmetry, Jacobi identity, Casimirs, invariants
#   phigen build {name}.yaml    # the solver, in C and NumPy
phigen: 1                       # version of this format
name: {name}
title: Free rigid body
license: 0BSD                   # of the generated code

# Expressions: numbers, names, + - * / ** ( ), sqrt exp log sin cos tan asin acos atan atan2
# sinh cosh tanh asinh acosh atanh abs, and the constants pi and E.
coordinates: [x1, x2, x3]

# Arguments of the generated code, with default values.
parameters:
  I1: 1
  I2: {{value: 2, positive: true, description: second moment of inertia}}
  I3: 3

# Named parts of expressions.
definitions:
  kinetic: (x1**2/I1 + x2**2/I2 + x3**2/I3)/2

# The Poisson structure, in exactly one of the forms matrix, brackets, canonical, log_canonical,
# lie_algebra, nambu, product and pullback. Brackets that are not given are 0.
poisson:
  brackets:
    x1: {{x2: -x3, x3: x2}}
    x2: {{x3: -x1}}

hamiltonian: kinetic

casimirs:                       # conserved whatever the Hamiltonian; checked
  C: x1**2 + x2**2 + x3**2
invariants: {{}}                  # further first integrals, if you know some; checked

birealisation: auto             # how the structure is discretised
order: 4                        # of the method
targets: [c, numpy]

# Experiments for phigen run, verify and report.
runs:
  tumbling:
    initial: [0.1, 1, 0.1]
    step: 0.05
    duration: 100               # or steps: 2000
    stride: 10                  # steps from one stored state to the next
"""


_LATTICE = """\
# A lattice of identical sites for phigen. This one is a chain of spins: change it into yours, then run
#   phigen check {name}.yaml    # proved for all sizes: Jacobi identity, Casimirs, invariants
#   phigen show {name}.yaml --expand 4   # a small one as an ordinary spec
phigen: 1                       # version of this format
name: {name}
title: Chain of spins
license: 0BSD                   # of the generated code

# One to three axes, the slowest first; boundary: periodic, open, or a list. Sizes are given by runs.
# For other relations: {{graph: bonds}}, with a list of bonds, or {{pairs: all}}.
lattice: {{axes: [i], boundary: periodic}}
coordinates: [x, y, z]          # of every site

parameters:
  J: 1
  Delta: 1.3
  B: {{value: 0.1*cos(2*pi*i/N_i), at: sites}}   # an array: a number, a formula of i and N_i, a list, a file, or random

# The structure of one site, in any form. `brackets` may name neighbours: {{a: {{"b[i-1]": -a/2}}}}.
poisson: {{lie_algebra: {{name: so(3)}}}}

# The density: H is its sum over the sites. x[i+1] is x at the next site; inside {{ }} it needs quotes.
hamiltonian: -J*(x*x[i+1] + y*y[i+1] + Delta*z*z[i+1]) - B*z

casimirs:                       # one for each site; {{value: …, at: sum}} or product for others
  C: x**2 + y**2 + z**2
invariants:                     # sums of densities
  M: z

order: 4                        # of the method

# Experiments for phigen run, verify and report.
runs:
  quench:
    sizes: [64]
    initial: {{random: sphere, seed: 1}}   # or by field: {{x: sin(2*pi*i/N_i), …}}, or a file state.npy
    step: 0.05
    duration: 50                # or steps: 1000
    stride: 10                  # steps from one stored state to the next
"""


def starter(name: str, *, lattice: bool = False) -> str:
    """Return the YAML text of a commented example spec with this name, of a system or of a lattice.

    Raises `SpecError` if the name is not allowed for a spec.
    """
    text = (_LATTICE if lattice else _TEMPLATE).format(name=name)
    loads(text, f"{name}.yaml")
    return text
