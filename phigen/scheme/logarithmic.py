"""The monitor ``log`` of a splitting into two parts, H = A + B.

H is replaced by K = log(A + e) − log(−B), and steps have equal size in the time τ of K. A is constant along its own
flow, so the flow of log(A + e) over τ is the flow of A over the time τ/(A + e). In the same way the flow of −log(−B) is
the flow of B over τ/(−B). Where K = 0, that is, where A + e = −B, the orbits are those of H. The energy level e =
−H(x₀) is constant on a trajectory. The physical time advances by ∂K/∂e τ = τ/(A + e) in the flow of A, and not at all
in the flow of B. Steps require A + e > 0 and −B > 0.

S. Mikkola, K. Tanikawa, Celestial Mechanics and Dynamical Astronomy 74 (1999); M. Preto, S. Tremaine, Astron. J. 118
(1999).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from phigen.errors import SpecError
from phigen.geometry.positivity import NOT_NEGATIVE, POSITIVE, sign_of
from phigen.geometry.system import System
from phigen.scheme.composition import find
from phigen.scheme.kernel import Kernel
from phigen.scheme.monitor import EXTENDED_SYSTEM_HINT, rate_kernel
from phigen.scheme.program import Monitor
from phigen.spec.model import Spec
from phigen.splitting.flow import Flow
from phigen.splitting.ring import TIME
from phigen.symbolic.expression import ZERO, Expression, power, substitute, symbol
from phigen.symbolic.numeric import DomainError, evaluate
from phigen.symbolic.symbols import LEVEL


@dataclass(frozen=True)
class Logarithmic:
    """The monitor ``log`` of a splitting H = A + B.

    Steps have the Hamiltonian K = log(A + e) − log(−B) in place of H, where e is the energy level. ``negative`` is B.
    """

    negative: Expression

    def outputs(self, flow: Flow) -> tuple[Expression, ...]:
        """Return the expressions that the kernel of ``flow`` computes. ``flow`` is the flow of A or of B.

        The expressions are the increments of the coordinates, the physical time of the flow, and a square root. For A
        this is the square root of A + e, for B that of −B. The square root is NaN where the step is not defined, so
        that the step fails.
        """
        argument, time = self._argument(flow), self.time(flow)
        increments = substitute(flow.increment, {TIME: time})
        return (*increments, ZERO if self._is_negative(flow) else time, power(argument, Fraction(1, 2)))

    def time(self, flow: Flow) -> Expression:
        """Return how long the flow of A or of B runs in a step over τ: τ/(A + e) for A, τ/(−B) for B."""
        return symbol(TIME) * power(self._argument(flow), -1)

    def part(self, flow: Flow) -> str:
        """Return the part of K = log(A + e) − log(−B) that belongs to the flow of A or of B, as text that ends with A
        or B.
        """
        return "-log(-B), B" if self._is_negative(flow) else "log(A + e), A"

    def _argument(self, flow: Flow) -> Expression:
        return -flow.hamiltonian if self._is_negative(flow) else flow.hamiltonian + symbol(LEVEL)

    def monitor(self, system: System) -> Monitor:
        """Return the record of the monitor for the program. The rate is dt/dτ = 1/(−B), where H = A + B and B < 0."""
        return Monitor(rate_kernel(system, power(-self.negative, -1)), None)

    def _is_negative(self, flow: Flow) -> bool:
        return flow.hamiltonian is self.negative

    @property
    def fact(self) -> str:
        """The line about the monitor in the header of generated files."""
        return fact_of(str(self.negative))


def fact_of(negative: str) -> str:
    """Return the line about the monitor ``log`` in the header of generated files; ``negative`` is the negative part of
    H as text."""
    return (
        "monitor: log; steps are equal in the rescaled time tau, with the Hamiltonian K = log(A + e) - log(-B), where "
        f"H = A + B, e = -H(x0), B = {negative}"
    )


def logarithmic_of(spec: Spec, system: System, flows: Sequence[Flow]) -> Logarithmic | None:
    """Return the monitor ``log`` of a splitting, or None if the spec has no monitor.

    Raises `SpecError` for options that exclude the monitor, if H is not the sum of two parts, or if no part is known to
    be negative where runs start.
    """
    if spec.monitor is None:
        return None
    message = ""
    if not isinstance(spec.monitor, str):
        message = (
            "monitor: for an expression g, K = g(H + e) does not split; `scheme: splitting` has only `monitor: log`"
        )
    elif spec.time:
        message = "monitor: not together with time: e = -H(x0) would not be constant"
    elif system.forces:
        message = "monitor: log is not offered with forces: e = -H(x0) would not be constant"
    elif len(flows) != 2:
        message = f"monitor: log needs H = A + B of two parts with elementary flows; this H has {len(flows)}"
    elif not isinstance(spec.gauge, str):
        message = "monitor: log is not offered with a gauge, which would change the parts of H"
    if message:
        hint = EXTENDED_SYSTEM_HINT if spec.time else "scheme: series allows an expression for g"
        raise SpecError([spec.diagnostic(("monitor",), message, hint)])
    negative_flow = next((f for f in flows if _below_zero(spec, system, f.hamiltonian)), None)
    if negative_flow is None:
        parts = ", ".join(str(f.hamiltonian) for f in flows)
        message = f"monitor: log needs a part that is negative, at least where runs start; the parts are {parts}"
        hint = (
            "positive: true declares the sign of a parameter; in hamiltonian, a constant can be subtracted from a part"
        )
        raise SpecError([spec.diagnostic(("monitor",), message, hint)])
    return Logarithmic(negative_flow.hamiltonian)


def composition_of(requested: str, order: int) -> str:
    """Return the name of the composition of a splitting with the monitor ``log``.

    If the spec asks for ``auto``, the result is a composition of Strang's splitting, else the ``requested`` one. For a
    Kepler motion, Strang's splitting with this monitor stays on the exact orbit for every step size. Other methods need
    not stay on this orbit.
    """
    composition = find("auto", order + order % 2)
    return composition.name if requested == "auto" and composition else requested


def _below_zero(spec: Spec, system: System, e: Expression) -> bool:
    """Whether the expression ``e``, a part of H, counts as negative.

    There are three cases: the form of the expression proves e < 0; the form proves e ≤ 0, and the spec has no runs; or
    the values of e at the starts of all runs are negative.
    """
    sign = sign_of(-e, system.positive)
    if sign == POSITIVE or (sign == NOT_NEGATIVE and not spec.runs):
        return True
    values = []
    for run in spec.runs.values():
        initial = dict(zip(spec.coordinates, map(float, run.initial), strict=True))
        try:
            values += evaluate([e], {**spec.parameters_of(run), **initial})
        except DomainError:
            return False
    return bool(values) and all(v < 0 for v in values)


def trimmed(kernel: Kernel, count: int) -> Kernel:
    """Return the kernel of a flow with only its first ``count`` outputs, which are the increments of the
    coordinates."""
    (output,) = kernel.outputs
    return replace(kernel, outputs=(replace(output, values=output.values[:count]),))
