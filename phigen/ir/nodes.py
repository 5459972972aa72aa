"""Nodes of the loop IR, the intermediate representation of generated code: statements, loops and values. Real
arithmetic is an `Expression` in symbols that statements declare.

There are two levels. On the level of *sites*, `Load` and `Store` name an array and the offset of a site, and loops run
over sites, bonds or pairs. On the level of *memory*, `Entry` and `Member` name elements of arrays and members of
records, and loops count an index. Each target has one lowering pass from the level of sites to the level of memory, the
only level that printers accept.

A dialect of C, such as that of a device, applies the lowering by rows (`phigen.ir.passes.by_rows`) or by tables
(`phigen.ir.passes.by_tables`), and prints the result by a `phigen.targets.spelling.Dialect`. The iterations of
``independent`` loops and of loops over row segments become threads of the device.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import Enum, auto
from functools import reduce

from phigen.scheme.kernel import Role
from phigen.symbolic.expression import Expression
from phigen.symbolic.symbols import Symbol

#: Two kinds of symbols for variables that the builder of the code has named, not the spec. If the spec uses the name
#: too, one variable gets another name: with FIXED the variable of the spec, with LABEL the variable of the builder.
FIXED, LABEL = "fixed", "label"


class Type(Enum):
    """Type of a declared value."""

    REAL = auto()
    INDEX = auto()
    SIZE = auto()  # count of elements, or index of a row segment
    FLAG = auto()  # small integer
    ARRAY = auto()  # array of reals, in a language without pointers
    INDICES = auto()  # array of indices, in a language without pointers
    ARRAYS = auto()  # array of pointers to the first elements of arrays of reals


@dataclass(frozen=True)
class Pointer:
    """Pointer to reals, or to SIMD vectors of reals if ``lanes``.

    The function only reads through a ``constant`` pointer. The elements of a ``restricted`` pointer are not written
    through any other pointer.
    """

    constant: bool = True
    restricted: bool = False
    lanes: bool = False


@dataclass(frozen=True)
class Vector:
    """Array of real numbers. With ``lanes``, its elements are SIMD vectors instead of numbers. With ``rows``, the array
    is a matrix with this number of rows.

    A parameter of this type is an address, and its ``length`` may be unknown (None). ``constant`` and ``restricted``
    have the same meaning as in `Pointer`.
    """

    length: Value | None
    rows: Value | None = None
    lanes: bool = False
    constant: bool = False
    restricted: bool = False


@dataclass(frozen=True)
class Tape:
    """Pointer to the next free vector of a tape, to which states are appended for the reverse pass; null if no states
    are stored.
    """

    length: Value


@dataclass(frozen=True)
class RecordType:
    """A record of the runtime, such as the solver or a row segment. It is identified by its name.

    A parameter of this type is an address; a local variable is an address if ``address`` is set. A function changes
    only records that are ``mutable``.
    """

    name: str
    mutable: bool = False
    address: bool = False


ParameterType = Type | Pointer | Vector | Tape | RecordType


class Storage(Enum):
    """Kinds of arrays over the sites. The value of a kind is the name that arrays of this kind have in kernels."""

    STATE = "x"  # fields, then parameters at sites, then increments of noise, then derived arrays
    VARIATION = "varied"
    START = "start"  # fields at the start of a stage
    OUTPUT = "out"
    OBSERVABLE = "observable"  # results for callers, in arrays without padding between rows
    SUM = "gathered"  # sums over bonds or pairs
    COTANGENT = "bar"  # cotangents of the state, followed by those of parameters at bonds
    START_COTANGENT = "start_bar"
    SUM_COTANGENT = "gathered_bar"
    SEED = "seed"  # cotangents of the outputs of a kernel


@dataclass(frozen=True)
class Array:
    """Array over the sites, identified by its kind of storage and its number among the arrays of this kind."""

    storage: Storage
    number: int
    name: str = ""


# ---- values; an `Expression` is a value too


@dataclass(frozen=True)
class Name:
    """A variable of a function. Its symbol identifies the variable."""

    symbol: str

    @property
    def text(self) -> str:
        """The name itself for symbols of the kinds FIXED and LABEL; "" for others."""
        return str(self.symbol.key[0]) if isinstance(self.symbol, Symbol) else ""


@dataclass(frozen=True)
class Constant:
    """Number, string, or null."""

    value: int | float | str | None


@dataclass(frozen=True)
class Load:
    """Element of an array over the sites, at an ``offset`` from the site of the loop, or at the ``end`` of a bond or
    pair.

    ``end`` is "a" or "b". In transposed functions it may be "bond": then the element belongs to the bond itself, as the
    cotangents of parameters at bonds do.
    """

    array: Array
    offset: tuple[int, ...] = ()
    end: str = ""


@dataclass(frozen=True)
class Coefficient:
    """Coefficient, identified by its number. Coefficients do not depend on the state; the kernel ``prepare`` computes
    them.
    """

    number: int


@dataclass(frozen=True)
class SystemParameter:
    """Parameter with the same value at all sites."""

    name: str


@dataclass(frozen=True)
class BondParameter:
    """Parameter at the present bond of a loop over bonds. If ``oriented``, it has the opposite sign for the site at the
    end b of the bond.
    """

    number: int
    name: str
    oriented: bool = False


@dataclass(frozen=True)
class Time:
    """The physical time at which a kernel is evaluated."""


@dataclass(frozen=True)
class Inside:
    """Weight of a term of H near open ends: 0 at sites where the term reads values beyond the ends of the lattice, else
    1.

    ``bounds`` has, for each axis, the least and the largest offset at which the term reads values.
    """

    number: int
    bounds: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class HasColour:
    """Weight that is 1 at sites of the colour which the sweep updates, else 0."""


@dataclass(frozen=True)
class OnSeam:
    """Weight of a term of H near boundary seams: 1 if the present sweep includes the term, else 0.

    The term begins at the site that is ``offset`` away from the site of the loop. The sweep includes the term on two
    conditions: the site where the term begins has the colour ``colour``, and this site lies on exactly those seams that
    the sweep treats.
    """

    number: int
    colour: int
    offset: tuple[int, ...]


@dataclass(frozen=True)
class Member:
    """Member of a record; for example, an array of the solver."""

    record: Value
    name: str


@dataclass(frozen=True)
class Entry:
    """Element of an array in memory."""

    array: Value
    index: Value


@dataclass(frozen=True)
class Binary:
    """Infix operator with two operands."""

    operator: str
    left: Value
    right: Value


@dataclass(frozen=True)
class Accumulated:
    """Sum of ``start`` and the summands of the expression ``terms``, added one by one from the left."""

    start: Value
    terms: Value


@dataclass(frozen=True)
class Cast:
    """Value converted to an index, a size, or a real number."""

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
    """Prefix operator, such as ``not`` or ``-``, with its operand."""

    operator: str
    value: Value


@dataclass(frozen=True)
class Grouped:
    """A value in parentheses."""

    value: Value


@dataclass(frozen=True)
class Listed:
    """List of values, in the brackets of the language."""

    values: tuple[Value, ...]


@dataclass(frozen=True)
class Several:
    """Several values, separated by commas, such as the results of a function."""

    values: tuple[Value, ...]


@dataclass(frozen=True)
class Called:
    """Result of a function, or of a method of an ``instance``."""

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
    """Declaration of variables of one type, which are constant unless ``mutable``.

    If it is ``in_place``, no variable is printed: each use of the name is replaced by the value.
    """

    type: Type | Pointer | Vector | RecordType
    items: tuple[tuple[str, Value], ...]
    in_place: bool = False
    note: str = ""
    mutable: bool = False


@dataclass(frozen=True)
class Unpack:
    """Declaration of several constants: the members or items of one value, such as a tuple."""

    names: tuple[str, ...]
    value: Value


@dataclass(frozen=True)
class Store:
    """Change of an array element at the site of the loop. If ``adds`` is true, the value is added to the element.
    Otherwise the value replaces the element.

    With ``extreme`` "max", the value replaces the element only if the value is larger; with "min", only if the value is
    smaller. ``offset`` and ``end`` select an element at another site, as in `Load`.
    """

    array: Array
    value: Value
    adds: bool = True
    offset: tuple[int, ...] = ()
    end: str = ""
    extreme: str = ""


@dataclass(frozen=True)
class Reduce:
    """Addition of the values at all sites to a single cotangent: that of a coefficient, or that of a parameter with one
    value for all sites.
    """

    source: str  # "coef" or "params"
    number: int
    name: str
    value: Value


#: Statements that store results; their values are whole expression graphs before the pass
#: `phigen.ir.passes.temporaries`.
Update = Store | Reduce


@dataclass(frozen=True)
class GatherSums:
    """Computation of ``count`` sums over bonds or pairs at all sites, by calls of ``functions``."""

    functions: tuple[str, ...]
    count: int


@dataclass(frozen=True)
class Assign:
    """Assignment of a value to a place in memory. If ``adds`` is true, the value is added to the value that the place
    holds. The field ``too`` lists further places that receive the same value.
    """

    target: Value
    value: Value
    adds: bool = False
    too: tuple[Value, ...] = ()


@dataclass(frozen=True)
class Together:
    """Assignments that are printed as a single statement, for languages that assign several values at once."""

    assignments: tuple[Assign, ...]


@dataclass(frozen=True)
class Clear:
    """Assignment of 0 to ``count`` elements of an array, from index ``first`` on; to all elements if ``count`` is
    None.
    """

    array: Value
    first: Value | None
    count: Value | None


@dataclass(frozen=True)
class Copy:
    """Copy of a vector, or of its first ``count`` elements, to another vector."""

    target: Value
    source: Value
    count: Value | None = None


@dataclass(frozen=True)
class Append:
    """Append a vector to a tape, if the tape is not null."""

    tape: Value
    vector: Value


@dataclass(frozen=True)
class Selection:
    """The sites over which a loop runs.

    With a ``colour``, they are the sites of this colour. With ``inside``, sites near boundary seams are excluded. With
    a ``window``, the loop runs only over sites near boundary seams, and evaluates the terms that begin on certain
    seams: bit k of ``window`` is set for the seam of axis k. Sites with numbers below ``first`` are excluded. With
    ``massive``, the sites after the last site that has a mass are excluded. In loops over pairs, ``first`` and
    ``massive`` apply to the second site of a pair.
    """

    colour: int | None = None
    inside: bool = False
    window: int | None = None
    first: int = 0
    massive: bool = False


ALL_SITES = Selection()


@dataclass(frozen=True)
class Loop:
    """Loop over sites, bonds or pairs. After the lowering, the loop has a counter, whose name is ``variable``. The
    first value of the counter is ``low``, and all values are less than ``high``.

    ``end`` and ``chosen`` say over which bonds a loop runs, as in `phigen.scheme.steps.Ends`. A loop of the kind
    "segments" runs over row segments; if ``threads`` is not 0, it uses several threads for lattices of more than
    ``threads`` sites. A loop of the kind "line" has a single statement in its body, and is printed on one line. A loop
    of the kind "search" has a single statement too, which may return from the function.
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
    limit: str = ""  # name of a variable for ``high``
    condition: Value | None = None  # the loop only runs if this value is true
    independent: str = ""  # SITE or LANE if the compiler may vectorise the iterations
    note: str = ""
    threads: int = 0

    def with_body(self, statements: Iterable[Statement]) -> Loop:
        """Return the loop with a different body."""
        return replace(self, body=tuple(statements))

    @property
    def stores(self) -> list[Store]:
        """The stores in the body of the loop."""
        return [s for s in self.body if isinstance(s, Store)]


