"""Settings of a spec that the search compares: bi-realisation, order, gauge, composition and scheme."""

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

#: Name for a choice of the spec that one word cannot express, such as formulas, or options of a bi-realisation.
OWN = "as in the spec"

#: Orders that are tried for series without composition. For the kind canonical-euler, order 1 is tried too, since its
#: step is explicit for separable H.
ORDERS = tuple(range(2, limits.ORDER + 1, 2))

#: Word for ``kind`` of a setting that is a splitting, and so has no bi-realisation.
SPLITTING = "splitting"

#: Value of the field ``kind`` in settings with Gauss collocation.
GAUSS = "gauss"

#: Orders that are tried for Gauss collocation.
GAUSS_ORDERS = (4, 8, 12, 16)

#: Word for ``kind`` of a setting with ``scheme: auto``, in which phigen chooses the scheme.
AUTO = "auto scheme"

#: Compositions that are tried for near-integrable H = A + εB, with their orders. The two ``wisdom-holman`` compositions
#: have a corrector, and the cheapest steps. The errors of the other three differ in their powers of ε and h.
NEAR_INTEGRABLE = (
    ("saba-8-2", 2),
    ("wisdom-holman-17", 2),
    ("wisdom-holman-modified-17", 4),
    ("aba-8-4", 4),
    ("aba-10-6-4", 4),
)

#: Kinds of bi-realisations that need formulas of the user; below, kinds with options, which are tried separately.
FORMULAS = ("custom", "group-map", "spray")
CHOICES = ("auto", "canonical-euler", "product", "pullback")
_NESTED = (("product", "auto"), ("product", "cayley"), ("pullback", "auto"), ("pullback", "cayley"))


@dataclass(frozen=True, order=True)
class Setting:
    """A choice of method: bi-realisation or other scheme, order, gauge and composition.

    ``kind`` is the kind of bi-realisation, or `SPLITTING`, `GAUSS` or `AUTO` for other schemes. A bi-realisation of the
    kind ``product`` or ``pullback`` is made from other bi-realisations, whose kind is in the field ``of``. If ``kind``
    or ``gauge`` is `OWN`, the choice of the spec remains. If ``monitor`` is empty, the monitor of the spec remains.
    """

    kind: str
    order: int
    gauge: str = "auto"
    composition: str = "none"
    of: str = "auto"
    monitor: str = ""

    @property
    def family(self) -> Setting:
        """This setting with order 0. Settings that differ only in the order have the same family."""
        return replace(self, order=0)

    @property
    def chart(self) -> Setting:
        """This setting reduced to its bi-realisation: with order 0, and default gauge and composition."""
        return Setting(self.kind, 0, of=self.of)

    @property
    def orders(self) -> tuple[int, ...]:
        """Orders that this setting can have if its other fields stay the same."""
        if self.is_splitting:
            return tuple(choosing.orders(self.composition))
        if self.is_gauss:
            return GAUSS_ORDERS
        if self.composition not in ("none", "auto"):
            return tuple(c.order for c in COMPOSITIONS if c.name == self.composition)
        return (1, *ORDERS) if self.kind == "canonical-euler" else ORDERS

    def described(self, kind: str = "") -> str:
        """Return the setting in words, such as ``exponential, order 8, without gauge, kahan-li``.

        If ``kind`` is not empty, ``kind`` replaces the kind of the setting. Callers pass the bi-realisation that phigen
        chose for ``auto``.
        """
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
        """Value of ``scheme:`` in a spec with this setting: series, splitting, gauss or auto."""
        return "auto" if self.kind == AUTO else self.kind if self.kind in (SPLITTING, GAUSS) else "series"

    def lines(self) -> list[str]:
        """Return the lines of a spec that request this setting. Fields with the value `OWN` have no line, since the
        spec keeps its own line.
        """
        kind = "auto" if self.scheme != "series" else self.kind
        chart_value = kind if self.of == "auto" else f"{{kind: {kind}, of: {self.of}}}"
        lines = [f"scheme: {self.scheme}"]
        lines += [] if kind == OWN else [f"birealisation: {chart_value}"]
        lines += [f"order: {self.order}", f"composition: {self.composition}"]
        lines += [f"monitor: {self.monitor}"] if self.monitor else []
        return lines if self.gauge == OWN else [*lines, f"gauge: {self.gauge}"]

    def applied(self, spec: Spec) -> Spec:
        """Return the spec with this setting in place of its scheme, bi-realisation, order, composition and gauge."""
        kind = "auto" if self.scheme != "series" else self.kind
        choice = spec.birealisation if kind == OWN else BirealisationChoice(kind, of=self.of)
        return replace(
            spec, scheme=self.scheme, birealisation=replace(choice, order=self.order),
            order=self.order, terms=None, composition=self.composition,
            gauge=spec.gauge if self.gauge == OWN else self.gauge,
            monitor=monitor_of(self.monitor, spec) if self.monitor else spec.monitor,
        )  # fmt: skip


