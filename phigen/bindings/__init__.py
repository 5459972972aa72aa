"""Bindings: modules of other languages that call the generated C, printed from the `Interface` of a solver."""
