"""Bindings: modules in other languages, such as Rust, that call the generated C of a solver."""
