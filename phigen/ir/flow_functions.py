"""Builders of the functions of a splitting: flows, the sequence of flows in a step, and their transposes.

The function of a flow calls a kernel that computes an increment, and adds the increment to the state. Versions for SIMD
act on a group of members of an ensemble. A group consists of SIMD batches, called packs, with one member in each lane.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from phigen.ir import nodes as ir
from phigen.ir.passes.function_parameters import typed_function
from phigen.scheme.alternation import Schedule

X, START, COEF, ROW, DISTINCT_COEF, PART, PACK, GROUP, BAR, K = (
    ir.fixed(name) for name in ("x", "start", "coef", "row", "distinct_coef", "part", "pack", "group", "bar", "k")
)
CHANGE, TURNED, BACK, SLOPES, BEFORE = (ir.fixed(name) for name in ("change", "turned", "back", "slopes", "before"))
DISPLACEMENT, TAPE, ELEMENT, ROW_SIZE = (ir.fixed(name) for name in ("displacement", "tape", "element", "ROW"))
PACKS, ELEMENTS = ir.Member(GROUP, "packs"), ir.fixed("ELEMENT")
_PACK, _GROUP = ir.RecordType("pack", mutable=True, address=True), ir.RecordType("group", mutable=True)
_LANES = ir.Pointer(constant=False, lanes=True)


@dataclass(frozen=True)
class FlowFunctions:
    """The functions of the flows of a splitting, for a single trajectory.

    A flow updates an array, and ``along`` is the length of this array. The first entries of the array are the
    coordinates, and ``dimension`` is their number. With a monitor, two further entries follow: the physical time of the
    step, and a sum of square roots that is NaN if the step is not defined (`phigen.scheme.logarithmic`). With
    ``turns``, a flow also updates the attitude, a group element. With ``stores``, the state is stored on a tape before
    each flow.
    """

    dimension: int
    along: int
    turns: bool = False
    stores: bool = False

    @property
    def arguments(self) -> tuple[ir.Value, ...]:
        """The arguments that follow the coefficients in calls of the function of a flow."""
        return (X, DISPLACEMENT, START, *[ELEMENT] * self.turns)

    def function(self, name: str, doc: str, parameters: Sequence[str], body: ir.Block) -> ir.Function:
        """Return a function whose parameters have the types that all functions of flows use."""
        state, length = ir.Vector(ir.Constant(self.along)), ir.Constant(self.dimension)
        types: dict[str, ir.ParameterType] = {
            "x": state,
            "displacement": state,
            "start": replace(state, constant=True),
            "element": ir.Vector(ELEMENTS),
            "tape": ir.Tape(length),
            "after": ir.Type.FLAG,
            "slope": ir.Vector(ir.Constant(self.dimension**2)),
        }
        return typed_function(name, doc, parameters, body, types)

    def flow(self, number: int, updated: Sequence[int]) -> ir.Function:
        """Return the function of flow ``number``, which adds its increments to the values with the indices
        ``updated``."""
        count = ir.Constant(max(1, len(updated)))
        body: list[ir.Statement] = [ir.vectors(ir.Vector(count), CHANGE)]
        called = (COEF, X, *[ELEMENT] * self.turns, CHANGE, *[TURNED] * self.turns)
        body += [ir.vectors(ir.Vector(ELEMENTS), TURNED)] * self.turns
        body.append(ir.Call(f"change{number}", called))
        body += [ir.Copy(ELEMENT, TURNED)] * self.turns
        for place, i in enumerate(updated):
            increment = ir.entry(CHANGE, place)
            body.append(ir.Call("add", (X, DISPLACEMENT, START, ir.Constant(i), increment)))
        doc = f"Apply the flow of H_{number} to x, over the time for which coef was prepared"
        parameters = ("coef", "x", "displacement", "start", *["element"] * self.turns)
        return self.function(f"flow{number}", doc, parameters, tuple(body))

    def schedule(self, schedule: Schedule) -> ir.Function:
        """Return the function that applies all flows of a step. Each flow reads its own row of coefficients."""
        parameters = ("coef", "x", "displacement", "start", *["element"] * self.turns, *["tape"] * self.stores)
        body = _in_order(schedule, COEF, ROW_SIZE, self._flow)
        return self.function("flows", "The flows of one step, one after the other", parameters, tuple(body))

    def _flow(self, part: int, coefficients: ir.Value) -> Iterator[ir.Statement]:
        """Yield the statements that store the state on the tape and apply the flow of part ``part``, counted from 0."""
        if self.stores:
            yield ir.Append(TAPE, X)
        yield ir.Call(f"flow{part + 1}", (coefficients, *self.arguments))

    def corrector(self, schedule: Schedule) -> ir.Function:
        """Return the function of the corrector, which alternates between the flows of two parts. The function is called
        before the first step of a run and, with other durations of the flows, after the last step.
        """
        (outer, first), *others = schedule.begin
        (_, last), *_ = schedule.end
        begin = ir.Select(ir.fixed("after"), ir.Constant(last), ir.Constant(first))
        body = [ir.Assign(COEF, ir.Binary("*", begin, ROW_SIZE), adds=True), *self._flow(outer, COEF)]
        if others:
            pair = (*self._flow(others[0][0], _row(K)), *self._flow(outer, _row(ir.plus(K, 1))))
            count, two = ir.Constant(len(schedule.begin)), ir.Constant(2)
            body.append(ir.Loop("stages", pair, "k", ir.Constant(1), count, step=two))
        doc = "Corrector: the flows before the first step of a run; if `after` is 1, the flows after the last step"
        parameters = ("after", "coef", "x", "displacement", "start", *["tape"] * self.stores)
        return self.function("corrector", doc, parameters, tuple(body))

    def tangent(self, count: int) -> ir.Function:
        """Return the function that first computes the Jacobian of the increment of a flow, and then applies the flow.

        The argument ``part`` of the function selects one of ``count`` flows.
        """
        cases = tuple(
            (
                ir.Call(f"tangent{k}", (COEF, X, ir.fixed("slope"))),
                ir.Call(f"flow{k}", (COEF, *self.arguments)),
            )
            for k in range(1, count + 1)
        )
        body: list[ir.Statement] = [ir.Switch(PART, tuple(range(1, count + 1)), cases)]
        if self.turns:
            note, zeros = "attitude increments, which are not needed here", ir.Listed((ir.Constant(0.0),))
            body.insert(0, ir.vectors(ir.Vector(ELEMENTS), ELEMENT, value=zeros, note=note))
        doc = "Apply the flow of a part of H; `slope` receives the Jacobian of the increment at the start of the flow"
        return self.function("tangent_flow", doc, ("part", "coef", "x", "displacement", "start", "slope"), tuple(body))


def _row(number: ir.Value) -> ir.Value:
    """Return the address of row ``number`` in the matrix of coefficients."""
    return ir.Binary("+", COEF, ir.Binary("*", number, ROW_SIZE))


def _in_order(
    schedule: Schedule, rows: ir.Name, size: ir.Value | None, flow: Callable[[int, ir.Value], Iterator[ir.Statement]]
) -> Iterator[ir.Statement]:
    """Yield the flows of a step: the first flow, then a loop over a repeated pattern of flows.

    ``flow(part, row)`` yields the statements of one flow, whose coefficients are in the row ``row``. The generated code
    has a variable ``rows``, which refers to the row of the next flow. If ``size`` is None, the variable holds the
    number of this row. Otherwise the variable holds the address of this row, and each row has ``size`` coefficients.
    """

    def further(count: int) -> ir.Value:
        if size is None:
            return ir.Constant(count)
        return size if count == 1 else ir.Binary("*", ir.Constant(count), size)

    yield from flow(0, rows)
    if schedule.stages:
        yield ir.Assign(rows, further(1), adds=True)
        pattern = [
            s for part, at in schedule.pattern for s in flow(part, ir.Binary("+", rows, further(at)) if at else rows)
        ]
        body = (*pattern, ir.Assign(rows, further(schedule.rows), adds=True))
        yield ir.Loop("stages", body, "k", ir.Constant(0), ir.Constant(schedule.stages))


# ---- SIMD batches: all members of a group


def group_flow(number: int, form: str, updated: Sequence[int]) -> ir.Function:
    """Return the function that adds the increments of a flow to the values ``updated`` of all members of a
    group.

    ``form`` is the suffix of the name of the function. The suffix says which versions of sin and other elementary
    functions are called: those for small arguments, or those for all arguments (`phigen.ir.passes.forms`).
    """
    count = ir.Constant(max(1, len(updated)))
    x, start, compensation = (ir.Member(PACK, name) for name in ("x", "start", "carry"))
    coefficients = ir.Entry(ir.Member(GROUP, "coef"), ir.Binary("*", DISTINCT_COEF, K))
    row = ir.Binary("+", coefficients, ir.Binary("*", ROW, ROW_SIZE))
    body: list[ir.Statement] = [
        ir.Declare(_PACK, ((PACK.symbol, ir.Prefix("&", ir.Entry(ir.Member(GROUP, "pack"), K))),)),
        ir.vectors(ir.Vector(count, lanes=True), CHANGE),
        ir.Call(f"change{number}{form}_lanes", (row, x, DISTINCT_COEF, CHANGE)),
    ]
    for place, i in enumerate(updated):
        state = (ir.entry(array, i) for array in (x, compensation, start))
        body.append(ir.Call("add_lanes", (*state, ir.entry(CHANGE, place))))
    doc = f"The flow of H_{number} for all members of a group"
    return typed_function(f"flow{number}{form}_lanes", doc, tuple(_TYPES), (_over_packs(tuple(body)),), _TYPES)


def group_schedule(schedule: Schedule, form: str) -> ir.Function:
    """Return the function that applies all flows of a step to all members of a group.

    ``form`` is the suffix of the name of the function. The suffix says which versions of sin and other elementary
    functions are called: those for small arguments, or those for all arguments (`phigen.ir.passes.forms`).
    """

    def flow(part: int, row: ir.Value) -> Iterator[ir.Statement]:
        yield ir.Call(f"flow{part + 1}{form}_lanes", (row, DISTINCT_COEF, GROUP))

    doc, body = "The flows of one step, one after the other", tuple(_in_order(schedule, ROW, None, flow))
    return typed_function(f"flows{form}_lanes", doc, tuple(_TYPES), body, _TYPES)


def _over_packs(body: ir.Block) -> ir.Loop:
    return ir.Loop("packs", body, "k", ir.Constant(0), PACKS)


#: Types of the parameters of functions that act on a group of members.
_TYPES: Mapping[str, ir.ParameterType] = {"row": ir.Type.FLAG, "distinct_coef": ir.Type.FLAG, "group": _GROUP}


# ---- transposes


@dataclass(frozen=True)
class Transposed:
    """Description of the transposed kernel of one flow. All fields except the last two contain indices.

    The kernel computes the cotangents of the coordinates ``state`` and of the coefficients ``row``; contributions to
    other cotangents are always 0. The kernel also recomputes some coordinates at the start of the flow; ``before`` has
    their indices. ``reads`` has the coordinates that the kernel reads, as ranges (first index, length). If
    ``full_range``, the flow has a second version, in which elementary functions are correct for all arguments. If
    ``full_range_back``, the transposed kernel also has a second version.
    """

    state: Sequence[int]
    row: Sequence[int]
    before: Sequence[int]
    reads: Sequence[tuple[int, int]]
    full_range: bool
    full_range_back: bool


@dataclass(frozen=True)
class FlowTransposes:
    """Builder of the functions that pull cotangents back through the flows of a splitting.

    The state has ``dimension`` coordinates, and each flow has a row of ``row`` coefficients. If ``recomputes``, the
    transposes also recompute the states before the flows, so that no tape is needed.
    """

    flows: Sequence[Transposed]
    dimension: int
    row: int
    recomputes: bool

    def _switch(self, case: Callable[[int, Transposed], Iterator[ir.Statement]]) -> ir.Switch:
        """Return the switch over the parts of H; ``case`` yields the statements for a part."""
        cases = tuple(tuple(case(k, flow)) for k, flow in enumerate(self.flows, 1))
        return ir.Switch(PART, tuple(range(1, len(cases) + 1)), cases)

    def _results(self, *, lanes: bool = False) -> Iterator[ir.Declare]:
        lengths = {BACK: self.dimension, SLOPES: self.row}
        if lanes and self.recomputes:
            lengths[BEFORE] = self.dimension
        return (ir.vectors(ir.Vector(ir.Constant(length), lanes=lanes), name) for name, length in lengths.items())

    def back(self) -> ir.Function:
        """Return the function that pulls the cotangent of a single trajectory back through a flow."""

        def case(k: int, flow: Transposed) -> Iterator[ir.Statement]:
            yield ir.Call(f"flow{k}_adjoint", (COEF, X, BAR, BACK, SLOPES))
            for place, i in enumerate(flow.state):
                yield ir.Assign(ir.entry(BAR, i), ir.entry(BACK, place), adds=True)
            for place, i in enumerate(flow.row):
                yield ir.Assign(ir.entry(ir.fixed("coef_bar"), i), ir.entry(SLOPES, place), adds=True)

        state = ir.Vector(ir.Constant(self.dimension))
        types = {"x": replace(state, constant=True), "bar": state, "coef_bar": ir.Vector(ir.Constant(self.row))}
        doc = (
            "Pull a cotangent back through the flow of a part of H, which started at x;"
            " the cotangents of its coefficients are"
        )
        parameters = ("part", "coef", "x", "bar", "coef_bar")
        body: ir.Block = (*self._results(), self._switch(case))
        return typed_function("follow_back", f"{doc} are added to coef_bar", parameters, body, types)

    @property
    def _stored(self) -> Mapping[str, ir.ParameterType]:
        """Types of the parameters of functions with a tape, which holds the coordinates of all members of a group."""
        return {**_TYPES, "tape": ir.Vector(ir.Constant(self.dimension), rows=ir.fixed("BACK_PACKS"), lanes=True)}

    def group_flows(self) -> ir.Function:
        """Return the function that applies a flow to all members of a group.

        The function first stores the coordinates, which the transpose of the flow needs.
        """

        def case(k: int, flow: Transposed) -> Iterator[ir.Statement]:
            pack = ir.Member(ir.Entry(ir.Member(GROUP, "pack"), K), "x")
            copies = (
                ir.Copy(ir.entry(ir.Entry(TAPE, K), first), ir.entry(pack, first), ir.Constant(count))
                for first, count in flow.reads
            )
            if flow.reads:
                yield _over_packs(tuple(copies))
            yield _in_form(f"flow{k}", flow.full_range, (ROW, ir.Constant(1), GROUP))

        doc = "Apply the flow of a part to all members of a group, after storing the coordinates that its reverse pass"
        body = (self._switch(case),)
        return typed_function("follow_lanes", f"{doc} reads", ("part", "row", "group", "tape"), body, self._stored)

    def group_back(self) -> ir.Function:
        """Return the function that pulls cotangents back through a flow, for all members of a group."""
        bars, coefficients = ir.Entry(ir.Member(BAR, "x"), K), ir.Entry(ir.Member(BAR, "coef"), K)
        first = ir.Binary("*", ROW, ROW_SIZE)

        def case(k: int, flow: Transposed) -> Iterator[ir.Statement]:
            results = (BACK, SLOPES, *[BEFORE] * self.recomputes)
            yield _in_form(f"flow{k}_adjoint", flow.full_range_back, (COEF, X, bars, *results))
            for place, i in enumerate(flow.before):
                yield ir.Copy(ir.entry(X, i), ir.entry(BEFORE, place))
            for place, i in enumerate(flow.state):
                yield ir.Call("gain_lanes", (ir.entry(bars, i), ir.entry(BACK, place)))
            for place, i in enumerate(flow.row):
                entry = ir.Entry(coefficients, ir.Binary("+", first, ir.Constant(i)))
                yield ir.Call("gain_lanes", (entry, ir.entry(SLOPES, place)))

        x = ir.Member(ir.Entry(ir.Member(GROUP, "pack"), K), "x") if self.recomputes else ir.Entry(TAPE, K)
        coef = ir.Binary("+", ir.Entry(ir.Member(GROUP, "coef"), K), first)
        places = (ir.Declare(_LANES, ((name.symbol, value),)) for name, value in ((COEF, coef), (X, x)))
        body = _over_packs((*self._results(lanes=True), *places, self._switch(case)))
        parameters = ("part", "row", "group", *["tape"] * (not self.recomputes), "bar")
        types = {**self._stored, "bar": ir.RecordType("back_group", mutable=True)}
        doc = "Pull cotangents back through the flow of a part, for all members of a group; "
        doc += (
            "also inverts the flow, which restores the states before it"
            if self.recomputes
            else "tape holds the stored coordinates of the states before the flow"
        )
        return typed_function("follow_back_lanes", doc, parameters, (body,), types)


def _in_form(name: str, has_far: bool, arguments: tuple[ir.Value, ...]) -> ir.Statement:
    """Return the call of a function ``name`` for SIMD lanes.

    The function may have a second version, in which sin and other elementary functions are correct for all arguments.
    The second version is called for groups of members whose flag ``full_range`` is set.
    """
    near = ir.Call(f"{name}_lanes", arguments)
    if not has_far:
        return near
    return ir.If(ir.Member(GROUP, "full_range"), (ir.Call(f"{name}_full_range_lanes", arguments),), (near,))
