"""Bi-realisations: one module per kind, each with the same interface; `phigen.realisations.catalogue` lists them."""
