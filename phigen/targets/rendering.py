"""Rendering of Jinja templates. The values for templates are printed strings and lists of strings; Python makes all
decisions.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import jinja2

from phigen import resources


@lru_cache
def _environment(target: str) -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(resources.templates() / target, encoding="utf-8"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # the output is code; text of the user has passed `phigen.targets.header.plain`
    )


def render(target: str, template: str, values: Mapping[str, object]) -> str:
    """Return the text of ``templates/TARGET/TEMPLATE.jinja`` with the values inserted. If a value is missing, Jinja
    raises an error.
    """
    return _environment(target).get_template(template + ".jinja").render(values)
