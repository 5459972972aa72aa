"""The loop IR: typed statements and loops between kernels and text."""
