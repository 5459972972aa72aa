"""JSON Schema of the spec format, for editors: made from the table the validator reads with."""

from __future__ import annotations

from typing import Any

from phigen.spec.fields import FORMAT_VERSION, SPEC


def schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a spec file.

    It says what can be said without reading expressions: a spec that phigen accepts always conforms.
    """
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"phigen spec, format version {FORMAT_VERSION}",
        "description": "A Poisson system for which phigen generates a solver",
        **SPEC.schema(),
    }
