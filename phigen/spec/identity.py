"""Digest of those parts of a spec that determine the meaning of the columns of its output."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from phigen.spec.model import Spec
from phigen.spec.problems import Problems
from phigen.spec.yaml_source import Mapping, Node, Scalar, Sequence, read

#: Keys of a spec that determine the meaning of columns. Values of parameters, methods and runs are not among them:
#: files with other values hold the same quantities.
DETERMINING = (
    "coordinates", "time", "definitions", "poisson", "hamiltonian", "forces", "damping", "noise", "casimirs",
    "observables", "lattice", "monitor", "reconstruct",
)  # fmt: skip
#: Number of hexadecimal digits of a digest: the specs of one person do not share 64 bits by chance.
DIGITS = 16


def digest(spec: Spec) -> str:
    """Return a digest of the equations, Casimirs and observables of a spec, without its comments and layout."""
    root = read(spec.source, Problems(spec.file, spec.source))
    parts = {key.text: _plain(value) for key, value in root.entries.values() if key.text in DETERMINING}
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:DIGITS]


def _plain(node: Node) -> Any:
    """Return the texts of a YAML value, in lists and dictionaries."""
    if isinstance(node, Scalar):
        return node.text
    if isinstance(node, Sequence):
        return [_plain(item) for item in node.items]
    assert isinstance(node, Mapping)
    return [[key.text, _plain(value)] for key, value in node.entries.values()]
