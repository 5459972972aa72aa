"""Command `python -m differential ordinary 0:100`: check the random systems of a range of seeds, and print failures."""

from __future__ import annotations

import argparse
import collections
import os
import sys
import tempfile
import time

from differential.suites import SUITES
from tools import WARNINGS

from phigen.runtime import toolchain


def main() -> int:
    """Check the systems of a range of seeds and return the exit status: 1 if a check fails, otherwise 0."""
    parser = argparse.ArgumentParser(prog="differential")
    parser.add_argument("kind", choices=SUITES)
    parser.add_argument("seeds", help="FIRST:END, or one seed")
    parser.add_argument("--no-shrink", action="store_true")
    options = parser.parse_args()
    first, _, end = options.seeds.partition(":")
    seeds = range(int(first), int(end or int(first) + 1))
    toolchain.BASE_FLAGS = (*("-O0" if f.startswith("-O") else f for f in toolchain.BASE_FLAGS), *WARNINGS)
    check_counts, refused, failed, begun = collections.Counter[str](), collections.Counter[str](), 0, time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["PHIGEN_CACHE_DIR"] = folder
        for seed in seeds:
            outcome = SUITES[options.kind].outcome(seed, shrink=not options.no_shrink)
            check_counts.update(outcome.made)
            refused.update([outcome.refused] if outcome.refused else [])
            failed += bool(outcome.failures)
            for failure in outcome.failures:
                print(f"--- {failure}\n", flush=True)
    print(f"{len(seeds)} systems in {time.monotonic() - begun:.0f} s: {failed} fail, {sum(refused.values())} refused")
    for name, count in [*check_counts.most_common(), *refused.most_common(12)]:
        print(f"{count:6} {name}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
