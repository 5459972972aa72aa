"""Bindings: the generated C as a module of another language, printed from the `Interface` of a solver."""
