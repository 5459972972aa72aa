"""Systems of the benchmarks. Each is given by π and H, from which specs and vector fields are derived."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import sympy

#: Orders of phigen's methods that are measured. For the series, each problem states the orders.
ORDERS = {"splitting": (2, 4, 6, 8, 10), "gauss": (4, 8, 12, 16), "gauss to truncation": (4, 8, 12, 16)}


@dataclass(frozen=True)
class Problem:
    """System with the data of its benchmark.

    ``short`` and ``long`` are the times of integration. ``first`` is the step size at which scans begin, ``typical``
    the step size at which the cost of steps is measured. ``splitting`` names the C file with an explicit Poisson
    splitting, ``constants`` are defined in that file.
    """

    name: str
    title: str
    coordinates: tuple[str, ...]
    poisson: tuple[tuple[str, ...], ...]
    hamiltonian: str
    casimirs: Mapping[str, str]
    start: tuple[float, ...]
    orders: tuple[int, ...]
    short: float = 1e4
    long: float = 1e6
    first: float = 2.0
    typical: float = 0.1
    kind: str = "auto"
    splitting: str = ""
    quadratic: bool = True
    methods: tuple[str, ...] = ("gauge none", "gauge auto", "splitting", "gauss")
    constants: Mapping[str, float] = field(default_factory=dict)

    def orders_of(self, method: str) -> tuple[int, ...]:
        """Return the orders of a method of phigen that are measured."""
        return ORDERS.get(method, self.orders)

    @property
    def dimension(self) -> int:
        return len(self.coordinates)

    @cached_property
    def symbols(self) -> list[sympy.Symbol]:
        return [sympy.Symbol(c, real=True) for c in self.coordinates]

    def parse(self, text: str) -> sympy.Expr:
        names = dict(zip(self.coordinates, self.symbols, strict=True))
        return sympy.nsimplify(sympy.sympify(text, locals=names, rational=True))

    @cached_property
    def field(self) -> list[sympy.Expr]:
        """The components of π∇H, simplified as a careful user would write them."""
        H = self.parse(self.hamiltonian)
        gradient = sympy.Matrix([sympy.diff(H, s) for s in self.symbols])
        pi = sympy.Matrix([[self.parse(e) for e in row] for row in self.poisson])
        return [sympy.factor_terms(sympy.expand(e)) for e in pi * gradient]

    def spec(self, order: int, method: str = "gauge none") -> str:
        """Return a spec of the system, named ``bench``, of the given order.

        ``method`` is ``gauge none`` or ``gauge auto`` for the series without composition, ``splitting``, ``gauss`` for
        Gauss collocation that is exactly Poisson, or ``gauss to truncation`` for Gauss collocation that is Poisson up
        to its error.
        """
        schemes = {
            "splitting": "scheme: splitting",
            "gauss": "scheme: gauss",
            "gauss to truncation": "scheme: gauss\nstructure: to truncation",
        }
        series = f"birealisation: {self.kind}\ncomposition: none\ngauge: {method.removeprefix('gauge ')}"
        rows = "\n".join(f"    - [{', '.join(row)}]" for row in self.poisson)
        casimirs = "".join(f"  {name}: {text}\n" for name, text in self.casimirs.items())
        return (
            f"phigen: 1\nname: bench\ncoordinates: [{', '.join(self.coordinates)}]\n"
            f"poisson:\n  matrix:\n{rows}\nhamiltonian: {self.hamiltonian}\n"
            f"{'casimirs:' if casimirs else ''}\n{casimirs}"
            f"order: {order}\n{schemes.get(method, series)}\n"
        )


_SO3 = (("0", "-x3", "x2"), ("x3", "0", "-x1"), ("-x2", "x1", "0"))
_SPHERE = {"C": "x1**2 + x2**2 + x3**2"}


def _body(name: str, title: str, inverse: tuple[str, str, str], **rest: object) -> Problem:
    energy = " + ".join(f"{w}*x{i}**2" for i, w in enumerate(inverse, start=1))
    constants = {f"INVERSE_{i}": float(sympy.Rational(w)) for i, w in enumerate(inverse, start=1)}
    return Problem(
        name,
        title,
        ("x1", "x2", "x3"),
        _SO3,
        f"({energy})/2",
        _SPHERE,
        (1.0, 1.0, 1.0),
        (4, 6, 8, 10, 12, 14),
        splitting="rigid_body",
        constants=constants,
        **rest,  # type: ignore[arg-type]
    )


def _se3() -> tuple[tuple[str, ...], ...]:
    P, G, zero = ("P1", "P2", "P3"), ("G1", "G2", "G3"), ("0", "0", "0")

    def hat(v: tuple[str, ...]) -> list[tuple[str, ...]]:
        return [("0", "-" + v[2], v[1]), (v[2], "0", "-" + v[0]), ("-" + v[1], v[0], "0")]

    top, bottom = zip(hat(P), hat(G), strict=True), hat(G)
    return (*((*a, *b) for a, b in top), *((*a, *zero) for a in bottom))


def _so4() -> tuple[tuple[str, ...], ...]:
    pairs = [(1, 2), (1, 3), (1, 4), (2, 3), (2, 4), (3, 4)]
    given = {
        "12": {"13": "-x23", "14": "-x24", "23": "x13", "24": "x14"},
        "13": {"14": "-x34", "23": "-x12", "34": "x14"},
        "14": {"24": "-x12", "34": "-x13"},
        "23": {"24": "-x34", "34": "x24"},
        "24": {"34": "-x23"},
    }
    names = [f"{i}{j}" for i, j in pairs]

    def entry(a: str, b: str) -> str:
        text = given.get(a, {}).get(b)
        if text is None:
            text = given.get(b, {}).get(a, "0")
            return text if text == "0" else text.removeprefix("-") if text.startswith("-") else "-" + text
        return text

    return tuple(tuple(entry(a, b) for b in names) for a in names)


def volterra(n: int) -> Problem:
    """Return the periodic Volterra lattice of n species."""
    v = [f"v{i}" for i in range(1, n + 1)]
    rows = [["0"] * n for _ in v]
    for i in range(n):
        j = (i + 1) % n
        rows[i][j], rows[j][i] = f"{v[i]}*{v[j]}", f"-{v[i]}*{v[j]}"
    start = tuple(1 + 0.5 * float(sympy.sin(2 * i)) for i in range(n))
    return Problem(
        f"volterra{n}",
        f"Volterra lattice, n = {n}",
        tuple(v),
        tuple(map(tuple, rows)),
        " + ".join(v),
        {},
        start,
        (2, 4),
        typical=0.05,
    )


PROBLEMS = (
    _body("P1", "Free rigid body, moments 1, 2, 3", ("1", "1/2", "1/3")),
    _body(
        "P1stiff",
        "Free rigid body, stiff",
        ("103.14159265358979", "101", "4.14159265358979"),
        short=100.0,
        long=1e4,
        first=0.02,
        typical=1e-3,
    ),
    Problem(
        "P2",
        "Bounded Lotka–Volterra system",
        ("x1", "x2", "x3"),
        (("0", "x1*x2", "-0.7*x1*x3"), ("-x1*x2", "0", "1.3*x2*x3"), ("0.7*x1*x3", "-1.3*x2*x3", "0")),
        "x1 + x2 + x3 - log(x1) - log(x2) - log(x3)",
        {"C": "1.3*log(x1) + 0.7*log(x2) + log(x3)"},
        (1.5, 0.8, 0.6),
        (4, 6, 8, 10, 12, 14),
        first=1.0,
        splitting="lotka_volterra",
        methods=("gauge none", "splitting", "gauss to truncation"),
        constants={"A12": 1.0, "A13": -0.7, "A23": 1.3},
    ),
    Problem(
        "P3",
        "Kowalevski top",
        ("P1", "P2", "P3", "G1", "G2", "G3"),
        _se3(),
        "(P1**2/2 + P2**2/2 + P3**2)/2 + G1",
        {"A": "G1**2 + G2**2 + G3**2", "B": "P1*G1 + P2*G2 + P3*G3"},
        (1.0, 0.5, 0.8, 0.6, 0.0, 0.8),
        (4, 6, 8, 10),
        first=1.0,
        splitting="kowalevski",
    ),
    Problem(
        "so4",
        "Manakov's body on so(4)*",
        ("x12", "x13", "x14", "x23", "x24", "x34"),
        _so4(),
        "(x12**2/3 + x13**2/4 + x14**2/5 + x23**2/5 + x24**2/6 + x34**2/7)/2",
        {
            "A": "x12**2 + x13**2 + x14**2 + x23**2 + x24**2 + x34**2",
            "B": "x12*x34 - x13*x24 + x14*x23",
        },
        (1.0, 0.5, -1 / 3, 0.25, 2 / 3, -0.2),
        (4, 6, 8),
        first=2.5,
    ),
    Problem(
        "nambu",
        "Nambu's pendulum, on Karasev's paths",
        ("theta", "p", "V"),
        (("0", "1", "0"), ("-1", "0", "-sin(theta)"), ("0", "sin(theta)", "0")),
        "p**2/2 + V",
        {"C": "V + cos(theta)"},
        (0.0, 1.9, 0.0),
        (4, 6, 8),
        first=1.0,
        kind="karasev",
        splitting="pendulum",
        quadratic=False,
        constants={"CASIMIR": 1.0},
        methods=("gauge none", "splitting", "gauss to truncation"),
    ),
)
