"""Reports: one self-contained HTML page about a spec, its solver, and what was proved and measured of both."""
