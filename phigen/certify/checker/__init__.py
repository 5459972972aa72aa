"""Checker of the certificates of `phigen certify`.

It needs python-flint and nothing of phigen: the folder can be copied.
"""
