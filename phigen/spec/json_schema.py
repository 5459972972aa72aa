"""JSON Schema of the spec format, for editors, from the table of the format that the validator uses."""

from __future__ import annotations

from typing import Any

from phigen.spec.fields import FORMAT_VERSION, SPEC


def schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a spec file.

    Every spec that phigen accepts conforms to this schema. Rules that can be checked only by reading expressions are
    left out.
    """
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"phigen spec, format version {FORMAT_VERSION}",
        "description": "A Poisson system for which phigen generates a solver",
        **SPEC.schema(),
    }
