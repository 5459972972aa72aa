"""Systems of many like sites: one cell and its relations, from which code of constant length is made."""
