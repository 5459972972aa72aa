"""Functions of a compiled solver, with the types of their arguments."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

from phigen.errors import ToolchainError

#: What functions return, and take, by their names without the prefix.
Signatures = Mapping[str, tuple[Any, tuple[Any, ...]]]


def bound(
    library: Any, prefix: str, wanted: Signatures, offered: Signatures | None = None, *, single: bool = False
) -> Any:
    """A namespace of the functions ``PREFIX_NAME``; those that are only ``offered`` may be absent. Doubles are floats
    where the precision is ``single``.

    Raises `ToolchainError` where one that is wanted is absent.
    """
    numbers = {ctypes.c_double: ctypes.c_float} if single else {}
    found = SimpleNamespace()
    for name, (result, arguments) in {**(offered or {}), **wanted}.items():
        function = getattr(library, f"{prefix}_{name}", None)
        if function is None and name in wanted:
            raise ToolchainError(
                f"the compiled solver has no function {prefix}_{name}\n"
                "  hint: the program named in CC did not compile the source it received; try gcc or clang"
            )
        if function is not None:
            function.restype = numbers.get(result, result)
            function.argtypes = [numbers.get(argument, argument) for argument in arguments]
            setattr(found, name, function)
    return found
