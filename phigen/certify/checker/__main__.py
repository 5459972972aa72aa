"""Replay a certificate of `phigen certify`: python -m checker NAME.bounds.json NAME.c

In a checkout of phigen the module is `phigen.certify.checker`. docs/certify.md has the theorems that it applies.
"""

import sys

from .replay import main

sys.exit(main(*sys.argv[1:]))