def monitor_of(expression_text: str, spec: Spec) -> str | Expression:
    """Return the monitor that a text states: the word ``log``, or a function of coordinates and parameters.

    Raises `ValueError` if the text is neither.
    """
    if expression_text == LOGARITHMIC:
        return LOGARITHMIC
    names = (*spec.coordinates, *(p.name for p in spec.parameters))
    expression = parse(expression_text, AllowedNames({n: symbol(n) for n in names}), lambda *_, **__: None)
    if expression is None:
        raise ValueError(f"{expression_text!r} is no monitor")
    return expression


def own_setting(compilation: Compilation) -> Setting:
    """Return the setting that a compiled spec states. If the spec leaves the choice of ``kind`` to phigen, the setting
    has the kind that phigen chose.
    """
    spec, order = compilation.spec, compilation.order.order
    gauge = spec.gauge if isinstance(spec.gauge, str) else OWN
    if compilation.scheme_name != "series":
        return Setting(compilation.kind, order, gauge, spec.composition if compilation.is_composed else "none")
    choice = spec.birealisation
    is_plain = choice == BirealisationChoice(choice.kind, order=choice.order) and choice.kind not in FORMULAS
    kind = compilation.kind if is_plain else OWN
    if spec.lattice:  # on lattices the series has order 2, and higher orders need a composition
        composition = "auto" if spec.composition == "none" else spec.composition
        return Setting(kind if compilation.birealisation else "auto", order, OWN, composition)
    return Setting(kind, order, gauge, spec.composition if compilation.is_composed else "none")


def charts(system: System, current: Setting) -> list[Setting]:
    """Return the settings to measure first.

    The settings are splittings and Gauss methods, the setting of the spec at orders 4 and 8, and each bi-realisation
    that might apply, at order 4. Whether a bi-realisation applies is known only when it is built. Bi-realisations that
    need formulas of the user are left out. If π is constant or linear, Karasev's bi-realisation is left out too, since
    other bi-realisations have the same maps in closed form.
    """
    linear = isinstance(system.shape, Constant | Canonical | LiePoisson | Affine)
    plain_kinds = [kind for kind in BIREALISATIONS if kind not in (*FORMULAS, *CHOICES)]
    plain_settings = [Setting(kind, 4) for kind in plain_kinds if not (kind == "karasev" and linear)]
    nested = [Setting(kind, 4, of=inner_kind) for kind, inner_kind in _NESTED]
    # Only the default of the option ``side``, q or p, is tried: the other side gives the adjoint method, with the same
    # errors.
    euler = [Setting("canonical-euler", order) for order in (1, 4)]
    composed = _near_integrable(system)
    # Splittings and Gauss methods come first, since they are built in seconds; series of order 8 may take minutes.
    quick = [Setting(SPLITTING, order, "none", "auto") for order in (4, 6)]
    quick += [Setting(GAUSS, order, "none") for order in (8, 16)]
    quick = [s for s in quick if s.chart != current.chart]
    first = [replace(current, order=order, composition=direct(current)) for order in (4, 8)]
    candidates = [s for s in (*plain_settings, *nested, *euler) if s.chart != current.chart]
    return [s for s in (*quick, *first, *composed, *candidates) if s != current]


def _near_integrable(system: System) -> list[Setting]:
    """Return splittings of H = A + εB, with the compositions of `NEAR_INTEGRABLE`; [] if H is no sum of this form."""
    try:
        small = split_in_parts(system).small
    except PhigenError:
        return []
    return [Setting(SPLITTING, order, "none", name) for name, order in NEAR_INTEGRABLE] if small is not None else []


def direct(setting: Setting) -> str:
    """Return the value of ``composition:`` with which a step of this scheme is not composed of whole steps.

    The value is ``none`` for series and Gauss methods. Splittings always compose flows, and have ``auto``.
    """
    return "auto" if setting.is_splitting or setting.composition == "auto" else "none"


def variants(best: Setting, gauged: bool, symmetric: bool) -> list[Setting]:
    """Return variants of a setting, of about the same order.

    One is without gauge, if the setting is ``gauged``. Another is a composition, if the setting is ``symmetric``.
    """
    variations = [replace(best, gauge="none")] if gauged else []
    if symmetric and direct(best) == "none":
        recommended = {c.order: c.name for c in reversed(COMPOSITIONS)}
        order = max((k for k in recommended if k <= best.order), default=min(recommended))
        variations.append(replace(best, composition=recommended[order], order=order))
    return variations
