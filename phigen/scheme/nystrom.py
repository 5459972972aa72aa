"""Splitting methods for H = T + V with {V, {V, {V, T}}} = 0: methods of Runge–Kutta–Nyström type, also with modified
potentials.

A step is Φ_h = φ_{t_n h} ∘ … ∘ φ_{t_1 h} with t_i = t_{n+1−i}, where the φ are flows of T and of V by turns. Because of
the condition {V, {V, {V, T}}} = 0, the times t_i need to satisfy fewer order conditions than for arbitrary T and V. If
V + κ{V, {V, T}} has an elementary flow too, this flow may take the place of each flow of V (a kick), with κ_i = m_i h².
The m_i are further unknowns of the order conditions (`phigen.splitting.kicks`).
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from phigen.scheme.alternation import Schedule


@dataclass(frozen=True)
class Nystrom:
    """A splitting method of Nyström type: the times t_i of its flows in order, and the ``multiples`` m_i of its
    kicks.

    ``kicks_first`` says whether a step begins with a flow of V. Methods are compared by ``error``, the Euclidean norm
    of their leading errors. These errors have components in a Lie algebra; its basis is defined in
    `tests/splitting/nystrom_algebra.py`.
    """

    name: str
    order: int
    kicks_first: bool
    times: tuple[Fraction, ...]
    multiples: tuple[Fraction, ...]
    error: float

    @property
    def stages(self) -> int:
        """The number of stages. A stage is a flow of the second part, followed by a flow of the first part."""
        return len(self.times) // 2

    @property
    def kicks(self) -> int:
        """The number of flows of V in a step."""
        return self.stages + self.kicks_first

    def schedule(self) -> Schedule:
        """Return the flows of a step; part 0 is the part with which a step begins."""
        multiples = []
        if self.multiples:
            kicks = iter(self.multiples)
            multiples = [next(kicks) if i % 2 != self.kicks_first else Fraction(0) for i in range(len(self.times))]
        return Schedule(
            tuple(float(t) for t in self.times), self.stages, ((1, 0), (0, 1)), tuple(float(m) for m in multiples)
        )


def _method(name: str, order: int, first: str, times: str, error: float, multiples: str = "") -> Nystrom:
    """Return a symmetric method for H = T + V, described by the first half of its step.

    The half includes the middle flow. ``first`` is T or V, the part with which the step begins. ``times`` lists the
    durations of the flows. If the method uses V + m h² {V, {V, T}} in place of V, then ``multiples`` lists the number m
    for each flow of V. ``error`` is the norm of the leading error of the method.
    """
    first_times = [Fraction(v) for v in times.split()]
    kicks = [Fraction(v) for v in multiples.split()]
    middle_kicks = (len(first_times) - 1) % 2 != (
        first == "V"
    )  # whether the middle flow, which is not repeated, is a kick
    mirrored = kicks[-2::-1] if middle_kicks else kicks[::-1]
    return Nystrom(name, order, first == "V", (*first_times, *first_times[-2::-1]), (*kicks, *mirrored), error)


#: Times t_i in the first half of a step, for the methods SRKN_6^b and SRKN_14^a. The methods are from S. Blanes, P. C.
#: Moan, Practical symplectic partitioned Runge–Kutta and Runge–Kutta–Nyström methods, J. Comput. Appl. Math. 142
#: (2002). The paper gives 15 digits. The further digits were computed by Newton's method.
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

#: Coefficients of methods that were found for phigen: the times of the flows, and the multiples of modified potentials.
#: Newton's method solved the order conditions from many random starts. Free parameters were determined by least squares
#: of the leading error, then by a random search for the least energy errors of four systems (Kowalevski top,
#: Hénon–Heiles, Kepler, two coupled pendulums). All digits are from a last Newton iteration. The tests verify the order
#: conditions.
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
    0.040031496593108290179180061365432125 0.138340277550383180385701990926915334
    0.214659451763270306526573691784460662 0.246593321481878151062119757392906376
    0.240622175561116907303777130185035481 -0.175575815022815926369894658115003035
    0.004686876082504495990469116665071732 0.581284431981109189844145819590362650
"""
_GRADIENT_7_V_KICKS = """
    -0.000372414491192510521782803794284883 -0.002249692598031045501458266278162529
    -0.003151770757015284730268638301185501 0.008003491839231681016579114926369419
"""
_GRADIENT_7_T = """
    0.059198749952413402620534763042896327 0.146837012270930984849713438112871326
    0.286888588007062121082872870047834581 0.035170885870967820952367003493803509
    -0.082309014066838221641093511149407434 0.220467296857067002572506555618570626
    0.236221676107362697937685878058676527 0.195049610002068383250826005549509078
"""
_GRADIENT_7_T_KICKS = """
    -0.000823869836401726185682987382000110 0.005282588497804155052304249696409170
    -0.004902689856144213782401403712113480 -0.004135021104687826576049383241332122
"""
_GRADIENT_12 = """
    0.140216052068515424240803867003284973 0.418959846950142968924127392655951422
    0.183047900136519827358827643694804510 -0.001380274199166939612026754860092485
    -0.185320903098955883274241132284123454 -0.393070234549448203204066907569222710
    -0.220587038163855668478512316207896391 0.061346964942588874622822096777045702
    0.291039453189741328880429788293030508 0.239805654078792531318922114479143681
    0.217958835387186656738639838131259443 0.174338042777090767950222058517174391
    0.147291400961696629068104622739280822
"""
_GRADIENT_12_KICKS = """
    0.001365056533662032651957842794580393 -0.000425330391716447407813357953230012
    -0.000536933765501642575489667629942383 0.002731193013760172163121353779298333
    -0.002664699986737016959450972160197169 -0.000361822719267102689467630060098099
    -0.004559940900604864930618705768982565
"""
_NYSTROM_18 = """
    0.050271536815688287596416735448297241 0.162794700263720053794824736143340671
    0.271362415911724442725604329455893555 0.422005111228910732992757145796307975
    0.257585187925646116789584295874205288 -0.010152711292605314570487663578890604
    -0.245198076489297852054780043914259772 -0.240211396635187013508094797600595079
    0.219982497352618386145368170155565276 -0.061581957938655471357009623337774260
    -0.150763725721451814272107781469493810 0.230243383433643024432483880718547868
    0.365224156894058818581388683554637468 0.479584241927225137613418870799661479
    -0.748636687268770376853769744378025311 -0.000322627169535353286825558154031009
    0.747498164197988250262860958622716894 -0.482358743817515796111066990786567040
    -0.534650939236408517841131206699073656
"""

