"""The spec that ``phigen new NAME`` prints: a working system with comments on what to change."""

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
    stride: 10                  # every how many steps are stored
"""


def starter(name: str) -> str:
    """The starter spec of that name.

    Raises `SpecError` if the name is not one for a spec.
    """
    text = _TEMPLATE.format(name=name)
    loads(text, f"{name}.yaml")
    return text
