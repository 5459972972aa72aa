"""Specs for the tests of the command line."""

GOOD = """\
phigen: 1
name: {name}
coordinates: [q, p]
poisson:
  canonical: {{q: [q], p: [p]}}
hamiltonian: (q**2 + p**2)/2
order: {order}
runs:
  turn:
    initial: [1, 0]
    step: 0.1
    steps: 50
    compare: [rk4]
    exact: {{q: cos(t), p: -sin(t)}}
"""

#: A spec whose brackets violate the Jacobi identity.
NOT_POISSON = """\
phigen: 1
name: wrong
coordinates: [x, y, z]
poisson:
  matrix: [[0, z, -y*z], [-z, 0, x], [y*z, -x, 0]]
hamiltonian: (x**2 + y**2 + z**2)/2
"""