@dataclass(frozen=True)
class Discard:
    """Statement that marks a parameter as unused, so that a compiler does not warn about it."""

    name: str


@dataclass(frozen=True)
class If:
    """Branch. The statements in ``then`` are executed if ``condition`` is true. The statements in ``otherwise`` are
    executed if ``condition`` is false.
    """

    condition: Value
    then: Block
    otherwise: Block = ()


@dataclass(frozen=True)
class Switch:
    """Statements of the case whose label equals a value. The last case is also used if no label equals the value."""

    value: Value
    labels: tuple[int, ...]
    cases: tuple[Block, ...]


@dataclass(frozen=True)
class Comment:
    """Comment for readers of the generated code."""

    text: str


@dataclass(frozen=True)
class Within:
    """Statements in a context manager of Python, such as one that silences warnings."""

    context: Value
    body: Block


@dataclass(frozen=True)
class Continue:
    """Continue with the next iteration of the loop."""


@dataclass(frozen=True)
class Call:
    """Call a function for its effect."""

    name: str
    arguments: tuple[Value, ...]
    instance: Value | None = None


@dataclass(frozen=True)
class Return:
    """Return from a function, with a value or without."""

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


#: Parameters of functions before the lowering. Each target has its own names for these parameters.
PARAMETERS = ("coef", "params", "start", "state", "varied", "sites", "colour", "out")

