"""What is measured and proved about systems and solvers: proofs, summaries, classical methods for comparison."""
