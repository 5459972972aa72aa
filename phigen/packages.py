"""Optional packages, which are imported when they are needed."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from phigen.errors import MissingPackageError


def imported(name: str, user: str = "this", installed_by: str = "") -> Any:
    """Return the module ``name``. Raises `MissingPackageError` if its package is not installed.

    The message says that ``user`` needs the package. ``installed_by`` are the arguments for ``pip install``, by default
    the name of the package.
    """
    package = name.partition(".")[0]
    try:
        return import_module(name)
    except ImportError as error:
        message = f"{user} needs {package}\n  hint: pip install {installed_by or package}"
        raise MissingPackageError(message) from error
