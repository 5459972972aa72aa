"""Passes of the loop IR: pure functions from functions of the IR to functions of the IR."""
