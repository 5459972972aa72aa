"""Targets: each prints a program in one language. See CONTRIBUTING for how to add one."""
