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

#: Stands for the choice of the spec where it has no name: formulas, or options of a kind.
OWN = "as in the spec"

#: Orders of direct series; canonical-euler is also explicit at order 1, for separable H.
ORDERS = tuple(range(2, limits.ORDER + 1, 2))

#: The scheme that needs no bi-realisation, which stands in the place of its kind.
SPLITTING = "splitting"

#: So does this; the orders that are tried of it.
GAUSS = "gauss"
GAUSS_ORDERS = (4, 8, 12, 16)

#: So does the choice among the schemes by their expected cost.
AUTO = "auto scheme"

#: Methods for near-integrable systems that are tried, with their orders: the best of each set of errors, by powers of
#: ε and h, and the one with a corrector, whose steps are the cheapest.
NEAR_INTEGRABLE = (("saba-8-2", 2), ("wisdom-holman-17", 2), ("aba-8-4", 4), ("aba-10-6-4", 4))

#: Kinds that need formulas of the user, and those with choices of their own.
FORMULAS = ("custom", "group-map", "spray")
CHOICES = ("auto", "canonical-euler", "product", "pullback")
_NESTED = (("product", "auto"), ("product", "cayley"), ("pullback", "auto"), ("pullback", "cayley"))


@dataclass(frozen=True, order=True)
class Setting:
    """One way to solve a system; ``kind`` and ``gauge`` may be `OWN`. ``of`` is that of products and pull-backs.

    A splitting has the kind `SPLITTING`, no gauge, and the composition ``auto``; Gauss collocation the kind `GAUSS`.
    ``monitor`` is that of the spec if it is empty.
    """

    kind: str
    order: int
    gauge: str = "auto"
    composition: str = "none"
    of: str = "auto"
    monitor: str = ""

    @property
    def family(self) -> Setting:
        """The setting without its order: what is common to methods that differ in the order alone."""
        return replace(self, order=0)

    @property
    def chart(self) -> Setting:
        """The bi-realisation alone."""
        return Setting(self.kind, 0, of=self.of)

    @property
    def orders(self) -> tuple[int, ...]:
        """The orders there are in its family."""
        if self.is_splitting:
            return tuple(choosing.orders(self.composition))
        if self.is_gauss:
            return GAUSS_ORDERS
        if self.composition not in ("none", "auto"):
            return tuple(c.order for c in COMPOSITIONS if c.name == self.composition)
        return (1, *ORDERS) if self.kind == "canonical-euler" else ORDERS

    def described(self, kind: str = "") -> str:
        """The setting in words: ``exponential, order 8, without gauge, kahan-li``; ``kind`` is that of the build."""
        named = self.kind if self.of == "auto" else f"{self.kind} of {self.of}"
        words = [kind or named, f"order {self.order}"]
        words += ["without gauge"] if self.gauge == "none" and self.scheme == "series" else []
        return ", ".join([*words, self.composition] if self.composition not in ("none", "auto") else words)

    @property
    def is_splitting(self) -> bool:
        """Whether its scheme is a splitting."""
        return self.kind == SPLITTING

    @property
    def is_gauss(self) -> bool:
        """Whether its scheme is Gauss collocation."""
        return self.kind == GAUSS

    @property
    def scheme(self) -> str:
        """Its scheme, as in specs."""
        return "auto" if self.kind == AUTO else self.kind if self.kind in (SPLITTING, GAUSS) else "series"

    def lines(self) -> list[str]:
        """The top-level lines of a spec that ask for it; what is `OWN` stays as it is there."""
        kind = "auto" if self.scheme != "series" else self.kind
        named = kind if self.of == "auto" else f"{{kind: {kind}, of: {self.of}}}"
        lines = [f"scheme: {self.scheme}"]
        lines += [] if kind == OWN else [f"birealisation: {named}"]
        lines += [f"order: {self.order}", f"composition: {self.composition}"]
        lines += [f"monitor: {self.monitor}"] if self.monitor else []
        return lines if self.gauge == OWN else [*lines, f"gauge: {self.gauge}"]

    def applied(self, spec: Spec) -> Spec:
        """The spec with this setting."""
        kind = "auto" if self.scheme != "series" else self.kind
        choice = spec.birealisation if kind == OWN else BirealisationChoice(kind, of=self.of)
        return replace(
            spec, scheme=self.scheme, birealisation=replace(choice, order=self.order),
            order=self.order, terms=None, composition=self.composition,
            gauge=spec.gauge if self.gauge == OWN else self.gauge,
            monitor=monitor_of(self.monitor, spec) if self.monitor else spec.monitor,
        )  # fmt: skip


