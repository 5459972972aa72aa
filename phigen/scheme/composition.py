"""Symmetric compositions: a step of high order consists of several steps by a symmetric method of order 2.

A step is Φ_h = φ_{γ_s h} ∘ … ∘ φ_{γ_1 h} with γ_i = γ_{s+1−i}, where φ_h is a step of the method of order 2. A
composition of Poisson maps is a Poisson map. A composition of symmetric methods with symmetric coefficients γ is
symmetric. The coefficients are those in E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration, 2nd ed.,
section V.3.2, which names their authors.
"""

from __future__ import annotations

from dataclasses import dataclass

# The first half of the fractions γ_i of each composition; the middle fraction follows from Σ γ_i = 1.
_YOSHIDA_6 = (0.78451361047755726381949763, 0.23557321335935813368479318, -1.17767998417887100694641568)
_KAHAN_LI_6 = (
    0.39216144400731413927925056,
    0.33259913678935943859974864,
    -0.70624617255763935980996482,
    0.08221359629355080023149045,
)
_SUZUKI_UMENO_8 = (
    0.74167036435061295344822780,
    -0.40910082580003159399730010,
    0.19075471029623837995387626,
    -0.57386247111608226665638773,
    0.29906418130365592384446354,
    0.33462491824529818378495798,
    0.31529309239676659663205666,
)
_KAHAN_LI_8 = (
    0.13020248308889008087881763,
    0.56116298177510838456196441,
    -0.38947496264484728640807860,
    0.15884190655515560089621075,
    -0.39590389413323757733623154,
    0.18453964097831570709183254,
    0.25837438768632204729397911,
    0.29501172360931029887096624,
)

# The first half of the fractions γ_i of a method of order 10, from M. Sofroniou, G. Spaletta, Derivation of symmetric
# composition constants for symmetric integrators, Optim. Methods Softw. 20 (2005).
_SOFRONIOU_SPALETTA_10 = (
    0.078795722521686419263907679337684,
    0.31309610341510852776481247192647,
    0.027918383235078066109520273275299,
    -0.22959284159390709415121339679655,
    0.13096206107716486317465685927961,
    -0.26973340565451071434460973222411,
    0.074973343155891435666137105641410,
    0.11199342399981020488957508073640,
    0.36613344954622675119314812353150,
    -0.39910563013603589787862981058340,
    0.10308739852747107731580277001372,
    0.41143087395589023782070411897608,
    -0.0048663605831352617621956593099771,
    -0.39203335370863990644808193642610,
    0.051942502962449647037182904015976,
    0.050665090759924496335874344156866,
    0.049674370639729879054568800279461,
)


@dataclass(frozen=True)
class Composition:
    """A symmetric composition with name, order and ``fractions`` γ_1 … γ_s; stage i is a step of size γ_i h."""

    name: str
    order: int
    fractions: tuple[float, ...]


def _symmetric(name: str, order: int, half: tuple[float, ...]) -> Composition:
    return Composition(name, order, (*half, 1.0 - 2.0 * sum(half), *reversed(half)))


#: All compositions. The first one of each order is recommended.
COMPOSITIONS = (
    _symmetric("suzuki", 4, (1 / (4 - 4 ** (1 / 3)),) * 2),
    _symmetric("triple-jump", 4, (1 / (2 - 2 ** (1 / 3)),)),
    _symmetric("kahan-li", 6, _KAHAN_LI_6),
    _symmetric("yoshida", 6, _YOSHIDA_6),
    _symmetric("kahan-li", 8, _KAHAN_LI_8),
    _symmetric("yoshida", 8, _SUZUKI_UMENO_8),
    _symmetric("sofroniou-spaletta", 10, _SOFRONIOU_SPALETTA_10),
)


def find(name: str, order: int) -> Composition | None:
    """Return the composition with this name and order, or None; ``auto`` stands for the recommended composition."""
    return next((c for c in COMPOSITIONS if c.order == order and name in ("auto", c.name)), None)


def orders(name: str) -> list[int]:
    """Return the orders for which there is a composition with this name."""
    return [c.order for c in COMPOSITIONS if name in ("auto", c.name)]
