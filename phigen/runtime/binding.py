"""Functions of a shared library for calls by ctypes, with the types of their arguments and results."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

from phigen.errors import ToolchainError

#: Name of a function, without its prefix → type of its result, and types of its arguments.
Signatures = Mapping[str, tuple[Any, tuple[Any, ...]]]


def bound(
    library: Any, prefix: str, required: Signatures, optional: Signatures | None = None, *, single: bool = False
) -> Any:
    """Return a namespace of the library's functions ``PREFIX_NAME``, whose ctypes argument and result types are set.

    Functions in ``optional`` may be missing from the library. With ``single``, each C double is declared as a float.
    Raises `ToolchainError` if a ``required`` function is missing.
    """
    numbers = {ctypes.c_double: ctypes.c_float} if single else {}
    functions = SimpleNamespace()
    for name, (result, arguments) in {**(optional or {}), **required}.items():
        function = getattr(library, f"{prefix}_{name}", None)
        if function is None and name in required:
            raise ToolchainError(
                f"the compiled solver has no function {prefix}_{name}\n"
                "  hint: the program named in CC did not compile the source it received; try gcc or clang"
            )
        if function is not None:
            function.restype = numbers.get(result, result)
            function.argtypes = [numbers.get(argument, argument) for argument in arguments]
            setattr(functions, name, function)
    return functions
