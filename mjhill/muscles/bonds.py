"""Bonds between filaments (Huxley 1957): what the models ``huxley`` and ``dm`` share.

Of all sites where a bond can be, n(x) is the share that has one, with x the distance of the site
from where the bond pulls with no force, in units of ``bond_reach``. Bonds form at the rate
f (1 - n) and break at the rate g n; shortening takes them towards negative x, where they push.
Eqs. 8-9 of Winters & Stark (1987).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import exp, sqrt

from mjhill.muscles.parts import LengthDependent, SeriesElement
from mjhill.quantity import LENGTH, quantity


@dataclass(frozen=True, kw_only=True)
class Bonds(SeriesElement, LengthDependent):
    """A muscle of bonds between filaments, with the series element of ``Hill``."""

    bond_reach: float = quantity(
        "h", LENGTH, "largest x at which a bond forms, as a length of the actuator",
        (1e-9, 10), low_allowed=True, array="biasprm",
    )  # fmt: skip
    attachment_rate: float = quantity(
        "f1", "1/s", "rate at which bonds form at x = 1; f = f1 x between 0 and 1",
        (1e-3, 1e6), low_allowed=True, array="biasprm",
    )  # fmt: skip
    detachment_rate: float = quantity(
        "g1", "1/s", "rate at which bonds break at x = 1; g = g1 x above 0",
        (1e-3, 1e6), low_allowed=True, array="biasprm",
    )  # fmt: skip
    pushing_detachment_rate: float = quantity(
        "g2", "1/s", "rate at which bonds break below 0, where they push",
        (1e-3, 1e6), low_allowed=True, array="biasprm",
    )  # fmt: skip
    stretched_detachment_rate: float = quantity(
        "g3", "1/s", "what bonds stretched beyond 1 break faster by: g3 (x - 1)",
        (0, 1e6), low_allowed=True, array="biasprm",
    )  # fmt: skip


REACH = 15.6e-9  # h [m] (Huxley 1957)
SARCOMERE = 2.7e-6  # optimal length in humans [m] (Walker & Schrodt 1974)
WIDTH = sqrt(0.45)  # of a fibre's force-length relation [fibre lengths] (Thelen 2003)
RATES = (43.3, 10.0, 209.0)  # f1, g1, g2 [1/s] of frog muscle at 0 °C (Huxley 1957)
# g3, as a share of f1, of rat soleus (Lemaire et al. 2016, J. Exp. Biol. 219:977-987); its form is
# that of Zahalak 1986. In Huxley's own model g3 is 0.
STRETCHED_RATE = 1400.0 / 800.0 * RATES[0]


@dataclass(frozen=True)
class Rates:
    """Rates of bonds [1/s] and their reach, as a length of the actuator."""

    bond_reach: float
    attachment_rate: float
    detachment_rate: float
    pushing_detachment_rate: float
    stretched_detachment_rate: float


def rates_for(width_short: float, width_long: float, max_velocity: float) -> Rates:
    """Rates and reach of the bonds of a muscle that ``Hill`` describes.

    The rates have Huxley's ratios and give the muscle's unloaded velocity. Its fibre length comes
    from the widths of its force-length relation (estimate), and the reach from that.
    """
    fibre = 0.5 * (width_short + width_long) / WIDTH
    reach = fibre * REACH / (0.5 * SARCOMERE)
    f1, g1, g2 = RATES
    faster = max_velocity / reach / unloaded_velocity(f1, g1, g2)
    return Rates(reach, f1 * faster, g1 * faster, g2 * faster, STRETCHED_RATE * faster)


def steady_force(
    velocity: float,
    attachment_rate: float,
    detachment_rate: float,
    pushing_detachment_rate: float,
) -> float:
    """Force in steady shortening [isometric force] at a velocity >= 0 [h/s] (Huxley 1957)."""
    if velocity <= 0.0:
        return 1.0
    both = attachment_rate + detachment_rate
    z = 2.0 * velocity / both
    pushed = 0.5 * (both / pushing_detachment_rate) ** 2 * z
    return 1.0 - z * (1.0 - exp(-1.0 / z)) * (1.0 + pushed)


@lru_cache(maxsize=64)
def unloaded_velocity(
    attachment_rate: float, detachment_rate: float, pushing_detachment_rate: float
) -> float:
    """Velocity [h/s] at which ``steady_force`` is 0."""
    from scipy.optimize import brentq

    rates = (attachment_rate, detachment_rate, pushing_detachment_rate)
    high = sum(rates)
    while steady_force(high, *rates) > 0.0:
        high *= 2.0
    return float(brentq(steady_force, 0.0, high, args=rates, xtol=1e-12 * high))


def attachment(x: float, attachment_rate: float) -> float:
    """Rate f [1/s] at which bonds form at x [h], at full activation."""
    if 0.0 < x <= 1.0:
        return attachment_rate * x
    return 0.0


def detachment(
    x: float,
    detachment_rate: float,
    pushing_detachment_rate: float,
    stretched_detachment_rate: float,
) -> float:
    """Rate g [1/s] at which bonds break at x [h]."""
    if x < 0.0:
        return pushing_detachment_rate
    return detachment_rate * x + stretched_detachment_rate * max(x - 1.0, 0.0)


def attachment_share(share: float, attachment_rate: float, detachment_rate: float) -> float:
    """Factor on f that gives a share of the isometric force [F_max] at full activation.

    n is f1/(f1 + g1) between 0 and 1 at rest, so a factor c on f gives the force
    c (f1 + g1)/(c f1 + g1) of that at full activation. This is its inverse; ``share`` is that of
    ``active_share``, so the isometric force is that of ``Hill``.
    """
    return share * detachment_rate / (detachment_rate + (1.0 - share) * attachment_rate)
