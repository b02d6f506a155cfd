"""The numerical scheme of ``dm``: moments of bonds in series with an elastic element.

Pure scalar functions, under the same rules as ``elements``.
"""

from __future__ import annotations

from math import sqrt

from mjhill.elements import series_force, series_stretch_at
from mjhill.muscles.moments import reactions, widened

TRIALS = 30  # steps of Newton's method at most
SOLVED = 1e-12  # of F_max
TOLERANCE = 1e-3  # error of a displacement that is taken, weighed as in ``displace``
SHORTEST, PATIENCE = 1.0 / 256, 400  # part of a step, and parts tried


def length_rate_of_element(
    stretch: float,
    length_rate: float,
    first: float,
    m0: float,
    bond_reach: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
    isometric_moment: float,
) -> float:
    """Rate of s [length/s] at which bonds and series element go on carrying the same force.

    ``first`` is the rate of M1 by forming and breaking [1/s].
    """
    _, slope = series_force(stretch, series_stretch, series_shape, series_limit)
    series = isometric_moment * slope
    bonds = m0 / bond_reach
    return (series * length_rate - first) / (series + bonds)


def carried_force(
    left: float,
    slope: float,
    stretch: float,
    start: float,
    bond_reach: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
    isometric_moment: float,
) -> float:
    """Force [F_max] at which bonds and series element meet, never below 0.

    Bonds carry ``left - slope w`` after a shortening w [h], which stretches the series element
    from ``stretch`` by w. Newton's method from ``start`` in the force: the equation is increasing
    and concave, so it does not overshoot.
    """
    reach = 1.0 / bond_reach
    force = max(start, 0.0)
    if left + slope * stretch * reach <= 0.0:
        return 0.0  # taut at no force is too long already
    for _trial in range(TRIALS):
        taut = series_stretch_at(force, series_stretch, series_shape, series_limit)
        _, stiffness = series_force(taut, series_stretch, series_shape, series_limit)
        rest = isometric_moment * force + slope * (taut - stretch) * reach - left
        change = rest / (isometric_moment + slope * reach / stiffness)
        force = max(force - change, 0.0)
        if abs(change) < SOLVED:
            break
    return force


def advance(
    stretch: float,
    travel: float,
    m0: float,
    m2: float,
    factor: float,
    dt: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
    bond_reach: float,
    attachment_rate: float,
    detachment_rate: float,
    pushing_detachment_rate: float,
    stretched_detachment_rate: float,
    isometric_moment: float,
) -> tuple[float, float, float]:
    """Stretch of the series element, M0 and M2 after dt [s], in which the length grows by travel.

    The step is divided where the displacement of the bonds is not what it was foreseen to be: bonds
    that are stretched beyond their reach break and leave the others with more to carry, so
    that all of them go within a millisecond.
    """
    elapsed, part = 0.0, 1.0  # in units of dt
    for _trial in range(PATIENCE):
        after, n0, n2, missed = displace(
            stretch, part * travel, m0, m2, factor, part * dt, series_stretch, series_shape,
            series_limit, bond_reach, attachment_rate, detachment_rate, pushing_detachment_rate,
            stretched_detachment_rate, isometric_moment,
        )  # fmt: skip
        if missed > TOLERANCE and part > SHORTEST:
            part = max(part * max(0.2, 0.8 * sqrt(TOLERANCE / missed)), SHORTEST)
            continue
        stretch, m0, m2 = after, n0, n2
        elapsed += part
        if elapsed >= 1.0 - 1e-9:
            break
        part = min(1.0 - elapsed, 2.0 * part)
    return stretch, m0, m2


