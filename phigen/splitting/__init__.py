"""The Hamiltonian as a sum of parts whose flows are elementary, and these flows: explicit steps."""
