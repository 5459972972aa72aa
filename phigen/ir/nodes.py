"""Nodes of the loop IR. Real arithmetic is an `Expression` over symbols that statements declare.

There are two levels. On the level of *sites*, `Load` and `Store` name an array and the offset of a site, and loops
run over sites, bonds or pairs. On the level of *memory*, `Entry`, `Member` and plain loops name elements of arrays.
Each target has one lowering pass from sites to memory; printers accept the level of memory only.

A dialect of C, such as that of a device, takes the functions of the lowering by rows (`phigen.ir.passes.by_rows`) or
by tables (`phigen.ir.passes.by_tables`) and prints them by a `phigen.targets.spelling.Dialect`. It maps the loops that
are ``independent`` and the loops over row segments to its threads; all other nodes have one meaning everywhere.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import Enum, auto
from functools import reduce

from phigen.scheme.kernel import Role
from phigen.symbolic.expression import Expression
from phigen.symbolic.symbols import Symbol

#: The kind of symbols that are printed unchanged, since the printed function reserves them; and the kind of symbols
#: that are printed by their text, unless the user has the same name.
FIXED, LABEL = "fixed", "label"


class Type(Enum):
    """Type of a declared value."""

    REAL = auto()
    INDEX = auto()
    SIZE = auto()  # a number of elements, or the number of a row segment
    FLAG = auto()  # a small integer
    ARRAY = auto()  # an array of reals, in a language without pointers
    INDICES = auto()  # an array of indices, likewise
    ARRAYS = auto()  # pointers to the first elements of several arrays of reals


@dataclass(frozen=True)
class Pointer:
    """Pointer to reals, or to reals in SIMD ``lanes``.

    A ``constant`` one is only read through, a ``restricted`` one has no alias that is written.
    """

    constant: bool = True
    restricted: bool = False
    lanes: bool = False


@dataclass(frozen=True)
class Vector:
    """Array of reals, or of reals in SIMD ``lanes``; a matrix if it has several ``rows``.

    As a parameter it is an address, of any length if it has none; a ``constant`` one is only read through, a
    ``restricted`` one has no alias.
    """

    length: Value | None
    rows: Value | None = None
    lanes: bool = False
    constant: bool = False
    restricted: bool = False


@dataclass(frozen=True)
class Tape:
    """Address of the next vector of a tape, or nothing if none are stored."""

    length: Value


@dataclass(frozen=True)
class RecordType:
    """Record of the runtime, by its name: the solver, or a row segment.

    Parameters of this type are addresses, and so are local names if it is an ``address``. A function changes only
    records that are ``mutable``.
    """

    name: str
    mutable: bool = False
    address: bool = False


ParameterType = Type | Pointer | Vector | Tape | RecordType


class Storage(Enum):
    """Kinds of arrays over the sites."""

    STATE = "x"  # fields, then parameters at sites, then increments of noise
    VARIATION = "varied"
    START = "start"  # the fields at the start of a stage
    OUTPUT = "out"
    OBSERVABLE = "observable"  # output for callers, without padding between rows
    SUM = "gathered"  # sums over bonds or pairs
    COTANGENT = "bar"  # of the state, then of parameters at bonds
    START_COTANGENT = "start_bar"
    SUM_COTANGENT = "gathered_bar"
    SEED = "seed"  # cotangents of the outputs of a kernel


@dataclass(frozen=True)
class Array:
    """Array over the sites: its number among the arrays of one kind of storage."""

    storage: Storage
    number: int
    name: str = ""


# ---- values; beside these, every `Expression` is a value


@dataclass(frozen=True)
class Name:
    """A variable that is declared in the function, by its name."""

    symbol: str

    @property
    def text(self) -> str:
        """The text of a fixed name."""
        return str(self.symbol.key[0]) if isinstance(self.symbol, Symbol) else ""


@dataclass(frozen=True)
class Constant:
    """A number in its shortest form, a string, or nothing."""

    value: int | float | str | None


@dataclass(frozen=True)
class Load:
    """Element of an array at an offset from the site of the loop, or at the ``end``, a or b, of a bond or pair.

    In transposed functions the end "bond" is the bond itself: arrays of cotangents of parameters at bonds are loaded
    and stored there.
    """

    array: Array
    offset: tuple[int, ...] = ()
    end: str = ""


@dataclass(frozen=True)
class Coefficient:
    """State-independent value, computed by ``prepare``."""

    number: int


@dataclass(frozen=True)
class SystemParameter:
    """Parameter that is the same at all sites."""

    name: str


@dataclass(frozen=True)
class BondParameter:
    """Parameter at the bond of the loop; an ``oriented`` one has the opposite sign seen from the end b."""

    number: int
    name: str
    oriented: bool = False


@dataclass(frozen=True)
class Time:
    """The physical time at which a kernel is evaluated."""


@dataclass(frozen=True)
class Inside:
    """1 where a term with these least and largest offsets along each axis lies within the open ends, else 0."""

    number: int
    bounds: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class HasColour:
    """1 at sites of the colour of the sweep, else 0."""


@dataclass(frozen=True)
class OnSeam:
    """1 where the site at an offset has a colour and lies on the boundary seams of the sweep, else 0."""

    number: int
    colour: int
    offset: tuple[int, ...]


@dataclass(frozen=True)
class Member:
    """A member of a record, such as the solver."""

    record: Value
    name: str


@dataclass(frozen=True)
class Entry:
    """Element of an array in memory."""

    array: Value
    index: Value


@dataclass(frozen=True)
class Binary:
    """Infix operator on two values."""

    operator: str
    left: Value
    right: Value


@dataclass(frozen=True)
class Accumulated:
    """A value, plus the terms of another value added one by one, from the left."""

    start: Value
    terms: Value


@dataclass(frozen=True)
class Cast:
    """A value as an index, as a size, or as a real number."""

    value: Value
    kind: str = "index"


@dataclass(frozen=True)
class Select:
    """One of two values, selected by a condition."""

    condition: Value
    then: Value
    otherwise: Value


@dataclass(frozen=True)
class Prefix:
    """A prefix operator, ``not`` or ``-``, on a value."""

    operator: str
    value: Value


@dataclass(frozen=True)
class Grouped:
    """A value in parentheses."""

    value: Value


@dataclass(frozen=True)
class Listed:
    """Values in the brackets of a list."""

    values: tuple[Value, ...]


@dataclass(frozen=True)
class Several:
    """Values separated by commas."""

    values: tuple[Value, ...]


@dataclass(frozen=True)
class Called:
    """Value of a function, or of a method of an ``instance``."""

    name: str
    arguments: tuple[Value, ...] = ()
    instance: Value | None = None


Value = (
    Expression | Name | Constant | Load | Coefficient | SystemParameter | BondParameter | Time | Inside | HasColour
    | OnSeam | Member | Entry | Binary | Accumulated | Cast | Select | Prefix | Grouped | Listed | Several | Called
)  # fmt: skip


# ---- statements


@dataclass(frozen=True)
class Declare:
    """Constants of one type; a constant ``in_place`` gets no name: its value is printed wherever it is used."""

    type: Type | Pointer | Vector | RecordType
    items: tuple[tuple[str, Value], ...]
    in_place: bool = False
    note: str = ""
    mutable: bool = False


@dataclass(frozen=True)
class Unpack:
    """Constants for the members, or the items, of one value."""

    names: tuple[str, ...]
    value: Value


@dataclass(frozen=True)
class Store:
    """Assign a value to the element at the site of the loop or, if it ``adds``, add the value to the element.

    An ``extreme``, ``max`` or ``min``, replaces the element only if it is larger or smaller. ``offset`` and ``end``
    select other elements, as in `Load`.
    """

    array: Array
    value: Value
    adds: bool = True
    offset: tuple[int, ...] = ()
    end: str = ""
    extreme: str = ""


@dataclass(frozen=True)
class Reduce:
    """Add a value to the cotangent of a coefficient or a parameter, which is the same at all sites."""

    source: str  # coef or params
    number: int
    name: str
    value: Value


#: Statements whose values are graphs before the pass `phigen.ir.passes.temporaries`.
Update = Store | Reduce


@dataclass(frozen=True)
class GatherSums:
    """Compute sums over bonds or pairs for all sites, by the functions of these names."""

    functions: tuple[str, ...]
    count: int


@dataclass(frozen=True)
class Assign:
    """Assign a value to a place in memory and to the places ``too`` or, if it ``adds``, add it."""

    target: Value
    value: Value
    adds: bool = False
    too: tuple[Value, ...] = ()


@dataclass(frozen=True)
class Together:
    """Assignments that make up one statement."""

    assignments: tuple[Assign, ...]


@dataclass(frozen=True)
class Clear:
    """Set ``count`` elements of an array to zero, from the index ``first`` on, or all without a count."""

    array: Value
    first: Value | None
    count: Value | None


@dataclass(frozen=True)
class Copy:
    """Copy a vector to another one, or ``count`` elements."""

    target: Value
    source: Value
    count: Value | None = None


@dataclass(frozen=True)
class Append:
    """Append a vector to a tape, if there is one."""

    tape: Value
    vector: Value


@dataclass(frozen=True)
class Selection:
    """The sites that a sweep updates: those of one ``colour``, those away from boundary seams, or those on a seam.

    ``inside`` excludes boundary seams; ``window`` selects the sites on the seams of these axes. Sites before the
    ``first`` are left out, in loops over pairs as the other site. Loops over ``massive`` sites end with the last one
    that has a mass.
    """

    colour: int | None = None
    inside: bool = False
    window: int | None = None
    first: int = 0
    massive: bool = False


ALL_SITES = Selection()


@dataclass(frozen=True)
class Loop:
    """Loop over sites, bonds or pairs; in memory, over a variable from ``low`` to before ``high``.

    ``end`` and ``chosen`` say which bonds a loop over bonds runs over, as in `phigen.scheme.steps.Ends`. A loop of the
    kind "segments" runs over row segments, by several threads if there are more sites than ``threads``, unless this is
    0. Loops of the kinds "line" and "search" have one statement; that of a search may end the function.
    """

    kind: str
    body: Block
    variable: str = "i"
    low: Value | None = None
    high: Value | None = None
    selection: Selection = ALL_SITES
    end: str = ""
    chosen: str = ""
    step: Value | None = None
    limit: str = ""  # the name of a variable that holds ``high``
    condition: Value | None = None  # the loop runs while it holds
    independent: str = ""  # SITE or LANE: the iterations that the compiler may vectorise
    note: str = ""
    threads: int = 0

    def with_body(self, statements: Iterable[Statement]) -> Loop:
        """Return the loop with other statements."""
        return replace(self, body=tuple(statements))

    @property
    def stores(self) -> list[Store]:
        """The stores among its statements."""
        return [s for s in self.body if isinstance(s, Store)]


@dataclass(frozen=True)
class Discard:
    """Mark a parameter as unused, for the compiler."""

    name: str


@dataclass(frozen=True)
class If:
    """Run statements if a condition holds, else the others."""

    condition: Value
    then: Block
    otherwise: Block = ()


@dataclass(frozen=True)
class Switch:
    """Run the statements of the case whose label equals a value; the last case is also that of all other values."""

    value: Value
    labels: tuple[int, ...]
    cases: tuple[Block, ...]


@dataclass(frozen=True)
class Comment:
    """Comment for readers of the generated code."""

    text: str


@dataclass(frozen=True)
class Within:
    """Statements in a context, such as one that silences warnings."""

    context: Value
    body: Block


@dataclass(frozen=True)
class Continue:
    """Go to the next iteration."""


@dataclass(frozen=True)
class Call:
    """Call a function for its effect."""

    name: str
    arguments: tuple[Value, ...]
    instance: Value | None = None


@dataclass(frozen=True)
class Return:
    """End a function, with a value or without."""

    value: Value | None = None


Statement = (
    Declare
    | Unpack
    | Store
    | Reduce
    | GatherSums
    | Assign
    | Together
    | Clear
    | Copy
    | Append
    | Loop
    | Discard
    | If
    | Switch
    | Comment
    | Within
    | Continue
    | Call
    | Return
)
Block = tuple[Statement, ...]


#: The parameters of functions on the level of sites; a target gives them its own names.
PARAMETERS = ("coef", "params", "start", "state", "varied", "sites", "colour", "out")

_NUMBERED = dict.fromkeys(("first", "end", "unit"), Type.SIZE)
_ARRAYS = dict.fromkeys(("x", "y", "v", "to", "bar", "handed", "received", "at_bonds"), Type.ARRAYS)
_SUMMED = dict.fromkeys(("sums", "numbers"), Pointer(constant=False))
#: The types of the parameters of functions by rows, by their names.
TYPES: dict[str, ParameterType] = {
    "s": RecordType("solver"),
    "row": RecordType("row"),
    "params": RecordType("params"),
    "coef": Pointer(),
    "out": Pointer(constant=False, restricted=True),
    **_NUMBERED,
    **_ARRAYS,
    **_SUMMED,
    **dict.fromkeys(("part", "flow", "far", "across"), Type.FLAG),
    "sign": Type.REAL,
}


@dataclass(frozen=True)
class ConstantTable:
    """Constants of the model: an array of integers with a name."""

    name: str
    values: tuple[int, ...]
    length: Value | None = None  # the number of the values, if it has no name


@dataclass(frozen=True)
class Function:
    """A function; ``doc`` is its purpose, ``role`` the purpose of its kernel, ``returns`` the type of its value.

    On the level of sites its parameters are some of `PARAMETERS`. On the level of memory the types of the parameters
    are in ``types``; types that are not listed there are in `TYPES`.
    """

    name: str
    doc: str
    role: Role
    parameters: tuple[str, ...]
    body: Block
    types: tuple[tuple[str, ParameterType], ...] = ()
    returns: Type | None = None

    @property
    def loop(self) -> Loop:
        """The loop of a function on the level of sites, its last statement."""
        loop = self.body[-1]
        assert isinstance(loop, Loop)
        return loop

    @property
    def known_types(self) -> dict[str, ParameterType]:
        """The types of parameters on the level of memory, by their names."""
        return {**TYPES, **dict(self.types)}

    def with_body(self, *body: Statement) -> Function:
        """Return the function with other statements."""
        return replace(self, body=body)


def fixed(name: str) -> Name:
    """Return a name that is printed as it is."""
    return Name(Symbol(FIXED, name))


def label(text: str) -> Name:
    """Return a name that is printed by its text, unless the user has the same name."""
    return Name(Symbol(LABEL, text))


def in_place(name: str, value: Value) -> Declare:
    """Return the declaration of a symbol whose value is printed wherever it is used."""
    return Declare(Type.REAL, ((name, value),), in_place=True)


def real(name: Name | str, value: Value, *, mutable: bool = False) -> Declare:
    """Return the declaration of one real value."""
    return Declare(Type.REAL, ((name.symbol if isinstance(name, Name) else name, value),), mutable=mutable)


def index(name: Name, value: Value) -> Declare:
    """Return the declaration of one index."""
    return Declare(Type.INDEX, ((name.symbol, value),))


def vectors(kind: Vector, *names: Name, value: Value | None = None, note: str = "") -> Declare:
    """Return the declaration of arrays that statements write to, without a value unless one is passed."""
    items = tuple((name.symbol, value or Constant(None)) for name in names)
    return Declare(kind, items, note=note, mutable=True)


def entry(array: Value, number: int | str) -> Entry:
    """Return the element of an array with a number, or a name."""
    return Entry(array, Constant(number))


def joined(operator: str, *values: Value) -> Value:
    """Return values joined by an infix operator, from the left."""
    return reduce(lambda left, right: Binary(operator, left, right), values)


def plus(value: Value, offset: int) -> Value:
    """Return a value plus an integer."""
    return Binary("+" if offset > 0 else "-", value, Constant(abs(offset))) if offset else value
