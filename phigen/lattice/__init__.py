"""Systems of many identical sites: one cell and its relations, from which code of constant length is made."""
