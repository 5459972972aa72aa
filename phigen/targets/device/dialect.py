"""The dialect of C for devices such as graphics cards: qualifiers before functions and tables."""

from __future__ import annotations

from collections.abc import Sequence

from phigen.targets.c.unused import declarations_of

#: Line in generated files that begins the code for devices. A compiler of the host skips this code.
DEVICES_ONLY = "#if defined(__OPENCL_VERSION__) || defined(__CUDACC__) || defined(__HIP__)"

_TABLE = "static const "

#: First words of declarations that define a type. Types need no qualifier for an address space.
_TYPES = ("typedef", "enum", "struct", "union")


#: Ways in which functions declare their parameter for coefficients.
_COEFFICIENTS = [f"const {real} {end}" for real in ("double", "float") for end in ("*coef,", "*coef)", "coef[")]


def qualified(lines: Sequence[str], name: str, *, common: bool = False) -> list[str]:
    """Return the lines of a file with qualifiers for devices. Lines before `DEVICES_ONLY` are not changed.

    Functions get the qualifier `NAME_FUNCTION`, which contains the word static; tables get `NAME_CONSTANT`. Kernels are
    not changed, since the runtime declares them with their qualifiers. If ``common`` is true, members of an ensemble
    may share coefficients. Then parameters for coefficients get the address space `NAME_COEF`. Raises `ValueError` for
    a variable that has no address space on devices: a variable outside functions that is not constant, or a static
    variable inside a function.
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
            raise ValueError(f"{name}: a declaration without an address space, which is an error in phigen: {line}")
    for line in spelt[begin:]:
        if line.lstrip().startswith("static "):
            raise ValueError(
                f"{name}: a declaration without an address space, which is an error in phigen: {line.strip()}"
            )
    for declared in _COEFFICIENTS if common else ():
        spelt[begin:] = [line.replace(declared, f"{name}_COEF {declared}") for line in spelt[begin:]]
    return spelt
