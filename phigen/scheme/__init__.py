"""One-step maps: how the step of each method becomes a program of functions without loops or branches."""
