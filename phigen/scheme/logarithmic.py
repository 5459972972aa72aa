"""The explicit monitor of a splitting in two parts, H = A + B: K = log(A + e) − log(−B).

A is constant along its own flow, so the flow of log(A + e) is that of A over the time τ/(A + e). Likewise the flow of
−log(−B) is that of B over τ/(−B). The orbits are those of H where K = 0, that is, where A + e = −B; e = −H(x₀) is held
fixed. The flow of A takes the physical time ∂K/∂e τ = τ/(A + e), that of B takes none. A + e > 0 and −B > 0 are
required: S. Mikkola, K. Tanikawa, Celestial Mechanics and Dynamical Astronomy 74 (1999); M. Preto, S. Tremaine, Astron.
J. 118 (1999).
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
    """The monitor of a splitting. ``negative`` is B, the Hamiltonian of one of the flows."""

    negative: Expression

    def outputs(self, flow: Flow) -> tuple[Expression, ...]:
        """Return the outputs of the kernel of a flow of K.

        They are the increments, the physical time of the flow, and the square root of A + e or −B, which is NaN outside
        the domain.
        """
        argument, time = self._argument(flow), self.time(flow)
        increments = substitute(flow.increment, {TIME: time})
        return (*increments, ZERO if self._is_negative(flow) else time, power(argument, Fraction(1, 2)))

    def time(self, flow: Flow) -> Expression:
        """Return the time over which the flow of a part of H is the flow of that part of K over τ."""
        return symbol(TIME) * power(self._argument(flow), -1)

    def _argument(self, flow: Flow) -> Expression:
        return -flow.hamiltonian if self._is_negative(flow) else flow.hamiltonian + symbol(LEVEL)

    def monitor(self, system: System) -> Monitor:
        """Return the record of the monitor, with dt/dτ = 1/(−B)."""
        return Monitor(rate_kernel(system, power(-self.negative, -1)), None)

    def _is_negative(self, flow: Flow) -> bool:
        return flow.hamiltonian is self.negative

    @property
    def fact(self) -> str:
        """The line about the monitor in the header of generated files."""
        return fact_of(str(self.negative))


def fact_of(negative: str) -> str:
    """Return the header line of a monitor with this B."""
    return f"monitor: log, steps are equal in tau; K = log(A + e) - log(-B) with B = {negative}"


def logarithmic_of(spec: Spec, system: System, flows: Sequence[Flow]) -> Logarithmic | None:
    """Return the monitor of a splitting, or None if the spec has none.

    Raises `SpecError` unless H is split into two parts A and B as the monitor requires.
    """
    if spec.monitor is None:
        return None
    message = ""
    if not isinstance(spec.monitor, str):
        message = "monitor: an expression makes K = g(H + e), which does not split; scheme: splitting offers log"
    elif spec.time:
        message = "monitor: not together with time: e = -H(x0) would not be constant"
    elif system.forces:
        message = "monitor: log is not offered with forces: e = -H(x0) would not be constant"
    elif len(flows) != 2:
        message = f"monitor: log needs H = A + B of two parts with elementary flows; here there are {len(flows)}"
    elif not isinstance(spec.gauge, str):
        message = "monitor: log is not offered with a gauge: the parts of H would not be those of the motion"
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
    """Return the composition of a splitting with this monitor: one of Strang's splitting, unless the spec names
    another.

    Steps of Strang's splitting of K, of any size, stay on the orbit of a Kepler motion. Steps of other methods need
    not.
    """
    composition = find("auto", order + order % 2)
    return composition.name if requested == "auto" and composition else requested


def _below_zero(spec: Spec, system: System, e: Expression) -> bool:
    """Whether an expression is negative, by its form or at the start of all runs.

    Without runs, 0 counts as negative.
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
    """Return the kernel of a flow with its first ``count`` outputs only, the increments of the coordinates."""
    (output,) = kernel.outputs
    return replace(kernel, outputs=(replace(output, values=output.values[:count]),))
