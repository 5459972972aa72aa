"""Check of HTML pages: elements are well nested, there are landmarks, controls and images have names, and nothing is
loaded from other addresses.
"""

from __future__ import annotations

from html.parser import HTMLParser
from itertools import pairwise

VOID = {"meta", "link", "br", "input", "img", "hr", "wbr"}
MATHML = {"math", "mrow", "mi", "mn", "mo", "mfrac", "msup", "msub", "msubsup", "msqrt", "mroot", "mover", "mtable",
          "mtr", "mtd"}  # fmt: skip


class Page(HTMLParser):
    """A parsed page: its elements with their attributes, ids, headings and texts. ``errors`` lists what violates the
    rules.
    """

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.errors: list[str] = []
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.texts: dict[str, list[str]] = {}
        self._open: list[str] = []
        self.feed(text)
        self.close()
        if self._open:
            self.errors.append(f"never closed: {self._open}")
        self._references()
        self._headings()
        self._tables()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        attributes = {name: value or "" for name, value in attrs}
        if len(attributes) != len(attrs):
            self.errors.append(f"{tag} has an attribute twice")
        self.elements.append((tag, attributes))
        self._expect_harmless(tag, attributes)
        if "math" in self._open and tag not in MATHML:
            self.errors.append(f"{tag} in a formula")
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self._open.pop()
            if "svg" not in self._open:
                self.errors.append(f"<{tag}/> is not closed in HTML")

    def handle_endtag(self, tag: str) -> None:
        if not self._open or self._open.pop() != tag:
            self.errors.append(f"</{tag}> closes something else")

    def handle_data(self, data: str) -> None:
        if self._open:
            self.texts.setdefault(self._open[-1], []).append(data)

    def all(self, tag: str) -> list[dict[str, str]]:
        """Return the attributes of all elements with the given tag."""
        return [attributes for name, attributes in self.elements if name == tag]

    def _expect_harmless(self, tag: str, attributes: dict[str, str]) -> None:
        for name, value in attributes.items():
            if name.startswith("on") or name in ("style", "srcdoc", "action", "formaction", "ping"):
                self.errors.append(f"{tag} has the attribute {name}")
            loads = name in ("src", "href", "xlink:href", "poster", "data", "background", "cite")
            if loads and not value.startswith(("#", "data:")):
                self.errors.append(f"{tag} loads {value!r}")
            if "url(" in value and "url(#" not in value:
                self.errors.append(f"{tag} refers to {value!r}")
        if tag in ("iframe", "object", "embed", "base", "form", "img", "audio", "video"):
            self.errors.append(f"there is an element {tag}")

    def _references(self) -> None:
        ids = [attributes["id"] for _, attributes in self.elements if "id" in attributes]
        self.errors += [f"id {i} is there twice" for i in sorted({i for i in ids if ids.count(i) > 1})]
        for tag, attributes in self.elements:
            named = attributes.get("aria-labelledby", "").split() + attributes.get("for", "").split()
            named += [attributes["href"][1:]] if attributes.get("href", "").startswith("#") else []
            named += [v[5:-1] for v in attributes.values() if v.startswith("url(#")]
            self.errors += [f"{tag} refers to {i}, which is not there" for i in named if i not in ids]

    def _headings(self) -> None:
        levels = [int(tag[1]) for tag, _ in self.elements if tag in ("h1", "h2", "h3", "h4")]
        if levels[:1] != [1] or levels.count(1) != 1:
            self.errors.append(f"headings begin {levels[:3]}")
        self.errors += [f"h{b} follows h{a}" for a, b in pairwise(levels) if b > a + 1]
        for landmark in ("header", "nav", "main", "footer"):
            if len(self.all(landmark)) != 1:
                self.errors.append(f"{len(self.all(landmark))} elements {landmark}")

    def _tables(self) -> None:
        tags = [tag for tag, _ in self.elements]
        if tags.count("table") != tags.count("caption"):
            self.errors.append("a table without caption")
        self.errors += [
            "th without scope" for attributes in self.all("th") if attributes.get("scope") not in ("col", "row")
        ]
        for attributes in self.all("svg"):
            if attributes.get("role") != "img" or "aria-labelledby" not in attributes:
                self.errors.append("a figure without name")
