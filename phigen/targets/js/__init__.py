"""The JavaScript target: a single ES module without dependencies."""
