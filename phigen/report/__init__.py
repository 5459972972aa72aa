"""Reports: one self-contained HTML page about a spec and its solver, with proofs and measurements."""
