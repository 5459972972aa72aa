"""Settings of a spec: bi-realisation, order, gauge, composition, scheme; and their lines in the spec."""

from __future__ import annotations

from dataclasses import dataclass, replace

from phigen.compilation import Compilation
from phigen.errors import PhigenError
from phigen.geometry.shapes import Affine, Canonical, Constant, LiePoisson
from phigen.geometry.system import System
from phigen.scheme import choosing
from phigen.scheme.composition import COMPOSITIONS
from phigen.spec import limits
from phigen.spec.grammar import AllowedNames, parse
from phigen.spec.model import BirealisationChoice, Spec
from phigen.spec.names import BIREALISATIONS, LOGARITHMIC
from phigen.splitting.parts import split as split_in_parts
from phigen.symbolic.expression import Expression, symbol

#: Name of a choice in the spec that has no other name: formulas, or options of a kind.
OWN = "as in the spec"

#: Orders of direct series. canonical-euler also has order 1, which is explicit for separable H.
ORDERS = tuple(range(2, limits.ORDER + 1, 2))

#: Name in place of the kind of bi-realisation, for splittings, which have none.
SPLITTING = "splitting"

#: The name in place of the kind for Gauss collocation, and the orders that are tried.
GAUSS = "gauss"
GAUSS_ORDERS = (4, 8, 12, 16)

#: The name in place of the kind for the automatic choice among all schemes.
AUTO = "auto scheme"

#: Candidate methods for near-integrable systems, with their orders: the best for each set of error terms in ε and h,
#: and methods with a corrector, whose steps are the cheapest.
NEAR_INTEGRABLE = (
    ("saba-8-2", 2),
    ("wisdom-holman-17", 2),
    ("wisdom-holman-modified-17", 4),
    ("aba-8-4", 4),
    ("aba-10-6-4", 4),
)

#: Kinds of bi-realisations that need formulas of the user, and kinds with options.
FORMULAS = ("custom", "group-map", "spray")
CHOICES = ("auto", "canonical-euler", "product", "pullback")
_NESTED = (("product", "auto"), ("product", "cayley"), ("pullback", "auto"), ("pullback", "cayley"))


@dataclass(frozen=True, order=True)
class Setting:
    """A bi-realisation, order, gauge, composition and scheme.

    ``kind`` and ``gauge`` may be `OWN`. ``of`` is the inner kind of products and pull-backs. A splitting has the kind
    `SPLITTING`, no gauge, and the composition ``auto``; Gauss collocation has the kind `GAUSS`. An empty ``monitor``
    stands for that of the spec.
    """

    kind: str
    order: int
    gauge: str = "auto"
    composition: str = "none"
    of: str = "auto"
    monitor: str = ""

    @property
    def family(self) -> Setting:
        """The setting without its order; methods of different orders have it in common."""
        return replace(self, order=0)

    @property
    def chart(self) -> Setting:
        """The setting reduced to its bi-realisation."""
        return Setting(self.kind, 0, of=self.of)

    @property
    def orders(self) -> tuple[int, ...]:
        """The orders that are available for the family of the setting."""
        if self.is_splitting:
            return tuple(choosing.orders(self.composition))
        if self.is_gauss:
            return GAUSS_ORDERS
        if self.composition not in ("none", "auto"):
            return tuple(c.order for c in COMPOSITIONS if c.name == self.composition)
        return (1, *ORDERS) if self.kind == "canonical-euler" else ORDERS

    def described(self, kind: str = "") -> str:
        """Return the setting in words: ``exponential, order 8, without gauge, kahan-li``; ``kind`` is the kind that
        was built."""
        chart_name = self.kind if self.of == "auto" else f"{self.kind} of {self.of}"
        attributes = [kind or chart_name, f"order {self.order}"]
        attributes += ["without gauge"] if self.gauge == "none" and self.scheme == "series" else []
        return ", ".join([*attributes, self.composition] if self.composition not in ("none", "auto") else attributes)

    @property
    def is_splitting(self) -> bool:
        """Whether the scheme is a splitting."""
        return self.kind == SPLITTING

    @property
    def is_gauss(self) -> bool:
        """Whether the scheme is Gauss collocation."""
        return self.kind == GAUSS

    @property
    def scheme(self) -> str:
        """The scheme, as in specs."""
        return "auto" if self.kind == AUTO else self.kind if self.kind in (SPLITTING, GAUSS) else "series"

    def lines(self) -> list[str]:
        """Return the top-level lines of a spec that request the setting; for `OWN` the lines of the spec remain."""
        kind = "auto" if self.scheme != "series" else self.kind
        chart_value = kind if self.of == "auto" else f"{{kind: {kind}, of: {self.of}}}"
        lines = [f"scheme: {self.scheme}"]
        lines += [] if kind == OWN else [f"birealisation: {chart_value}"]
        lines += [f"order: {self.order}", f"composition: {self.composition}"]
        lines += [f"monitor: {self.monitor}"] if self.monitor else []
        return lines if self.gauge == OWN else [*lines, f"gauge: {self.gauge}"]

    def applied(self, spec: Spec) -> Spec:
        """Return the spec with this setting."""
        kind = "auto" if self.scheme != "series" else self.kind
        choice = spec.birealisation if kind == OWN else BirealisationChoice(kind, of=self.of)
        return replace(
            spec, scheme=self.scheme, birealisation=replace(choice, order=self.order),
            order=self.order, terms=None, composition=self.composition,
            gauge=spec.gauge if self.gauge == OWN else self.gauge,
            monitor=monitor_of(self.monitor, spec) if self.monitor else spec.monitor,
        )  # fmt: skip


