"""``python -m phigen`` is the command ``phigen``."""

from phigen.cli import main

main()
