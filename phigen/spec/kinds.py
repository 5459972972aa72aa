"""Kinds of values in a spec. Each kind can read a node and describe itself as JSON Schema.

`fields.py` builds the table of the format from kinds. The validator and the schema are made from that table. Reading
checks the structure of the YAML, but no expressions. The text of an expression stays a `Scalar` node, which is parsed
later, when the declared names are known. A value with an error is reported and read as None, which is never a valid
value.
"""

# `return reader.error(…)` reports an error and returns None, which stands for a value that could not be read.
# mypy: disable-error-code="func-returns-value"

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from phigen.errors import Location
from phigen.spec import limits
from phigen.spec.names import IDENTIFIER, MEANT, MEANT_WORDS
from phigen.spec.problems import Problems, counted, did_you_mean, intended, one_of, shown
from phigen.spec.yaml_source import Mapping as MappingNode
from phigen.spec.yaml_source import Node, Scalar, describe, is_unprintable, kind_of
from phigen.spec.yaml_source import Sequence as SequenceNode

#: A date. As an expression, 2026-01-01 would be the difference 2024, so dates are refused where expressions stand.
_DATE = re.compile(r"\s*[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}([Tt\s]|$)")

_LISTS = "lists are written [a, b]"

Path = tuple[Any, ...]
Schema = dict[str, Any]


@dataclass
class Reader:
    """Results of reading: the errors so far, and the place and the purpose of each value.

    A value is identified by its path of keys.
    """

    problems: Problems
    locations: dict[Path, Location] = field(default_factory=dict)
    purposes: dict[Path, str] = field(default_factory=dict)

    def error(self, node: Node, message: str, hint: str = "", *, limit: bool = False) -> None:
        """Report an error at a node."""
        self.problems.add(message, node.location, hint, limit=limit)


def label(path: Path) -> str:
    """Return the beginning of messages about a value: the last key on its path, and a colon."""
    keys = [part for part in path if isinstance(part, str)]
    return f"{keys[-1]}: " if keys else ""


def list_hint(node: Node) -> str:
    """Return the hint for a node that should be a list.

    The hint shows how to write a list with the value of the node or, if the node is a mapping, with its keys.
    """
    if isinstance(node, MappingNode):
        names = [key.text for key, _ in node.entries.values()][:3]
        return f"{_LISTS}; the names alone are written [{', '.join(names)}]" if names else _LISTS
    if isinstance(node, Scalar) and not node.is_null:
        names = listed(node.text)
        if names:
            return f"write [{', '.join(names)}]"
        if len(node.text) < 20:
            return f"{_LISTS}, and a list of one is [{node.text}]"
    return _LISTS


def listed(text: str) -> list[str]:
    """Return the names in a text that has two or more names with commas, semicolons or blanks between them.

    The list is empty for other texts.
    """
    names = re.split(r"\s*[,;]\s*|\s+", text)
    return names if 1 < len(names) < 20 and all(re.fullmatch(IDENTIFIER, name) for name in names) else []


class Kind:
    """A kind of value; ``expected`` is its name in messages."""

    expected = "a value"

    def read(self, node: Node, path: Path, reader: Reader) -> Any:
        """Return the value of a node; None after an error, which is reported."""
        raise NotImplementedError

    def schema(self) -> Schema:
        """Return the JSON Schema of the values of this kind."""
        raise NotImplementedError

    def mismatch(self, node: Node, path: Path, reader: Reader, hint: str = "") -> None:
        """Report a node of the wrong kind. The hint is ``hint`` or, by default, the purpose of the key."""
        message = f"{label(path)}expected {self.expected}, found {kind_of(node)}"
        reader.error(node, message, hint or reader.purposes.get(path, ""))