def monitor_of(expression_text: str, spec: Spec) -> str | Expression:
    """Return the monitor of a text: ``log``, or a function of coordinates and parameters."""
    if expression_text == LOGARITHMIC:
        return LOGARITHMIC
    names = (*spec.coordinates, *(p.name for p in spec.parameters))
    expression = parse(expression_text, AllowedNames({n: symbol(n) for n in names}), lambda *_, **__: None)
    if expression is None:
        raise ValueError(f"{expression_text!r} is no monitor")
    return expression


def own_setting(compilation: Compilation) -> Setting:
    """Return the present setting of a spec, with the kinds that ``auto`` chose."""
    spec, order = compilation.spec, compilation.order.order
    gauge = spec.gauge if isinstance(spec.gauge, str) else OWN
    if compilation.scheme_name != "series":
        return Setting(compilation.kind, order, gauge, spec.composition if compilation.is_composed else "none")
    choice = spec.birealisation
    is_plain = choice == BirealisationChoice(choice.kind, order=choice.order) and choice.kind not in FORMULAS
    kind = compilation.kind if is_plain else OWN
    if spec.lattice:  # the series of a lattice has order 2 and is composed for higher orders
        composition = "auto" if spec.composition == "none" else spec.composition
        return Setting(kind if compilation.birealisation else "auto", order, OWN, composition)
    return Setting(kind, order, gauge, spec.composition if compilation.is_composed else "none")


def charts(system: System, current: Setting) -> list[Setting]:
    """Return the first settings: one of order 4 for each bi-realisation that might apply, and that of the spec at
    several orders.

    Two groups of kinds are omitted: those that need formulas of the user, and Karasev's paths for constant or linear π,
    for which the same maps have closed forms. The builds of the others show which of them apply. Splittings and Gauss
    steps come first.
    """
    linear = isinstance(system.shape, Constant | Canonical | LiePoisson | Affine)
    plain_kinds = [kind for kind in BIREALISATIONS if kind not in (*FORMULAS, *CHOICES)]
    plain_settings = [Setting(kind, 4) for kind in plain_kinds if not (kind == "karasev" and linear)]
    nested = [Setting(kind, 4, of=inner_kind) for kind, inner_kind in _NESTED]
    # The other side is the adjoint, which has the same errors in reversed time.
    euler = [Setting("canonical-euler", order) for order in (1, 4)]
    composed = _near_integrable(system)
    # They are built in seconds, whereas series of order 8 may take minutes.
    quick = [Setting(SPLITTING, order, "none", "auto") for order in (4, 6)]
    quick += [Setting(GAUSS, order, "none") for order in (8, 16)]
    quick = [s for s in quick if s.chart != current.chart]
    first = [replace(current, order=order, composition=direct(current)) for order in (4, 8)]
    candidates = [s for s in (*plain_settings, *nested, *euler) if s.chart != current.chart]
    return [s for s in (*quick, *first, *composed, *candidates) if s != current]


def _near_integrable(system: System) -> list[Setting]:
    """Return splittings of H = A + εB with methods for near-integrable systems; empty if H is not such a sum."""
    try:
        small = split_in_parts(system).small
    except PhigenError:
        return []
    return [Setting(SPLITTING, order, "none", name) for name, order in NEAR_INTEGRABLE] if small is not None else []


def direct(setting: Setting) -> str:
    """Return the composition of the plain methods of the setting's kind."""
    return "auto" if setting.is_splitting or setting.composition == "auto" else "none"


def variants(best: Setting, gauged: bool, symmetric: bool) -> list[Setting]:
    """Return variants of a bi-realisation at about the same order: without gauge, or as a composition."""
    variations = [replace(best, gauge="none")] if gauged else []
    if symmetric and direct(best) == "none":
        recommended = {c.order: c.name for c in reversed(COMPOSITIONS)}
        order = max((k for k in recommended if k <= best.order), default=min(recommended))
        variations.append(replace(best, composition=recommended[order], order=order))
    return variations
