"""Targets, each of which prints a program in one language. CONTRIBUTING says how to add one."""
