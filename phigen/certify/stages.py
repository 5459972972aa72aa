"""The stages of a certified step as lists of operations, which are built from functions and tables of the C.

In arguments, ``facts`` is the result of `phigen.certify.reader.read`, n the number of coordinates, and k the number of
a stage.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from flint import arb

from phigen.certify.checker import Evaluation, RefusedError, column
from phigen.certify.reader import GeneratedC, PathReader

#: Largest compensation term after a step, in units of 2^-53 times the largest absolute value of the coordinate. The
#: term is the rounding error of one addition, which is at most 1 unit; the rest is a margin.
CARRY = 1.01

#: In a Gauss step, the C estimates the contraction rate of the iteration, to decide when the iteration ends.
#: Certificates assume that the estimate is at least this number. In runs of the systems in ``specs`` the rate is
#: between 0.05 and 0.5.
LEAST_RATE = 0.05

Stage = dict[str, Any]


class Listing:
    """List of operations of a stage, to which the operations of several functions are appended.

    Operations refer to operands by their indices. An input, such as a coordinate, occurs once.
    """

    def __init__(self) -> None:
        self.operations: list[list[Any]] = []
        self._inputs: dict[tuple[Any, ...], int] = {}

    def add(self, *operation: Any) -> int:
        """Append an operation (name, *operands), and return its index."""
        self.operations.append(list(operation))
        return len(self.operations) - 1

    def input(self, *operation: Any) -> int:
        """Return the index of the operation that reads an input. The operation is appended if the input was not read
        before.
        """
        if operation not in self._inputs:
            self._inputs[operation] = self.add(*operation)
        return self._inputs[operation]

    def inputs(self, name: str, count: int) -> list[int]:
        """Return the indices of operations that read the first ``count`` entries of the input array ``name``."""
        return [self.input(name, i) for i in range(count)]

    def sum(self, terms: Sequence[int]) -> int:
        """Append operations that add the values with the indices ``terms``, in this order. Return the index of
        the sum.
        """
        total = terms[0]
        for term in terms[1:]:
            total = self.add("add", total, term)
        return total

    def copy(self, kernel: Mapping[str, Any], **inputs: Any) -> dict[str, list[int]]:
        """Append the operations of a function, and return the indices of its outputs, by name of the array.

        ``inputs`` maps each array that the function reads to the indices of the operations that replace its entries.
        """
        operation_indices: list[int] = []
        for op, *a in kernel["operations"]:
            if op == "input":
                operation_indices.append(inputs[a[0]][a[1]])
            else:
                operation_indices.append(
                    self.add(op, *a) if op == "number" else self.add(op, *(operation_indices[i] for i in a))
                )
        return {name: [operation_indices[i] for i in indices] for name, indices in kernel["outputs"].items()}


class _Parameters(dict[str, int]):
    """Indices of the operations that read parameters, by the names of the parameters in C.

    When a parameter is first used, the operation that reads it is appended to ``listing``. ``names`` maps names in C to
    names in the spec.
    """

    def __init__(self, listing: Listing, names: Mapping[str, str]) -> None:
        self._listing, self._names = listing, names

    def __missing__(self, member: str) -> int:
        return self._listing.input("constant", "parameters", self._names[member])


class _Gauge(dict[int, int]):
    """Indices of the operations that read multiples of Casimirs, by the number of the Casimir.

    When a multiple is first used, the operation that reads it is appended to ``listing``.
    """

    def __init__(self, listing: Listing) -> None:
        self._listing = listing

    def __missing__(self, index: int) -> int:
        return self._listing.input("constant", "gauge", index)


def prepared(facts: Mapping[str, Any], listing: Listing, stage: int) -> list[int]:
    """Append the operations that compute the coefficients of a stage, and return the indices of the
    coefficients.

    The coefficients depend on parameters, step size and time. In a splitting, ``stage`` is the number of a row of
    coefficients. Several flows of a step may use the same row.
    """
    step = listing.input("constant", "step")
    h = step
    if len(facts["fractions"]) > 1:
        h = listing.add("mul", listing.input("exact", facts["fractions"][stage]), step)
    kick = []
    if facts.get("multiples"):  # coefficient of the modified potential of a splitting: a multiple of h²
        square = listing.add("mul", step, step)
        kick = [listing.add("mul", listing.input("exact", facts["multiples"][stage]), square)]
    kernels, inputs = facts["kernels"], {"params": _Parameters(listing, facts["members"]), "gauge": _Gauge(listing)}
    coef = listing.copy(kernels["prepare"], **inputs, h=[h], kick=kick)["coef"]
    if "at_time" in kernels:
        moment = listing.add("mul", listing.input("exact", facts["middles"][stage]), step)
        t = listing.add("add", listing.input("t", 0), moment)
        coef = coef + listing.copy(kernels["at_time"], coef=coef, t=[t])["now"]
    return coef


def stages_of(
    facts: Mapping[str, Any], text: str, name: str, centre: Sequence[Any], exact: bool = False
) -> list[Stage]:
    """Return the stages of a step as lists of operations; ``facts`` is what `read` returns for the C of the
    solver.

    Steps along paths use Taylor series. The C ends a series at small terms, so the number of terms depends on the
    state. If ``exact``, the series have the largest number of terms that the C ever computes. Otherwise they have the
    largest number of terms that the C computes for states in the box ``centre``.
    """
    source, n = GeneratedC(text, name), len(centre)
    if facts["kind"] == "path":
        return _path(facts, source, n, centre, exact)
    return _STAGES[facts["kind"]](facts, n)


def _explicit(facts: Mapping[str, Any], n: int) -> list[Stage]:
    listing = Listing()
    coef = prepared(facts, listing, 0)
    change = listing.copy(facts["kernels"]["explicit"], coef=coef, state=listing.inputs("x", n))["increment"]
    return [{"operations": listing.operations, "change": change}]


def _splitting(facts: Mapping[str, Any], n: int) -> list[Stage]:
    """Return the stages of a step by splitting: one or, with a corrector, three (inverse corrector, step,
    corrector).

    In a stage, the flows add their changes to a sum that begins with the compensation term.
    """
    return [_flows(facts, schedule, n) for schedule in facts["schedules"]]


def _flows(facts: Mapping[str, Any], schedule: Sequence[Sequence[int]], n: int) -> Stage:
    listing, rows = Listing(), dict[int, list[int]]()
    # with a monitor (dt = g dτ), the C has one more coordinate, the physical time
    extra_coordinates = max(0, 1 + max(i for pairs in facts["moves"].values() for i, _ in pairs) - n)
    zeros = [listing.input("exact", 0.0)] * extra_coordinates
    state, start = listing.inputs("x", n) + zeros, listing.inputs("start", n) + zeros
    displacements = listing.inputs("carry", n) + zeros
    for flow, row in schedule:
        if row not in rows:
            rows[row] = prepared(facts, listing, row)
        change = listing.copy(facts["kernels"][f"change{flow}"], coef=rows[row], state=state)["change"]
        for i, j in facts["moves"][str(flow)]:
            displacements[i] = listing.add("add", displacements[i], change[j])
            state[i] = listing.add("add", start[i], displacements[i])
    return {"operations": listing.operations, "change": displacements[:n]}


def _newton(facts: Mapping[str, Any], n: int) -> list[Stage]:
    """Return the stages of a step that is solved by Newton's method for y, the solution of the implicit equation.

    The C does not evaluate the increment after the last correction of y; it corrects the increment to first order.
    """
    stages = []
    for k in range(len(facts["fractions"])):
        listing = Listing()
        y = listing.inputs("u", n)
        outputs = listing.copy(facts["kernels"]["linearise"], coef=prepared(facts, listing, k), y=y)
        sizes = [listing.add("abs", i) for i in y]
        floor = listing.add("mul", listing.add("exact", facts["floor"]), _largest(listing, sizes))
        floor = listing.add("add", floor, listing.add("exact", 2.0**-1022))
        stages.append(
            {
                "operations": listing.operations,
                "change": outputs["increment"],
                "equation": outputs["displacement"],
                "matrix": outputs["jacobian"],
                "gain": outputs["increment_jacobian"],
                "start": y,
                "away": outputs["displacement"],
                "scale": [listing.add("add", size, floor) for size in sizes],
                "stops": [{"now": math.sqrt(facts["tolerance"])}, {"before": facts["nearly_solved"]}],
                "share": 0,
                "based": 1,
                "derived": 1,
                "last": 0,
            }
        )
    return stages


def _gauss(facts: Mapping[str, Any], n: int) -> list[Stage]:
    """Return the one stage of a Gauss step, which is solved by fixed-point iteration.

    The unknowns are the increments of all stages of the Gauss method.
    """
    listing, kernels, nodes = Listing(), facts["kernels"], len(facts["weights"])
    width = len(kernels["stage_field"]["outputs"]["move"])
    coef = prepared(facts, listing, 0)
    point = [*listing.inputs("x", n), listing.input("t", 0)]
    moves = [[listing.input("u", i * width + k) for k in range(width)] for i in range(nodes)]
    swept, step = list[int](), listing.input("constant", "step")
    for i in range(nodes):
        w = listing.add("mul", step, listing.add("exact", facts["weights"][i]))
        mixing = [listing.add("exact", row[i]) for row in facts["mixing"]]
        products = [[listing.add("mul", mixing[j], moves[j][k]) for j in range(nodes)] for k in range(width)]
        z = [listing.sum(terms) for terms in products]
        swept += listing.copy(kernels["stage_field"], coef=coef, x=point, z=z, w=[w])["move"]
    stage_outputs = []
    for k in range(width):
        parts = [listing.sum([moves[i][k] for i in range(first, nodes, 2)]) for first in range(min(2, nodes))]
        stage_outputs.append(listing.sum(parts))
    change = listing.copy(kernels["stage_change"], coef=coef, x=point, z=stage_outputs)["change"]
    squares = [listing.add("mul", x, x) for x in point[:n]]
    size, unit = listing.add("sqrt", listing.sum(squares)), listing.add("exact", 1.0)
    stalled = {"part": facts["stalled"], "now": facts["rounding"]}
    return [
        {
            "operations": listing.operations,
            "change": change,
            "equation": [listing.add("neg", i) for i in swept],
            "matrix": [],
            "gain": [],
            "start": [listing.input("exact", 0.0)] * (nodes * width),
            "away": swept,
            "scale": [size if k < facts["plain"] else unit for k in range(width)] * nodes,
            "stops": [
                {"now": facts["solved"], "rate": LEAST_RATE},
                stalled,
                {"part": 1.0, "now": facts["nearly_rounding"]},
            ],
            "share": nodes,
            "based": 0,
            "derived": 0,
            "last": 1,
        }
    ]


#: The C ends a Taylor series at terms below a threshold. This is the safety factor in comparisons of terms with the
#: threshold: the terms are computed for a first box of unknowns, and the final box may be wider.
MARGIN = 4.0


def _path(
    facts: Mapping[str, Any], source: GeneratedC, n: int, centre: Sequence[Any], exact: bool = False
) -> list[Stage]:
    """Return the stages of a step that follows paths. The C computes each path by a Taylor series.

    The unknowns of a stage are p = ∇S_h at the mean of its path, where S_h is the generating function.
    """
    limit = int(facts["most_terms"])
    longest, stages = PathReader(source, facts["series"], n, limit).described, []
    for k in range(len(facts["fractions"])):
        orders = (limit, limit, 0) if exact else _orders(facts, longest, n, k, centre)
        stages.append(_along_path(facts, source, n, k, *orders))
    return stages


def _series(facts: Mapping[str, Any], kernel: Any, listing: Listing, k: int, x: Sequence[int], u: Sequence[int]) -> Any:
    """Append the operations of the Taylor series of the path ṁ = π(m)p that starts at x, with p = ``u``.

    Return the indices of the terms of order 1, 2, … for each coordinate.
    """
    starts = {f"s{i}": [j] for i, j in enumerate(x)}
    outputs = listing.copy(kernel, coef=prepared(facts, listing, k), p=u, **starts)
    return [outputs[f"s{i}"] for i in range(len(x))]


def _along_path(
    facts: Mapping[str, Any], source: GeneratedC, n: int, k: int, least: int, max_terms: int, coordinate: int
) -> Stage:
    """Return stage ``k`` of a step along paths.

    The C computes each path by a Taylor series. `_orders` explains ``least``, ``max_terms`` and ``coordinate``.
    """
    listing, kernels = Listing(), facts["kernels"]
    x, u, coef = listing.inputs("x", n), listing.inputs("u", n), prepared(facts, listing, k)
    terms = _series(facts, PathReader(source, facts["series"], n, max_terms).described, listing, k, x, u)
    change, y = [], []
    for i, row in enumerate(terms):
        shares = [listing.add("div", t, listing.add("number", float(j + 2))) for j, t in enumerate(row)]
        change.append(listing.add("rest", listing.sum(row[:least]), i, 1, *row[least:]))
        mean = listing.add("rest", listing.sum(shares[:least]), i, least + 2, *row[least:])
        y.append(listing.add("add", x[i], mean))
    outputs = listing.copy(kernels["generate"], coef=coef, y=y)
    first = listing.copy(kernels["generate"], coef=coef, y=x)["slope"]
    largest = [_largest(listing, [listing.add("abs", i) for i in u])] * n
    tail = Listing()
    lower = _series(facts, PathReader(source, facts["series"], n, least + 1).described, tail, k, tail.inputs("m", n),
                    tail.inputs("u", n))  # fmt: skip
    measured = _measured(facts, listing, x, terms, [max(least - 2, 1)])[coordinate]
    return {
        "change": change,
        "equation": [listing.add("neg", i) for i in outputs["slope"]],
        "matrix": outputs["jacobian"],
        "gain": [],
        "start": first,
        "away": [listing.add("sub", a, b) for a, b in zip(first, outputs["slope"], strict=True)],
        "scale": largest,
        "stops": [{"now": facts["solved"]}, {"before": facts["nearly_solved"], "part": facts["shrinking"]}],
        "share": 0,
        "based": 0,
        "derived": 0,
        "last": 0,
        "difference": facts["difference"],
        "seen": [measured[0]] if least > 2 else [],
        "seen_above": measured[1],
        "hidden": _measured(facts, listing, x, terms, [max_terms - 1, max_terms]),
        "path": {
            "operations": tail.operations,
            "field": [row[0] for row in lower],
            "next": [row[least] for row in lower],
        },
        "operations": listing.operations,
    }


def _largest(listing: Listing, sizes: Sequence[int]) -> int:
    largest = sizes[0]
    for size in sizes[1:]:
        largest = listing.add("max", largest, size)
    return largest


def _measured(
    facts: Mapping[str, Any], listing: Listing, x: Sequence[int], terms: Sequence[Sequence[int]], orders: Sequence[int]
) -> list[list[int]]:
    """Append operations that compute thresholds for terms of a Taylor series. The C neglects a term below its
    threshold.

    Returns pairs of indices for the given ``orders``: a term, and its threshold.
    """
    starts = [listing.add("abs", i) for i in x]
    least = listing.add("mul", listing.add("exact", facts["least_share"]), listing.sum(starts))
    negligible, pairs = listing.add("exact", facts["negligible"]), []
    for order in orders:
        for start, row in zip(starts, terms, strict=True):
            sums = listing.sum([start, listing.add("abs", listing.sum(row[:order])), least])
            pairs.append([row[order - 1], listing.add("mul", negligible, sums)])
    return pairs


def _orders(facts: Mapping[str, Any], kernel: Any, n: int, k: int, box: Sequence[Any]) -> tuple[int, int, int]:
    """Return the least and the largest number of terms that the C uses in Taylor series of paths from a box of
    states.

    The third result is the index of a coordinate whose series cannot end before the least number of terms.
    """
    listing = Listing()
    x = listing.inputs("x", n)
    p = listing.copy(facts["kernels"]["generate"], coef=prepared(facts, listing, k), y=x)["slope"]
    terms = _series(facts, kernel, listing, k, x, p)
    limit = len(terms[0])
    pairs = _measured(facts, listing, x, terms, range(1, limit + 1))
    c = {"step": facts["step"], "parameters": facts["parameters"], "gauge": facts["gauge"], "ulps": 1.0, "carry": CARRY,
         "series": facts["series"]}  # fmt: skip
    time = [arb(facts["start"])]
    run = Evaluation(c, listing.operations, {"x": list(box), "t": time}, exact=True)
    centre = [arb(v.mid()) for v in box]
    evaluation = Evaluation(c, listing.operations, {"x": centre, "t": time}, exact=True)
    radius = column(box) - column(centre)
    least, coordinate = 2, 0
    for order in range(1, limit + 1):
        at_order = pairs[(order - 1) * n : order * n]
        slopes = run.outputs([a for a, _ in at_order], {"x": n})[2]
        values = column(evaluation.x[a] for a, _ in at_order) + slopes * radius
        ratios = [
            float(v.abs_lower() / run.x[b].abs_upper()) for v, (_, b) in zip(values.entries(), at_order, strict=True)
        ]
        if max(ratios) < MARGIN:
            break
        least, coordinate = order + 2, ratios.index(max(ratios))
    rows = [[(run.x[a], run.x[b]) for a, b in pairs[i * n : i * n + n]] for i in range(limit)]
    converged_orders = [
        i + 1 for i, row in enumerate(rows) if all(a.abs_upper() * MARGIN < b.abs_lower() for a, b in row)
    ]
    hidden = [i for i in converged_orders if i >= least and i - 1 in converged_orders]
    if not hidden:
        raise RefusedError(f"the Taylor series of paths take more than {limit} terms")
    return least, min(hidden), coordinate


_STAGES: Mapping[str, Callable[..., list[Stage]]] = {
    "explicit": _explicit,
    "splitting": _splitting,
    "newton": _newton,
    "gauss": _gauss,
}