def monitor_of(written: str, spec: Spec) -> str | Expression:
    """The monitor that a text denotes: ``log``, or a function of coordinates and parameters."""
    if written == LOGARITHMIC:
        return LOGARITHMIC
    names = (*spec.coordinates, *(p.name for p in spec.parameters))
    expression = parse(written, AllowedNames({n: symbol(n) for n in names}), lambda *_, **__: None)
    if expression is None:
        raise ValueError(f"{written!r} is no monitor")
    return expression


def own_setting(compilation: Compilation) -> Setting:
    """The setting of a spec as it is now, with the kinds that ``auto`` chose."""
    spec, order = compilation.spec, compilation.order.order
    gauge = spec.gauge if isinstance(spec.gauge, str) else OWN
    if compilation.scheme_name != "series":
        return Setting(compilation.kind, order, gauge, spec.composition if compilation.is_composed else "none")
    choice = spec.birealisation
    plain = choice == BirealisationChoice(choice.kind, order=choice.order) and choice.kind not in FORMULAS
    kind = compilation.kind if plain else OWN
    if spec.lattice:  # its series has order 2 and is composed for higher orders
        composition = "auto" if spec.composition == "none" else spec.composition
        return Setting(kind if compilation.birealisation else "auto", order, OWN, composition)
    return Setting(kind, order, gauge, spec.composition if compilation.is_composed else "none")


def charts(system: System, current: Setting) -> list[Setting]:
    """Settings to begin with: one of order 4 for each bi-realisation that might apply, the spec's own at more orders.

    Left out are those that need formulas of the user, and Karasev's paths where π is linear or constant: there its
    maps are those of a closed form. Which of the others apply, building them shows.
    """
    linear = isinstance(system.shape, Constant | Canonical | LiePoisson | Affine)
    plain = [kind for kind in BIREALISATIONS if kind not in (*FORMULAS, *CHOICES)]
    named = [Setting(kind, 4) for kind in plain if not (kind == "karasev" and linear)]
    nested = [Setting(kind, 4, of=of) for kind, of in _NESTED]
    # The other side is the adjoint, whose errors are the same in reversed time.
    euler = [Setting("canonical-euler", order) for order in (1, 4)]
    composed = _near_integrable(system)
    split = [Setting(SPLITTING, order, "none", "auto") for order in (4, 6)]
    split += [Setting(GAUSS, order, "none") for order in (8, 16)]
    first = [replace(current, order=order, composition=direct(current)) for order in (4, 8)]
    others = [s for s in (*split, *named, *nested, *euler) if s.chart != current.chart]
    return [s for s in (*first, *composed, *others) if s != current]


def _near_integrable(system: System) -> list[Setting]:
    """Splittings of H = A + εB with the methods for these; none if H is no such sum."""
    try:
        small = split_in_parts(system).small
    except PhigenError:
        return []
    return [Setting(SPLITTING, order, "none", name) for name, order in NEAR_INTEGRABLE] if small is not None else []


def direct(setting: Setting) -> str:
    """The composition of the plain methods of its kind."""
    return "auto" if setting.is_splitting or setting.composition == "auto" else "none"


def variants(best: Setting, gauged: bool, symmetric: bool) -> list[Setting]:
    """The same bi-realisation at about the same order otherwise: without gauge, or composed."""
    variations = [replace(best, gauge="none")] if gauged else []
    if symmetric and direct(best) == "none":
        recommended = {c.order: c.name for c in reversed(COMPOSITIONS)}
        order = max((k for k in recommended if k <= best.order), default=min(recommended))
        variations.append(replace(best, composition=recommended[order], order=order))
    return variations
