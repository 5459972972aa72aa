"""Optional packages, which are imported when they are needed."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from phigen.errors import MissingPackageError


def imported(name: str, user: str = "this", installed_by: str = "") -> Any:
    """Return a module. Raises `MissingPackageError`: its ``user`` needs the package, which pip installs.

    ``installed_by`` are the arguments of ``pip install``, the name of the package by default.
    """
    package = name.partition(".")[0]
    try:
        return import_module(name)
    except ImportError as error:
        message = f"{user} needs {package}\n  hint: pip install {installed_by or package}"
        raise MissingPackageError(message) from error