#: All splitting methods of Nyström type; `_method` explains the arguments.
METHODS = (
    _method("blanes-moan-rkn", 4, "V", _SRKN6B, 3.76e-5),
    _method("blanes-moan-rkn", 6, "T", _SRKN14A, 2.03e-7),
    _method("force-gradient", 4, "V", _GRADIENT_3, 0.000129, _GRADIENT_3_KICKS),
    _method("force-gradient", 4, "T", _GRADIENT_4, 2.42e-05, _GRADIENT_4_KICKS),
    _method("force-gradient", 6, "V", _GRADIENT_7_V, 1.89e-06, _GRADIENT_7_V_KICKS),
    _method("force-gradient", 6, "T", _GRADIENT_7_T, 2.33e-06, _GRADIENT_7_T_KICKS),
    _method("force-gradient", 8, "V", _GRADIENT_12, 1.08e-06, _GRADIENT_12_KICKS),
    _method("nystrom", 8, "V", _NYSTROM_18, 7.83e-06),
)

#: The names of the Nyström methods, each once.
NAMES = tuple(dict.fromkeys(m.name for m in METHODS))


def orders(name: str) -> list[int]:
    """Return the orders for which there is a Nyström method with this name."""
    return sorted({m.order for m in METHODS if m.name == name})
