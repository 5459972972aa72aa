"""Splitting methods for near-integrable systems H = A + εB, with exact flows of A and of B.

A step is e^{a_1 hA} e^{b_1 hεB} … e^{b_s hεB} e^{a_{s+1} hA} with symmetric coefficients. Its error per unit of time is
a sum of terms ε^k h^m. A method has the generalised order (8, 6, 4) if the terms of order ε, ε² and ε³ begin at εh^8,
ε²h^6 and ε³h^4. Let c_i = a_1 + … + a_i. The order conditions follow from the flows of B at the times c_i along the
flow of A:

- of order ε: Σ b_i c_i^k = 1/(k + 1), as for a quadrature with the nodes c_i and the weights b_i;
- of order ε²: Σ_{i<j} b_i b_j (c_i^k c_j^l − c_i^l c_j^k) = (1/(k + 1) − 1/(l + 1))/(k + l + 2) for k < l, which
  removes errors at h^{k+l+2}.

Sources of the methods. Generalised order (2s, 2), by Gauss's quadrature: J. Laskar, P. Robutel, High order symplectic
integrators for perturbed Hamiltonian systems, Celestial Mechanics and Dynamical Astronomy 80 (2001). Order (8, 4): R.
I. McLachlan, Composition methods in the presence of small parameters, BIT 35 (1995). Orders (8, 6, 4) and (10, 6, 4):
S. Blanes, F. Casas, A. Farrés, J. Laskar, J. Makazaga, A. Murua, New families of symplectic splitting methods for
numerical integration in dynamical astronomy, Applied Numerical Mathematics 68 (2013). Correctors: J. Wisdom, M. Holman,
J. Touma, Symplectic correctors, Fields Institute Communications 10 (1996). Steps that are modified by {B, {B, A}}: H.
Rein, D. Tamayo, G. Brown, High-order symplectic integrators for planetary dynamics and their implementation in REBOUND,
Monthly Notices of the Royal Astronomical Society 489 (2019).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise

from phigen.gauss.tableau import gauss_nodes
from phigen.scheme.alternation import Alternation, Schedule
from phigen.scheme.corrector import corrector, schedule

# Two strings for each method. The first string is the first half of the symmetric list a_1, a_2, …; the second string
# is the first half of the list b_1, b_2, … If a list has a middle number, its half ends with this number. All digits
# are from Newton's method on the order conditions.
_8_4 = (
    "0.0753469602698928884165278036834744643726526645540790631409721 "
    "0.517916854688256782300773978496315644323847447821980915025719 "
    "-0.0932638149581496707173017821797901086965001123760599781666913",
    "0.190225939373676619245230762738453897461203619904872644686567 "
    "0.846524070443526257055080544646775834177113742394682854555924 "
    "-1.07350001963440575260062261477045946327663472459911099848498",
)
_8_6_4 = (
    "0.0711334264982231177779387300061549964174022959237396066958582 "
    "0.241153427956640098736487795326289649617814678049335179255881 "
    "0.521411761772814789212136078067994229991436478850263542789578 "
    "-0.333698616227678005726562603400438876026653452823338328741317",
    "0.183083687472197221961703757166430291072624126551597616793627 "
    "0.310782859898574869507522291054262796375157321116257726841587 "
    "-0.0265646185119588006972121379164987592663297728525475851924395 "
    "0.0653961422823734184559721793911134363710",
)
_10_6_4 = (
    "0.0380944974224121954569753223086375653406600603958069701639145 "
    "0.145298716116913749294020072660663749744308885146126023662728 "
    "0.207627695725541250716205611324988206515836968446160915076714 "
    "0.435909703651526159223154862401065184400688796494327254963353 "
    "-0.65386122583278670938071173739070941200298942096484232773342",
    "0.095858880837075210610771503771458847769342226040714700327836 "
    "0.204446153142998780680507783916434477976329958617371067841119 "
    "0.217070347978991101714338592430633671452975982042108321618577 "
    "-0.0173753819590650930056178801185269971986481667001940897875319",
)


@dataclass(frozen=True)
class NearIntegrable(Alternation):
    """A splitting method for H = A + εB.

    ``a`` and ``b`` are the fractions of the step for which the flows of A and of εB run. ``generalised`` has the powers
    of h with which the errors of order ε, ε², … begin.
    """

    generalised: tuple[int, ...] = ()
    a: tuple[Fraction, ...] = ()
    b: tuple[Fraction, ...] = ()

    @property
    def errors(self) -> str:
        """The leading errors as text, such as ``ε h^8 + ε² h^4``."""
        powers = ("ε", "ε²", "ε³")
        return " + ".join(f"{power} h^{m}" for power, m in zip(powers, self.generalised, strict=False))


@dataclass(frozen=True)
class Corrected(NearIntegrable):
    """A method with a symplectic corrector for H = A + εB: each step is one flow of εB and one flow of A.

    ``corrector`` has the durations of the flows at the end of a run. A run starts with the inverses of these flows. In
    the steps, but not in the corrector, the product of ``multiple`` and h²{B, {B, A}} is added to B.
    """

    corrector: tuple[Fraction, ...] = ()
    multiple: Fraction = Fraction(0)

    def schedule(self) -> Schedule:
        """Return the flows of a step, and the flows at the start and the end of a run.

        In H = A + εB, part number 0 is εB, and part number 1 is A.
        """
        flows = schedule(self.corrector)
        if not self.multiple:
            return flows
        return replace(flows, multiples=(float(self.multiple), *[0.0] * (len(flows.times) - 1)))


def _method(name: str, generalised: tuple[int, ...], a: list[Fraction], b: list[Fraction]) -> NearIntegrable:
    """Return the method for H = A + εB with the fractions ``a`` and ``b`` for the flows of A and of εB; both lists sum
    to 1."""
    times = [t for pair in zip(a, b, strict=False) for t in pair]
    alpha = [times[0]]
    for t in times[1:]:
        alpha.append(t - alpha[-1])
    return NearIntegrable(name, generalised[-1], tuple(alpha), generalised, tuple(a), tuple(b))


def _method_from_halves(
    name: str, generalised: tuple[int, ...], stages: int, halves: tuple[str, str]
) -> NearIntegrable:
    """Return the method for H = A + εB with ``stages`` flows of εB.

    The fractions of the step for the flows of A form a symmetric list a, and those for εB a symmetric list b.
    ``halves`` has the first half of a and the first half of b, each with the middle value.
    """
    a, b = ([Fraction(v) for v in half.split()] for half in halves)
    return _method(name, generalised, _mirrored(a, stages + 1), _mirrored(b, stages))


def _mirrored(half: list[Fraction], count: int) -> list[Fraction]:
    """Return all ``count`` fractions of a symmetric list from its first half.

    The last fraction of the half is replaced by the number for which the sum is exactly 1.
    """
    outer, odd = half[:-1], count % 2
    last = 1 - 2 * sum(outer, Fraction(0)) if odd else Fraction(1, 2) - sum(outer, Fraction(0))
    return [*outer, last, *([] if odd else [last]), *reversed(outer)]


def _quadrature(stages: int) -> NearIntegrable:
    """Return the method of Laskar and Robutel for H = A + εB with ``stages`` flows of εB, at the nodes of Gauss's
    quadrature."""
    nodes = [Fraction(0), *gauss_nodes(stages), Fraction(1)]
    a = [next_node - node for node, next_node in pairwise(nodes)]
    b = [_weight(nodes[1:-1], i) for i in range(stages)]
    a, b = (_mirrored(f[: (len(f) + 1) // 2], len(f)) for f in (a, b))
    return _method(f"saba-{2 * stages}-2", (2 * stages, 2), a, b)


def _weight(nodes: list[Fraction], i: int) -> Fraction:
    """Return the weight of node i in the quadrature over [0, 1] with these nodes.

    The weight is the integral of the polynomial that is 1 at node i and 0 at the other nodes.
    """
    p = [Fraction(1)]
    for c in (c for j, c in enumerate(nodes) if j != i):
        p = [(x - c * y) / (nodes[i] - c) for x, y in zip([Fraction(0), *p], [*p, Fraction(0)], strict=True)]
    return sum((x / (k + 1) for k, x in enumerate(p)), Fraction(0))


def _modified(order: int) -> Corrected:
    """Return the method for H = A + εB with a corrector of odd ``order`` and a modified B: B − h²{B, {B,
    A}}/24.

    The errors of the method begin at ε h^(order + 1) and ε² h^4.
    """
    unmodified = _wisdom_holman(order)
    return replace(
        unmodified,
        name=f"wisdom-holman-modified-{order}",
        order=4,
        generalised=(order + 1, 4),
        corrector=corrector(order, balanced=True),
        multiple=Fraction(-1, 24),
    )


def _wisdom_holman(order: int) -> Corrected:
    """Return the method for H = A + εB with a corrector of odd ``order``; at order 1 there is no corrector.

    The errors of the method begin at ε h^(order + 1) and ε² h^2.
    """
    name = "wisdom-holman" if order == 1 else f"wisdom-holman-{order}"
    half = Fraction(1, 2)
    return Corrected(name, 2, (half, half), (order + 1, 2), (half, half), (Fraction(1),), corrector(order))


#: All methods for near-integrable systems. The first one of each order is recommended.
METHODS = (
    _quadrature(4),
    _quadrature(2),
    _quadrature(3),
    _quadrature(5),
    *(_wisdom_holman(order) for order in (1, 3, 5, 7, 11, 17)),
    _method_from_halves("aba-10-6-4", (10, 6, 4), 8, _10_6_4),
    _method_from_halves("aba-8-6-4", (8, 6, 4), 7, _8_6_4),
    _method_from_halves("aba-8-4", (8, 4), 5, _8_4),
    *(_modified(order) for order in (7, 11, 17)),
)
NAMES = tuple(method.name for method in METHODS)


def find(name: str, order: int) -> NearIntegrable | None:
    """Return the near-integrable method with this name and order, or None; ``auto`` stands for the recommended
    method."""
    return next((m for m in METHODS if m.order == order and name in ("auto", m.name)), None)


def orders(name: str) -> list[int]:
    """Return the orders for which there is a near-integrable method with this name."""
    return sorted({m.order for m in METHODS if m.name == name})
