"""Bindings: modules in other languages that call the generated C, printed from the `Interface` of a solver."""
