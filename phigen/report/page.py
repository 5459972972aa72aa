"""HTML of pages: blocks made from templates, and the page around the blocks.

Text of specs is untrusted, so templates escape it; only text that this package has built is `Markup`. The page declares
a Content-Security-Policy, which forbids all access to the network. The policy allows only the style sheet and the
scripts of the page; their hashes identify them.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import Any

import jinja2
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup, escape

from phigen import resources
from phigen._version import __version__

#: Cell of a table: its class, and its text or markup.
Cell = tuple[str, str]

#: Equations are set in columns if there are more than MANY, and each has at most SHORT characters of markup.
MANY, SHORT = 6, 420

_STYLES, _SCRIPTS = ("report.css",), ("theme.js", "space.js", "viewer.js")
#: Scripts of the live panel: FIELDS for lattices, CURVES for other systems. On the page, the scripts stand after the
#: JavaScript of the solvers.
CURVES = ("race.js", "start.js", "curves.js", "live.js")
FIELDS = ("race.js", "start.js", "fields.js", "live.js")


@cache
def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(resources.templates() / "report", encoding="utf-8"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=True,
    )


def block(template: str, **values: object) -> Markup:
    """Render ``templates/report/TEMPLATE.html.jinja`` with values. Values are escaped unless they are `Markup`."""
    return Markup(_environment().get_template(f"{template}.html.jinja").render(values))


def joined(blocks: Iterable[Markup]) -> Markup:
    """Return the concatenation of blocks."""
    return Markup("\n").join(blocks)


def paragraph(text: str, kind: str = "") -> Markup:
    """Return a paragraph; ``kind`` is its class."""
    return block("paragraph", text=text, kind=kind)


def heading(text: str) -> Markup:
    """Return a heading within a section."""
    return block("heading", text=text)


def table(caption: str, columns: Sequence[Cell], rows: Sequence[tuple[str, Sequence[Cell]]], kind: str = "") -> Markup:
    """Return a table with row headers. ``columns`` has the headers of all columns, including the column of row headers.
    ``kind`` is the CSS class of the table.
    """
    return block("table", caption=caption, columns=columns, rows=rows, kind=kind)


def facts(pairs: Iterable[tuple[str, str]]) -> Markup:
    """Return a description list of pairs (term, description)."""
    return block("facts", pairs=list(pairs))


def fold(summary: str, body: Markup) -> Markup:
    """Return a collapsible part of the page."""
    return block("fold", summary=summary, body=body)


def equations(listed: Sequence[Sequence[str]]) -> Markup:
    """Return equations as HTML.

    Each equation is a sequence of pieces of MathML, between which lines may break. Many short equations are set in
    columns.
    """
    are_short = len(listed) > MANY and all(sum(map(len, parts)) < SHORT for parts in listed)
    return block(
        "equations",
        kind="columns" if are_short else "",
        equations=[[Markup(part) for part in parts] for parts in listed],
    )


def data(identifier: str, value: Any) -> Markup:
    """Return an HTML element that contains data for a script.

    The data are JSON, written so that no text in them can close the element.
    """
    return block("data", identifier=identifier, value=htmlsafe_json_dumps(value, dumps=_compact))


def _compact(value: Any, **_: Any) -> str:
    return json.dumps(value, separators=(",", ":"), ensure_ascii=True)


def page(
    title: str,
    lead: Markup,
    sections: Sequence[tuple[str, str, Markup]],
    solvers: str = "",
    panel: Sequence[str] = CURVES,
) -> str:
    """Return the page that consists of the introduction ``lead`` and of ``sections`` (id, title, body).

    ``solvers`` is the JavaScript of the solvers of the live panel. ``panel`` has the names of the scripts of the live
    panel.
    """
    live = [solvers, *map(_asset, panel)] if solvers else []
    return _complete(
        "page",
        [*map(_asset, _SCRIPTS), *live],
        title=title,
        lead=lead,
        sections=sections,
        contents=[(identifier, name) for identifier, name, _ in sections],
    )


def alone(title: str, body: Markup, solvers: str, panel: Sequence[str]) -> str:
    """Return a page that consists of the live panel alone."""
    scripts = [_asset("space.js"), solvers, *map(_asset, (*panel, "alone.js"))]
    return _complete("alone", [_minified(script) for script in scripts], title=title, body=body)


def with_origin(html: str, origin: str) -> str:
    """Return the page with the text ``origin`` (version and command) in its metadata."""
    generator = '<meta name="generator"'
    return html.replace(generator, f'<meta name="source" content="{escape(origin)}">\n{generator}', 1)


def _minified(script: str) -> str:
    """Return a script without comment lines and indentation."""
    lines = (line.strip() for line in script.splitlines())
    return "\n".join(line for line in lines if line and not line.startswith("//"))


def _complete(template: str, scripts: Sequence[str], **values: object) -> str:
    """Return a page with its style sheet, its scripts, and a Content-Security-Policy that forbids further scripts."""
    css, code = "\n".join(map(_asset, _STYLES)), "\n".join(scripts)
    return _environment().get_template(f"{template}.html.jinja").render(
        policy=f"default-src 'none'; img-src data:; style-src {_hash(css)}; script-src {_hash(code)}; "
        "base-uri 'none'; form-action 'none'",
        css=Markup(css),
        scripts=Markup(code),
        version=__version__,
        **values,
    )  # fmt: skip


def _asset(name: str) -> str:
    return (resources.templates() / "report" / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    """Return the hash of an inline script or style sheet, as a Content-Security-Policy writes it."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


_SUBSCRIPT = re.compile(r"(?<=[A-Za-zα-ωΑ-Ω∂])_(\w+)")
_POWER = re.compile(r"(?:\*\*|\^)(-?\d+|\w)")
_DECIMAL = re.compile(r"(?<=\d)e([+-]\d+)")
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def typeset(text: str) -> Markup:
    """Return plain text as HTML, with subscripts and superscripts in formulas such as S_1, h^2 and 3e-16."""
    markup = str(escape(text))
    markup = _SUBSCRIPT.sub(r"<sub>\1</sub>", markup)
    markup = _POWER.sub(r"<sup>\1</sup>", markup)
    return Markup(_DECIMAL.sub(lambda m: "·10" + str(int(m[1])).translate(_SUPERSCRIPTS), markup))


def scientific(value: float, digits: int = 2) -> str:
    """Return a number as text for readers, such as 3.1·10⁻⁸, 0.25, 7.99, 0 or ∞; NaN becomes a dash."""
    if value != value:
        return "–"
    if value in (float("inf"), float("-inf")):
        return "∞" if value > 0 else "−∞"
    if value == 0:
        return "0"
    if 1e-2 <= abs(value) < 1e3:
        return f"{value:.{digits}f}".replace("-", "−")
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}·10{str(int(exponent)).translate(_SUPERSCRIPTS)}".replace("-", "−", 1)


def listed(values: Mapping[str, float]) -> str:
    """Return labels with their numbers as one line, such as ``rk4 3.1·10⁻⁸, dop853 …``."""
    return ", ".join(f"{name} {scientific(value)}" for name, value in values.items())
