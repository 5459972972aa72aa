"""The dialect of C that devices understand: qualifiers of functions and tables."""

from __future__ import annotations

from collections.abc import Sequence

from phigen.targets.c.unused import functions_of

#: The line from which on a file is for devices only.
DEVICES_ONLY = "#if defined(__OPENCL_VERSION__) || defined(__CUDACC__) || defined(__HIP__)"

_TABLE = "static const "


def qualified(lines: Sequence[str], name: str) -> list[str]:
    """Return the lines of a solver with the qualifiers of devices before functions and tables of the part for devices.

    Functions become `NAME_FUNCTION`, which is static; kernels are named in the runtime.
    """
    begin, linkage = lines.index(DEVICES_ONLY), {"static", "inline", f"{name}_APART"}
    spelt = [*lines]
    for k in range(begin, len(lines)):
        if lines[k].startswith(_TABLE):
            spelt[k] = f"{name}_CONSTANT {lines[k].removeprefix(_TABLE)}"
    for function in functions_of(lines):
        words = lines[function.begin].split(" ")
        if words[0] == f"{name}_KERNEL":
            continue
        while words[0] in linkage:
            words.pop(0)
        spelt[function.begin] = " ".join([f"{name}_FUNCTION", *words])
    return spelt
