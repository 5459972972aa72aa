"""Figures of matplotlib as parts of a page.

Colours are replaced by variables of the style sheet, so that a figure follows the theme of the page. Ids become unique.
The Content-Security-Policy of the page forbids style attributes and style elements, so each style becomes an attribute
of SVG, such as fill or stroke.
"""

from __future__ import annotations

import re
from xml.etree import ElementTree

from markupsafe import Markup

from phigen.drawing.palette import PALETTE

_SVG, _LINK = "{http://www.w3.org/2000/svg}", "{http://www.w3.org/1999/xlink}href"
_NUMBER = re.compile(r"-?\d+\.\d{3,}")
_FONT = re.compile(r"(?:(\w+) )?([\d.]+)px .*")
#: Colours of figures, and the variables of the style sheet that replace them.
_COLOURS = {**{value: f"var(--{role})" for role, value in PALETTE.items()}, "#000000": "var(--ink)"}
#: Pixels of the page for one typographic point of a figure. With this factor the widest figure fills the column of
#: text.
PIXELS = 1.75
#: Elements that a page does not need.
_DROPPED = (f"{_SVG}metadata", f"{_SVG}style")


def inlined(text: str, identifier: str, title: str, description: str) -> Markup:
    """Return an SVG file of matplotlib as an element of a page; all of its ids begin with ``identifier``."""
    root = ElementTree.fromstring(text)
    for parent in list(root.iter()):
        for child in [c for c in parent if c.tag in _DROPPED]:
            parent.remove(child)
    for element in root.iter():
        element.tag = element.tag.removeprefix(_SVG)
        _with_variables(element)
        _identified(element, f"{identifier}-")
    for side in ("width", "height"):
        root.set(side, f"{float(root.attrib[side].removesuffix('pt')) * PIXELS:.0f}")
    root.attrib |= {"role": "img", "aria-labelledby": f"{identifier}-title {identifier}-desc"}
    for index, (tag, content) in enumerate((("title", title), ("desc", description))):
        about = ElementTree.Element(tag, id=f"{identifier}-{tag}")
        about.text = content
        root.insert(index, about)
    return Markup(ElementTree.tostring(root, encoding="unicode", short_empty_elements=True))


def _with_variables(element: ElementTree.Element) -> None:
    """Convert styles to attributes, colours to variables, and numbers to two decimals."""
    for declaration in element.attrib.pop("style", "").split(";"):
        name, _, value = (part.strip() for part in declaration.partition(":"))
        font = _FONT.fullmatch(value) if name == "font" else None
        if font:
            element.set("font-size", font[2])
            if font[1] == "italic":
                element.set("font-style", "italic")
        elif name and name not in ("font-family", "font"):
            element.set(name, value)
    for name, value in element.attrib.items():
        if name in ("fill", "stroke"):
            element.set(name, _COLOURS.get(value, value))
        elif name not in ("id", "href", _LINK):
            element.set(name, _NUMBER.sub(lambda m: f"{float(m[0]):.2f}", value))


def _identified(element: ElementTree.Element, prefix: str) -> None:
    """Add a prefix to ids and to references to them."""
    for name, value in list(element.attrib.items()):
        if name == "id":
            element.set(name, prefix + value)
        elif value.startswith("url(#"):
            element.set(name, f"url(#{prefix}{value[5:]}")
        elif name in ("href", _LINK) and value.startswith("#"):
            element.attrib.pop(name)
            element.set("href", f"#{prefix}{value[1:]}")
        elif name == _LINK:  # the link of an image contains the data of the image, not an id
            element.attrib.pop(name)
            element.set("href", value)
