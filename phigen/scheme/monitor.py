"""Monitored systems. Steps have equal size in a time τ with dt = g dτ and g > 0, and are Poisson maps.

A canonical pair (t, e) is added to the coordinates, and H is replaced by K = g(x)(H(x) + e). Where K = 0, that is, for
e = −H(x₀), the orbits of K are those of H. Along these orbits dt/dτ = ∂K/∂e = g. K does not depend on t, so e is
constant, and the solver treats it as a parameter with a value for each trajectory. Let the bi-realisation of the pair
be the midpoint rule. Then the step in x is that of the series S_τ(x; e) of K, and t₁ − t₀ = ∂S_τ/∂e at the solution y
of its implicit equation. One method computes t and x, so t is as accurate as x.

With forces, −H(x) is not constant and no step is a Poisson map, so K is not used. Instead, p = τg(∇H + ζ) and the
impulse τgf at y, together with t₁ − t₀ = τg(y), form a symmetric step of order 2 for (t, x). Here ζ is the covector
force and f the vector force.
"""

from __future__ import annotations

from collections.abc import Iterator

from phigen.errors import SpecError
from phigen.geometry.system import System
from phigen.scheme.generating import GeneratingFunction
from phigen.scheme.kernel import Kernel, Output
from phigen.spec.model import Spec
from phigen.symbolic.expression import Expression

#: Hint if H depends on the time, so that e is not constant: the user can make t and e coordinates of the system.
EXTENDED_SYSTEM_HINT = (
    "remove time:, and make t and e coordinates too, a canonical pair; then hamiltonian: g*(H + e), "
    "with e = -H at the start"
)


def elapsed_kernel(system: System, generating: GeneratingFunction) -> Kernel | None:
    """Return the kernel of the physical time of a monitored step: ∂S_τ/∂e at the solution y of its implicit equation.

    S_τ is the generating function, and e the energy level. Returns None without a monitor.
    """
    if generating.elapsed is None:
        return None
    (value,) = generating.coefficients.hoist([generating.elapsed])
    return Kernel(
        "elapsed",
        "the physical time of a step, from the solution y: the derivative of S_h with respect to e",
        {"coef": generating.coefficients.slots, "y": system.coordinates},
        (Output("elapsed", (value,)),),
    )


def rate_kernel(system: System, monitor: Expression) -> Kernel:
    """Return the kernel of dt/dτ = g at a state, where τ is the time of the monitor; ``monitor`` is g as an
    expression."""
    return Kernel(
        "monitor",
        "the rate dt/dtau, which has to be positive",
        {"params": system.parameter_names, "x": system.coordinates},
        (Output("rate", (monitor,)),),
    )


def monitor_facts(monitor: Expression | None, *, forced: bool) -> Iterator[str]:
    """Yield the line about the monitor in the header of generated files, if there is a monitor."""
    if monitor and forced:
        yield f"monitor: dt = g dtau with g = {monitor}; steps are equal in tau"
    elif monitor:
        rescaled = "steps are equal in tau, with the Hamiltonian K = g (H + e), e = -H(x0)"
        yield f"monitor: dt = g dtau with g = {monitor}; {rescaled}"


def monitor_of(spec: Spec) -> Expression | None:
    """Return the monitor g of a spec whose steps have a generating function, or None.

    Raises `SpecError` if the monitor is ``log``, if the system is a lattice, or if H depends on the time. Also raises
    `SpecError` if the system has forces and the spec states multiples of Casimirs as gauge.
    """
    if spec.monitor is None:
        return None
    obstacles = {
        "time: e = -H(x0) would not be constant": spec.time,
        "lattice: the fastest site would determine the steps of all": spec.lattice,
    }
    for obstacle, is_present in obstacles.items():
        if is_present:
            message = f"monitor: not together with {obstacle}"
            raise SpecError([spec.diagnostic(("monitor",), message, EXTENDED_SYSTEM_HINT if spec.time else "")])
    if spec.forces and not isinstance(spec.gauge, str):
        message = (
            "gauge: with a monitor and forces, no Casimirs are subtracted, since steps do not follow K = g (H + e)"
        )
        raise SpecError([spec.diagnostic(("gauge",), message, "gauge: none")])
    if isinstance(spec.monitor, str):
        hint = "scheme: splitting, or dt/dtau as an expression in the coordinates"
        raise SpecError([spec.diagnostic(("monitor",), "monitor: log needs H = A + B split in two", hint)])
    return spec.monitor