@dataclass(frozen=True)
class Text(Kind):
    """Prose, such as a title or a description. It may have several lines if ``lines`` is true, else only one."""

    lines: bool = False
    expected = "text"

    def read(self, node: Node, path: Path, reader: Reader) -> str | None:
        if not isinstance(node, Scalar) or node.is_null:
            return self.mismatch(node, path, reader)
        if node.is_numeric or node.boolean is not None:
            return self.mismatch(node, path, reader, "put text that looks like a value between quotes")
        longest = limits.TEXT_LENGTH if self.lines else limits.LINE_LENGTH
        if len(node.text) > longest:
            return reader.error(node, f"the text has {len(node.text)} characters, the limit is {longest}", limit=True)
        text = node.text.strip("\n") if self.lines else node.text.strip()
        unprintable = [c for c in text if is_unprintable(c) and c not in ("\n\t" if self.lines else "")]
        if unprintable == ["\n"] * len(unprintable) and unprintable:
            return reader.error(node, f"{label(path)}expected one line of text, found {len(unprintable) + 1} lines")
        if unprintable:
            return reader.error(node, f"the text contains the character {describe(unprintable[0])}")
        return text

    def schema(self) -> Schema:
        return {"type": "string", "maxLength": limits.TEXT_LENGTH if self.lines else limits.LINE_LENGTH}


@dataclass(frozen=True)
class ShapedText(Kind):
    """A text that matches the regular expression ``pattern``. In messages, the words in ``expected`` describe
    the text.

    Messages about a text that does not match have the hint ``hint``. Messages about a node that is no text have the
    hint ``example``.
    """

    pattern: str
    expected: str = "a name"
    hint: str = ""
    longest: int = limits.NAME_LENGTH
    example: str = ""

    def read(self, node: Node, path: Path, reader: Reader) -> Scalar | None:
        if not isinstance(node, Scalar):
            return self.mismatch(node, path, reader, self.example)
        if node.is_null or node.boolean is not None:
            named = re.fullmatch(self.pattern, node.text)
            return self.mismatch(
                node, path, reader, self.example or (f"quotes make it a name: '{node.text}'" if named else "")
            )
        names = listed(node.text) if path and isinstance(path[-1], int) else []
        return node if self.accepts(node, reader, f"write commas: {', '.join(names)}" if names else "") else None

    def accepts(self, node: Scalar, reader: Reader, hint: str = "") -> bool:
        """Return whether the text of ``node`` matches ``pattern`` and is not too long. Otherwise report an error with
        ``hint``.
        """
        if len(node.text) > self.longest:
            message = f"the name {shown(node.text, 30)} has {len(node.text)} characters, the limit is {self.longest}"
            reader.error(node, message, limit=True)
        elif not re.fullmatch(self.pattern, node.text):
            strange = [c for c in node.text if not c.isascii() or not c.isprintable()]
            detail = f" ({describe(strange[0])})" if strange else ""
            reader.error(node, f"{shown(node.text)} is not {self.expected}{detail}", hint or self.hint)
        else:
            return True
        return False

    def schema(self) -> Schema:
        return {"type": "string", "pattern": f"^{self.pattern}$", "maxLength": self.longest}


@dataclass(frozen=True)
class OneOf(Kind):
    """A value that must be one of the listed ``words``. ``hints`` has hints for some other words."""

    words: tuple[str, ...]
    hints: Mapping[str, str] = field(default_factory=dict, hash=False)

    @property
    def expected(self) -> str:  # type: ignore[override]
        return one_of(self.words)

    def read(self, node: Node, path: Path, reader: Reader) -> str | None:
        if not isinstance(node, Scalar) or node.is_null:
            return self.mismatch(node, path, reader)
        if node.text in self.words:
            return node.text
        hint = self.hints.get(node.text) or did_you_mean(node.text, self.words, MEANT_WORDS) or self.expected
        return reader.error(node, f"{label(path)}{shown(node.text)} is not known", hint)

    def schema(self) -> Schema:
        return {"enum": list(self.words)}


@dataclass(frozen=True)
class Integer(Kind):
    """An integer between given bounds, written in digits."""

    least: int
    most: int
    limit: bool = False  # whether a number above ``most`` exceeds a limit (`LimitError`)

    expected = "an integer"

    def read(self, node: Node, path: Path, reader: Reader) -> int | None:
        if not isinstance(node, Scalar) or not re.fullmatch(r"[+-]?[0-9]+(\.[0-9]*)?([eE]\+?[0-9]{1,2})?", node.text):
            return self.mismatch(node, path, reader)
        if not node.plain:
            return self.mismatch(node, path, reader, "numbers need no quotes")
        value = Fraction(node.text) if len(node.text) < 100 else Fraction(10) ** 100
        if value.denominator != 1:
            return self.mismatch(node, path, reader)
        if self.least <= value <= self.most:
            return int(value)
        message = f"{label(path)}{node.text[:60]} is not between {self.least} and {self.most}"
        if self.least == self.most:
            message = f"{label(path)}{node.text[:60]} is not known; this version of phigen reads {self.least}"
        return reader.error(node, message, limit=self.limit and value > self.most)

    def schema(self) -> Schema:
        return {"type": "integer", "minimum": self.least, "maximum": self.most}


