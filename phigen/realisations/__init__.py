"""Bi-realisations: one file per kind, all behind the protocol of `phigen.realisations.catalogue`."""
