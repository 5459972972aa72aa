"""Passes of the loop IR, each a pure function from functions to functions."""
