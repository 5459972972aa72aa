"""Reader of spec files.

`load` and `loads` return a `Spec`, which contains the place of each of its parts in the file. Both functions report all
errors of a file together. `schema` describes the format for editors, and `starter` returns a first spec.
"""

from __future__ import annotations

from os import PathLike, fspath
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from phigen.spec.model import Spec

__all__ = ["load", "loads", "schema", "starter"]

# Each function imports its modules when it is called, so that importing phigen.spec.model is fast. No module of this
# package may be called load, loads, schema or starter: importing it would replace the function of that name.


def load(path: str | PathLike[str]) -> Spec:
    """Return the spec in a file.

    Raises `SpecError` with all errors, in the order of the file. If each of these errors is that the file exceeds a
    limit, the exception is a `LimitError`.
    """
    from phigen import resources
    from phigen.errors import Diagnostic, SpecError
    from phigen.reading import opened
    from phigen.spec import limits
    from phigen.spec.validate import validate

    file = fspath(path)
    try:
        with opened(file) as stream:
            data = stream.read(limits.FILE_BYTES + 1)
    except (OSError, ValueError) as error:
        if "\n" in file:
            message = "expected the name of a spec file, found a text of several lines"
            raise SpecError([Diagnostic(message, hint="phigen.spec.loads(text) reads a spec from a text")]) from error
        if isinstance(error, FileNotFoundError):
            raise SpecError([resources.missing(file)]) from error
        reason = getattr(error, "strerror", None) or str(error)
        raise SpecError([Diagnostic(f"cannot read {file!r}: {reason}")]) from error
    return validate(data, file)


def loads(text: str, file: str = "<string>") -> Spec:
    """Return the spec in a text. Messages show ``file`` as the name of the text. Raises the same exceptions as
    `load`.
    """
    from phigen.spec.validate import validate

    return validate(text.encode("utf-8", "surrogatepass"), file)


def schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of spec files, for editors."""
    from phigen.spec.json_schema import schema as build

    return build()


def starter(name: str, *, lattice: bool = False) -> str:
    """Return the YAML text of a commented example spec. Raises `SpecError` if no spec may have this name."""
    from phigen.spec.first_spec import starter as build

    return build(name, lattice=lattice)
