"""Systems of many identical sites, described by one cell: fields, brackets, energies and the generated step."""
