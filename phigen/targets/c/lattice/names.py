"""What the values that a loop over sites reads and changes are called in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from types import MappingProxyType

from phigen.ir.lattice import begins, bounds
from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.symbolic.symbols import (
    AROUND,
    BEGINS,
    CHOSEN,
    COEFFICIENT,
    GATHERED,
    HERE,
    INCREMENT,
    INITIAL,
    THERE,
    VARIATION,
    Symbol,
)
from phigen.targets.c.kernels import members, printer
from phigen.targets.c.lattice.layout import Layout
from phigen.targets.code import Code
from phigen.targets.names import Scope
from phigen.targets.reserved import C_RESERVED

#: What the loops call their own.
_OWN = frozenset(
    {"coef", "row", "to", "out", "apart", "i", "j", "k", "l", "side", "sums", "begin", "end", "whole", "lanes"}
    | {"at_bonds", "sign", "across", "first", "left", "count"}
)


#: The loop over the sites of a piece of a row.
OVER_SITES = "for (ptrdiff_t i = row->from, to = row->to; i < to; ++i)"


def told(program: Program, source: str = "coef") -> str:
    """The arguments of a loop over sites: coefficients, unless it goes by the parameters of the solver; and the row."""
    return "const double *coef, " * (source == "coef") + f"const {program.name}_row *row"


class SiteNames:
    """What the symbols of a kernel are called in a loop over sites."""

    def __init__(
        self,
        program: Program,
        layout: Layout,
        kernel: Kernel,
        code: Code,
        moved: set[str],
        calls: Mapping[str, str],
        sums: Sequence[str] = (),
        seeds: Mapping[str, Sequence[str]] = MappingProxyType({}),
        here: str = "a",
        opposite: Set[str] = frozenset(),
        at_bonds: str = "row->s->at_bonds",
        inside: bool = False,
    ) -> None:
        """``opposite`` are the parameters with the sign of bonds, and all are in arrays ``at_bonds``; ``inside`` a loop
        over sites are those over their bonds, so that the end a of a bond is the site itself."""
        self.layout, self.moved, self.code, self._fields = layout, moved, code, program.coordinates
        called = {word.strip("({") for text in calls.values() for word in text.split("(")}
        shares = {f"share{k}" for k in range(layout.step.row + len(program.parameters))}
        numbered = {f"{word}{k}" for word in ("change", "add", "sum") for k in range(3)} | shares
        numbered |= {f"there{k}" for k in range(len(layout.weights))}
        numbered |= {f"{word}{k}" for word in ("add", "own") for k in range(len(code.stores))}
        self.scope = Scope(C_RESERVED | _OWN | called | numbered)
        self.show = printer(self.scope, calls)
        self._here, self._inside = here, inside
        self._pointers: dict[tuple[str, int], str] = {}
        self._loaded: list[str] = []
        self._weights: list[str] = []
        self._own: list[str] = []
        self._other: dict[str, str] = {}
        self._first: list[str] = []
        self._starts: list[tuple[str, str]] = []
        member = members(program)
        for s in (s for symbols in kernel.inputs.values() for s in symbols if s in code.used):
            if isinstance(s, Symbol) and s.kind == COEFFICIENT:
                named = f"c{s.key[0]}"
                self.scope.bind(s, named)
                self._first.append(f"{named} = coef[{s.key[0]}]")
            elif isinstance(s, Symbol) and s.kind == GATHERED:
                number = list(sums).index(s)
                self.scope.bind(s, f"sum{number}" if inside else f"row->s->gathered[{number}][i]")
            elif isinstance(s, Symbol) and s.kind == CHOSEN:
                self.scope.bind(s, "(row->s->colours[i] == row->chosen ? 1.0 : 0.0)")
            elif isinstance(s, Symbol) and s.kind == VARIATION:
                self._bind_variation(s, str(s.key[0]))
            elif isinstance(s, Symbol) and s.kind == INITIAL:
                pointer, number = self.scope[Symbol("start", str(s.key[0]))], program.coordinates.index(str(s.key[0]))
                self._starts.append(("const double *restrict ", f"{pointer} = row->start[{number}]{layout.at(0)}"))
                self.scope.bind(s, f"{pointer}[i]")
            elif isinstance(s, Symbol) and s.kind == AROUND:
                self._bind_around(s, seeds[AROUND][int(s.key[0])])
            elif isinstance(s, Symbol) and s.kind in seeds:
                self._bind_seed(s, seeds[s.kind][int(s.key[0])], {HERE: "a", THERE: "b"}.get(s.kind))
            elif isinstance(s, Symbol) and s.kind == INCREMENT:
                self._bind_site(s)
            elif isinstance(s, Symbol) and s.kind == BEGINS:
                self._bind_kind(s)
            elif isinstance(s, Symbol):
                self._bind_weight(s)
            elif s == program.time:
                self._first.append(f"{self.scope[s]} = row->s->now")
            elif s in layout.step.sites.ends:
                self._bind_end(s)
            elif s in layout.step.sites.places:
                self._bind_site(s)
            elif s in layout.step.sites.at_bonds:
                side = "side * " if s in opposite else ""
                self._other[s] = f"{self.scope[s]} = {side}{at_bonds}[{layout.step.sites.at_bonds.index(s)}][k]"
            else:
                self._first.append(f"{self.scope[s]} = row->s->params.{member[s]}")

    def _bind_end(self, s: str) -> None:
        base, end = self.layout.step.sites.ends[s]
        pointer = self.pointer(base, 0)
        if self._inside and end == self._here:
            self.scope.bind(s, self.scope[base])
            self._loaded.append(f"{self.scope[base]} = {pointer}[i]")
        else:
            self._bind_at(s, end, f"{self.scope[s]} = {pointer}")

    def _bind_at(self, s: str, end: str, text: str) -> None:
        """What is read at the site i that a loop is over, or at the other site j of a bond or a pair."""
        if end == self._here:
            self._own.append(f"{text}[i]")
        else:
            self._other[s] = f"{text}[j]"

    def _bind_seed(self, s: Symbol, text: str, end: str | None) -> None:
        """A cotangent, of what is found at a site, or of the sums at an end of its bonds or pairs."""
        if end:
            self._bind_at(s, end, f"{self.scope[s]} = {text}")
        else:
            self._loaded.append(f"{self.scope[s]} = {text}[i]")

    def _bind_around(self, s: Symbol, array: str) -> None:
        """A cotangent at a neighbour."""
        offset = [int(o) for o in s.key[1:]]
        line = self.layout.line(offset)
        pointer = self.scope[Symbol("around", s.key[0], line)]
        self._starts.append(("const double *restrict ", f"{pointer} = {array}{self.layout.at(line)}"))
        self.scope.bind(s, beside(pointer, offset[-1]))

    def _bind_variation(self, s: Symbol, place: str) -> None:
        """The variation of a field at a site, a neighbour, or an end of a bond or a pair."""
        sites = self.layout.step.sites
        field, end = sites.ends.get(place, (sites.places[place][0] if place in sites.places else "", ""))
        offset = (0,) * len(sites.axes) if end else sites.places[place][1]
        line = self.layout.line(offset)
        pointer = self.scope[Symbol("varied", field, line)]
        array = f"row->varied[{self._fields.index(field)}]"
        self._starts.append(("const double *", f"{pointer} = {array}{self.layout.at(line)}"))
        if end:
            self._bind_at(s, end, f"{self.scope[s]} = {pointer}")
        else:
            self.scope.bind(s, beside(pointer, offset[-1]))

    def of_pair(self, code: Code) -> tuple[list[str], list[str]]:
        """What some code reads at the other site, and at the site that a loop is over."""
        return together([text for s, text in self._other.items() if s in code.used]), together(self._own)

    def _bind_kind(self, s: Symbol) -> None:
        """Whether a site has a colour, and is on the seams that a row tells of: these have kinds from one on."""
        colour, *offset = map(int, s.key)
        line, named = self.layout.line(offset), f"w{begins(self.layout.step).index(s)}"
        kinds, window = self.scope[Symbol("kinds", line)], self.scope[Symbol("window")]
        self._starts.append(("const double *restrict ", f"{kinds} = row->s->kinds{self.layout.at(line)}"))
        if f"{window} = row->window" not in self._first:
            self._first.append(f"{window} = row->window")
        self.scope.bind(s, named)
        self._weights.append(
            f"const double {named} = {beside(kinds, offset[-1])} == {window} + {colour}.0 ? 1.0 : 0.0;"
        )

    def _bind_weight(self, s: Symbol) -> None:
        k = self.layout.weights.index(s)
        named = f"w{k}"
        self.scope.bind(s, named)
        low, high = bounds(s.key)[-1]
        tests = [f"i - {-low} >= 0"] * (low < 0) + [f"i + {high} < row->s->length"] * (high > 0)
        if tests:
            there = "1.0"
            if len(self.layout.step.sites.axes) > 1:  # read before the loop, or gcc would not vectorise that
                there = f"there{k}"
                self._first.append(f"{there} = row->present[{k}]")
            self._weights.append(f"const double {named} = {' && '.join(tests)} ? {there} : 0.0;")
        else:
            self._first.append(f"{named} = row->present[{k}]")

    def _bind_site(self, s: str) -> None:
        base, offset = self.layout.step.sites.places[s]
        pointer = self.pointer(base, self.layout.line(offset))
        if offset[-1] == 0 and not any(offset):
            self._loaded.append(f"{self.scope[s]} = {pointer}[i]")
        else:
            self.scope.bind(s, beside(pointer, offset[-1]))

    def pointer(self, base: str, line: int) -> str:
        """The name of the row of an array at a line."""
        key = (base, line)
        if key not in self._pointers:
            self._pointers[key] = self.scope[f"{base}_row{line or ''}"]
        return self._pointers[key]

    def loaded(self) -> list[str]:
        """What is read at the beginning of the loop."""
        return [*together([*dict.fromkeys(self._loaded)]), *self._weights]

    def pointers(self) -> list[str]:
        """What is read before the loop."""
        for f in sorted(self.moved):
            self.pointer(f, 0)
        found, beside = [*dict.fromkeys(self._starts)], list[str]()
        for (base, line), named in self._pointers.items():
            constant = "" if base in self.moved and line == 0 else "const "
            kind = f"{constant}double *{'' if base in self.moved else 'restrict '}"
            place = f"{named} = row->x[{self.layout.arrays.index(base)}]{self.layout.at(line)}"
            if line:
                beside.append(f"{kind}{place}; /* {self.layout.place(line)} */")
            else:
                found.append((kind, place))
        return [*together(self._first), *pointers(found), *beside]


def beside(pointer: str, offset: int) -> str:
    """A value of a row at an offset from the site i."""
    return f"{pointer}[i{offset:+d}]".replace("+", " + ").replace("-", " - ").replace(" + 0", "")


def pointers(found: Sequence[tuple[str, str]]) -> list[str]:
    """Declarations of pointers, by their kind, as in ``const double *restrict``, and what each points to."""
    kinds = dict.fromkeys(kind for kind, _ in found)
    own = {kind: f"*{kind.partition('*')[2]}" for kind in kinds}
    return [
        f"{kind.partition('*')[0]}{', '.join(own[kind] + place for k, place in found if k == kind)};" for kind in kinds
    ]


def together(values: Sequence[str]) -> list[str]:
    """One declaration of several constants."""
    return [f"const double {', '.join(values)};"] if values else []
