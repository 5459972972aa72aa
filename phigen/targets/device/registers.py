"""Steps that need more registers than cards have, by measurements with the compiler of CUDA (docs/devices.md)."""

from __future__ import annotations

from phigen.scheme.program import Program

#: The most coordinates times order of steps by Newton's method whose values stay in registers, in double precision;
#: there are twice as many registers for numbers in single precision. Measured: 18 and 20 do, 24 spill up to 8 kB.
_FITTING = 20


def spilling(program: Program) -> str:
    """Return why the steps of an ordinary system spill into memory on cards, and what to do; "" if they do not."""
    step = program.step
    if step.kind.sites:
        return ""
    if step.path is not None or step.kind.collocates:
        return f"the steps of {program.name} keep arrays in the memory of cards, which is slow: try scheme: splitting"
    fitting = _FITTING * (2 if program.single else 1)
    if not step.kind.predicted or program.dimension * program.order <= fitting:
        return ""
    lower = fitting // program.dimension
    hint = f"take order {lower} or lower, or scheme: splitting" if lower else "take scheme: splitting"
    about = f"{program.dimension} coordinates, order {program.order}"
    return f"the steps of {program.name} ({about}) need more registers than cards have, which is slow: {hint}"
