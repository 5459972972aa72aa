"""Parser of YAML 1.2 into a tree of nodes with their places.

The parser reads the event stream of the library ruamel, not its loaders. So anchors, aliases and tags are refused
before anything is expanded, and nesting is limited before it can exhaust the stack. A scalar keeps its text: ``1e-3``
becomes an exact rational, and ``no`` is a name, not a boolean.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass, field
from typing import Any

from phigen.errors import Location
from phigen.spec import limits
from phigen.spec.problems import Problems, shown
from phigen.spec.quoting import needs_quotes, quoted
from phigen.spec.syntax_hints import syntax_hint


@dataclass
class Node:
    """A YAML value and the place where it starts."""

    location: Location


@dataclass
class Scalar(Node):
    """A YAML scalar, as its text. It is ``plain`` if it has no quotes.

    ``offset`` is the number of columns from the location of the scalar to the first character of the text: 1 if there
    is a quote, else 0. It is None if the text has escapes or several lines, since then its characters are not in
    consecutive columns. For a text of several lines without escapes, ``places`` has the line and the column of each
    character that is not a blank, and of the end.
    """

    text: str
    plain: bool
    offset: int | None
    places: tuple[tuple[int, int], ...] = ()

    def at(self, index: int) -> Location:
        """Return the place of the character ``text[index]`` in the file. If this place is unknown, return the place of
        the scalar.
        """
        here = self.location
        if self.offset is not None:
            return Location(here.line, here.column + self.offset + index, here.file)
        if not self.places:
            return here
        line, column = self.places[sum(not c.isspace() for c in self.text[:index])]
        return Location(line, column, here.file)

    @property
    def is_null(self) -> bool:
        """Whether YAML reads the text as null: no text, ``~`` or ``null``, without quotes."""
        return self.plain and self.text in ("", "~", "null", "Null", "NULL")

    @property
    def boolean(self) -> bool | None:
        """Return the boolean that YAML 1.2 reads; None if the text is not a boolean."""
        return _BOOLEANS.get(self.text) if self.plain else None

    @property
    def is_numeric(self) -> bool:
        """Whether YAML reads the text as a number."""
        return self.plain and _NUMBER.fullmatch(self.text) is not None


@dataclass
class Sequence(Node):
    """A YAML sequence, with its items in the order of the file."""

    items: list[Node] = field(default_factory=list)


@dataclass
class Mapping(Node):
    """A YAML mapping, in the order of the file. Duplicate keys have been reported and dropped."""

    entries: dict[str, tuple[Scalar, Node]] = field(default_factory=dict)


_BOOLEANS = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_NUMBER = re.compile(
    r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|0o[0-7]+|0x[0-9a-fA-F]+|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)"
)
_BYTE_ORDER_MARKS = (
    (b"\xef\xbb\xbf", "UTF-8"),
    (b"\xff\xfe\x00\x00", "UTF-32"),
    (b"\x00\x00\xfe\xff", "UTF-32"),
    (b"\xff\xfe", "UTF-16"),
    (b"\xfe\xff", "UTF-16"),
)
#: Invisible format characters that occur in ordinary text: joiners and the soft hyphen. Other invisible characters are
#: refused, because they can make a line look different from what it is.
_HARMLESS = "\u200c\u200d\u00ad"


def kind_of(node: Node) -> str:
    """Return the words for the kind of a node, such as "a list", in messages "expected …, found …"."""
    if isinstance(node, Sequence):
        return "a list"
    if isinstance(node, Mapping):
        return "a mapping"
    assert isinstance(node, Scalar)
    if node.is_null:
        return "nothing"
    if node.boolean is not None:
        return f"the boolean {node.text}"
    return f"the number {node.text[:60]}" if node.is_numeric else f"the text {shown(node.text)}"


def is_unprintable(character: str) -> bool:
    """Whether a character is a control character, bidirectional override, surrogate or similar."""
    if character in _HARMLESS:
        return False
    return unicodedata.category(character) in ("Cc", "Cf", "Cs", "Zl", "Zp") or (ord(character) & 0xFFFE) == 0xFFFE


def describe(character: str) -> str:
    """Return the code point and the name of a character, such as ``U+202E RIGHT-TO-LEFT OVERRIDE``."""
    return f"U+{ord(character):04X} {unicodedata.name(character, 'control character')}"


def decode(data: bytes, file: str) -> str:
    r"""Return the text of a file, with ``\n`` line ends.

    Raises `SpecError` if the bytes are not text in UTF-8, and `LimitError` if the file is too long.
    """
    problems, start = Problems(file), Location(1, 1, file)
    if len(data) > limits.FILE_BYTES:
        message = f"the file is larger than {limits.FILE_BYTES // 1024} kB, the limit for a spec"
        raise problems.stop(message, start, limit=True)
    for mark, encoding in _BYTE_ORDER_MARKS:
        if data.startswith(mark):
            message = f"the file starts with a byte order mark of {encoding}"
            raise problems.stop(message, start, "save it as UTF-8 without a byte order mark")
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        before = data[: error.start].decode("utf-8").replace("\r\n", "\n")
        byte = f"the byte 0x{data[error.start]:02x} is not valid UTF-8"
        raise problems.stop(byte, _location(before, len(before), file), "save the file as UTF-8") from None
    text = text.replace("\r\n", "\n")
    problems = Problems(file, text)
    if not text.isascii() or re.search(r"[\x00-\x08\x0b-\x1f\x7f]", text):
        for index, character in enumerate(text):
            if (
                character not in "\n\t"
                and (not character.isascii() or not character.isprintable())
                and is_unprintable(character)
            ):
                message = f"the character {describe(character)} is not allowed in a spec"
                problems.add(message, _location(text, index, file), "delete it")
    problems.finish()
    return text


def _location(text: str, index: int, file: str) -> Location:
    start = text.rfind("\n", 0, index) + 1
    return Location(text.count("\n", 0, index) + 1, index - start + 1, file)


def read(text: str, problems: Problems) -> Mapping:
    """Return the top-level mapping of a spec. Raises `SpecError` at errors after which reading cannot continue."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    builder = _Builder(text, problems)
    try:
        for event in YAML(typ="safe", pure=True).parse(text):
            builder.take(event)
    except MarkedYAMLError as error:
        raise builder.syntax_error(error) from None
    except (YAMLError, ValueError, OverflowError) as error:
        # ruamel raises ValueError for some errors, for instance for an escape with an impossible number
        raise problems.stop(f"not valid YAML: {shown(error, 200)}", Location(1, 1, problems.file)) from None
    root = builder.root
    if root is None or (isinstance(root, Scalar) and root.is_null):
        raise problems.stop(
            "the file is empty", Location(1, 1, problems.file), "phigen new NAME writes a spec to start from"
        )
    if not isinstance(root, Mapping):
        message = f"a spec is a mapping of keys to values, not {kind_of(root)}"
        raise problems.stop(message, root.location, "phigen new NAME writes a spec to start from")
    return root


