"""Moments of a distribution of bonds that is taken to be Gaussian (Zahalak 1981).

Distances are in units of the bonds' reach, see ``bonds``. M0 is the share of sites with a bond, M1
the force and M2 twice the elastic energy, each but for a scale.
"""

from __future__ import annotations

from functools import lru_cache
from math import erf, exp, sqrt

NARROWEST = 1e-2  # standard deviation that is the least [h]
FEWEST = 1e-9  # bonds that are there at least, so that their mean is defined [-]


def widened(m0: float, m1: float, m2: float) -> tuple[float, float]:
    """M0 and M2, changed as little as a Gaussian needs: bonds, and a variance above 0."""
    m0 = max(m0, FEWEST)
    return m0, max(m2, m1 * m1 / m0 + NARROWEST * NARROWEST * m0)


def upper_moments(mean: float, deviation: float, above: float) -> tuple[float, float, float, float]:
    """Moments 0 to 3 of a normal distribution's part above a limit."""
    z = (above - mean) * (1.0 / deviation)
    density = deviation * exp(-0.5 * z * z) * 0.3989422804014327  # 1/sqrt(2 pi)
    zeroth = 0.5 - 0.5 * erf(z * 0.7071067811865476)
    first = mean * zeroth + density
    variance = deviation * deviation
    second = mean * first + variance * zeroth + above * density
    third = mean * second + 2.0 * variance * first + above * above * density
    return zeroth, first, second, third


def reactions(
    m0: float,
    m1: float,
    m2: float,
    share: float,
    attachment_rate: float,
    detachment_rate: float,
    pushing_detachment_rate: float,
    stretched_detachment_rate: float,
) -> tuple[float, float, float, float, float]:
    """Rates [1/s] of M0, M1 and M2 by forming and breaking, ``share`` times f (eq. 10).

    Returns:
        The three rates, then the share of bonds that is lost in a second, of M0 and of M2.
    """
    mean = m1 / m0
    variance = m2 / m0 - mean * mean
    deviation = sqrt(variance)
    a0, a1, a2, a3 = upper_moments(mean, deviation, 0.0)
    b0, b1, b2, b3 = upper_moments(mean, deviation, 1.0)
    f, g, g2, g3 = (
        share * attachment_rate, detachment_rate, pushing_detachment_rate,
        stretched_detachment_rate,
    )  # fmt: skip
    lost0 = f * (a1 - b1) + g * a1 + g2 * (1.0 - a0) + g3 * (b1 - b0)
    lost1 = f * (a2 - b2) + g * a2 + g2 * (mean - a1) + g3 * (b2 - b1)
    second = mean * mean + variance
    lost2 = f * (a3 - b3) + g * a3 + g2 * (second - a2) + g3 * (b3 - b2)
    return (
        f * 0.5 - m0 * lost0,
        f * (1.0 / 3.0) - m0 * lost1,
        f * 0.25 - m0 * lost2,
        lost0,
        lost2 / second,
    )


@lru_cache(maxsize=256)
def steady_moments(
    share: float,
    attachment_rate: float,
    detachment_rate: float,
    pushing_detachment_rate: float,
    stretched_detachment_rate: float,
    velocity: float = 0.0,
) -> tuple[float, float, float]:
    """M0, M1 and M2 at ``share`` times f and a shortening velocity [h/s], in the end."""
    from scipy.integrate import solve_ivp
    from scipy.optimize import root

    rates = (
        attachment_rate, detachment_rate, pushing_detachment_rate, stretched_detachment_rate,
    )  # fmt: skip

    def change(_time: float, moments: list[float]) -> list[float]:
        m0, m1, m2 = moments
        m0, m2 = widened(m0, m1, m2)
        d0, d1, d2, _, _ = reactions(m0, m1, m2, share, *rates)
        return [d0, d1 - velocity * m0, d2 - 2.0 * velocity * m1]

    # the true distribution at rest, from which the Gaussian one goes its way
    bonds = share * attachment_rate / (share * attachment_rate + detachment_rate)
    start = [bonds, bonds / 2, bonds / 3]
    long = 40.0 / (share * attachment_rate + detachment_rate)
    near = solve_ivp(change, (0.0, long), start, method="LSODA", rtol=1e-9, atol=1e-12).y[:, -1]
    found = root(lambda moments: change(0.0, moments), near, tol=1e-14)
    m0, m1, m2 = (found.x if found.success else near).tolist()
    return m0, m1, m2


@lru_cache(maxsize=64)
def closure(
    attachment_rate: float,
    detachment_rate: float,
    pushing_detachment_rate: float,
    stretched_detachment_rate: float,
) -> tuple[float, float, float, float]:
    """M1 at rest at full activation, and three coefficients of ``attachment_factor``.

    With them the isometric force at a lower activation is right to 0.1 % of F_max.
    """
    import numpy as np
    from scipy.optimize import brentq

    # rates count by their ratios alone
    unit = attachment_rate + detachment_rate
    rates = tuple(
        rate / unit
        for rate in (attachment_rate, detachment_rate, pushing_detachment_rate,
                     stretched_detachment_rate)
    )  # fmt: skip
    full = steady_moments(1.0, *rates)[1]
    shares = np.array([0.02, 0.1, 0.3, 0.5, 0.7, 0.85, 0.95])

    def off(factor: float, share: float) -> float:
        return steady_moments(factor, *rates)[1] / full - share

    factors = np.array([brentq(off, 1e-4, 1.0, args=(x,), xtol=1e-9) for x in shares.tolist()])
    bends = (shares / factors - shares) / (1.0 - shares)
    square, linear, constant = np.polyfit(shares, bends, 2).tolist()
    return full, constant, linear, square