@dataclass(frozen=True)
class Boolean(Kind):
    """A value that must be true or false."""

    expected = "true or false"

    def read(self, node: Node, path: Path, reader: Reader) -> bool | None:
        if not isinstance(node, Scalar) or node.boolean is None:
            hint = "write true or false" if isinstance(node, Scalar) and node.plain else ""
            return self.mismatch(node, path, reader, hint)
        return node.boolean

    def schema(self) -> Schema:
        return {"type": "boolean"}


@dataclass(frozen=True)
class ExpressionText(Kind):
    """The text of an expression, which is parsed later. A ``constant`` expression uses no names."""

    constant: bool = False

    @property
    def expected(self) -> str:  # type: ignore[override]
        return "a number" if self.constant else "an expression"

    def read(self, node: Node, path: Path, reader: Reader) -> Scalar | None:
        if not isinstance(node, Scalar) or node.is_null:
            return self.mismatch(node, path, reader)
        if node.boolean is not None and self.constant:
            return self.mismatch(node, path, reader)
        if _DATE.match(node.text):
            hint = "if it is a difference, write spaces around -"
            return reader.error(node, f"{label(path)}{shown(node.text)} is a date, not {self.expected}", hint)
        return node

    def schema(self) -> Schema:
        return {"type": ["number", "string"], "maxLength": limits.EXPRESSION_LENGTH}


@dataclass(frozen=True)
class ListOf(Kind):
    """A list of values of one kind."""

    item: Kind
    least: int = 0
    most: int = limits.ENTRIES
    expected = "a list"

    def read(self, node: Node, path: Path, reader: Reader) -> list[Any] | None:
        if isinstance(node, MappingNode) and isinstance(self.item, ShapedText):
            self.mismatch(node, path, reader, list_hint(node))
            # The user has written a mapping in place of a list. After the error, the keys of the mapping are read as
            # the list. So the keys count as declared names, and later uses of the names are not reported.
            node = SequenceNode(node.location, [key for key, _ in node.entries.values()])
        if not isinstance(node, SequenceNode):
            is_matrix = isinstance(self.item, ListOf) and isinstance(node, MappingNode)
            hint = "a matrix is a list of its rows: [[a, b], [c, d]]" if is_matrix else list_hint(node)
            return self.mismatch(node, path, reader, hint)
        if len(node.items) < self.least:
            least = counted(self.least, "entry", "entries")
            return reader.error(node, f"{label(path)}expected at least {least}, found {len(node.items)}")
        if len(node.items) > self.most:
            return reader.error(node, f"{label(path)}{len(node.items)} entries, the limit is {self.most}", limit=True)
        values = []
        for index, item in enumerate(node.items):
            reader.locations[*path, index] = item.location
            values.append(self.item.read(item, (*path, index), reader))
        return values

    def schema(self) -> Schema:
        return {"type": "array", "items": self.item.schema(), "minItems": self.least, "maxItems": self.most}


@dataclass(frozen=True)
class MapOf(Kind):
    """A mapping from names chosen by the user to values of one kind; it is read as name → (key, value)."""

    key: ShapedText
    value: Kind
    least: int = 0
    expected = "a mapping"

    def read(self, node: Node, path: Path, reader: Reader) -> dict[str, tuple[Scalar, Any]] | None:
        if not isinstance(node, MappingNode):
            hint = "remove the key, or write {} for none" if isinstance(node, Scalar) and node.is_null else ""
            return self.mismatch(node, path, reader, hint)
        if len(node.entries) < self.least:
            return reader.error(node, f"{label(path)}expected at least {self.least} entry, found none")
        if len(node.entries) > limits.ENTRIES:
            message = f"{label(path)}{len(node.entries)} entries, the limit is {limits.ENTRIES}"
            return reader.error(node, message, limit=True)
        values = {}
        for name, (key, item) in node.entries.items():
            if self.key.accepts(key, reader):
                inner = (*path, name)
                reader.locations[inner] = place(key, item)
                values[name] = (key, self.value.read(item, inner, reader))
        return values

    def schema(self) -> Schema:
        names = {k: v for k, v in self.key.schema().items() if k != "type"}
        return {
            "type": "object",
            "propertyNames": names,
            "additionalProperties": self.value.schema(),
            "minProperties": self.least,
            "maxProperties": limits.ENTRIES,
        }


