"""The loop IR: typed statements and loops, built from kernels and printed as source code."""
