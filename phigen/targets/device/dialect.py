"""The dialect of C that devices understand: qualifiers of functions and tables."""

from __future__ import annotations

from collections.abc import Sequence

from phigen.targets.c.unused import declarations_of

#: Line in generated files after which the code is for devices only.
DEVICES_ONLY = "#if defined(__OPENCL_VERSION__) || defined(__CUDACC__) || defined(__HIP__)"

_TABLE = "static const "

#: First words of declarations of types, which have no address space.
_TYPES = ("typedef", "enum", "struct", "union")


#: Texts that declare coefficients as parameters of functions.
_COEFFICIENTS = [f"const {real} {end}" for real in ("double", "float") for end in ("*coef,", "*coef)", "coef[")]


def qualified(lines: Sequence[str], name: str, *, common: bool = False) -> list[str]:
    """Return the lines of a solver with qualifiers for devices, in the part of the file for devices.

    Functions become `NAME_FUNCTION`, which is static, and tables `NAME_CONSTANT`; kernels have their qualifiers in the
    runtime. If coefficients may be ``common`` to all members, functions read them in the address space `NAME_COEF`.
    Raises `ValueError` for objects without an address space: non-constant objects of a file, and static objects of
    functions.
    """
    begin, linkage = lines.index(DEVICES_ONLY), {"static", "inline", f"{name}_APART"}
    spelt = [*lines]
    for declaration in declarations_of(lines):
        line = lines[declaration.begin]
        words = line.split(" ")
        if declaration.begin < begin or words[0] in (*_TYPES, f"{name}_KERNEL"):
            continue
        if declaration.name:
            while words[0] in linkage:
                words.pop(0)
            spelt[declaration.begin] = " ".join([f"{name}_FUNCTION", *words])
        elif line.startswith(_TABLE):
            spelt[declaration.begin] = f"{name}_CONSTANT {line.removeprefix(_TABLE)}"
        else:
            raise ValueError(f"{name}: an object without address space: {line}")
    for line in spelt[begin:]:
        if line.lstrip().startswith("static "):
            raise ValueError(f"{name}: an object without address space: {line.strip()}")
    for declared in _COEFFICIENTS if common else ():
        spelt[begin:] = [line.replace(declared, f"{name}_COEF {declared}") for line in spelt[begin:]]
    return spelt