class _Builder:
    """Builder of nodes from the events of ruamel; a stack has the sequences and mappings that are not complete."""

    def __init__(self, text: str, problems: Problems) -> None:
        self.text, self.problems = text, problems
        self.root: Node | None = None
        self.stack: list[tuple[Sequence | Mapping, list[Scalar | None]]] = []
        self.count = 0
        self.documents = 0

    def place(self, mark: Any) -> Location:
        """Return the location of a mark of ruamel. Locations are counted from 1, marks from 0."""
        return Location(mark.line + 1, mark.column + 1, self.problems.file)

    def syntax_error(self, error: Any) -> Exception:
        mark = error.problem_mark or error.context_mark
        # If parsing fails at the end of the file, the message names the start of the unfinished list or mapping, which
        # is more helpful. The parser notices a key without a colon only in a later line.
        if error.context_mark and (mark.index >= len(self.text) or error.context == "while scanning a simple key"):
            mark = error.context_mark
        location = self.place(mark) if mark else Location(1, 1, self.problems.file)
        what = " ".join(part for part in (error.context, error.problem) if part)
        lines = self.text.split("\n")
        opening = (error.context_mark.line + 1, error.context_mark.column + 1) if error.context_mark else None
        hint = syntax_hint(error.context or "", error.problem or "", opening, (location.line, location.column), lines)
        line = lines[location.line - 1]
        if needs_quotes(line, location.column - 1):
            self.problems.forget(location.line)  # earlier errors of this line follow from the missing quotes
            what = "inside { } and [ ], write what contains [ ] between quotes"
            hint = f"write {quoted(line).strip()}"
        return self.problems.stop(f"not valid YAML: {what}", location, hint)

    def take(self, event: Any) -> None:
        """Handle one event of the YAML parser: add its node to the tree, or refuse what specs must not contain."""
        kind = type(event).__name__
        if kind == "DocumentStartEvent":
            self.start_document(event)
        elif kind == "AliasEvent":
            hint = "phigen allows no aliases; write an expression that starts with * between quotes"
            raise self.problems.stop(
                f"the alias *{event.anchor[:60]} is not allowed", self.place(event.start_mark), hint
            )
        elif kind in ("SequenceEndEvent", "MappingEndEvent"):
            self.stack.pop()
        elif kind in ("ScalarEvent", "SequenceStartEvent", "MappingStartEvent"):
            self.start_node(kind, event)

    def start_document(self, event: Any) -> None:
        place = self.place(event.start_mark)
        self.documents += 1
        if self.documents > 1:
            raise self.problems.stop(
                "a second YAML document starts here", place, "write one spec per file, and remove the ---"
            )
        if event.tags or (event.version and tuple(event.version) != (1, 2)):
            raise self.problems.stop("YAML directives are not allowed; a spec is YAML 1.2", place, "remove the % lines")

    def start_node(self, kind: str, event: Any) -> None:
        place = self.place(event.start_mark)
        if event.anchor is not None:
            hint = "phigen allows no anchors; write an expression that starts with & between quotes"
            raise self.problems.stop(f"the anchor &{event.anchor[:60]} is not allowed", place, hint)
        if event.tag is not None:
            hint = "phigen allows no tags; write a text that starts with ! between quotes"
            raise self.problems.stop(f"the YAML tag {shown(event.tag)} is not allowed", place, hint)
        self.count += 1
        if self.count > limits.YAML_NODES:
            raise self.problems.stop(f"more than {limits.YAML_NODES} YAML values", place, limit=True)
        if kind == "ScalarEvent":
            offset = self.offset(event)
            places = self.places(event) if offset is None else ()
            self.attach(Scalar(place, event.value, event.style is None, offset, places))
            return
        if len(self.stack) >= limits.YAML_DEPTH:
            raise self.problems.stop(f"YAML nested deeper than {limits.YAML_DEPTH} levels", place, limit=True)
        node = Sequence(place) if kind == "SequenceStartEvent" else Mapping(place)
        self.attach(node)
        self.stack.append((node, [None]))

    def offset(self, event: Any) -> int | None:
        raw = self.text[event.start_mark.index : event.end_mark.index]
        if raw == event.value:
            return 0
        return 1 if raw[:1] in ("'", '"') and raw[1:-1] == event.value else None

    def places(self, event: Any) -> tuple[tuple[int, int], ...]:
        """Return line and column of each non-blank character of a text, and of the end of the text.

        The text spans several lines, which YAML joins by changing blanks only. If other characters differ from those in
        the file, the text has escapes; then the places are unknown, and the result is ().
        """
        start, end = event.start_mark.index, event.end_mark.index
        characters = [c for c in event.value if not c.isspace()]
        if event.style in ("|", ">"):  # the text begins in the line after that of the sign | or >
            start = self.text.find("\n", start, end)
        elif event.style:
            start += 1
        places: list[tuple[int, int]] = []
        line, column = event.start_mark.line + 1, start - self.text.rfind("\n", 0, start)
        for k in range(start, end):
            if not self.text[k].isspace():
                if len(places) == len(characters) or self.text[k] != characters[len(places)]:
                    break
                places.append((line, column))
            line, column = (line + 1, 1) if self.text[k] == "\n" else (line, column + 1)
        if not places or len(places) < len(characters):
            return ()
        return (*places, (places[-1][0], places[-1][1] + 1))

    def attach(self, node: Node) -> None:
        """Add a node to the innermost list or mapping that is being read, as an item, a key or a value."""
        if not self.stack:
            self.root = node
            return
        parent, pending = self.stack[-1]
        if isinstance(parent, Sequence):
            parent.items.append(node)
        elif pending[0] is None:
            if not isinstance(node, Scalar):
                raise self.problems.stop(f"a key is a name, not {kind_of(node)}", node.location)
            pending[0] = node
        else:
            key, pending[0] = pending[0], None
            if isinstance(node, Scalar) and node.is_null and not node.text:
                node.location = key.location  # ruamel reports the place of the next token for an empty value
            first = parent.entries.get(key.text)
            if first is None:
                parent.entries[key.text] = (key, node)
            else:
                where = f"line {first[0].location.line}, column {first[0].location.column}"
                self.problems.add(f"the key {shown(key.text)} is given twice; the first is in {where}", key.location)
