"""Digest of a spec. If two files of results have the same digest, their columns contain the same quantities."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from phigen.spec.model import Spec
from phigen.spec.problems import Problems
from phigen.spec.yaml_source import Mapping, Node, Scalar, Sequence, read

#: Keys of a spec that determine the meaning of the columns of its output. Parameters, the method and the runs are left
#: out: if they change, the numbers in the columns change, but each column holds the same quantity.
DETERMINING = (
    "coordinates", "time", "definitions", "poisson", "hamiltonian", "forces", "damping", "noise", "casimirs",
    "observables", "lattice", "monitor", "reconstruct",
)  # fmt: skip
#: Number of hexadecimal digits of a digest. With 16 digits (64 bits), two different specs of one user practically never
#: have the same digest.
DIGITS = 16


def digest(spec: Spec) -> str:
    """Return a digest of the keys `DETERMINING` of a spec (equations, Casimirs, observables, …).

    Comments and the layout of the file do not change the digest.
    """
    root = read(spec.source, Problems(spec.file, spec.source))
    parts = {key.text: _plain(value) for key, value in root.entries.values() if key.text in DETERMINING}
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:DIGITS]


def _plain(node: Node) -> Any:
    """Return a YAML value as a text or a nested list of texts. A mapping becomes a list of pairs [key, value]."""
    if isinstance(node, Scalar):
        return node.text
    if isinstance(node, Sequence):
        return [_plain(item) for item in node.items]
    assert isinstance(node, Mapping)
    return [[key.text, _plain(value)] for key, value in node.entries.values()]
