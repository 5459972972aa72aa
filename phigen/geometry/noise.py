"""Noise along Hamiltonian vector fields: dx = … + Σ σ_k π∇g_k ∘ dW_k, in the sense of Stratonovich.

Such noise conserves all Casimirs and the volume of the symplectic leaves. Without forces, the flow for each path of the
noise is a Poisson map. The amplitudes σ_k may depend on parameters and the time only.

With forces πζ, the density exp(−H/T) on every leaf is stationary if πζ = −(1/2T) Σ σ_k² (X_k H) X_k with X_k = π∇g_k.
This is the relation of fluctuation and dissipation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from phigen.spec.model import SpecNoise
from phigen.symbolic.expression import Expression, gradient


@dataclass(frozen=True)
class Source:
    """A source of noise σ π∇g ∘ dW, with the Hamiltonian g and the amplitude σ."""

    name: str
    hamiltonian: Expression
    amplitude: Expression

    def impulse(self, coordinates: Sequence[str]) -> tuple[Expression, ...]:
        """Return the covector σ∇g for the Hamiltonian g and the amplitude σ of the source. A step adds σ∇g, times the
        increment ΔW of the noise, to its covector p.
        """
        return tuple(self.amplitude * g for g in gradient(self.hamiltonian, coordinates))


def sources_of(spec_sources: Mapping[str, SpecNoise]) -> tuple[Source, ...]:
    """Return the sources of noise of a spec, in the order of the spec."""
    return tuple(Source(name, s.hamiltonian, s.amplitude) for name, s in spec_sources.items())
