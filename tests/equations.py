"""Equations of motion written by hand, and a solver for them in many digits. This module imports nothing of phigen."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mpmath

Field = Callable[[Sequence[Any]], list[Any]]


def charged_particle(s: Sequence[Any]) -> list[Any]:
    """Return the right-hand side for a charged particle: the Lorentz force v × B + E in B = (0, 0, 1 + x² + y²)."""
    x, y, z, u, v, w = s
    B = 1 + x * x + y * y
    return [u, v, w, v * B - x / 5, -u * B - y / 5, -2 * z / 5]


def guiding_centre(s: Sequence[Any]) -> list[Any]:
    """Return the right-hand side of guiding-centre motion: x' = (u B* + b × ∇(μ|B| + φ))/(b·B*), u' = -B*·∇(μ|B| +
    φ)/(b·B*), where B* = B + u curl b and B = (-κy, κx, 1) with κ = ½.
    """
    x, y, z, u = s
    kappa, mu, k = mpmath.mpf(1) / 2, mpmath.mpf("0.3"), mpmath.mpf("0.2")
    B = mpmath.sqrt(1 + kappa**2 * (x * x + y * y))
    b = [-kappa * y / B, kappa * x / B, 1 / B]
    curl = [-(kappa**2) * y / B**3, kappa**2 * x / B**3, (2 * kappa + kappa**3 * (x * x + y * y)) / B**3]
    star = [B * bi + u * c for bi, c in zip(b, curl, strict=True)]
    D = sum(bi * si for bi, si in zip(b, star, strict=True))
    g = [mu * kappa**2 * x / B, mu * kappa**2 * y / B, k * z]
    drift = [b[1] * g[2] - b[2] * g[1], b[2] * g[0] - b[0] * g[2], b[0] * g[1] - b[1] * g[0]]
    force = -sum(si * gi for si, gi in zip(star, g, strict=True)) / D
    return [*((u * si + di) / D for si, di in zip(star, drift, strict=True)), force]


def maxwell_bloch(s: Sequence[Any]) -> list[Any]:
    """Return the right-hand side of the Maxwell–Bloch equations x' = y, y' = x z, z' = -x y."""
    x, y, z = s
    return [y, x * z, -x * y]


def sir(s: Sequence[Any]) -> list[Any]:
    """Return the right-hand side of the SIR model of Kermack and McKendrick, with the rates β = ½ and γ = 1/5."""
    infections, recoveries = s[0] * s[1] / 2, s[1] * mpmath.mpf("0.2")
    return [-infections, infections - recoveries, recoveries]


def ablowitz_ladik3(s: Sequence[Any]) -> list[Any]:
    """Return the right-hand side of the Ablowitz–Ladik equations i qn' = (1 - |qn|²) (q(n+1) + q(n-1)) - 2 qn on a ring
    of three sites, for the real and imaginary parts of qn.
    """
    q = [mpmath.mpc(s[0], s[1]), mpmath.mpc(s[2], s[3]), mpmath.mpc(s[4], s[5])]
    result = []
    for n in range(3):
        square = s[2 * n] ** 2 + s[2 * n + 1] ** 2
        slope = -1j * ((1 - square) * (q[(n + 1) % 3] + q[n - 1]) - 2 * q[n])
        result += [slope.real, slope.imag]
    return result


def nambu_pendulum(s: Sequence[Any]) -> list[Any]:
    """Return the right-hand side of theta' = p, p' = -sin(theta), V' = p sin(theta)."""
    theta, p, _ = s
    return [p, -mpmath.sin(theta), p * mpmath.sin(theta)]


def engel_geodesics(s: Sequence[Any]) -> list[Any]:
    """Return the right-hand side of h1' = h2 h3, h2' = -h1 h3, h3' = -h1 h4, h4' = 0."""
    h1, h2, h3, h4 = s
    return [h2 * h3, -h1 * h3, -h1 * h4, 0 * h4]


def sklyanin_gyrostat(s: Sequence[Any]) -> list[Any]:
    """Return the right-hand side of the gyrostat with Sklyanin's brackets {Sa, Sb} = 2 S0 Sc, {S0, Sa} = 2 (Jb - Jc) Sb
    Sc for cyclic a, b, c, with J = (1, 3/2, 5/2).
    """
    S0, S1, S2, S3 = s
    J12, J23, J31 = mpmath.mpf(-1) / 2, mpmath.mpf(-1), mpmath.mpf(3) / 2
    g1, g2, g3 = S1 + mpmath.mpf("0.1"), S2 / 2 + mpmath.mpf("0.2"), S3 / 3
    return [
        2 * (J23 * S2 * S3 * g1 + J31 * S3 * S1 * g2 + J12 * S1 * S2 * g3),
        2 * S0 * (S3 * g2 - S2 * g3),
        2 * S0 * (S1 * g3 - S3 * g1),
        2 * S0 * (S2 * g1 - S1 * g2),
    ]


def toda3(s: Sequence[Any]) -> list[Any]:
    """Return the right-hand side of the Toda equations ai' = ai (b(i+1) - bi), bi' = 2 (ai² - a(i-1)²)."""
    a1, a2, b1, b2, b3 = s
    return [a1 * (b2 - b1), a2 * (b3 - b2), 2 * a1 * a1, 2 * (a2 * a2 - a1 * a1), -2 * a2 * a2]


#: Right-hand sides of equations of motion, by the names of systems of the corpus.
FIELDS: Mapping[str, Field] = {
    "ablowitz_ladik3": ablowitz_ladik3,
    "charged_particle": charged_particle,
    "engel_geodesics": engel_geodesics,
    "guiding_centre": guiding_centre,
    "maxwell_bloch": maxwell_bloch,
    "nambu_pendulum": nambu_pendulum,
    "sir_epidemic": sir,
    "sir_final_size": sir,
    "sklyanin_gyrostat": sklyanin_gyrostat,
    "toda3": toda3,
    "toda3_quadratic": toda3,
}


def extrapolated(field: Field, x: Sequence[Any], time: Any, pieces: int, rows: int) -> list[Any]:
    """Return the state at ``time`` by the explicit midpoint rule with extrapolation in h² (Gragg, Bulirsch, Stoer). Its
    order is 2·``rows``.

    The time is divided into ``pieces`` equal intervals. In each interval the results with 2, 4, … 2·``rows`` substeps
    are extrapolated. The precision is the current one of mpmath.
    """
    big = mpmath.mpf(time) / pieces
    state = [mpmath.mpf(v) for v in x]
    for _ in range(pieces):
        table: list[list[Any]] = []
        slope = field(state)
        for row in range(rows):
            count = 2 * (row + 1)
            h = big / count
            before, now = state, [s + h * f for s, f in zip(state, slope, strict=True)]
            for _ in range(count - 1):
                before, now = now, [b + 2 * h * f for b, f in zip(before, field(now), strict=True)]
            new = [now]
            for k in range(row):
                ratio = (mpmath.mpf(count) / (2 * (row - k))) ** 2 - 1
                new.append([a + (a - b) / ratio for a, b in zip(new[k], table[k], strict=True)])
            table = new
        state = table[-1]
    return state
