"""What is proved about one spec, and compiling with those proofs as a condition."""
