"""Splitting methods for two parts with {V, {V, {V, T}}} = 0: Runge–Kutta–Nyström methods, and modified potentials.

A step alternates flows of T and V, Φ_h = φ_{t_n h} ∘ … ∘ φ_{t_1 h}, with t_i = t_{n+1−i}. Under that condition fewer
order conditions remain than for any two parts. Where V + κ{V, {V, T}} has an elementary flow too, each kick may have a
multiple κ_i = m_i h² of its own, and there are more unknowns to meet them with (`phigen.splitting.kicks`).
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from phigen.scheme.alternation import Schedule


@dataclass(frozen=True)
class Nystrom:
    """A named method: the times t_i of all flows, in order, and the multiples m_i of the kicks, if they are modified.

    ``kicks_first`` tells that V is followed first. ``error`` is the Euclidean norm of the leading error, in the basis
    of the Lie algebra of `tests/splitting/nystrom_algebra.py`: what methods are compared by.
    """

    name: str
    order: int
    kicks_first: bool
    times: tuple[Fraction, ...]
    multiples: tuple[Fraction, ...]
    error: float

    @property
    def stages(self) -> int:
        """Flows of the part that is followed last."""
        return len(self.times) // 2

    @property
    def kicks(self) -> int:
        """Flows of V."""
        return self.stages + self.kicks_first

    def schedule(self) -> Schedule:
        """The flows of a step, where part 0 is that which is followed first."""
        multiples = []
        if self.multiples:
            kicks = iter(self.multiples)
            multiples = [next(kicks) if i % 2 != self.kicks_first else Fraction(0) for i in range(len(self.times))]
        return Schedule(
            tuple(float(t) for t in self.times), self.stages, ((1, 0), (0, 1)), tuple(float(m) for m in multiples)
        )


def _method(name: str, order: int, first: str, half: str, error: float, multiples: str = "") -> Nystrom:
    """Times up to the middle one, and the multiples of the kicks among them."""
    times = [Fraction(v) for v in half.split()]
    kicks = [Fraction(v) for v in multiples.split()]
    middle_kicks = (len(times) - 1) % 2 != (first == "V")  # the middle flow is a kick, which is not repeated
    mirrored = kicks[-2::-1] if middle_kicks else kicks[::-1]
    return Nystrom(name, order, first == "V", (*times, *times[-2::-1]), (*kicks, *mirrored), error)


#: S. Blanes, P. C. Moan, Practical symplectic partitioned Runge–Kutta and Runge–Kutta–Nyström methods, J. Comput. Appl.
#: Math. 142 (2002): SRKN_6^b and SRKN_14^a. The published 15 digits are continued by Newton's method.
_SRKN6B = """
    0.082984406417404976396007246036789421 0.245298957184271116624067925015978842
    0.396309801498368038617837686730772926 0.604872665711079915617327045447534800
    -0.039056304922348427477692693169960308 -0.350171622895351032241394970463513642
    0.119524194013150824927695520804795920
"""
_SRKN14A = """
    0.037859319840611013897251956856493515 0.091719152624462168375800049480471774
    0.102635633102436598455590357121678546 0.183983170005004879368045855850523796
    -0.025867888266558349619274009672672499 -0.056534365832889167100198236291745510
    0.314241403071446401323398237217362172 0.004914688774711815665926291510156628
    -0.130144459517415184777573296148419791 0.143761127168361842465924358261460133
    0.106417700369541824903180053674410472 0.328567693746803465258399213337637147
    -0.008794243128510176267258668072482249 -0.196411466486455004033897532148503968
    0.207305069056895744169370738047259668
"""

#: Computed for phigen: Newton's method on the order conditions from many random starts, the free parameters by least
#: squares of the leading error, and all digits by Newton's method again. The tests verify the order conditions.
_GRADIENT_3 = """
    0.080025653215254155070797714594342583 0.272898300356015957781728984549341217
    0.419974346784745844929202285405657417 0.454203399287968084436542030901317567
"""
_GRADIENT_3_KICKS = """
    -0.003406099495913717018801394666180101 -0.007049909670768977182265247360647550
"""
_GRADIENT_4 = """
    0.093259099325376108512327966181102156 0.224779957633654066568316636870825550
    0.279163436207719245349242695035407673 0.275220042366345933431683363129174450
    0.255154928933809292276858677566980341
"""
_GRADIENT_4_KICKS = """
    -0.002474542816440333160851626080935415 -0.003054258970326065498497284066003496
"""
_GRADIENT_7_V = """
    0.037445175956936561215198324682753732 0.134086657352754333090397893058278790
    0.213909370658189498982706472126877611 0.262501760757563771300290878862208916
    0.208099686656618914155323953393402281 -0.084984063777196780669726748968031298
    0.040545766728255025646771249796966376 0.376791291333757352558075954095087184
"""
_GRADIENT_7_V_KICKS = """
    -0.000014148299650509159367273121933156 -0.002627014673759902644237038774438342
    -0.006462840389106924894265056377282354 0.008673189865584648289659973843479632
"""
_GRADIENT_7_T = """
    0.067171870432524439508245672326839856 0.165339984329115799308500918478668361
    0.288298263259635906231166969759493368 0.083862507029070582203820026920913298
    -0.069772846834726002704119925077717979 0.194663505868928913836204816701010163
    0.214302713142565656964707282991384755 0.112268005545769409302948475798816355
"""
_GRADIENT_7_T_KICKS = """
    -0.001266127365062552629142909160549295 0.002813468593456661895854428366652562
    -0.006858486504390513593278761896061748 -0.009660379495765944515671291883199312
"""
_GRADIENT_12 = """
    -0.121013141144751798512272408259447413 0.542930626764231525015124166197397055
    0.350315338573023222119412143685638773 0.000182148920227205243862223784211277
    -0.349781211098134810159613799162808010 -0.544328631256914194059454496238830879
    0.166531596224159786142338071624550342 0.168054042018586859852850956565466520
    0.268113940956459262784569302953244697 0.361537317619673104021556949525748891
    0.408657034592212926272972961202441520 -0.028375504065804500073939799833992864
    -0.445647116205937177294812544087239818
"""
_GRADIENT_12_KICKS = """
    0.084603933662083332781253603204183756 -0.033642279885512803364301107792783090
    -0.033627884265235257934334155219100161 0.060591012893263426410141971780827748
    -0.002322511461437407100114548269958906 -0.011134456622416085152708821793426773
    -0.015285412734827071021494844322140307
"""

#: All methods.
METHODS = (
    _method("blanes-moan-rkn", 4, "V", _SRKN6B, 3.76e-5),
    _method("blanes-moan-rkn", 6, "T", _SRKN14A, 2.03e-7),
    _method("force-gradient", 4, "V", _GRADIENT_3, 0.000129, _GRADIENT_3_KICKS),
    _method("force-gradient", 4, "T", _GRADIENT_4, 2.42e-05, _GRADIENT_4_KICKS),
    _method("force-gradient", 6, "V", _GRADIENT_7_V, 2.67e-06, _GRADIENT_7_V_KICKS),
    _method("force-gradient", 6, "T", _GRADIENT_7_T, 3.23e-06, _GRADIENT_7_T_KICKS),
    _method("force-gradient", 8, "V", _GRADIENT_12, 3.93e-06, _GRADIENT_12_KICKS),
)

#: The names of these methods.
NAMES = tuple(dict.fromkeys(m.name for m in METHODS))


def orders(name: str) -> list[int]:
    """The orders that a name offers."""
    return sorted({m.order for m in METHODS if m.name == name})
