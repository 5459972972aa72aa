"""Replay of a certificate: the C that it is about, the boxes that cover the domain, and the bound of each."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from flint import arb, ctx

from .contraction import gauss
from .explicit_steps import Certificate, explicit, splitting
from .krawczyk import newton
from .reader import read
from .rounding import RefusedError, demand, interval, mag

#: Precision of the balls in bits: their own rounding is far below that of doubles.
BITS = 80

KINDS = {"explicit": explicit, "splitting": splitting, "newton": newton, "gauss": gauss}


def check(c: Certificate, domain: Sequence[Sequence[float]], node: Certificate) -> tuple[int, list[float]]:
    """Check the leaves below a node of the tree, whose boxes are the parts of a domain.

    Return their number, and the largest absolute values of coordinates before and after the step.
    """
    if "at" in node:
        low, high = [list(d) for d in domain], [list(d) for d in domain]
        demand(domain[node["axis"]][0] < node["at"] < domain[node["axis"]][1], "a box is divided outside")
        low[node["axis"]][1] = high[node["axis"]][0] = node["at"]
        (m, a), (n, b) = (check(c, part, below) for part, below in zip((low, high), node["parts"], strict=True))
        return m + n, [max(pair) for pair in zip(a, b, strict=True)]
    *X, T = [interval(d) for d in domain]
    bounds, image = KINDS[c["kind"]](c, X, T, node)
    for bound, claim in zip(bounds, c["bound"], strict=True):
        demand(bound <= arb(claim), f"the bound is {float(bound):.4g} where {claim:.4g} is claimed")
    return 1, [max(float(mag(x)), float(mag(y))) for x, y in zip(X, image, strict=True)]


def main(path: str, c_path: str) -> int:
    """Check a certificate of a C file, and print the bound; 0 if it holds."""
    certificate, text = json.loads(Path(path).read_text(encoding="utf-8")), Path(c_path).read_bytes()
    before, ctx.prec = ctx.prec, BITS
    try:
        print(replayed(certificate, text))
    except RefusedError as refusal:
        print(f"refused: {refusal}")
        return 1
    finally:
        ctx.prec = before
    return 0


def replayed(c: dict[str, Any], text: bytes) -> str:
    """Check a certificate of a C file; return what it says. Raises `RefusedError`."""
    demand(hashlib.sha256(text).hexdigest() == c["c_sha256"], "the certificate is about another C file")
    for key, fact in read(text.decode(), c["name"]).items():
        demand(c.get(key) == fact, f"the {key} of the certificate are not those of the C")
    boxes, largest = check(c, [*c["domain"], c["time"]], c["tree"])
    ulps = max(b / math.ulp(x) for b, x in zip(c["bound"], largest, strict=True))
    return f"{c['name']}: {boxes} boxes; a step is within {ulps:.3g} ulp of the exact map in each coordinate"