@dataclass(frozen=True)
class RecordKey:
    """A key of a record, with the kind and the purpose of its value."""

    key: str
    kind: Kind
    description: str
    required: bool = False
    default: Any = None  # default that the JSON Schema shows; model.py has the default that applies


@dataclass(frozen=True)
class Record(Kind):
    """A mapping with fixed keys. It is read as a dictionary, from which keys with errors are left out.

    At most one of the keys in ``alternatives`` may be present. If ``one_required`` is true, at least one key in
    ``alternatives`` or ``substitutes`` must be present. A key in ``substitutes`` may be combined with a key in
    ``alternatives``. If ``nonempty`` is true, the mapping must not be empty. If the value is no mapping, the error
    shows ``example``. ``hints`` has hints for keys that belong to another part of the spec.
    """

    what: str
    fields: tuple[RecordKey, ...]
    alternatives: tuple[str, ...] = ()
    one_required: bool = False
    nonempty: bool = False
    substitutes: tuple[str, ...] = ()
    example: str = ""
    hints: Mapping[str, str] = field(default_factory=dict)

    @property
    def expected(self) -> str:  # type: ignore[override]
        return f"a mapping ({self.what})" if " " in self.what else "a mapping"

    def read(self, node: Node, path: Path, reader: Reader) -> dict[str, Any] | None:
        fields_by_key = {f.key: f for f in self.fields}
        if not isinstance(node, MappingNode):
            return self.mismatch(node, path, reader, self.instructions(node))
        values = {}
        for name, (key, item) in node.entries.items():
            if name in fields_by_key:
                value = self._read_value(fields_by_key[name], key, item, path, reader)
                if value is not None:
                    values[name] = value
        for name in [name for name in node.entries if name not in fields_by_key]:
            meant, value = self._read_unknown(name, node, path, reader)
            if value is not None:
                values.setdefault(meant, value)
        self.check_presence(node, reader)
        return values

    def _read_value(self, known: RecordKey, key: Scalar, item: Node, path: Path, reader: Reader) -> Any:
        """Return the value of a known key.

        If the value must be one of several words, a misspelt word is reported, and read as the word that it resembles.
        """
        inner = (*path, known.key)
        reader.locations[inner] = place(key, item)
        reader.purposes[inner] = known.description
        value = known.kind.read(item, inner, reader)
        if value is None and isinstance(known.kind, OneOf) and isinstance(item, Scalar):
            return intended(item.text, known.kind.words) or None
        return value

    def _read_unknown(self, name: str, node: MappingNode, path: Path, reader: Reader) -> tuple[str, Any]:
        """Report an unknown key. Return the known key that was probably meant, and the value.

        The first result is "" if no known key resembles the unknown one. The value is read only if the unknown key is
        probably a misspelt known key; otherwise the second result is None. For instance, the second result is None for
        words of other programs (`MEANT`), because other programs often write values differently.
        """
        key, item = node.entries[name]
        hint, meant = self._hint(name, node), self._resembled_key(name, node)
        reader.error(key, f"{self.what} has no key {shown(name)}", hint)
        if not meant:
            return meant, None
        if name in MEANT or meant in node.entries or (*path, meant) in reader.locations or "did you mean" not in hint:
            reader.locations.setdefault((*path, meant), key.location)  # so that the key is not reported as missing
            return meant, None
        before = reader.problems.copy()
        known = next(f for f in self.fields if f.key == meant)
        value = self._read_value(known, key, item, path, reader)
        if value is None:
            reader.problems.restore(before)
        return meant, value

    def _resembled_key(self, name: str, node: MappingNode) -> str:
        """Return the key of this record that an unknown name resembles; "" if there is none.

        A key that is not in the mapping yet is preferred to one that is present.
        """
        keys = [f.key for f in self.fields]
        key = intended(name, keys, MEANT)
        if key in node.entries and key != MEANT.get(name):
            candidates = [k for k in keys if k not in node.entries and not k.startswith(f"{key}_")]
            key = intended(name, candidates, MEANT) or key
        return key

    def _hint(self, name: str, node: MappingNode) -> str:
        """Return the hint for an unknown key: where it belongs, else the key that was probably meant, else all keys."""
        meant, keys = MEANT.get(name, name), [f.key for f in self.fields]
        misplaced = self.hints.get(name) or ("" if meant in keys else self.hints.get(meant, ""))
        key = self._resembled_key(name, node)
        return misplaced or (f"did you mean {key!r}?" if key else "") or self.instructions()

    def instructions(self, node: Node | None = None) -> str:
        """Return the hint that shows the form of the mapping: an example and the keys.

        If ``node`` is only the name of a key, the hint shows how to write this key with a value.
        """
        named_field = next((f for f in self.fields if isinstance(node, Scalar) and f.key == node.text), None)
        if named_field is not None and isinstance(named_field.kind, Record) and named_field.kind.example:
            return f"write {{{named_field.key}: {named_field.kind.example}}}"
        example = f"for example {self.example}; " if self.example else ""
        return f"{example}keys: " + ", ".join(f.key for f in self.fields)

    def check_presence(self, node: MappingNode, reader: Reader) -> None:
        """Report keys that are required and missing, and keys that exclude each other."""
        keys = [f.key for f in self.fields]
        strange = set(node.entries) - set(keys)  # unknown keys, which were reported before
        present_keys = {*node.entries, *(self._resembled_key(name, node) for name in strange)}
        for key_field in self.fields:
            if key_field.required and key_field.key not in present_keys:
                reader.error(
                    node,
                    f"{self.what}: the key {key_field.key!r} is missing",
                    f"{key_field.key}: {key_field.description}",
                )
        forms = [name for name in node.entries if name in self.alternatives]
        for name in forms[1:]:
            message = f"{self.what}: {forms[0]} and {name} exclude each other"
            reader.error(node.entries[name][0], message, "give only one of them")
        if (
            self.one_required
            and not forms
            and not strange
            and not any(name in node.entries for name in self.substitutes)
        ):
            reader.error(node, f"{self.what}: one of {', '.join(self.alternatives)} is needed")
        if self.nonempty and not node.entries:
            reader.error(node, f"{self.what}: one of {', '.join(keys)} is needed")

    def schema(self) -> Schema:
        properties = {}
        for f in self.fields:
            properties[f.key] = {**f.kind.schema(), "description": f.description}
            if f.default is not None:
                properties[f.key]["default"] = f.default
        schema: Schema = {"type": "object", "properties": properties, "additionalProperties": False}
        if required := [f.key for f in self.fields if f.required]:
            schema["required"] = required
        if self.nonempty:
            schema["minProperties"] = 1
        if self.one_required:
            exclusive: Schema = {"oneOf": [{"required": [key]} for key in self.alternatives]}
            substitutes = [{"required": [key]} for key in self.substitutes]
            schema |= {"anyOf": [exclusive, *substitutes]} if substitutes else exclusive
        elif self.alternatives:
            schema["not"] = {"required": list(self.alternatives)}
        return schema


@dataclass(frozen=True)
class Either(Kind):
    """A value of one of several kinds; ``kinds`` maps the type of the YAML node (scalar, list, mapping) to its kind."""

    kinds: Mapping[type[Node], Kind]

    @property
    def expected(self) -> str:  # type: ignore[override]
        return " or ".join(k.expected for k in self.kinds.values())

    def read(self, node: Node, path: Path, reader: Reader) -> Any:
        kind = self.kinds.get(type(node))
        if kind is None or (isinstance(node, Scalar) and node.is_null):
            return self.mismatch(node, path, reader)
        return kind.read(node, path, reader)

    def schema(self) -> Schema:
        return {"anyOf": [k.schema() for k in self.kinds.values()]}


def place(key: Scalar, value: Node) -> Location:
    """Return the place for messages about an entry of a mapping: that of the value if it is a scalar, else that of the
    key.
    """
    return value.location if isinstance(value, Scalar) and not value.is_null else key.location