def displace(
    stretch: float,
    travel: float,
    m0: float,
    m2: float,
    factor: float,
    dt: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
    bond_reach: float,
    attachment_rate: float,
    detachment_rate: float,
    pushing_detachment_rate: float,
    stretched_detachment_rate: float,
    isometric_moment: float,
) -> tuple[float, float, float, float]:
    """As ``advance``, in one part; and by how much the displacement was foreseen wrongly [h].

    Half of the displacement, then forming and breaking by an exponential midpoint rule, then the
    other half. The displacement is the one after which bonds and series element carry the same.
    """
    force, _ = series_force(stretch, series_stretch, series_shape, series_limit)
    m1 = isometric_moment * force
    m0, m2 = widened(m0, m1, m2)
    d0, d1, d2, loss0, loss2 = reactions(
        m0, m1, m2, factor, attachment_rate, detachment_rate, pushing_detachment_rate,
        stretched_detachment_rate,
    )  # fmt: skip
    rate = length_rate_of_element(
        stretch, travel / dt, d1, m0, bond_reach, series_stretch, series_shape, series_limit,
        isometric_moment,
    )  # fmt: skip
    half = -0.5 * dt * rate / bond_reach
    # the whole displacement of an explicit step may leave the bonds far behind
    half = min(max(half, -1.0), 1.0)
    m2 += half * (half * m0 - 2.0 * m1)
    m1 -= half * m0
    loss1 = 0.5 * (loss0 + loss2)
    z0, z1, z2 = 0.5 * dt * loss0, 0.5 * dt * loss1, 0.5 * dt * loss2
    # (1 - exp(-z))/z to third order, never below 0
    n0 = m0 + 0.5 * dt * d0 * settled(z0)
    n1 = m1 + 0.5 * dt * d1 * settled(z1)
    n2 = m2 + 0.5 * dt * d2 * settled(z2)
    n0, n2 = widened(n0, n1, n2)
    e0, e1, e2, _, _ = reactions(
        n0, n1, n2, factor, attachment_rate, detachment_rate, pushing_detachment_rate,
        stretched_detachment_rate,
    )  # fmt: skip
    m0 += dt * settled(2.0 * z0) * (e0 + loss0 * (n0 - m0))
    m1 += dt * settled(2.0 * z1) * (e1 + loss1 * (n1 - m1))
    m2 += dt * settled(2.0 * z2) * (e2 + loss2 * (n2 - m2))
    m0, m2 = widened(m0, m1, m2)
    longer = stretch + travel
    # after a displacement of half + w: M1 = m1 - w m0
    carried = carried_force(
        m1 + half * m0, m0, longer, force, bond_reach, series_stretch, series_shape,
        series_limit, isometric_moment,
    )  # fmt: skip
    if carried > 0.0:
        after = series_stretch_at(carried, series_stretch, series_shape, series_limit)
        whole = (after - longer) / bond_reach
    else:
        whole = (m1 + half * m0) / m0  # bonds that carry nothing; the series element is slack
        after = longer + bond_reach * whole
    rest = whole - half
    m2 += rest * (rest * m0 - 2.0 * m1)
    m0, m2 = widened(m0, m1 - rest * m0, m2)
    return after, m0, m2, abs(whole - 2.0 * half) * max(m0 * (z0 + z2) / isometric_moment, 0.02)


def settled(z: float) -> float:
    """(1 - exp(-z))/z for z >= 0, by the Padé approximant that is L-stable."""
    return (1.0 + z * (1.0 / 6.0)) / (1.0 + z * (2.0 / 3.0) + z * z * (1.0 / 6.0))


def moment_rates(
    stretch: float,
    length_rate: float,
    m0: float,
    m2: float,
    factor: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
    bond_reach: float,
    attachment_rate: float,
    detachment_rate: float,
    pushing_detachment_rate: float,
    stretched_detachment_rate: float,
    isometric_moment: float,
) -> tuple[float, float, float]:
    """True rates of s [length/s], M0 and M2 [1/s]."""
    force, _ = series_force(stretch, series_stretch, series_shape, series_limit)
    m1 = isometric_moment * force
    m0, m2 = widened(m0, m1, m2)
    d0, d1, d2, _, _ = reactions(
        m0, m1, m2, factor, attachment_rate, detachment_rate, pushing_detachment_rate,
        stretched_detachment_rate,
    )  # fmt: skip
    s_rate = length_rate_of_element(
        stretch, length_rate, d1, m0, bond_reach, series_stretch, series_shape, series_limit,
        isometric_moment,
    )  # fmt: skip
    return s_rate, d0, d2 + 2.0 * m1 * s_rate / bond_reach
