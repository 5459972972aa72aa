"""JavaScript: one ES module, without dependencies."""