_NUMBERED = dict.fromkeys(("first", "end", "unit"), Type.SIZE)
_ARRAYS = dict.fromkeys(("x", "y", "v", "to", "bar", "handed", "received", "at_bonds"), Type.ARRAYS)
_SUMMED = dict.fromkeys(("sums", "numbers"), Pointer(constant=False))
#: Types of the parameters of functions after the lowering by rows: name of the parameter → type.
TYPES: dict[str, ParameterType] = {
    "s": RecordType("solver"),
    "row": RecordType("row"),
    "params": RecordType("params"),
    "coef": Pointer(),
    "out": Pointer(constant=False, restricted=True),
    **_NUMBERED,
    **_ARRAYS,
    **_SUMMED,
    **dict.fromkeys(("part", "flow", "full_range", "across"), Type.FLAG),
    "sign": Type.REAL,
}


@dataclass(frozen=True)
class ConstantTable:
    """Array of constant integers, with its name in generated code."""

    name: str
    values: tuple[int, ...]
    length: Value | None = None  # the macro or constant for the number of values, if there is one


@dataclass(frozen=True)
class Function:
    """Function of the generated code.

    ``doc`` is printed as the comment of the function. If the function evaluates a kernel, ``role`` is the role of this
    kernel. ``returns`` is the type of the result. Before the lowering, each parameter is one of `PARAMETERS`. After the
    lowering, each parameter has a type, which is listed in ``types`` or in `TYPES`.
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
        """The loop over sites, bonds or pairs in a function before lowering. It is the last statement of the
        function.
        """
        loop = self.body[-1]
        assert isinstance(loop, Loop)
        return loop

    @property
    def known_types(self) -> dict[str, ParameterType]:
        """Map from the names of the parameters of a function to their types, after lowering."""
        return {**TYPES, **dict(self.types)}

    def with_body(self, *body: Statement) -> Function:
        """Return the function with a different body."""
        return replace(self, body=body)


def fixed(name: str) -> Name:
    """Return a variable that is printed as ``name``."""
    return Name(Symbol(FIXED, name))


def label(text: str) -> Name:
    """Return a variable that is printed as ``text``, or under a similar name if the spec uses this name."""
    return Name(Symbol(LABEL, text))


def in_place(name: str, value: Value) -> Declare:
    """Return the declaration of a symbol whose value is printed wherever the symbol is used."""
    return Declare(Type.REAL, ((name, value),), in_place=True)


def real(name: Name | str, value: Value, *, mutable: bool = False) -> Declare:
    """Return the declaration of a real variable."""
    return Declare(Type.REAL, ((name.symbol if isinstance(name, Name) else name, value),), mutable=mutable)


def index(name: Name, value: Value) -> Declare:
    """Return the declaration of an index."""
    return Declare(Type.INDEX, ((name.symbol, value),))


def vectors(kind: Vector, *names: Name, value: Value | None = None, note: str = "") -> Declare:
    """Return the declaration of mutable arrays, without initial values unless ``value`` is passed."""
    items = tuple((name.symbol, value or Constant(None)) for name in names)
    return Declare(kind, items, note=note, mutable=True)


def entry(array: Value, number: int | str) -> Entry:
    """Return an element of an array. Its index is a number, or the name of a variable."""
    return Entry(array, Constant(number))


def joined(operator: str, *values: Value) -> Value:
    """Return values joined by an infix operator, evaluated from the left."""
    return reduce(lambda left, right: Binary(operator, left, right), values)


def plus(value: Value, offset: int) -> Value:
    """Return the sum of a value and an integer."""
    return Binary("+" if offset > 0 else "-", value, Constant(abs(offset))) if offset else value
