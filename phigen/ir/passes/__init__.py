"""Passes of the loop IR: each pass is a pure function that returns a changed function of the generated code."""
